//! Checks the control interrupt in the finished image: it and all it calls lie in CCM, and no panic
//! can be reached from it.
//!
//! CCM is 128 MiB away from the flash, further than a call instruction reaches: a call out of it needs
//! a veneer of the linker in CCM (`Thunk`), or a register. There must be neither, so that nothing
//! outside is reachable; and no function of the panic machinery may lie inside.

use anyhow::{Context, Result, bail};
use object::Endianness;
use object::elf::{FileHeader32, SHT_SYMTAB};
use object::read::elf::{FileHeader, SectionHeader, Sym};

/// The control interrupt.
const INTERRUPT: &str = "ADC1_2";
/// The section of code in CCM.
const SECTION: &str = ".ccm";

/// Fails if something is wrong with the control interrupt of an image.
pub fn check(elf: &[u8]) -> Result<()> {
    let header = FileHeader32::<Endianness>::parse(elf)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, elf)?;
    let (_, section) = sections
        .section_by_name(endian, SECTION.as_bytes())
        .with_context(|| format!("the image has no section {SECTION}"))?;
    let code = section.data(endian, elf)?;
    let begin = section.sh_addr(endian);

    let symbols = sections.symbols(endian, elf, SHT_SYMTAB)?;
    let mut inside: Vec<(u32, String)> = Vec::new();
    for symbol in symbols.iter() {
        // Addresses of functions have bit 0 set.
        let address = symbol.st_value(endian) & !1;
        if address >= begin && ((address - begin) as usize) < code.len() {
            let name = symbol.name(endian, symbols.strings())?;
            inside.push((address - begin, String::from_utf8_lossy(name).into_owned()));
        }
    }
    if !inside.iter().any(|(_, name)| name == INTERRUPT) {
        bail!("{INTERRUPT} is not in {SECTION}");
    }
    if let Some((_, name)) = inside.iter().find(|(_, name)| reaches_out(name)) {
        bail!("{name} is in {SECTION}");
    }
    if let Some(at) = call_through_register(code, &mut inside) {
        bail!("a call through a register at {:#010x}", begin + at);
    }
    Ok(())
}

/// Veneers, and what panics.
fn reaches_out(name: &str) -> bool {
    ["Thunk", "panic", "unwrap_failed", "expect_failed", "index_fail"]
        .iter()
        .any(|part| name.contains(part))
}

/// Where code calls, or jumps, through a register other than the link register.
fn call_through_register(code: &[u8], symbols: &mut [(u32, String)]) -> Option<u32> {
    symbols.sort();
    // `$t` begins code, `$d` data (ABI for the Arm architecture).
    let marks: Vec<(usize, bool)> = symbols
        .iter()
        .filter(|(_, name)| name.starts_with("$t") || name.starts_with("$d"))
        .map(|(at, name)| (*at as usize, name.starts_with("$t")))
        .collect();
    let ends = marks.iter().skip(1).map(|mark| mark.0).chain([code.len()]);
    for (&(begin, is_code), end) in marks.iter().zip(ends) {
        let mut at = begin;
        while is_code && at + 2 <= end {
            let word = u16::from_le_bytes([code[at], code[at + 1]]);
            let register = word >> 3 & 0xf;
            // BLX register; BX register.
            if word & 0xff87 == 0x4780 || (word & 0xff87 == 0x4700 && register != 14) {
                return u32::try_from(at).ok();
            }
            // The long instructions begin with 0b11101 and above.
            at += if word >> 11 >= 0b11101 { 4 } else { 2 };
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(code: &[u16], marks: &[(u32, &str)]) -> Option<u32> {
        let bytes: Vec<u8> = code.iter().flat_map(|word| word.to_le_bytes()).collect();
        let mut marks: Vec<_> = marks.iter().map(|(at, name)| (*at, (*name).to_owned())).collect();
        call_through_register(&bytes, &mut marks)
    }

    #[test]
    fn calls_through_registers_are_found_in_code_only() {
        // blx r3; bx lr; bx r12
        assert_eq!(found(&[0x4798, 0x4770], &[(0, "$t")]), Some(0));
        assert_eq!(found(&[0x4770, 0x4760], &[(0, "$t")]), Some(2));
        assert_eq!(found(&[0x4770, 0x4770], &[(0, "$t")]), None);
        // Behind a long instruction, in its second half, and in data.
        assert_eq!(found(&[0xf000, 0x4798, 0x4770], &[(0, "$t")]), None);
        assert_eq!(found(&[0x4770, 0x4798], &[(2, "$d.1"), (0, "$t")]), None);
        assert_eq!(found(&[0x4770, 0x0000, 0x4798], &[(4, "$t"), (2, "$d"), (0, "$t")]), Some(4));
    }

    #[test]
    fn veneers_and_panics_reach_out() {
        assert!(reaches_out("__Thumbv7ABSLongThunk_memcpy"));
        assert!(reaches_out("_RNvNtCsabc_4core9panicking5panic"));
        assert!(!reaches_out("ADC1_2"));
    }
}
