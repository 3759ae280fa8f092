//! The check sum in the finished image, which the firmware compares at every start (`src/chip/start.rs`), and the same image as `.bin`
//! and `.hex` for programs that do not read ELF.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use crc::{CRC_32_ISO_HDLC, Crc};
use ihex::Record;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{LittleEndian, Object, ObjectSymbol};

/// First address of the flash, and its size, bytes.
const FLASH: usize = 0x0800_0000;
const SIZE: usize = 512 * 1024;

/// Puts the check sum into an ELF file; doing it twice gives the same result. Writes the other files beside it.
pub fn seal(path: &Path) -> Result<()> {
    let mut bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let elf: ElfFile32<LittleEndian> = ElfFile32::parse(&*bytes)?;
    let symbol = |name| Some(elf.symbol_by_name(name)?.address() as usize - FLASH);
    let (pieces, check) = symbol("__pieces").zip(symbol("__check")).context("no check sum")?;
    let (mut flash, mut place) = (Vec::new(), 0);
    for header in elf.elf_program_headers() {
        let [at, offset] = [header.p_paddr, header.p_offset].map(|n| n.get(LittleEndian) as usize);
        let data = header.data(LittleEndian, &*bytes).unwrap_or_default();
        let at = at.wrapping_sub(FLASH);
        if at < SIZE && !data.is_empty() {
            let end = at + data.len();
            // Gaps are filled as erased flash.
            flash.resize(flash.len().max(end.next_multiple_of(8)), 0xff);
            flash[at..end].copy_from_slice(data);
            place = if (at..end).contains(&check) { offset + check - at } else { place };
        }
    }
    // The lower three bytes of an address count from the beginning of the flash.
    let word = |at: usize| (0..3).fold(0, |word, n| word | usize::from(flash[at + n]) << (8 * n));
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let mut digest = crc.digest();
    // An image may leave a piece empty.
    let pieces = (pieces..check).step_by(8).map(|at| word(at)..word(at + 4));
    pieces.filter(|piece| !piece.is_empty()).for_each(|piece| digest.update(&flash[piece]));
    let sum = digest.finalize().to_le_bytes();
    flash[check..check + 4].copy_from_slice(&sum);
    bytes[place..place + 4].copy_from_slice(&sum);
    fs::write(path, &bytes)?;
    let mut records = Vec::new();
    let lines = flash.chunks(16).enumerate();
    for (n, line) in lines.filter(|(_, line)| line.iter().any(|byte| *byte != 0xff)) {
        let address = (FLASH + 16 * n) as u32;
        records.push(Record::ExtendedLinearAddress((address >> 16) as u16));
        records.push(Record::Data { offset: address as u16, value: line.to_vec() });
    }
    records.push(Record::EndOfFile);
    fs::write(path.with_extension("hex"), ihex::create_object_file_representation(&records)?)?;
    fs::write(path.with_extension("bin"), flash).context("the .bin")
}
