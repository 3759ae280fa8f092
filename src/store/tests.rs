use drive_core::carrier::Asymmetry;
use drive_core::learned::{Fitted, Learned, Verdict};
use drive_core::table::{CarrierTable, Grid, POINTS, ReferenceTable, SlopeTable};
use drive_settings::entry::Change;
use drive_settings::value::Value;
use proptest::prelude::*;

use super::learned as learned_words;
use super::*;
use crate::boards;
use crate::monitor::record::Reason;
use crate::settings::keys;

pub(crate) mod fake;
mod older;

use fake::Fake;

fn board() -> FirmwareSettings {
    FirmwareSettings::of_the_board()
}

fn with_r_s(r_s: f32) -> FirmwareSettings {
    let mut settings = board();
    settings.drive.motor.r_s = r_s;
    settings
}

/// A possible result of a self-commissioning, from 16 numbers from -1 to 1; without a saliency sensitivity, from a current difference.
fn learned(random: [f32; POINTS]) -> Learned {
    let sign = if random[7] < 0.0 { -1.0 } else { 1.0 };
    let slope = random.map(|x| sign * (0.3 + 0.26 * x));
    let slope = SlopeTable::from_points(Grid::REFERENCE, slope).filter(|_| random[8] > -0.5);
    let slope_at_rest = slope.map_or(0.0, |slope| slope.at_rest());
    let mut reference = random.map(|x| 0.3 * x);
    let mut carrier = random.map(|x| 1.25 + 0.75 * x);
    (reference[0], carrier[0]) = (0.0, 1.0);
    Learned {
        reference: ReferenceTable::from_points(Grid::REFERENCE, reference).unwrap(),
        carrier: CarrierTable::from_points(Grid::REFERENCE, carrier).filter(|_| random[1] > -0.5),
        points: 13,
        slope,
        slope_at_rest,
        limit_a: 2.5 + 1.4 * random[9],
        spread: 0.005 * random[2].abs(),
        ripple: 0.0,
        asymmetry: Asymmetry {
            constant: 0.05 * random[10],
            sin: 0.05 * random[11],
            cos: 0.05 * random[12],
        },
        at_start: (random[14] > 0.0).then_some(Asymmetry {
            constant: 0.05 * random[13],
            sin: 0.05 * random[14],
            cos: 0.05 * random[15],
        }),
        positions: 1 + (random[13].abs() * 254.0) as u8,
        gain_mismatch: Fitted { value: 0.1 * random[3], misfit: random[4], accepted: true },
        current_saliency: Fitted { value: random[5], misfit: 1.0, accepted: random[5].abs() < 0.3 },
        flux_saliency: 0.05 * random[6],
        verdict: slope.map_or(Verdict::Sound, |slope| Verdict::of_slope(slope.at_rest())),
    }
}

fn with_learned() -> FirmwareSettings {
    let random = core::array::from_fn(|n| (n as f32 * 0.7).sin());
    FirmwareSettings { learned: Some(learned(random)), ..with_r_s(6.0) }
}

fn load(fake: &mut Fake) -> Loaded {
    Saved::load(fake, &board()).1
}

fn save(fake: &mut Fake, settings: &FirmwareSettings) -> Result<(), FlashError> {
    Saved::load(fake, &board()).0.save(settings)
}

#[test]
fn an_erased_flash_holds_nothing() {
    assert_eq!(load(&mut Fake::new()), Ok(None));
}

#[test]
fn what_is_saved_is_loaded_and_the_slots_take_turns() {
    let mut fake = Fake::new();
    let mut erased = Vec::new();
    for n in 1..7 {
        let before = fake.words;
        save(&mut fake, &with_r_s(n as f32)).unwrap();
        erased.push([0, 1].map(|slot| fake.words[slot] != before[slot]));
        assert_eq!(load(&mut fake), Ok(Some(with_r_s(n as f32))));
    }
    let turns = [[true, false], [false, true]];
    assert_eq!(erased, [turns, turns, turns].concat());
    // The same without a reset in between.
    let (mut saved, _) = Saved::load(&mut fake, &board());
    for n in 7..10 {
        saved.save(&with_r_s(n as f32)).unwrap();
    }
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(9.0))));
}

/// The record of firmware without learned values equals the present one, without these values.
#[test]
fn a_record_without_what_was_learned_is_loaded_and_one_with_it_is_passed_over_by_older_firmware() {
    let old = codec::record(&with_r_s(7.0), 0);
    assert_eq!(codec::length(&old), 2 + keys::COUNT);
    // Magic, version 2 and one entry per key, as in the flash of boards.
    assert_eq!(old[0], (keys::COUNT as u64) << 48 | 0x0002_7672_6469);
    // Entries have numbers, so a new name loses nothing.
    assert!(keys::all().zip(&old[2..]).all(|(key, word)| u32::from(key.id()) == *word as u32));
    assert!(old[codec::length(&old)..].iter().all(|word| *word == u64::MAX));
    let mut fake = Fake::new();
    save(&mut fake, &with_r_s(7.0)).unwrap();
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(7.0))));

    let new = codec::record(&with_learned(), 0);
    assert_eq!(codec::length(&new), codec::WORDS);
    // No key has the number of a learned value, so firmware that does not know the learned values leaves them alone.
    for word in &new[2 + keys::COUNT..codec::WORDS] {
        assert!(learned_words::index(*word as u32).is_some());
        assert!(keys::all().all(|key| u32::from(key.id()) != *word as u32));
    }
}

#[test]
fn what_was_learned_is_saved_and_loaded_with_its_settings_and_gone_with_the_defaults() {
    let mut fake = Fake::new();
    save(&mut fake, &with_learned()).unwrap();
    assert_eq!(load(&mut fake), Ok(Some(with_learned())));
    save(&mut fake, &board()).unwrap();
    assert_eq!(load(&mut fake), Ok(Some(board())));
}

/// Half of a result, or one that no self-commissioning can give, is refused by name, with any settings.
#[test]
fn what_cannot_have_been_learned_is_refused() {
    let first = 2 + keys::COUNT;
    let spoil: [fn(&mut u64); 3] =
        [|word| *word ^= 1, |word| *word |= 0x7f80_0000 << 32, |word| *word = u64::MAX];
    for (n, spoil) in spoil.into_iter().enumerate() {
        let mut record = codec::record(&with_learned(), 3);
        spoil(&mut record[first + 3 * n]);
        let mut fake = Fake::new();
        fake.hold(0, resealed(record));
        assert_eq!(load(&mut fake), Err(Rejected::Value("learned")), "{n}");
    }
}

#[test]
fn sequence_numbers_wrap() {
    let mut fake = Fake::new();
    for (slot, sequence) in [(0, u32::MAX), (1, 0)] {
        let record = codec::record(&with_r_s(slot as f32 + 1.0), sequence);
        fake.hold(slot, record);
    }
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(2.0))));
    save(&mut fake, &with_r_s(3.0)).unwrap();
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(3.0))));
}

/// Power fails in every operation of a save, and again in every operation of the next one.
#[test]
fn whenever_the_power_fails_the_old_or_the_new_set_is_there() {
    // One erasure, and every double word of the record.
    let operations = 2 + keys::COUNT + 1;
    for seed in 0..20 {
        for first in 0..=operations {
            let mut fake = Fake::new();
            fake.random = seed * 1000 + first as u64;
            save(&mut fake, &with_r_s(1.0)).unwrap();
            save(&mut fake, &with_r_s(2.0)).unwrap();
            fake.left = Some(first);
            let done = save(&mut fake, &with_r_s(3.0)).is_ok();
            assert_eq!(done, first == operations);
            let Ok(Some(now)) = load(&mut fake) else { panic!("none left at {first}") };
            let r_s = now.drive.motor.r_s;
            assert!(r_s == 3.0 || (r_s == 2.0 && !done), "{r_s} at {first}");

            let second = (first * 7 + seed as usize) % operations;
            fake.left = Some(second);
            assert!(save(&mut fake, &with_r_s(4.0)).is_err());
            let Ok(Some(then)) = load(&mut fake) else { panic!("{first}, then {second}") };
            let next = then.drive.motor.r_s;
            assert!(next == r_s || next == 4.0, "{next} at {first}, then {second}");
            fake.left = None;
            save(&mut fake, &with_r_s(5.0)).unwrap();
            assert_eq!(load(&mut fake), Ok(Some(with_r_s(5.0))));
        }
    }
}

#[test]
fn a_failed_save_leaves_the_set_before_and_says_why() {
    let mut fake = Fake::new();
    save(&mut fake, &with_r_s(1.0)).unwrap();
    fake.left = Some(0);
    assert_eq!(save(&mut fake, &with_r_s(2.0)), Err(FlashError::Erase(0)));
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(1.0))));
}

#[test]
fn what_a_later_firmware_wrote_is_kept_until_the_save_after_next() {
    let mut fake = Fake::new();
    save(&mut fake, &with_r_s(1.0)).unwrap();
    let mut record = codec::record(&with_r_s(2.0), 1);
    record[0] += 1 << 32;
    // The checksum is computed as by a later firmware.
    fake.hold(1, resealed(record));
    let kept = fake.words[1];
    assert_eq!(load(&mut fake), Err(Rejected::Newer(3)));
    save(&mut fake, &with_r_s(3.0)).unwrap();
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(3.0))));
    assert_eq!(fake.words[1], kept);
}

#[test]
fn keys_may_come_and_go() {
    let mut record = codec::record(&with_r_s(7.0), 3);
    // The second key is one that this firmware does not know.
    record[3] ^= 1 << 12;
    let mut fake = Fake::new();
    fake.hold(0, resealed(record));
    assert_eq!(load(&mut fake), Ok(Some(with_r_s(7.0))));
}

/// A record with entries that this firmware does not know.
fn record(
    settings: &FirmwareSettings,
    sequence: u32,
    others: impl IntoIterator<Item = u64>,
) -> [u64; SLOT_WORDS] {
    let mut words = [ERASED; SLOT_WORDS];
    codec::write(&mut words, settings, sequence, others.into_iter());
    words
}

/// Settings of a module that an image leaves out outlast the saves of that image, together with the settings that it knows.
#[test]
fn a_save_keeps_the_settings_that_only_another_image_knows() {
    let unknown = [60_000, 60_001].map(|id| 0x3f80_0000 << 32 | id);
    let entries = |fake: &Fake, slot: usize| -> Vec<u64> {
        codec::unknown(|at| fake.words[slot][at]).collect()
    };
    let mut fake = Fake::new();
    fake.hold(0, record(&with_learned(), 3, unknown));
    assert_eq!(load(&mut fake), Ok(Some(with_learned())));
    for (slot, settings) in [(1, with_r_s(8.0)), (0, with_learned()), (1, board())] {
        save(&mut fake, &settings).unwrap();
        assert_eq!(load(&mut fake), Ok(Some(settings)));
        assert_eq!(entries(&fake, slot), unknown);
    }
    // Those that do not fit are left out, and none of the known ones.
    fake.hold(0, record(&with_learned(), 9, 60_000..60_500));
    assert_eq!(load(&mut fake), Ok(Some(with_learned())));
    assert_eq!(entries(&fake, 0).len(), SLOT_WORDS - codec::WORDS);
}

/// They belong to the board on which they were saved, and only this version of the layout has their ids.
#[test]
fn a_save_drops_what_was_saved_on_another_board_or_in_another_layout() {
    let other = boards::ALL.iter().find(|other| **other != board().board).unwrap();
    for settings in [FirmwareSettings::of(other), board()] {
        let mut record = record(&settings, 3, [60_000]);
        if settings.board == board().board {
            record[0] += 1 << 32;
        }
        let mut fake = Fake::new();
        fake.hold(0, resealed(record));
        assert!(load(&mut fake).is_err());
        save(&mut fake, &with_r_s(2.0)).unwrap();
        assert_eq!(load(&mut fake), Ok(Some(with_r_s(2.0))));
        assert_eq!(codec::unknown(|word| fake.words[1][word]).count(), 0);
    }
}

#[test]
fn a_value_that_nobody_knows_is_named() {
    let place = keys::all().position(|key| key.name() == "angle_source").unwrap();
    let mut record = codec::record(&board(), 3);
    record[2 + place] ^= 1 << 40;
    let mut fake = Fake::new();
    fake.hold(0, resealed(record));
    assert_eq!(load(&mut fake), Err(Rejected::Value("angle_source")));
}

/// The record with a corrected checksum.
fn resealed(mut record: [u64; SLOT_WORDS]) -> [u64; SLOT_WORDS] {
    let mut bytes = record[0].to_le_bytes().to_vec();
    bytes.extend((record[1] as u32).to_le_bytes());
    bytes.extend(record[2..codec::length(&record)].iter().flat_map(|word| word.to_le_bytes()));
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes);
    record[1] = record[1] & 0xffff_ffff | u64::from(checksum) << 32;
    record
}

#[test]
fn numbers_of_settings_follow_those_of_the_records() {
    let (newer, value) = (Rejected::Newer(2), Rejected::Value("x"));
    let all = [Rejected::Broken, newer, value, Rejected::Refused, Rejected::Board("x")];
    let codes = all.map(Rejected::code);
    assert_eq!(codes, [70, 71, 72, 73, 76]);
    assert!(Reason::ALL.iter().all(|reason| !codes.contains(&(reason.0 as u8))));
    assert!(all.iter().all(|why| why.to_string().starts_with("7")));
}

/// The test covers the learned values, too: never the settings of one set with the learned values of another.
#[test]
fn whenever_the_power_fails_what_was_learned_is_with_its_settings() {
    let mut before = with_learned();
    before.drive.motor.r_s = 2.0;
    let mut after = before;
    after.drive.motor.r_s = 3.0;
    after.learned = Some(learned([0.4; POINTS]));
    for seed in 0..20 {
        for operation in 0..=codec::WORDS {
            let mut fake = Fake::new();
            fake.random = seed * 1000 + operation as u64;
            save(&mut fake, &before).unwrap();
            fake.left = Some(operation);
            assert!(save(&mut fake, &after).is_err());
            let Ok(Some(now)) = load(&mut fake) else { panic!("none at {operation}") };
            assert!(now == before || now == after, "{now:?} at {operation}");
        }
    }
}

proptest! {
    #[test]
    fn whatever_was_learned_survives(
        random in proptest::array::uniform16(-1.0_f32..=1.0), r_s in 0.1_f32..100.0,
    ) {
        let settings = FirmwareSettings { learned: Some(learned(random)), ..with_r_s(r_s) };
        let mut fake = Fake::new();
        save(&mut fake, &settings).unwrap();
        prop_assert_eq!(load(&mut fake), Ok(Some(settings)));
    }

    #[test]
    fn every_value_of_every_key_survives(bits: u32, i in 0..keys::COUNT) {
        let mut settings = board();
        let key = keys::all().nth(i).unwrap();
        let text = match key.get(&settings) {
            Value::Number(_) | Value::Auto => f32::from_bits(bits).to_string(),
            Value::Whole(_) => bits.to_string(),
            Value::Word(_) => key.words()[bits as usize % key.words().len()].to_owned(),
        };
        if let Ok(value) = key.parse(&text) {
            key.set(&mut settings, value);
        }
        let mut fake = Fake::new();
        save(&mut fake, &settings).unwrap();
        // Numbers of the board are those of the image, whatever was saved.
        if matches!(key, keys::Key::Drive(entry) if entry.change == Change::Board) {
            settings = board();
        }
        let name = settings.board.name;
        let expected = if settings.board == board().board {
            Ok(Some(settings))
        } else {
            Err(Rejected::Board(name))
        };
        prop_assert_eq!(load(&mut fake), expected);
    }

    #[test]
    fn a_flipped_bit_is_found_and_the_set_before_counts(
        word in 0..2 + keys::COUNT, bit in 0_u32..64, both: bool,
    ) {
        let mut fake = Fake::new();
        save(&mut fake, &with_r_s(1.0)).unwrap();
        save(&mut fake, &with_r_s(2.0)).unwrap();
        let flip = |value: &mut Option<u64>| *value = value.map(|value| value ^ 1 << bit);
        flip(&mut fake.words[1][word]);
        if both {
            flip(&mut fake.words[0][word]);
            prop_assert_eq!(load(&mut fake), Err(Rejected::Broken));
        } else {
            prop_assert_eq!(load(&mut fake), Ok(Some(with_r_s(1.0))));
        }
    }

    #[test]
    fn any_contents_are_looked_at_without_harm(
        seed: u64, torn in 0_u64..4, header: bool, entries: u16,
    ) {
        let mut fake = Fake::new();
        fake.random = seed;
        for slot in 0..SLOTS {
            for word in 0..SLOT_WORDS {
                let value = fake.next();
                fake.words[slot][word] = (fake.next() % 4 >= torn).then_some(value);
            }
            if header {
                let record = codec::record(&board(), 0);
                fake.words[slot][0] = Some(record[0] & 0xffff_ffff_ffff | u64::from(entries) << 48);
            }
        }
        prop_assert_eq!(load(&mut fake), Err(Rejected::Broken));
        save(&mut fake, &with_r_s(3.0)).unwrap();
        prop_assert_eq!(load(&mut fake), Ok(Some(with_r_s(3.0))));
    }
}

/// Each word of a stored result is replaced by values that no self-commissioning gives. Values that are accepted all the same are
/// bounded, above all the injection current, and none is infinite.
#[test]
fn a_restored_result_is_bounded_whatever_a_word_says() {
    let whole = learned_words::to_words(&crate::console::tests::found(), false);
    let mut taken = 0;
    for word in 0..learned_words::WORDS {
        for value in
            [f32::NAN, f32::INFINITY, 1e30, -1e30, 100.0, -100.0, 1.0, -1.0, 1e-30, 0.0, -0.0]
        {
            let mut words = whole;
            words[word] = value.to_bits();
            let Some(result) = learned_words::from_words(&words) else { continue };
            taken += 1;
            let what = format!("word {word} = {value}");
            let carrier = result.carrier.expect("the flags are as they were");
            assert!(carrier.points().iter().all(|share| (0.5..=2.0).contains(share)), "{what}");
            assert!(result.reference.points().iter().all(|q| q.abs() <= 0.3), "{what}");
            let slope = result.slope.expect("the flags are as they were");
            assert!(slope.points().iter().all(|k| (0.001..=0.6).contains(&k.abs())), "{what}");
            assert!(result.flux_saliency.abs() < 1.0 && result.limit_a < 10.0, "{what}");
            let numbers =
                [result.spread, result.gain_mismatch.misfit, result.current_saliency.value];
            assert!(numbers.iter().all(|number| number.is_finite()), "{what}");
        }
    }
    assert!((50..400).contains(&taken), "{taken} taken");
}
