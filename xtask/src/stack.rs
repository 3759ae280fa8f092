//! The most stack that the image can use, from its machine code.
//!
//! The frame of each function follows from its instructions that move the stack pointer; the call graph, from its calls. A call through a
//! register could go to any function that nobody calls by name, so the deepest of these is assumed; printing a line nests at most
//! [`NESTED`] of them (text, value, part of the value, buffer). The nesting is an assumption about `core::fmt`: nothing here proves it.
//! Recursion and a stack that grows by a register are refused, because then there is no limit.
//!
//! The same graph shows where the control interrupt goes: the interrupt and all functions that it calls are in CCM. CCM is 128 MiB away
//! from the flash, further than a call instruction reaches, so a call out of it needs a veneer of the linker in CCM (`Thunk`), or a
//! register. A register is refused; a veneer may lead only to the cold code of the control, which `memory.x` gathers in a section of its
//! own.
//!
//! Own code, because cargo-call-stack needs a nightly compiler.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use anyhow::{Context, Result, bail, ensure};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use crate::elf::{self, Instruction};

/// Nested calls through registers.
const NESTED: usize = 4;
/// Bytes that the core pushes for an interrupt, with floating point and alignment.
const EXCEPTION: u32 = 104 + 4;
/// The interrupts by rising priority: one of each priority can interrupt main and the interrupts before it, once.
const INTERRUPTS: [&[&str]; 3] = [&PORTS, &["ADC1_2"], &["NonMaskableInt"]];
/// The interrupts of serial ports, which belong to modules that an image may leave out.
const PORTS: [&str; 2] = ["LPUART", "USART3"];
/// Part of the name of the panic handler. It panics only once, so its stack is added once to everything else; an endless recursion
/// through it is only apparent.
const PANIC: &str = "rust_begin_unwind";
/// Parts of the names of functions that panic.
const PANICS: [&str; 5] = [PANIC, "panic", "unwrap_failed", "expect_failed", "index_fail"];
/// The main program.
const MAIN: &str = "main";
/// Functions that only the processor calls, and that never return or have a stack of their own.
const BY_PROCESSOR: [&str; 3] = ["Reset", "HardFault", "DefaultHandler"];
/// Parts of the names of the functions of core that print numbers and padding. The only register calls in them go to the text's output.
const PRINTERS: [&str; 3] =
    ["4core3fmtNtB5_9Formatter", "4core3fmtNtB5_11PostPadding", "float_to_decimal"];
/// Parts of the names of the outputs' functions.
const OUTPUTS: [&str; 2] = ["4core3fmt5Write9write_str", "4core3fmt5Write10write_char"];
/// Part of the name of a veneer, which ends with the name of its target.
const VENEER: &str = "LongThunk_";
/// Sections with code.
const SECTIONS: [&str; 5] = [".start", ".text", ".ccm", ".design", ".background"];
/// The control interrupt.
const CONTROL: &str = "ADC1_2";

/// The sections that decide where an interrupt may go.
struct Places {
    /// Code in the bank that is written: no interrupt may need it.
    written_bank: Range<u32>,
    /// Code in CCM, and the cold code in the flash that it may call.
    ccm: Range<u32>,
    cold: Range<u32>,
}

/// One function.
#[derive(Debug, Default, PartialEq, Eq)]
struct Function {
    name: String,
    end: u32,
    /// Bytes.
    frame: u32,
    calls: Vec<u32>,
    calls_through_register: bool,
}

type Functions = BTreeMap<u32, Function>;

/// The most bytes of stack in use at once.
pub fn worst_case(image: &[u8]) -> Result<u32> {
    let functions = functions(image)?;
    let main = depth_of(&functions, MAIN)?;
    let panic = functions.values().find(|function| function.name.contains(PANIC));
    let panic = panic.map_or(Ok(0), |function| depth_of(&functions, &function.name))?;
    INTERRUPTS.iter().try_fold(main + panic, |sum, names| {
        let names = names.iter().filter(|name| !is_left_out(&functions, name));
        Ok(sum + EXCEPTION + most(names.map(|name| depth_of(&functions, name)))?)
    })
}

/// Whether this is the interrupt of a port that the image does not have.
fn is_left_out(functions: &Functions, name: &str) -> bool {
    PORTS.contains(&name) && find(functions, name).is_err()
}

fn most(mut depths: impl Iterator<Item = Result<u32>>) -> Result<u32> {
    depths.try_fold(0, |most, depth| Ok(most.max(depth?)))
}

/// Fails if an interrupt can reach a panic, code in the bank of the flash that is written, or a call through a register, whose target is
/// unknown. Fails also if the control interrupt is not in CCM, or leads out of it.
pub fn check_interrupts(image: &[u8]) -> Result<()> {
    let elf: ElfFile32 = ElfFile32::parse(image)?;
    let place = |name| -> Result<Range<u32>> {
        let section = elf.section_by_name(name).context(name)?;
        let begin = section.address() as u32;
        Ok(begin..begin + section.size() as u32)
    };
    let (written_bank, ccm, cold) = (place(".background")?, place(".ccm")?, place(".design")?);
    check_reach(&functions(image)?, &Places { written_bank, ccm, cold })
}

fn check_reach(functions: &Functions, places: &Places) -> Result<()> {
    ensure!(places.ccm.contains(&find(functions, CONTROL)?), "{CONTROL} is not in CCM");
    let interrupts = INTERRUPTS.concat().into_iter().filter(|name| !is_left_out(functions, name));
    let first = interrupts.map(|name| anyhow::Ok((find(functions, name)?, String::new())));
    let mut left = first.collect::<Result<Vec<_>>>()?;
    let mut seen = BTreeSet::new();
    while let Some((at, path)) = left.pop() {
        if !seen.insert(at) {
            continue;
        }
        let function =
            functions.get(&at).with_context(|| format!("no function at {at:#x}:{path}"))?;
        let path = format!("{path} {}", function.name);
        ensure!(!is_named(function, &PANICS), "an interrupt can panic:{path}");
        ensure!(!places.written_bank.contains(&at), "in the bank that is written:{path}");
        match function.name.split_once(VENEER) {
            Some((_, target)) => {
                let target = find(functions, target)?;
                let stays = !places.ccm.contains(&at) || places.cold.contains(&target);
                ensure!(stays, "out of CCM:{path}");
                left.push((target, path.clone()));
            }
            None => ensure!(!function.calls_through_register, "a call through a register:{path}"),
        }
        left.extend(function.calls.iter().map(|to| (*to, path.clone())));
    }
    Ok(())
}

/// The address of the function of this name.
fn find(functions: &Functions, name: &str) -> Result<u32> {
    let found = functions.iter().find(|(_, function)| function.name == name);
    Ok(*found.with_context(|| format!("the image has no function {name}"))?.0)
}

fn functions(image: &[u8]) -> Result<Functions> {
    let elf: ElfFile32 = ElfFile32::parse(image)?;
    let mut functions = Functions::new();
    for symbol in elf.symbols().filter(|s| s.kind() == SymbolKind::Text && s.size() > 0) {
        let address = elf::address(&symbol);
        let function = functions.entry(address).or_default();
        function.end = address + symbol.size() as u32;
        // Several names can share an address. The names that are searched for are kept.
        if function.name.is_empty() || is_entry(symbol.name()?) {
            function.name = symbol.name()?.to_owned();
        }
    }
    for section in SECTIONS {
        for instruction in elf::instructions(&elf, section)? {
            let function = functions.range_mut(..=instruction.address).next_back();
            if let Some((&begin, function)) = function.filter(|f| instruction.address < f.1.end) {
                add(function, begin, instruction).with_context(|| function.name.clone())?;
            }
        }
    }
    Ok(functions)
}

fn is_entry(name: &str) -> bool {
    name == MAIN || INTERRUPTS.concat().contains(&name) || BY_PROCESSOR.contains(&name)
}

/// Adds the effect of an instruction to a function that begins at `begin`.
fn add(function: &mut Function, begin: u32, instruction: Instruction) -> Result<()> {
    let Instruction { address, first, second } = instruction;
    let (a, b) = (u32::from(first), u32::from(second.unwrap_or(0)));
    let immediate = (a >> 10 & 1) << 11 | (b >> 12 & 7) << 8 | b & 0xff;
    function.calls_through_register |= instruction.is_call_through_register();
    match (first, second) {
        (0xb400..=0xb5ff, None) => function.frame += 4 * (a & 0x1ff).count_ones(), // PUSH
        (0xb080..=0xb0ff, None) => function.frame += 4 * (a & 0x7f),               // SUB SP, #
        (_, None) => {}
        (0xe92d, _) => function.frame += 4 * b.count_ones(), // PUSH
        (0xed2d | 0xed6d, _) => function.frame += 4 * (b & 0xff), // VPUSH
        (0xf84d, _) if b & 0xf00 == 0xd00 => function.frame += b & 0xff, // STR, pre-indexed
        (0xe96d, _) => function.frame += 4 * (b & 0xff),     // STRD, pre-indexed
        (0xf1ad | 0xf5ad, _) if b & 0x8f00 == 0x0d00 => function.frame += expanded(immediate), // SUB
        (0xf2ad | 0xf6ad, _) if b & 0x8f00 == 0x0d00 => function.frame += immediate, // SUBW
        (0xebad, _) if b & 0xf00 == 0xd00 => {
            bail!("the stack grows by a register at {address:#010x}")
        }
        _ if a & 0xf800 == 0xf000 && (b & 0xd000 == 0xd000 || b & 0xd000 == 0x9000) => {
            // BL, and B.W if it leaves the function.
            let (s, j1, j2) = (a >> 10 & 1, b >> 13 & 1, b >> 11 & 1);
            let (i1, i2) = (1 ^ j1 ^ s, 1 ^ j2 ^ s);
            let offset = s << 24 | i1 << 23 | i2 << 22 | (a & 0x3ff) << 12 | (b & 0x7ff) << 1;
            let offset = (offset << 7) as i32 >> 7;
            let target = address.wrapping_add(4).wrapping_add_signed(offset);
            if !(begin..function.end).contains(&target) || b & 0xd000 == 0xd000 {
                function.calls.push(target);
            }
        }
        _ => {}
    }
    Ok(())
}

/// The constant of an instruction, expanded as in Thumb.
fn expanded(immediate: u32) -> u32 {
    let byte = immediate & 0xff;
    match immediate >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (0x80 | immediate & 0x7f).rotate_right(immediate >> 7),
    }
}

/// The deepest the stack gets below the function of this name.
fn depth_of(functions: &Functions, name: &str) -> Result<u32> {
    let start = find(functions, name)?;
    let called: Vec<u32> = functions.values().flat_map(|f| f.calls.iter().copied()).collect();
    let by_pointer = |at| !called.contains(&at) && !is_entry(&functions[&at].name);
    // Depth of a call through a register, with no nested one, one, and so on.
    let deepest = |through: Through, which: &dyn Fn(u32) -> bool| {
        let mut known = BTreeMap::new();
        let inside = functions.keys().filter(|at| which(**at));
        most(inside.map(|&at| depth(functions, at, through, &mut known, &mut Vec::new())))
    };
    let mut through = Through::default();
    through.output = deepest(through, &|at| is_named(&functions[&at], &OUTPUTS))?;
    for _ in 0..NESTED {
        through.any = deepest(through, &by_pointer)?;
    }
    depth(functions, start, through, &mut BTreeMap::new(), &mut Vec::new())
}

/// The deepest the stack gets below a call through a register.
#[derive(Clone, Copy, Default)]
struct Through {
    /// Depth of a call to an output of text.
    output: u32,
    /// Depth of a call to any function.
    any: u32,
}

fn is_named(function: &Function, parts: &[&str]) -> bool {
    parts.iter().any(|part| function.name.contains(part))
}

fn depth(
    functions: &Functions,
    at: u32,
    through: Through,
    known: &mut BTreeMap<u32, u32>,
    path: &mut Vec<u32>,
) -> Result<u32> {
    if let Some(depth) = known.get(&at) {
        return Ok(*depth);
    }
    // Assembly and veneers without a symbol take no stack.
    let Some(function) = functions.get(&at) else { return Ok(0) };
    if function.name.contains(PANIC) && !path.is_empty() {
        return Ok(0);
    }
    ensure!(!path.contains(&at), "{} calls itself", function.name);
    path.push(at);
    let veneer = function.name.split_once(VENEER);
    let target = veneer.and_then(|(_, name)| functions.iter().find(|(_, f)| f.name == name));
    let mut below = match target {
        _ if !function.calls_through_register => 0,
        Some((&target, _)) => depth(functions, target, through, known, path)?,
        None if is_named(function, &PRINTERS) => through.output,
        None => through.any,
    };
    for &target in &function.calls {
        below = below.max(depth(functions, target, through, known, path)?);
    }
    path.pop();
    known.insert(at, function.frame + below);
    Ok(function.frame + below)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instruction(address: u32, first: u16, second: u16) -> Instruction {
        Instruction { address, first, second: (first >> 11 >= 0b11101).then_some(second) }
    }

    fn frame(words: &[(u16, u16)]) -> u32 {
        let mut function = Function { end: 100, ..Function::default() };
        for &(first, second) in words {
            add(&mut function, 0, instruction(0, first, second)).unwrap();
        }
        function.frame
    }

    #[test]
    fn instructions_that_move_the_stack_pointer_count() {
        // push {r4-r7, lr}; sub sp, #16; push.w {r4-r11, lr}; vpush {d8, d9}
        assert_eq!(frame(&[(0xb5f0, 0), (0xb084, 0)]), 20 + 16);
        assert_eq!(frame(&[(0xe92d, 0x4ff0), (0xed2d, 0x8b04)]), 36 + 16);
        // sub.w sp, sp, #1024; subw sp, sp, #1100; str r11, [sp, #-4]!
        assert_eq!(frame(&[(0xf5ad, 0x6d80)]), 1024);
        assert_eq!(frame(&[(0xf2ad, 0x4d4c)]), 1100);
        assert_eq!(frame(&[(0xf84d, 0xbd04)]), 4);
    }

    /// The interrupts at 0, 10, 20, 30, each of 10 bytes, and one more function, which the control interrupt calls through a veneer.
    fn interrupts(name: &str, at: u32) -> Functions {
        let function = |name: &str, end, calls: &[u32]| Function {
            name: name.into(),
            end,
            calls: calls.to_vec(),
            ..Function::default()
        };
        let mut functions: Functions = (0..4)
            .zip(INTERRUPTS.concat())
            .map(|(n, name)| (10 * n, function(name, 10 * n + 10, &[])))
            .collect();
        let control = find(&functions, "ADC1_2").unwrap();
        functions.get_mut(&control).unwrap().calls.push(40);
        let mut veneer = function(&format!("__Thumbv7ABS{VENEER}middle"), 50, &[]);
        veneer.calls_through_register = true;
        functions.insert(40, veneer);
        functions.insert(50, function("middle", 60, &[at]));
        functions.insert(at, function(name, at + 10, &[50]));
        functions
    }

    #[test]
    fn an_interrupt_reaches_no_panic_no_unknown_target_and_not_the_written_bank() {
        // The control interrupt and its veneer in CCM, which leads to cold code.
        let places = |ccm, cold| Places { written_bank: 1000..2000, ccm, cold };
        let (ccm, cold) = (20..50, 50..60);
        let check =
            |functions: &Functions| check_reach(functions, &places(ccm.clone(), cold.clone()));
        let error = |functions: &Functions| check(functions).unwrap_err().to_string();
        let mut sound = interrupts("leaf", 60);
        check(&sound).unwrap();
        let out = check_reach(&sound, &places(20..50, 60..70)).unwrap_err().to_string();
        assert!(out.starts_with("out of CCM: ADC1_2"), "{out}");
        let elsewhere = check_reach(&sound, &places(30..50, 50..60)).unwrap_err().to_string();
        assert_eq!(elsewhere, "ADC1_2 is not in CCM");
        assert!(error(&interrupts("leaf", 1500)).starts_with("in the bank that is written"));
        for name in ["_RNvNtCs_4core9panicking5panic", "_RNvNtCs_4core6option13unwrap_failed"] {
            let reached = error(&interrupts(name, 60));
            assert!(reached.ends_with(&format!(" middle {name}")), "{reached}");
        }
        sound.get_mut(&60).unwrap().calls_through_register = true;
        assert!(error(&sound).starts_with("a call through a register: ADC1_2"));
        // A call to a missing function, and a veneer to a missing function.
        sound.remove(&60);
        assert!(error(&sound).starts_with("no function at 0x3c"));
        sound.remove(&50);
        assert!(error(&sound).contains("no function middle"));
        // A panic that is not reached.
        let mut other = interrupts("core::panicking", 60);
        other.get_mut(&50).unwrap().calls.clear();
        check(&other).unwrap();
    }

    #[test]
    fn calls_and_recursion_are_found() {
        // bl +4 after the instruction, from address 0
        let mut function = Function { end: 8, ..Function::default() };
        add(&mut function, 0, instruction(0, 0xf000, 0xf802)).unwrap();
        assert_eq!(function.calls, [8]);
        let leaf = Function { name: "leaf".into(), end: 20, frame: 24, ..Function::default() };
        let caller =
            Function { name: MAIN.into(), end: 8, frame: 8, calls: vec![8], ..Function::default() };
        let mut functions = Functions::from([(0, caller), (8, leaf)]);
        assert_eq!(depth_of(&functions, MAIN).unwrap(), 32);
        functions.get_mut(&8).unwrap().calls.push(0);
        assert!(depth_of(&functions, MAIN).unwrap_err().to_string().contains("calls itself"));
    }
}
