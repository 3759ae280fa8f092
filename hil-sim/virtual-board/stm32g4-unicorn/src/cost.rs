//! Cycles of instructions on a Cortex-M4F from memory without wait states (Cortex-M4 TRM, DDI0439), and the wait states
//! of code in the flash.
//!
//! The count of a block is static: an instruction that its IT condition skips counts as executed, an integer division
//! as 6, and a floating-point result that the next instruction needs costs one more. It is an estimate that no board
//! has confirmed.

/// Further cycles for a branch that is taken, because the pipeline is filled again.
pub const TAKEN: u32 = 2;
/// Exception entry and exit, including saving and restoring the floating-point registers.
pub const ENTRY: u32 = 12 + 18;
/// See [`ENTRY`].
pub const EXIT: u32 = 12 + 17;
/// Further cycles for an access to a peripheral register, because of its bus.
pub const BUS: u32 = 3;

/// An executed block of instructions and its cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Address of its first instruction.
    pub address: u32,
    /// Size in bytes.
    pub size: u32,
    /// Cycles with its last branch not taken.
    pub cycles: u32,
    /// Whether that branch was taken.
    pub taken: bool,
}

/// Returns the cycles that the core waits for a block of code in the flash: its wait states for every line of 8 bytes
/// (dual bank). It is an upper bound, because prefetch and instruction cache hide a part.
pub fn waits(address: u32, size: u32, wait_states: u32) -> u32 {
    let lines = ((address + size - 1) / 8 + 1).saturating_sub(address / 8);
    wait_states * lines
}

/// Returns the cycles of blocks, including the branches that were taken.
pub fn of(blocks: &[Block]) -> u32 {
    blocks.iter().map(|block| block.cycles + if block.taken { TAKEN } else { 0 }).sum()
}

/// Costs of the blocks of a memory, computed when they are first executed.
#[derive(Debug)]
pub struct Costs {
    base: u32,
    of: fn(Instruction) -> u32,
    /// Size in bytes and cost, by half-words of the memory.
    blocks: Vec<(u16, u16)>,
}

impl Costs {
    /// Makes the costs of a memory of `size` bytes from `base`; `of` is the cost of an instruction.
    pub fn new(base: u32, size: u32, of: fn(Instruction) -> u32) -> Self {
        Self { base, of, blocks: vec![(0, 0); size as usize / 2] }
    }

    /// Returns the cost of a block that was learned with this size.
    #[inline]
    pub fn known(&self, address: u32, size: u32) -> Option<u32> {
        let (known, cost) = *self.blocks.get((address.wrapping_sub(self.base) / 2) as usize)?;
        (u32::from(known) == size && size > 0).then_some(u32::from(cost))
    }

    /// Computes the cost of a block.
    pub fn learn(&mut self, address: u32, code: &[u8]) -> u32 {
        let cost = instructions(code).map(self.of).sum();
        if let Some(place) = self.blocks.get_mut((address.wrapping_sub(self.base) / 2) as usize) {
            *place = (code.len() as u16, cost as u16);
        }
        cost
    }
}

/// One instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// Offset in bytes from the beginning of the block.
    pub offset: u32,
    /// Cycles, with a branch not taken.
    pub cycles: u32,
}

/// Returns the instructions of a block.
pub fn instructions(code: &[u8]) -> impl Iterator<Item = Instruction> + '_ {
    let mut at = 0;
    let mut before = Previous::default();
    std::iter::from_fn(move || {
        let half = |at: usize| Some(u16::from_le_bytes([*code.get(at)?, *code.get(at + 1)?]));
        let first = half(at)?;
        let offset = at as u32;
        let is_long = first >> 11 >= 0b11101;
        let cycles;
        (cycles, before) =
            if is_long { long(first, half(at + 2)?, before) } else { short(first, before) };
        at += if is_long { 4 } else { 2 };
        Some(Instruction { offset, cycles })
    })
}

/// The properties of the last instruction that matter for the next one.
#[derive(Clone, Copy, Debug, Default)]
struct Previous {
    memory: bool,
    /// Single-precision register that the instruction computed.
    result: Option<u16>,
}

/// Cycles of an instruction, and its properties for the next one.
type Timing = (u32, Previous);

const MEMORY: Previous = Previous { memory: true, result: None };
const STORE: Timing = (1, MEMORY);

/// A load takes one cycle if it follows a load or a store.
fn load(before: Previous) -> Timing {
    (if before.memory { 1 } else { 2 }, MEMORY)
}

fn plain(cycles: u32) -> Timing {
    (cycles, Previous::default())
}

fn short(w: u16, before: Previous) -> Timing {
    let low = u32::from(w & 0xff);
    match w >> 8 {
        0x48..=0x4f | 0x56..=0x5f => load(before),
        0x60..=0x9f if w & 0x0800 != 0 => load(before),
        0x50..=0x55 | 0x60..=0x9f => STORE,
        // PUSH, POP, with the link register or the program counter.
        0xb5 | 0xbd => plain(2 + low.count_ones()),
        0xb4 | 0xbc | 0xc0..=0xcf => plain(1 + low.count_ones()),
        _ => plain(1),
    }
}

fn long(w: u16, v: u16, before: Previous) -> Timing {
    let is_load = w & 0x10 != 0;
    match w >> 8 {
        0xe8 | 0xe9 if w & 0x40 == 0 => plain(1 + u32::from(v).count_ones()),
        // Table branch.
        0xe8 if w & 0xfff0 == 0xe8d0 && v & 0xffe0 == 0xf000 => plain(2),
        // LDREX, STREX and their like.
        0xe8 if w & 0x0120 == 0 && is_load => load(before),
        0xe8 if w & 0x0120 == 0 => STORE,
        0xe8 | 0xe9 => plain(3),
        0xec..=0xee => float(w, v, before),
        0xf8 | 0xf9 if is_load => load(before),
        0xf8 | 0xf9 => STORE,
        // SDIV, UDIV.
        0xfb if w & 0xffd0 == 0xfb90 => plain(6),
        _ => plain(1),
    }
}

fn float(w: u16, v: u16, before: Previous) -> Timing {
    let double = u32::from(v >> 8 & 1);
    let vd = (v >> 12 & 15) << 1 | w >> 6 & 1;
    let vn = (w & 15) << 1 | v >> 7 & 1;
    let vm = (v & 15) << 1 | v >> 5 & 1;
    let waits = |sources: &[u16]| u32::from(before.result.is_some_and(|r| sources.contains(&r)));
    if w >> 8 != 0xee {
        return match w {
            _ if w & 0xffe0 == 0xec40 => plain(2),
            _ if w & 0x0120 != 0x0100 => plain(1 + u32::from(v & 0xff)),
            // VLDR, VSTR.
            _ if w & 0x10 != 0 => (2 + double, MEMORY),
            _ => (2 + double + waits(&[vd]), MEMORY),
        };
    }
    // A move between the register files.
    if v & 0x10 != 0 {
        return plain(1 + waits(&[vn]));
    }
    let (operation, more) = (w >> 4 & 0xb, w & 0xf);
    let (cycles, sources): (u32, &[u16]) = match operation {
        0x0 | 0x1 | 0x9 | 0xa => (3, &[vd, vn, vm]),
        0x2 | 0x3 => (1, &[vn, vm]),
        0x8 => (14, &[vn, vm]),
        0xb if more == 1 && v >> 6 & 3 == 3 => (14, &[vm]),
        // A compare reads its first operand.
        0xb if more == 4 || more == 5 => (1, &[vd, vm]),
        0xb if v & 0x40 == 0 => (1, &[]),
        _ => (1, &[vm]),
    };
    let compares = operation == 0xb && (more == 4 || more == 5);
    let result = (!compares).then_some(vd);
    (cycles + waits(sources), Previous { memory: false, result })
}
