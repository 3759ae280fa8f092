//! Checks the control interrupt in the finished image: it and all it calls lie in CCM.
//!
//! CCM is 128 MiB away from the flash, further than a call instruction reaches: a call out of it needs
//! a veneer of the linker in CCM (`Thunk`), or a register. `stack::check_interrupts` refuses the register. A veneer may lead to the
//! cold code of the control alone, which `memory.x` gathers in a section of its own.

use std::collections::BTreeSet;

use anyhow::{Result, ensure};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol};

use crate::stack::VENEER;

/// The control interrupt.
const INTERRUPT: &str = "ADC1_2";
/// The section of code in CCM.
const SECTION: &str = ".ccm";
/// The section of cold code in the flash that it may call.
const COLD: &str = ".design";

/// Fails if an image breaks one of these rules.
pub fn check(image: &[u8]) -> Result<()> {
    let elf: ElfFile32 = ElfFile32::parse(image)?;
    let names = |section| {
        let index = elf.section_by_name(section).map(|section| section.index());
        let inside = elf.symbols().filter(move |symbol| symbol.section_index() == index);
        inside.map(|symbol| symbol.name()).collect::<Result<BTreeSet<_>, _>>()
    };
    let (control, cold) = (names(SECTION)?, names(COLD)?);
    ensure!(control.contains(INTERRUPT), "{INTERRUPT} is not in {SECTION}");
    let out = leads_out(&control, &cold);
    ensure!(out.is_none(), "{} leads out of {SECTION}", out.unwrap_or_default());
    Ok(())
}

/// The first veneer among these functions that leads elsewhere than to the cold ones.
fn leads_out<'a>(control: &BTreeSet<&'a str>, cold: &BTreeSet<&str>) -> Option<&'a str> {
    let leads = |name: &&&str| name.split_once(VENEER).is_some_and(|(_, to)| !cold.contains(to));
    control.iter().find(leads).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_veneer_leads_to_the_cold_code_alone() {
        let cold = BTreeSet::from(["start"]);
        let out = |name| leads_out(&BTreeSet::from([name]), &cold);
        assert_eq!(out("ADC1_2"), None);
        assert_eq!(out("__Thumbv7ABSLongThunk_start"), None);
        assert_eq!(out("__Thumbv7ABSLongThunk_memcpy"), Some("__Thumbv7ABSLongThunk_memcpy"));
    }
}
