//! A set of settings as double words of the flash.
//!
//! | double word | bits 0 to 31 | 32 to 47 | 48 to 63 |
//! |---|---|---|---|
//! | 0 | magic | version | entries |
//! | 1 | sequence number | checksum, 32 bits | |
//! | 2 and on | number of the key | its value, 32 bits | |
//!
//! A key is known by a number made of its name, so that keys can come and go: what a record does not
//! hold stays as it is by default, what no key has asked for is passed over. What was learned is behind
//! the keys, if there is something, as entries with numbers of their own ([`learned`]). The version
//! changes only with this layout. The checksum is that of Ethernet over everything but itself.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

use super::{NotUsed, SLOT_WORDS, learned};
use crate::console::keys::{FirmwareSettings, KEYS, find_id};

/// The layout that is written.
pub const VERSION: u16 = 1;
/// Double words of the longest record that is written.
pub const WORDS: usize = FIRST + KEYS.len() + learned::WORDS;
/// The double word that is written last.
pub const COMMIT: usize = 1;
/// The first entry.
const FIRST: usize = 2;

/// "idrv", so that other contents are no record.
const MAGIC: u32 = 0x7672_6469;
const ERASED: u64 = u64::MAX;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// Erased throughout.
    Blank,
    /// Anything else that is no whole record.
    Broken,
    /// A whole record.
    Whole {
        /// Of its layout.
        version: u16,
        /// Its sequence number.
        sequence: u32,
    },
}

fn pair(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

fn halves(word: u64) -> (u32, u32) {
    (word as u32, (word >> 32) as u32)
}

/// The record of `settings`, erased behind its [`length`].
pub fn record(settings: &FirmwareSettings, sequence: u32) -> [u64; WORDS] {
    let mut words = [ERASED; WORDS];
    for (key, word) in KEYS.iter().zip(words.iter_mut().skip(FIRST)) {
        *word = pair(key.id(), key.to_bits(settings));
    }
    let mut entries = KEYS.len();
    if let Some(found) = &settings.learned {
        let values = learned::to_words(found).into_iter().enumerate();
        for ((n, value), word) in values.zip(words.iter_mut().skip(FIRST + entries)) {
            *word = pair(learned::id(n), value);
        }
        entries += learned::WORDS;
    }
    words[0] = pair(MAGIC, u32::from(VERSION) | (entries as u32) << 16);
    let written = words.iter().skip(FIRST).take(entries).copied();
    words[COMMIT] = pair(sequence, checksum(words[0], sequence, written));
    words
}

/// Double words of a record that are written.
pub fn length(record: &[u64; WORDS]) -> usize {
    FIRST + header(record[0]).map_or(0, |(_, entries)| entries)
}

#[inline(never)]
fn checksum(header: u64, sequence: u32, entries: impl Iterator<Item = u64>) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&header.to_le_bytes());
    digest.update(&sequence.to_le_bytes());
    entries.for_each(|entry| digest.update(&entry.to_le_bytes()));
    digest.finalize()
}

/// Version and number of entries, if it is a header.
fn header(word: u64) -> Option<(u16, usize)> {
    let (magic, rest) = halves(word);
    let (version, entries) = (rest as u16, (rest >> 16) as usize);
    (magic == MAGIC && entries <= SLOT_WORDS - FIRST).then_some((version, entries))
}

/// What a slot holds that is read by `read`. (Nothing here is inlined: it is called from several places,
/// seldom.)
#[inline(never)]
pub fn find(read: &mut dyn FnMut(usize) -> Option<u64>) -> Found {
    if let Some((version, sequence)) = whole(read) {
        return Found::Whole { version, sequence };
    }
    if (0..SLOT_WORDS).all(|word| read(word) == Some(ERASED)) {
        Found::Blank
    } else {
        Found::Broken
    }
}

#[inline(never)]
fn whole(read: &mut dyn FnMut(usize) -> Option<u64>) -> Option<(u16, u32)> {
    let first = read(0)?;
    let (version, entries) = header(first)?;
    let (sequence, written) = halves(read(COMMIT)?);
    let mut complete = true;
    let entries = (FIRST..FIRST + entries).map(|word| {
        let entry = read(word);
        complete &= entry.is_some();
        entry.unwrap_or(ERASED)
    });
    let checksum = checksum(first, sequence, entries);
    (complete && checksum == written).then_some((version, sequence))
}

/// The settings of a whole record.
///
/// # Errors
/// Why they are not used.
#[inline(never)]
pub fn settings(
    read: &mut dyn FnMut(usize) -> Option<u64>,
    defaults: &FirmwareSettings,
) -> Result<FirmwareSettings, NotUsed> {
    let (version, entries) = read(0).and_then(header).ok_or(NotUsed::Broken)?;
    if version > VERSION {
        return Err(NotUsed::Newer(version));
    }
    let mut settings = *defaults;
    let (mut words, mut found) = ([0; learned::WORDS], 0_u64);
    for word in FIRST..FIRST + entries {
        let (id, bits) = halves(read(word).ok_or(NotUsed::Broken)?);
        if let Some(key) = find_id(id) {
            key.set_bits(&mut settings, bits).ok_or(NotUsed::Value(key.name))?;
        } else if let Some(place) = learned::place(id) {
            words[place] = bits;
            found |= 1 << place;
        }
    }
    if found > 0 {
        let whole = learned::from_words(&words).filter(|_| found == learned::ALL);
        settings.learned = Some(whole.ok_or(NotUsed::Value(learned::NAME))?);
    }
    Ok(settings)
}
