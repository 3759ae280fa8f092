//! The ELF: what is loaded where, names and source lines of addresses, places of variables.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gimli::{EndianArcSlice, Reader as _, RunTimeEndian};
use object::{Object, ObjectSection, ObjectSymbol};

type Slice = EndianArcSlice<RunTimeEndian>;

/// Environment variable that names the ELF.
pub const ELF: &str = "INDUCTION_DRIVE_ELF";
/// Where `cargo firmware` puts it in the target directory, with rustup's and with Debian's compiler.
const PLACES: [&str; 2] = ["", "debian"];
const INSIDE: &str = "thumbv7em-none-eabihf/firmware/induction-drive";

/// A segment of the flash.
#[derive(Clone, Debug)]
pub struct Segment {
    /// Where it lies in the flash.
    pub address: u32,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// An image.
pub struct Image {
    bytes: Vec<u8>,
    dwarf: gimli::Dwarf<Slice>,
    segments: Vec<Segment>,
    symbols: BTreeMap<u32, (u32, String)>,
    lines: addr2line::Context<Slice>,
}

/// A function at an address, the innermost first where functions are inlined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Its name with its path.
    pub function: String,
    /// File and line.
    pub place: String,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// The file is not there, or is no ELF for this chip.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
        Self::parse(bytes).with_context(|| path.display().to_string())
    }

    /// The image that `cargo firmware` built last, or the one that the environment names.
    ///
    /// # Errors
    /// There is none.
    pub fn built() -> Result<Self> {
        if let Some(path) = std::env::var_os(ELF) {
            return Self::open(Path::new(&path));
        }
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let target =
            std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
        let places = PLACES.map(|place| target.join(place).join(INSIDE));
        let age = |path: PathBuf| Some((path.metadata().ok()?.modified().ok()?, path));
        let newest = places.into_iter().filter_map(age).max();
        Self::open(&newest.context("no firmware image: type `cargo firmware`")?.1)
    }

    /// Understands the contents of an ELF file.
    ///
    /// # Errors
    /// It is no ELF for this chip.
    pub fn parse(bytes: Vec<u8>) -> Result<Self> {
        let segments = segments(&bytes)?;
        let file = object::File::parse(&*bytes)?;
        let mut symbols = BTreeMap::new();
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or_default();
            if !name.is_empty() && !name.starts_with('$') {
                let place = (symbol.size() as u32, name.to_owned());
                // Of several names for one address the one with a size.
                let entry = symbols.entry(symbol.address() as u32 & !1).or_insert(place.clone());
                if entry.0 == 0 {
                    *entry = place;
                }
            }
        }
        let endian = RunTimeEndian::Little;
        let section = |id: gimli::SectionId| -> Result<Slice> {
            let data = match file.section_by_name(id.name()) {
                Some(section) => section.uncompressed_data()?,
                None => Cow::Borrowed(&[][..]),
            };
            Ok(EndianArcSlice::new(data.into(), endian))
        };
        let lines = addr2line::Context::from_dwarf(gimli::Dwarf::load(section)?)?;
        Ok(Self { dwarf: gimli::Dwarf::load(section)?, segments, symbols, lines, bytes })
    }

    /// The file.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// What lies in the flash.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Address and size of the only symbol whose name contains `part`.
    ///
    /// # Errors
    /// There is none, or more than one.
    pub fn symbol(&self, part: &str) -> Result<(u32, u32)> {
        let mut found = self.symbols.iter().filter(|(_, (_, name))| name.contains(part));
        match (found.next(), found.next()) {
            (Some((address, (size, _))), None) => Ok((*address, *size)),
            (None, _) => bail!("the image has no symbol with {part:?}"),
            (Some((_, a)), Some((_, b))) => bail!("{part:?} is in {} and in {}", a.1, b.1),
        }
    }

    /// Address of the symbol with exactly this name.
    ///
    /// # Errors
    /// There is none.
    pub fn address(&self, name: &str) -> Result<u32> {
        let file = object::File::parse(&*self.bytes)?;
        let symbol = file.symbol_by_name(name);
        Ok(symbol.with_context(|| format!("the image has no symbol {name}"))?.address() as u32)
    }

    /// Size of the structure named `name`, and where in it its `member` is.
    ///
    /// # Errors
    /// The debug information has no such structure or member.
    pub fn member(&self, name: &str, member: &str) -> Result<(u32, u32)> {
        let mut units = self.dwarf.units();
        while let Some(header) = units.next()? {
            let unit = self.dwarf.unit(header)?;
            let named = |entry: &gimli::DebuggingInformationEntry<Slice>, name: &str| -> bool {
                let value = entry.attr_value(gimli::DW_AT_name);
                let text = value.and_then(|value| self.dwarf.attr_string(&unit, value).ok());
                text.is_some_and(|text| text.to_string_lossy().is_ok_and(|text| text == name))
            };
            let number = |entry: &gimli::DebuggingInformationEntry<Slice>, which| {
                entry.attr_value(which).and_then(|value| value.udata_value())
            };
            let mut size = None;
            let mut entries = unit.entries();
            while let Some(entry) = entries.next_dfs()? {
                if entry.tag() == gimli::DW_TAG_structure_type {
                    let found = named(entry, name);
                    size = if found { number(entry, gimli::DW_AT_byte_size) } else { None };
                } else if let Some(size) = size
                    && entry.tag() == gimli::DW_TAG_member
                    && named(entry, member)
                    && let Some(offset) = number(entry, gimli::DW_AT_data_member_location)
                {
                    return Ok((size as u32, offset as u32));
                }
            }
        }
        bail!("the image knows no {member} in {name}")
    }

    /// Address of the variable whose name contains `part` and which has just room for `size` bytes and
    /// a flag.
    ///
    /// # Errors
    /// There is none.
    pub fn variable(&self, part: &str, size: u32) -> Result<u32> {
        let fits = |(_, (found, name)): &(&u32, &(u32, String))| {
            name.contains(part) && (size..size + 16).contains(found)
        };
        let found = self.symbols.iter().find(fits);
        found.map(|found| *found.0).with_context(|| format!("no variable {part} of {size} bytes"))
    }

    /// The functions at an address of code, inlined ones first.
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

    /// Where an address of code is, for people.
    pub fn location(&self, address: u32) -> String {
        let mut text = format!("{address:#010x}");
        let below = self.symbols.range(..=address).next_back();
        if let Some((begin, (size, name))) = below
            && (address < begin + size || *size == 0)
        {
            let _ = write!(text, " {name}+{:#x}", address - begin);
        }
        for frame in self.frames(address) {
            let _ = write!(text, "\n    {} at {}", frame.function, frame.place);
        }
        text
    }
}

fn segments(bytes: &[u8]) -> Result<Vec<Segment>> {
    use object::elf::{EM_ARM, FileHeader32, PT_LOAD};
    use object::read::elf::{FileHeader, ProgramHeader};
    let header = FileHeader32::<object::Endianness>::parse(bytes)?;
    let endian = header.endian()?;
    if header.e_machine(endian) != EM_ARM {
        bail!("not for an Arm processor");
    }
    let mut segments = Vec::new();
    for program in header.program_headers(endian, bytes)? {
        let data = program.data(endian, bytes).unwrap_or_default();
        if program.p_type(endian) == PT_LOAD && !data.is_empty() {
            let address = program.p_paddr(endian);
            segments.push(Segment { address, bytes: data.to_vec() });
        }
    }
    Ok(segments)
}
