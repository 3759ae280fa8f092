//! Any contents of the flash are read without harm. Loaded settings can be built or are refused (tried with one input in a hundred,
//! because a design takes longer than everything else), and a save after that is loaded again.
#![no_main]

use induction_drive::settings::FirmwareSettings;
use induction_drive::store::{Flash, FlashError, SLOT_WORDS, SLOTS, Saved, codec};
use induction_drive_fuzz::doubles::found;
use induction_drive_fuzz::{is_designed, sum};
use libfuzzer_sys::fuzz_target;

struct Fake([[Option<u64>; SLOT_WORDS]; SLOTS]);

impl Flash for &mut Fake {
    fn read(&mut self, slot: usize, word: usize) -> Option<u64> {
        self.0[slot][word]
    }
    fn erase(&mut self, slot: usize) -> Result<(), FlashError> {
        self.0[slot] = [Some(u64::MAX); SLOT_WORDS];
        Ok(())
    }
    fn program(&mut self, slot: usize, word: usize, value: u64) -> Result<(), FlashError> {
        assert_eq!(self.0[slot][word], Some(u64::MAX), "not erased");
        self.0[slot][word] = Some(value);
        Ok(())
    }
}

fuzz_target!(|bytes: &[u8]| {
    let defaults = FirmwareSettings::of_the_board();
    let mut fake = Fake([[Some(u64::MAX); SLOT_WORDS]; SLOTS]);
    // A whole record with everything in each slot, and changes of it: slot, place, kind of change, eight bytes.
    for slot in 0..SLOTS {
        for (word, value) in codec::record(&full(), slot as u32).into_iter().enumerate() {
            fake.0[slot][word] = Some(value);
        }
    }
    for change in bytes.chunks_exact(11) {
        let slot = usize::from(change[0]) % SLOTS;
        let word = usize::from(change[1]) % SLOT_WORDS;
        let value = u64::from_le_bytes(change[3..11].try_into().expect("eight bytes"));
        fake.0[slot][word] = match change[2] % 4 {
            0 => None,
            1 => Some(value),
            2 => fake.0[slot][word].map(|old| old ^ value),
            // A value for a key, as if it had been saved: the checksum is corrected.
            _ => fake.0[slot][word].map(|old| old & 0xffff_ffff | value << 32),
        };
        if change[2] % 4 == 3 {
            reseal(&mut fake.0[slot]);
        }
    }
    let (mut saved, loaded) = Saved::load(&mut fake, &defaults);
    if let Ok(Some(settings)) = loaded
        && is_designed(bytes)
    {
        let _ = settings.build();
    }
    let mut other = defaults;
    other.drive.motor.r_s = 7.0;
    saved.save(&other).expect("nothing fails here");
    assert_eq!(Saved::load(&mut fake, &defaults).1, Ok(Some(other)));
});

/// Settings, and a result that may have been learned with them.
fn full() -> FirmwareSettings {
    let mut settings = FirmwareSettings::of_the_board();
    settings.learn(&found(), false);
    settings
}

/// Corrects the checksum, with the number of entries that this firmware writes.
fn reseal(slot: &mut [Option<u64>; SLOT_WORDS]) {
    let words: Vec<u64> = slot[..codec::WORDS].iter().map(|word| word.unwrap_or(0)).collect();
    let mut bytes = words[0].to_le_bytes().to_vec();
    bytes.extend((words[1] as u32).to_le_bytes());
    bytes.extend(words[2..].iter().flat_map(|word| word.to_le_bytes()));
    slot[1] = Some(words[1] & 0xffff_ffff | u64::from(sum(&bytes)) << 32);
}
