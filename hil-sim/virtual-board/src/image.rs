//! The ELF: segments of the flash, symbols, functions and source lines of addresses.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use gimli::{EndianArcSlice, RunTimeEndian};
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Architecture, Object, ObjectSection, ObjectSymbol, SymbolKind};

use crate::power_stage::REFERENCE;
use stm32g4_unicorn::memory::Region;

type Slice = EndianArcSlice<RunTimeEndian>;

/// Environment variable with the path of the ELF.
pub const ELF: &str = "INDUCTION_DRIVE_ELF";
/// Environment variable with the folder that contains the ELFs of the other boards.
const BOARDS: &str = "INDUCTION_DRIVE_BOARDS";
/// Folders in the target directory in which `cargo firmware` puts the ELF, with rustup's and with Debian's compiler.
const PLACES: [&str; 2] = ["", "debian"];
const INSIDE: &str = "thumbv7em-none-eabihf/firmware/induction-drive";

/// A segment of the flash.
#[derive(Clone, Debug)]
pub struct Segment {
    /// Its address in the flash.
    pub address: u32,
    /// Contents.
    pub bytes: Vec<u8>,
}

struct Symbol {
    region: Region,
    name: String,
    is_code: bool,
}

/// An image.
pub struct Image {
    /// The file.
    pub bytes: Vec<u8>,
    /// Contents of the flash.
    pub segments: Vec<Segment>,
    symbols: Vec<Symbol>,
    lines: addr2line::Context<Slice>,
}

/// A function at an address; with inlined functions, the innermost comes first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Its name with its path.
    pub function: String,
    /// File and line.
    pub place: String,
}

/// Returns the target directory.
fn target() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from)
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// The file does not exist, or it is not an ELF for this chip.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
        Self::parse(bytes).with_context(|| path.display().to_string())
    }

    /// Opens the image that `cargo firmware` built last, or the one that the environment names.
    ///
    /// # Errors
    /// There is no image.
    pub fn built() -> Result<Self> {
        if let Some(path) = std::env::var_os(ELF) {
            return Self::open(Path::new(&path));
        }
        let places = PLACES.map(|place| target().join(place).join(INSIDE));
        let age = |path: PathBuf| Some((path.metadata().ok()?.modified().ok()?, path));
        let newest = places.into_iter().filter_map(age).max();
        Self::open(&newest.context("no firmware image: type `cargo firmware`")?.1)
    }

    /// Opens the image that `cargo firmware --board NAME` built last for a board, or the one in the folder that the
    /// environment names, which has one folder per board. For the reference board it is [`Image::built`].
    ///
    /// # Errors
    /// There is no image.
    pub fn built_for(board: &str) -> Result<Self> {
        if board == REFERENCE.name {
            return Self::built();
        }
        let folder =
            std::env::var_os(BOARDS).map_or_else(|| target().join("boards"), PathBuf::from);
        Self::open(&folder.join(board).join("induction-drive"))
            .with_context(|| format!("no image of {board}: type `cargo firmware --board {board}`"))
    }

    /// Parses the contents of an ELF file.
    ///
    /// # Errors
    /// The contents are not an ELF for this chip.
    pub fn parse(bytes: Vec<u8>) -> Result<Self> {
        let file = ElfFile32::<object::Endianness>::parse(&*bytes)?;
        ensure!(file.architecture() == Architecture::Arm, "not for an Arm processor");
        let (endian, mut segments) = (file.endian(), Vec::new());
        for program in file.elf_program_headers() {
            let data = program.data(endian, &*bytes).unwrap_or_default();
            if program.p_type(endian) == PT_LOAD && !data.is_empty() {
                segments.push(Segment { address: program.p_paddr(endian), bytes: data.to_vec() });
            }
        }
        let mut symbols: Vec<_> = file.symbols().filter_map(|symbol| named(&symbol)).collect();
        // If several symbols have one address, the largest comes last.
        symbols.sort_unstable_by_key(|symbol| (symbol.region.address, symbol.region.size));
        let section = |id: gimli::SectionId| -> Result<Slice> {
            let section = file.section_by_name(id.name());
            let data = section.map(|section| section.uncompressed_data()).transpose()?;
            Ok(EndianArcSlice::new(data.unwrap_or_default().into(), RunTimeEndian::Little))
        };
        let lines = addr2line::Context::from_dwarf(gimli::Dwarf::load(section)?)?;
        Ok(Self { segments, symbols, lines, bytes })
    }

    /// Returns address and size of the symbol with exactly this name, demangled and without angle brackets.
    ///
    /// # Errors
    /// There is no such symbol, or more than one.
    pub fn symbol(&self, name: &str) -> Result<Region> {
        let mut found = self.symbols.iter().filter(|symbol| symbol.name == name);
        match (found.next(), found.next()) {
            (Some(symbol), None) => Ok(symbol.region),
            (None, _) => bail!("the image has no symbol {name}"),
            (Some(_), Some(_)) => bail!("the image has several symbols {name}"),
        }
    }

    /// Returns the words of a constant in the flash.
    ///
    /// # Errors
    /// There is no such symbol, or it is not in the flash.
    pub fn contents(&self, name: &str) -> Result<Vec<u32>> {
        let Region { address, size } = self.symbol(name)?;
        let bytes = self.segments.iter().find_map(|segment| {
            let at = address.checked_sub(segment.address)? as usize;
            segment.bytes.get(at..at + size as usize)
        });
        let words = bytes.with_context(|| format!("{name} is not in the flash"))?.as_chunks().0;
        Ok(words.iter().map(|word| u32::from_le_bytes(*word)).collect())
    }

    /// Returns every second address of the code: an instruction begins at each of them or at the one before.
    pub fn code(&self) -> impl Iterator<Item = u32> {
        let functions = self.symbols.iter().filter(|symbol| symbol.is_code);
        functions.flat_map(|f| (f.region.address..f.region.end()).step_by(2))
    }

    /// Returns the functions at an address of code, inlined ones first.
    pub fn frames(&self, address: u32) -> Vec<Frame> {
        let mut frames = Vec::new();
        if let Ok(mut found) = self.lines.find_frames(u64::from(address)).skip_all_loads() {
            while let Ok(Some(frame)) = found.next() {
                let function = frame.function.as_ref().and_then(|f| f.demangle().ok());
                let place = frame.location.as_ref().map_or(String::new(), |at| {
                    let file = at.file.unwrap_or("?");
                    let short = file.rsplit('/').take(3).collect::<Vec<_>>();
                    let short = short.into_iter().rev().collect::<Vec<_>>().join("/");
                    format!("{short}:{}", at.line.unwrap_or(0))
                });
                frames
                    .push(Frame { function: function.map_or("?".into(), Cow::into_owned), place });
            }
        }
        frames
    }

    /// Describes the position of an address of code.
    pub fn location(&self, address: u32) -> String {
        let mut text = format!("{address:#010x}");
        let above = self.symbols.partition_point(|symbol| symbol.region.address <= address);
        if let Some(Symbol { region, name, .. }) = self.symbols[..above].last()
            && (address < region.end() || region.size == 0)
        {
            let _ = write!(text, " {name}+{:#x}", address - region.address);
        }
        for frame in self.frames(address) {
            let _ = write!(text, "\n    {} at {}", frame.function, frame.place);
        }
        text
    }
}

/// Returns a symbol whose name is not the assembler's own.
fn named<'a>(symbol: &impl ObjectSymbol<'a>) -> Option<Symbol> {
    let mangled = symbol.name().ok().filter(|name| !name.is_empty() && !name.starts_with('$'))?;
    let name = addr2line::demangle_auto(Cow::Borrowed(mangled), Some(gimli::DW_LANG_Rust));
    // The lowest bit of a function's address is the Thumb bit.
    let region = Region { address: symbol.address() as u32 & !1, size: symbol.size() as u32 };
    let is_code = symbol.kind() == SymbolKind::Text;
    Some(Symbol { region, name: name.replace(['<', '>'], ""), is_code })
}
