//! The check sum in the finished image, which the firmware compares at every start (`src/chip/start.rs`), and the same image as
//! `.bin` and `.hex` for programs that take no ELF.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use crc::{CRC_32_ISO_HDLC, Crc};
use ihex::Record;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{LittleEndian, Object, ObjectSymbol};

/// First address of the flash.
const FLASH: u32 = 0x0800_0000;
/// Bytes in a record of a `.hex`.
const RECORD: usize = 16;

/// A part of the file that lies in the flash: its place in the file, its address and its bytes.
struct Part<'a> {
    place: usize,
    address: u32,
    bytes: &'a [u8],
}

/// Puts the check sum into an ELF; the same twice gives the same. Writes the other files beside it.
pub fn seal(path: &Path) -> Result<()> {
    let mut bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let (place, sum) = sum(&bytes)?;
    bytes[place..place + 4].copy_from_slice(&sum.to_le_bytes());
    fs::write(path, &bytes)?;
    let parts = parts(&bytes)?;
    let mut flash = Vec::new();
    let mut records = Vec::new();
    for part in &parts {
        let at = (part.address - FLASH) as usize;
        // As erased between the parts.
        flash.resize(flash.len().max(at + part.bytes.len()), 0xff);
        flash[at..at + part.bytes.len()].copy_from_slice(part.bytes);
    }
    // A record may not cross an end of 64 KiB.
    for (n, value) in flash.chunks(RECORD).enumerate() {
        let address = FLASH + (n * RECORD) as u32;
        if address.is_multiple_of(1 << 16) {
            records.push(Record::ExtendedLinearAddress((address >> 16) as u16));
        }
        if value.iter().any(|byte| *byte != 0xff) {
            records.push(Record::Data { offset: address as u16, value: value.to_vec() });
        }
    }
    records.push(Record::EndOfFile);
    fs::write(path.with_extension("hex"), ihex::create_object_file_representation(&records)?)?;
    Ok(fs::write(path.with_extension("bin"), flash)?)
}

/// Place of the check sum in the file, and its value over the pieces that the image names.
fn sum(bytes: &[u8]) -> Result<(usize, u32)> {
    let elf: ElfFile32<LittleEndian> = ElfFile32::parse(bytes)?;
    let symbol = |name| {
        let found = elf.symbol_by_name(name).with_context(|| format!("no symbol {name}"));
        found.map(|symbol| symbol.address() as u32)
    };
    let parts = parts(bytes)?;
    let byte = |address: u32| {
        let part = parts.iter().find(|p| (p.address..p.address + p.bytes.len() as u32).contains(&address));
        let part = part.with_context(|| format!("the image has a gap at {address:#x}"))?;
        let at = (address - part.address) as usize;
        anyhow::Ok((part.place + at, part.bytes[at]))
    };
    let word = |at| (0..4).try_fold(0, |word, n| anyhow::Ok(word | u32::from(byte(at + n)?.1) << (8 * n)));
    let (pieces, check) = (symbol("__pieces")?, symbol("__check")?);
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let (mut digest, mut covered) = (crc.digest(), 4);
    for at in (pieces..check).step_by(8) {
        let piece = (word(at)?..word(at + 4)?).map(|at| byte(at).map(|(_, byte)| byte));
        let piece = piece.collect::<Result<Vec<_>>>()?;
        digest.update(&piece);
        covered += piece.len();
    }
    covered += (check - pieces) as usize;
    let whole = parts.iter().map(|part| part.bytes.len()).sum::<usize>();
    ensure!(covered == whole, "the check sum covers {covered} of {whole} bytes of the image");
    Ok((byte(check)?.0, digest.finalize()))
}

fn parts(bytes: &[u8]) -> Result<Vec<Part<'_>>> {
    let elf: ElfFile32<LittleEndian> = ElfFile32::parse(bytes)?;
    let (headers, endian) = (elf.elf_program_headers(), LittleEndian);
    let parts = headers.iter().filter(|h| h.p_type(endian) == object::elf::PT_LOAD && h.p_filesz(endian) > 0);
    parts
        .map(|h| {
            let bytes = h.data(endian, bytes).ok().context("a segment outside of the file")?;
            Ok(Part { place: h.p_offset(endian) as usize, address: h.p_paddr(endian), bytes })
        })
        .collect()
}
