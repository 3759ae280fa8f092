//! Records that older firmware has saved.

use drive_core::{AngleSource, Command, Drive, Mode, Refused};

use super::*;

/// The flash of a board that runs commit 1abee12 and has saved this record.
fn board_of_1abee12(record: &[u8]) -> Fake {
    let mut fake = Fake::new();
    for (place, word) in fake.words[0].iter_mut().zip(record.chunks_exact(8)) {
        *place = Some(u64::from_le_bytes(word.try_into().unwrap()));
    }
    fake
}

/// The record has hashes of the names; only version 2 and later have numbers.
#[test]
fn records_saved_by_commit_1abee12_are_read() {
    let defaults = include_bytes!("defaults-1abee12.bin");
    let mut expected = board();
    // That firmware had no rules: these numbers were in its settings.
    for (name, value) in [
        ("inverter.full_compensation_a", "0.03"),
        ("injection.amplitude_v", "50"),
        ("injection.full_reference_iq_a", "1"),
        ("injection.current_saliency", "0.0338"),
        ("injection.tracked_rpm", "700"),
        ("injection.deficit_s", "0.08"),
        ("limits.current_a", "3.5"),
        ("motor.inertia", "0.012"),
        ("limits.trip_a", "4.3"),
        ("limits.dc_over_v", "400"),
        ("limits.dc_under_v", "200"),
        ("limits.speed_rpm", "2000"),
        ("limits.unexplained_v", "12"),
        ("sequence.magnetise_s", "0.8"),
        ("sequence.i_d", "0.7"),
        ("sequence.stop_a_per_s", "30"),
        ("speed.i_q_limit_a", "3"),
        ("speed.limit_rpm", "300"),
        ("speed.ramp_rpm_per_s", "300"),
    ] {
        let key = keys::find(name).unwrap();
        key.set(&mut expected, key.parse(value).unwrap());
    }
    assert!(expected.build().is_ok());
    assert_eq!(load(&mut board_of_1abee12(defaults)), Ok(Some(expected)));

    let changed = include_bytes!("changed-1abee12.bin");
    let mut expected = board();
    // The values that its console showed; none is the default.
    for line in include_str!("changed-1abee12.txt").lines() {
        let (name, value) = line.split_once(' ').unwrap();
        let key = keys::find(name).unwrap_or_else(|| panic!("no key {name}"));
        key.set(&mut expected, key.parse(value).unwrap());
    }
    // That firmware learned with other rules, so its result is left out.
    assert_eq!(load(&mut board_of_1abee12(changed)), Ok(Some(expected)));
}

/// Earlier firmware had other rules for d-axis current, current limit, table and dead time. The drive leaves out the values learned by
/// it, complete or not, and keeps its settings. A start without an encoder then needs a self-commissioning.
#[test]
fn a_result_of_other_rules_is_left_out() {
    let new = with_learned();
    let flags = 2 + keys::COUNT + 36;
    for lacks in [0, 3, 20] {
        let mut record = codec::record(&new, 3);
        let mut fake = Fake::new();
        fake.hold(0, record);
        assert_eq!(load(&mut fake), Ok(Some(new)));
        // The bit that it did not write, and the last values.
        record[flags] &= !(1 << (32 + 24));
        record[codec::WORDS - lacks as usize..].fill(u64::MAX);
        record[0] -= lacks << 48;
        fake.hold(0, resealed(record));
        let expected = FirmwareSettings { learned: None, ..new };
        assert_eq!(load(&mut fake), Ok(Some(expected)), "{lacks}");
        let mut drive = Drive::new(expected.build().unwrap());
        let start = Command::Start(Mode::Torque);
        assert_eq!(drive.command(&start), Err(Refused::NotLearned));
        // With the encoder nothing has to be learned.
        let mut loaded = expected;
        loaded.drive.angle_source = AngleSource::Encoder;
        assert!(Drive::new(loaded.build().unwrap()).command(&start).is_ok());
        // Without the word that holds the rules the values are no result.
        record[codec::WORDS - lacks as usize - 1] = u64::MAX;
        record[flags] = record[flags - 1];
        record[0] -= 1 << 48;
        fake.hold(0, resealed(record));
        assert_eq!(load(&mut fake), Err(Rejected::Value("learned")), "{lacks}");
    }
}
