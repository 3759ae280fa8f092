//! Settings that outlast a reset: two slots in the flash, written in turn.
//!
//! One slot holds the valid set; the next `save` writes the other: it is erased, then the record is programmed, the double word with
//! sequence number and checksum last. At any instant of a power failure that double word is missing, torn or whole, so either the old or
//! the new set is valid. A double word torn by a power failure is read as an error of the flash, never as data.
//!
//! Own code replaces `sequential-storage` (8.0.2), which moves its contents through one page that it erases. That crate recognises a page
//! in use by four bits of its first and last word. If a page is half erased, the crate takes the rest of it for the source, and erases
//! the good copy.

pub mod codec;
mod flash;
pub mod learned;

use codec::{COMMIT, Rejected};
pub(crate) use flash::{ERASED, halves, newer, pair};
pub use flash::{Flash, FlashError, SLOT_WORDS, SLOTS};

use crate::settings::FirmwareSettings;

/// The saved settings, if any were saved. A record that cannot be used stays in the flash until the next save or longer.
pub type Loaded = Result<Option<FirmwareSettings>, Rejected>;

/// The saved settings: the flash, and the slot that the next `save` must not touch.
#[derive(Debug)]
pub struct Saved<F> {
    flash: F,
    /// The slot with the valid set, and its sequence number.
    newest: Option<(usize, u32)>,
    /// The slot of a set that was used: a save keeps its entries that this firmware does not know.
    used: Option<usize>,
    /// The slot for the next set if none is valid.
    free: usize,
}

impl<F: Flash> Saved<F> {
    /// Reads both slots. Keys that the record does not hold keep their value from `defaults`.
    pub fn load(mut flash: F, defaults: &FirmwareSettings) -> (Self, Loaded) {
        let newest =
            newer([0, 1].map(|slot| codec::whole_record(&mut |word| flash.read(slot, word))));
        let blank =
            [0, 1].map(|slot| (0..SLOT_WORDS).all(|word| flash.read(slot, word) == Some(ERASED)));
        let loaded = match newest {
            Some((slot, _)) => {
                codec::settings(&mut |word| flash.read(slot, word), defaults).map(Some)
            }
            None if blank == [true; SLOTS] => Ok(None),
            None => Err(Rejected::Broken),
        };
        let free = usize::from(!blank[0] && blank[1]);
        let used = newest.filter(|_| loaded.is_ok()).map(|(slot, _)| slot);
        (Self { flash, newest, used, free }, loaded)
    }

    /// The flash, for the other data stored in it.
    pub fn flash(&mut self) -> &mut F {
        &mut self.flash
    }

    /// Writes the settings. Takes up to two page erasures; only with the outputs off.
    ///
    /// # Errors
    /// The flash failed; the previous set stays valid.
    pub fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError> {
        let (slot, sequence) = match self.newest {
            Some((newest, sequence)) => (1 - newest, sequence.wrapping_add(1)),
            None => (self.free, 0),
        };
        let flash = &mut self.flash;
        let others = self.used.map(|slot| codec::unknown(move |word| flash.read(slot, word)));
        let mut record = [ERASED; SLOT_WORDS];
        codec::write(&mut record, settings, sequence, others.into_iter().flatten());
        self.flash.erase(slot)?;
        // The double word that makes the record valid comes last.
        let others = (0..codec::length(&record)).filter(|word| *word != COMMIT);
        for word in others.chain([COMMIT]) {
            let Some(value) = record.get(word) else { continue };
            self.flash.write(slot, word, *value)?;
        }
        (self.newest, self.used) = (Some((slot, sequence)), Some(slot));
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests;
