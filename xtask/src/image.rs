//! The image for the board: building it, writing it, and what it takes of each memory.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use object::Endianness;
use object::elf::{FileHeader32, SHF_ALLOC, SHT_PROGBITS, SHT_SYMTAB};
use object::read::elf::{FileHeader, SectionHeader, Sym};

use crate::control;
use crate::paths;
use crate::run::{self, Step};
use crate::stack;
use crate::toolchain::{self, PROFILE, TARGET, Target};

/// The name probe-rs has for the controller of the board.
const CHIP: &str = "STM32G474RETx";

/// Builds the image; gives back where it is.
pub fn build() -> Result<PathBuf> {
    build_with(&toolchain::for_target()?)
}

/// The same, when it is known how to build for the target.
pub fn build_with(target: &Target) -> Result<PathBuf> {
    Step::new("firmware").run(target.cargo("build")?.args(["--package", "induction-drive"]))?;
    let elf = target.target_dir()?.join(TARGET).join(PROFILE).join("induction-drive");
    let bytes = fs::read(&elf).with_context(|| elf.display().to_string())?;
    control::check(&bytes).context("the control interrupt")?;
    paths::check(&bytes)?;
    Ok(elf)
}

/// Builds the image, writes it to the board and shows its log until interrupted.
pub fn flash() -> Result<()> {
    // Asked before the build: no minute of waiting for a message like this.
    let probe = run::command("probe-rs").arg("--version").output();
    if probe.is_err_and(|error| error.kind() == ErrorKind::NotFound) {
        bail!("probe-rs is missing. Type:\n    cargo install probe-rs-tools --locked");
    }
    let elf = build()?;
    Step::new("flash").run(run::command("probe-rs").args(["run", "--chip", CHIP]).arg(elf))
}

/// Shows what the image takes of each memory.
pub fn report_size(elf: &Path) -> Result<()> {
    let bytes = fs::read(elf).with_context(|| elf.display().to_string())?;
    let sections = sections(&bytes).with_context(|| elf.display().to_string())?;
    let path = run::root().join("memory.x");
    let memory = fs::read_to_string(&path).with_context(|| path.display().to_string())?;

    println!("\n{:<8} {:>9} {:>9} {:>6}   sections", "memory", "used", "of", "");
    for region in regions(&memory)? {
        let inside: Vec<&Section> = sections.iter().filter(|s| region.takes(s)).collect();
        let used: u64 = inside.iter().map(|section| section.size).sum();
        let list: Vec<String> =
            inside.iter().map(|section| format!("{} {}", section.name, section.size)).collect();
        let percent = 100.0 * used as f64 / region.length as f64;
        println!(
            "{:<8} {used:>9} {:>9} {percent:>5.1}%   {}",
            region.name,
            region.length,
            list.join(", ")
        );
    }
    let code = sum(&sections, |s| matches!(s.name.as_str(), ".vector_table" | ".text" | ".ccm"));
    let constants = sum(&sections, |s| s.name == ".rodata");
    let trace = symbol_size(&bytes, TRACE)?;
    let ram =
        sum(&sections, |s| matches!(s.name.as_str(), ".data" | ".bss" | ".uninit" | ".ccm_data"));
    println!("code {code}, constants {constants}, static RAM {ram} with {trace} for the trace");
    limit("code and constants", code + constants, CODE_LIMIT)?;
    limit("static RAM without the trace", ram.saturating_sub(trace), RAM_LIMIT)?;
    let stack = regions(&memory)?.iter().find(|r| r.name == "STACK").map_or(0, |r| r.length);
    limit("stack in the worst case", stack::worst_case(&bytes).context("stack")?.into(), stack)
}

/// Most that code and constants may take, bytes.
const CODE_LIMIT: u64 = 96 * 1024;
/// Most that variables may take, the trace and the stack left out, bytes.
const RAM_LIMIT: u64 = 24 * 1024;
/// What the symbol of the trace's memory contains.
const TRACE: &str = "TRACE_MEMORY";

fn sum(sections: &[Section], which: impl Fn(&Section) -> bool) -> u64 {
    sections.iter().filter(|section| which(section)).map(|section| section.size).sum()
}

fn limit(what: &str, used: u64, limit: u64) -> Result<()> {
    if used > limit {
        bail!("{what}: {used} bytes, {limit} are allowed");
    }
    println!("{what}: {used} of {limit} bytes");
    Ok(())
}

fn symbol_size(bytes: &[u8], part: &str) -> Result<u64> {
    let header = FileHeader32::<Endianness>::parse(bytes)?;
    let endian = header.endian()?;
    let symbols = header.sections(endian, bytes)?.symbols(endian, bytes, SHT_SYMTAB)?;
    let mut size = 0;
    for symbol in symbols.iter() {
        let name = symbol.name(endian, symbols.strings())?;
        if String::from_utf8_lossy(name).contains(part) {
            size += u64::from(symbol.st_size(endian));
        }
    }
    Ok(size)
}

/// A section that takes memory on the controller.
#[derive(Debug, PartialEq, Eq)]
struct Section {
    name: String,
    address: u64,
    size: u64,
    /// Whether its contents come from the image, and so from the flash.
    stored: bool,
}

fn sections(bytes: &[u8]) -> Result<Vec<Section>> {
    let header = FileHeader32::<Endianness>::parse(bytes)?;
    let endian = header.endian()?;
    let table = header.sections(endian, bytes)?;
    let mut sections = Vec::new();
    for section in table.iter() {
        let size = u64::from(section.sh_size(endian));
        if !section.sh_flags(endian).contains(SHF_ALLOC) || size == 0 {
            continue;
        }
        sections.push(Section {
            name: String::from_utf8_lossy(table.section_name(endian, section)?).into_owned(),
            address: u64::from(section.sh_addr(endian)),
            size,
            stored: section.sh_type(endian) == SHT_PROGBITS,
        });
    }
    Ok(sections)
}

/// A memory of the controller.
#[derive(Debug, PartialEq, Eq)]
struct Region {
    name: String,
    origin: u64,
    length: u64,
}

impl Region {
    fn takes(&self, section: &Section) -> bool {
        let inside = (self.origin..self.origin + self.length).contains(&section.address);
        // What has contents after reset lies in the flash too, wherever it is copied to.
        inside || (self.name == "FLASH" && section.stored)
    }
}

/// The memories that `memory.x` declares: `NAME : ORIGIN = 0x..., LENGTH = ...K`.
fn regions(memory_x: &str) -> Result<Vec<Region>> {
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
    let regions: Vec<Region> = memory_x.lines().filter_map(region).collect();
    if regions.is_empty() {
        bail!("memory.x declares no memory");
    }
    Ok(regions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_x_declares_what_the_controller_has() {
        let text = fs::read_to_string(run::root().join("memory.x")).unwrap();
        let regions = regions(&text).unwrap();
        let known: Vec<(&str, u64, u64)> =
            regions.iter().map(|r| (r.name.as_str(), r.origin, r.length / 1024)).collect();
        assert_eq!(
            known,
            [
                ("FLASH", 0x0800_0000, 232),
                ("CONTROL", 0x0803_a000, 24),
                // Overflows where there is no memory.
                ("STACK", 0x2000_0000, 20),
                // To 96, not 128: CCM is mapped again behind it.
                ("RAM", 0x2000_5000, 76),
                ("CCM", 0x1000_0000, 32),
            ]
        );
    }

    #[test]
    fn initialised_data_takes_both_flash_and_ram() {
        let data = Section { name: ".data".into(), address: 0x2000_0000, size: 8, stored: true };
        let bss = Section { name: ".bss".into(), address: 0x2000_0008, size: 8, stored: false };
        let text = "FLASH : ORIGIN = 0x08000000, LENGTH = 512K\n\
                    RAM : ORIGIN = 0x20000000, LENGTH = 96K";
        let regions = regions(text).unwrap();
        assert!(regions[0].takes(&data) && regions[1].takes(&data));
        assert!(!regions[0].takes(&bss) && regions[1].takes(&bss));
    }

    #[test]
    fn what_is_no_elf_is_refused() {
        assert!(sections(b"no ELF").is_err());
    }
}
