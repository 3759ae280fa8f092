//! The record: a set of settings as double words of the flash.
//!
//! | double word | bits 0 to 31 | 32 to 47 | 48 to 63 |
//! |---|---|---|---|
//! | 0 | magic | version | entries |
//! | 1 | sequence number | checksum, 32 bits | |
//! | 2 and on | id of the key | its value, 32 bits | |
//!
//! The id of a key is its permanent number, in version 1 the hash of its name, so keys can be added, removed and renamed: a key that the
//! record does not hold keeps its default, and an entry that belongs to no key is skipped. The result of a self-commissioning, if there
//! is one, follows the keys as entries with ids of their own ([`learned`]). Behind them come the entries of the record before that belong
//! to no key: an image without a module keeps the settings of the module. The version changes only with this layout. The checksum is the
//! CRC-32 of Ethernet over everything but itself.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use drive_settings::entry::Change;
use drive_settings::renamed::old_name;

use super::flash::{ERASED, SLOT_WORDS, halves, pair};
use super::learned;
use crate::boards;
use crate::hash;
use crate::settings::FirmwareSettings;
use crate::settings::keys::{self, Key};

/// The layout that is written.
pub const VERSION: u16 = 2;
/// Double words of the longest record of settings that are known.
pub const WORDS: usize = FIRST + keys::COUNT + learned::WORDS;
const _: () = assert!(WORDS <= SLOT_WORDS);
/// The double word that is written last.
pub const COMMIT: usize = 1;
/// The first entry.
const FIRST: usize = 2;

/// "idrv": marks a record.
const MAGIC: u32 = 0x7672_6469;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Reason why saved settings are rejected; numbered like the faults (see `monitor/record.rs`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejected {
    /// The flash is not blank, and holds no whole record.
    Broken,
    /// A later firmware wrote the record, in this version of the layout.
    Newer(u16),
    /// The value of this setting is unknown to the firmware.
    Value(&'static str),
    /// The firmware of another board, this one, saved them.
    Board(&'static str),
    /// The design rules refuse the settings.
    Refused,
}

impl Rejected {
    /// Number of the reason.
    pub const fn code(self) -> u8 {
        match self {
            Self::Broken => 70,
            Self::Newer(_) => 71,
            Self::Value(_) => 72,
            Self::Refused => 73,
            Self::Board(_) => 76,
        }
    }
}

/// The record of `settings`; the double words after its [`length`] are erased.
pub fn record(settings: &FirmwareSettings, sequence: u32) -> [u64; SLOT_WORDS] {
    let mut words = [ERASED; SLOT_WORDS];
    write(&mut words, settings, sequence, core::iter::empty());
    words
}

/// Writes the record of `settings`, and of `others` as far as these fit, to erased words.
pub fn write(
    words: &mut [u64; SLOT_WORDS],
    settings: &FirmwareSettings,
    sequence: u32,
    others: impl Iterator<Item = u64>,
) {
    let mut end = FIRST;
    let mut put = |entry| {
        if let Some(word) = words.get_mut(end) {
            (*word, end) = (entry, end + 1);
        }
    };
    keys::all().for_each(|key| put(pair(key.id().into(), key.to_bits(settings))));
    if let Some(learned) = &settings.learned {
        let values = learned::to_words(learned, settings.drive.scales.both_zero_vectors);
        (0..).zip(values).for_each(|(index, value)| put(pair(learned::id(index), value)));
    }
    others.for_each(put);
    words[0] = pair(MAGIC, u32::from(VERSION) | ((end - FIRST) as u32) << 16);
    let written = words.iter().take(end).skip(FIRST).copied();
    words[COMMIT] = pair(sequence, checksum(words[0], sequence, written));
}

/// The entries of a whole record that this firmware does not know: settings of a module that its image leaves out.
pub fn unknown(mut read: impl FnMut(usize) -> Option<u64>) -> impl Iterator<Item = u64> {
    // In other versions the ids are of another kind.
    let head = read(0).and_then(header).filter(|(version, _)| *version == VERSION);
    let words = FIRST..FIRST + head.map_or(0, |(_, entries)| entries);
    words.filter_map(read).filter(|entry| {
        let (id, _) = halves(*entry);
        learned::index(id).is_none() && keys::all().all(|key| u32::from(key.id()) != id)
    })
}

/// Double words of a record in use.
pub fn length(record: &[u64; SLOT_WORDS]) -> usize {
    FIRST + header(record[0]).map_or(0, |(_, entries)| entries)
}

fn checksum(header: u64, sequence: u32, entries: impl Iterator<Item = u64>) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&header.to_le_bytes());
    digest.update(&sequence.to_le_bytes());
    entries.for_each(|entry| digest.update(&entry.to_le_bytes()));
    digest.finalize()
}

/// Version and number of entries, if the double word is a header.
fn header(word: u64) -> Option<(u16, usize)> {
    let (magic, rest) = halves(word);
    let (version, entries) = (rest as u16, (rest >> 16) as usize);
    (magic == MAGIC && entries <= SLOT_WORDS - FIRST).then_some((version, entries))
}

/// The sequence number, if the slot that `read` reads holds a record with the right checksum.
pub fn whole_record(read: &mut dyn FnMut(usize) -> Option<u64>) -> Option<u32> {
    let first = read(0)?;
    let (_, entries) = header(first)?;
    let (sequence, written) = halves(read(COMMIT)?);
    let mut complete = true;
    let entries = (FIRST..FIRST + entries).map(|word| {
        let entry = read(word);
        complete &= entry.is_some();
        entry.unwrap_or(ERASED)
    });
    let checksum = checksum(first, sequence, entries);
    (complete && checksum == written).then_some(sequence)
}

/// The settings of a whole record.
///
/// # Errors
/// The reason why the settings are rejected.
pub fn settings(
    read: &mut dyn FnMut(usize) -> Option<u64>,
    defaults: &FirmwareSettings,
) -> Result<FirmwareSettings, Rejected> {
    let (version, entries) = read(0).and_then(header).ok_or(Rejected::Broken)?;
    if version > VERSION {
        return Err(Rejected::Newer(version));
    }
    let mut settings = *defaults;
    let (mut words, mut present) = ([0; learned::WORDS], 0_u64);
    // Records without a board are older than the second board.
    settings.board = boards::ALL[0];
    for word in FIRST..FIRST + entries {
        let (id, bits) = halves(read(word).ok_or(Rejected::Broken)?);
        let is_it = |key: &Key| match version {
            ..=1 => hash::of(old_name(key.name()).bytes()) == id,
            _ => u32::from(key.id()) == id,
        };
        match keys::all().find(is_it) {
            // Numbers of the board are those of this image.
            Some(Key::Drive(entry)) if entry.change == Change::Board => {}
            Some(key) => key.set_bits(&mut settings, bits).ok_or(Rejected::Value(key.name()))?,
            None => {
                if let Some(index) = learned::index(id) {
                    words[index] = bits;
                    present |= 1 << index;
                }
            }
        }
    }
    if settings.board != defaults.board {
        return Err(Rejected::Board(settings.board.name));
    }
    // A result learned with other rules is left out: the drive has to learn again.
    if present > 0 && !learned::is_of_other_rules(&words, present) {
        let same = learned::in_both(&words) == settings.drive.scales.both_zero_vectors;
        let is_sound = same && present == learned::ALL;
        let learned = learned::from_words(&words).filter(|_| is_sound);
        settings.learned = Some(learned.ok_or(Rejected::Value(learned::NAME))?);
    }
    Ok(settings)
}
