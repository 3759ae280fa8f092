//! Machine code in the finished image, instruction by instruction.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol};

/// One Thumb instruction.
#[derive(Clone, Copy)]
pub struct Instruction {
    /// Address.
    pub address: u32,
    /// First half-word.
    pub first: u16,
    /// Second half-word of a long instruction.
    pub second: Option<u16>,
}

impl Instruction {
    /// Whether it is `blx` with a register, or `bx` with a register other than the link register.
    pub fn is_call_through_register(self) -> bool {
        let Self { first, .. } = self;
        first & 0xff87 == 0x4780 || (first & 0xff87 == 0x4700 && first >> 3 & 0xf != 14)
    }
}

/// Address of a symbol. The addresses of functions have bit 0 set.
pub fn address<'a>(symbol: &impl ObjectSymbol<'a>) -> u32 {
    symbol.address() as u32 & !1
}

/// The instructions in the section of this name.
pub fn instructions(elf: &ElfFile32, section: &str) -> Result<Vec<Instruction>> {
    let found = elf.section_by_name(section);
    let section = found.with_context(|| format!("the image has no section {section}"))?;
    let mut marks = BTreeMap::new();
    for symbol in elf.symbols() {
        // `$t` begins code, `$d` data (ABI for the Arm architecture).
        match symbol.name()?.get(..2) {
            Some(mark @ ("$t" | "$d")) => marks.insert(address(&symbol), mark == "$t"),
            _ => None,
        };
    }
    Ok(decode(u32::try_from(section.address())?, section.data()?, &marks))
}

/// The instructions in bytes that begin at an address; `marks` say where code (true) and data (false) begin.
fn decode(begin: u32, bytes: &[u8], marks: &BTreeMap<u32, bool>) -> Vec<Instruction> {
    let mut instructions = Vec::new();
    let mut halves = (begin..).step_by(2).zip(bytes.chunks_exact(2)).peekable();
    while let Some((address, half)) = halves.next() {
        if marks.range(..=address).next_back().is_none_or(|(_, is_code)| *is_code) {
            let first = u16::from_le_bytes([half[0], half[1]]);
            // Long instructions begin with 0b11101 and above.
            let is_second =
                |(next, _): &(u32, &[u8])| first >> 11 >= 0b11101 && !marks.contains_key(next);
            let second = halves.next_if(is_second);
            let second = second.map(|(_, half)| u16::from_le_bytes([half[0], half[1]]));
            instructions.push(Instruction { address, first, second });
        }
    }
    instructions
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(code: &[u16], marks: &[(u32, bool)]) -> Option<u32> {
        let bytes: Vec<u8> = code.iter().flat_map(|word| word.to_le_bytes()).collect();
        let instructions = decode(0, &bytes, &marks.iter().copied().collect());
        let found = instructions.iter().find(|i| i.is_call_through_register());
        found.map(|instruction| instruction.address)
    }

    #[test]
    fn calls_through_registers_are_found_in_code_only() {
        // blx r3; bx lr; bx r12
        assert_eq!(found(&[0x4798, 0x4770], &[(0, true)]), Some(0));
        assert_eq!(found(&[0x4770, 0x4760], &[(0, true)]), Some(2));
        assert_eq!(found(&[0x4770, 0x4770], &[(0, true)]), None);
        // Not a call: after a long instruction, in its second half, and in data.
        assert_eq!(found(&[0xf000, 0x4798, 0x4770], &[(0, true)]), None);
        assert_eq!(found(&[0x4770, 0x4798], &[(2, false), (0, true)]), None);
        assert_eq!(found(&[0x4770, 0, 0x4798], &[(4, true), (2, false), (0, true)]), Some(4));
    }
}
