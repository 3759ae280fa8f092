//! `cargo xtask size`: the use of each memory by the image, and its budgets.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::map::{self, Entry, Level};
use crate::{image, run, sources, stack, toolchain};

/// Part of the name of the trace's memory.
const TRACE: &str = "TRACE_MEMORY";

/// Builds all images of the reference board and prints their use of each memory; fails above a budget.
pub fn report_all() -> Result<()> {
    let target = toolchain::for_target()?;
    image::IMAGES
        .iter()
        .try_for_each(|name| report(&image::build_for(&target, image::REFERENCE, name)?, name))
}

/// Prints the use of each memory by an image; fails above a budget.
pub fn report(elf: &Path, name: &str) -> Result<()> {
    let map = sources::read(elf.with_extension("map"))?;
    let sections = map::entries(&map, Level::Output);
    let regions = regions(&sources::read("memory.x")?);

    println!("\nimage {name}\n{:<8} {:>9} {:>9} {:>6}   sections", "memory", "used", "of", "");
    for region in &regions {
        let inside = sections.iter().filter(|section| region.takes(section) && section.size > 0);
        let list: Vec<String> = inside.map(|s| format!("{} {}", s.name, s.size)).collect();
        let (used, of) = (sum(&sections, |s| region.takes(s)), region.length);
        let percent = 100.0 * used as f64 / of as f64;
        println!("{:<8} {used:>9} {of:>9} {percent:>5.1}%   {}", region.name, list.join(", "));
    }
    let named = |names: &[&str]| sum(&sections, |s| names.contains(&s.name));
    let code = named(&[".vector_table", ".design", ".text", ".ccm", ".background"]);
    let constants = named(&[".rodata"]);
    let ram = named(&[".data", ".bss", ".uninit", ".control_data"]);
    let trace = sum(&map::entries(&map, Level::Symbol), |symbol| symbol.name.contains(TRACE));
    println!("code {code}, constants {constants}, static RAM {ram} with {trace} for the trace");

    let budgets = image::read(name)?.bytes;
    let bank = |bank: Region| sum(&sections, |section| bank.takes(section));
    let image = fs::read(elf).with_context(|| elf.display().to_string())?;
    run::limit("control code", named(&[".ccm"]), budgets.control_code, "bytes")?;
    run::limit("flash", bank(Region::bank(0)) + bank(Region::bank(1)), budgets.flash, "bytes")?;
    run::limit("first bank of the flash", bank(Region::bank(0)), budgets.flash_bank, "bytes")?;
    run::limit("second bank of the flash", bank(Region::bank(1)), budgets.flash_bank, "bytes")?;
    let ram = ram.saturating_sub(trace);
    run::limit("static RAM without the trace", ram, budgets.static_ram, "bytes")?;
    let deepest = stack::worst_case(&image).context("stack")?.into();
    run::limit("stack in the worst case", deepest, budgets.stack, "bytes")
}

fn sum(entries: &[Entry], which: impl Fn(&Entry) -> bool) -> u64 {
    entries.iter().filter(|entry| which(entry)).map(|entry| entry.size).sum()
}

/// A memory of the controller.
struct Region {
    name: String,
    origin: u64,
    length: u64,
}

impl Region {
    /// A bank of the flash, 0 or 1.
    fn bank(index: u64) -> Self {
        let length = 256 * 1024;
        Self { name: String::new(), origin: 0x0800_0000 + index * length, length }
    }

    /// Whether a section takes this memory: at run time, or by its contents before they are copied.
    fn takes(&self, section: &Entry) -> bool {
        let memory = self.origin..self.origin + self.length;
        memory.contains(&section.run) || memory.contains(&section.load)
    }
}

/// The memories that `memory.x` declares: `NAME : ORIGIN = 0x..., LENGTH = ...K`.
fn regions(memory_x: &str) -> Vec<Region> {
    let region = |line: &str| -> Option<Region> {
        let (name, rest) = line.split_once(':')?;
        let (origin, length) = rest.split_once(',')?;
        let origin = origin.trim().strip_prefix("ORIGIN = 0x")?;
        let length = length.trim().strip_prefix("LENGTH = ")?.strip_suffix('K')?;
        Some(Region {
            name: name.trim().to_owned(),
            origin: u64::from_str_radix(origin, 16).ok()?,
            length: 1024 * length.parse::<u64>().ok()?,
        })
    };
    memory_x.lines().filter_map(region).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_take_the_memory_that_they_are_loaded_from() {
        let regions = regions(&sources::read("memory.x").unwrap());
        let map = " 80001d8  80001d8     faa0     8 .text
20008800  8012edc       48     4 .data
20008848 20008848     9364     8 .bss
10000000  8040000     5100     8 .ccm
10000000  8040000      3ba     4         a.o:(.text.ADC1_2)
10000000  8040000       a0     1                 .Lanon.8c1de73ce14781661d140f7ad80739f2.20
20011bac 20011bac      c50     8 .control_data
       0        0    7aa1f     1 .debug_loc";
        let taken = map::entries(map, Level::Output).into_iter().map(|section| {
            let names = regions.iter().filter(|region| region.takes(&section));
            (section.name, section.size, names.map(|r| r.name.as_str()).collect::<Vec<_>>())
        });
        let expected: [(&str, u64, &[&str]); 6] = [
            (".text", 64_160, &["FLASH"]),
            (".data", 72, &["FLASH", "RAM"]),
            (".bss", 37_732, &["RAM"]),
            (".ccm", 20_736, &["CONTROL", "CCM"]),
            (".control_data", 3152, &["RAM"]),
            (".debug_loc", 502_303, &[]),
        ];
        assert_eq!(taken.collect::<Vec<_>>(), expected.map(|(n, s, list)| (n, s, list.to_vec())));
    }
}
