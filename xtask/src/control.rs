//! Checks the control interrupt in the finished image: it and all it calls lie in CCM, and no panic
//! can be reached from it.
//!
//! CCM is 128 MiB away from the flash, further than a call instruction reaches: a call out of it needs
//! a veneer of the linker in CCM (`Thunk`), or a register. There must be neither, but for a command, which is taken
//! between two steps, and for what runs with the outputs off; and no function of the panic machinery may lie inside.

use anyhow::{Result, ensure};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol};

use crate::elf;

/// The control interrupt.
const INTERRUPT: &str = "ADC1_2";
/// The section of code in CCM.
const SECTION: &str = ".ccm";

/// Fails if an image breaks one of these rules.
pub fn check(image: &[u8]) -> Result<()> {
    let elf: ElfFile32 = ElfFile32::parse(image)?;
    let section = elf.section_by_name(SECTION).map(|section| section.index());
    let mut has_interrupt = false;
    let mut allowed = Vec::new();
    for symbol in elf.symbols().filter(|symbol| symbol.section_index() == section) {
        let name = symbol.name()?;
        has_interrupt |= name == INTERRUPT;
        if leads_to_allowed(name) {
            let address = symbol.address() & !1;
            allowed.push(address..address + symbol.size());
        } else {
            ensure!(!reaches_out(name), "{name} is in {SECTION}");
        }
    }
    ensure!(has_interrupt, "{INTERRUPT} is not in {SECTION}");
    for instruction in elf::instructions(&elf, SECTION)? {
        let address = instruction.address;
        let allowed = allowed.iter().any(|veneer| veneer.contains(&address.into()));
        ensure!(
            allowed || !instruction.is_call_through_register(),
            "a call through a register at {address:#010x}"
        );
    }
    Ok(())
}

/// Functions in the flash that the interrupt calls: a command, between two steps, and the evaluation of a learning, with the
/// outputs off.
const FROM_FLASH: [&str; 2] = ["Drive7command", "evaluate_learning"];

/// Whether a symbol is a veneer to one of these functions.
fn leads_to_allowed(name: &str) -> bool {
    name.contains("Thunk") && FROM_FLASH.iter().any(|part| name.contains(part))
}

/// Whether a symbol is a veneer, or a function that panics.
fn reaches_out(name: &str) -> bool {
    ["Thunk", "panic", "unwrap_failed", "expect_failed", "index_fail"]
        .iter()
        .any(|part| name.contains(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn veneers_and_panics_reach_out() {
        assert!(reaches_out("__Thumbv7ABSLongThunk_memcpy"));
        assert!(reaches_out("_RNvNtCsabc_4core9panicking5panic"));
        assert!(!reaches_out("ADC1_2"));
        assert!(leads_to_allowed("__Thumbv7ABSLongThunk__RNvCsabc_5Drive17evaluate_learning"));
        assert!(!leads_to_allowed("__Thumbv7ABSLongThunk_memcpy"));
    }
}
