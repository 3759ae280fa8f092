//! Records that older firmware has saved.

use drive_core::{AngleSource, Command, Drive, Mode, Refused};

use drive_settings::Flux;

use super::*;

/// The flash of a board that runs commit 1abee12 and has saved this record.
fn board_of_1abee12(record: &[u8]) -> Fake {
    let mut fake = Fake::new();
    for (place, word) in fake.words[0].iter_mut().zip(record.chunks_exact(8)) {
        *place = Some(u64::from_le_bytes(word.try_into().unwrap()));
    }
    fake
}

/// By the hashes of the names: records have numbers from version 2 on.
#[test]
fn records_saved_by_commit_1abee12_are_read() {
    let defaults = include_bytes!("defaults-1abee12.bin");
    let mut expected = board();
    // That firmware had no rules: these numbers stood in its settings.
    for (name, value) in [
        ("inverter.full_compensation_a", "0.03"),
        ("injection.amplitude_v", "50"),
        ("injection.full_reference_iq_a", "1"),
        ("injection.current_saliency", "0.0338"),
        ("injection.tracked_rpm", "700"),
        ("injection.loss_s", "0.08"),
        ("limits.current_a", "3.5"),
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
    assert_eq!(load(&mut board_of_1abee12(defaults)), Loaded::Settings(expected));

    let changed = include_bytes!("changed-1abee12.bin");
    let mut expected = board();
    // The values that its console showed: none is the default.
    for line in include_str!("changed-1abee12.txt").lines() {
        let (name, value) = line.split_once(' ').unwrap();
        let key = keys::find(name).unwrap_or_else(|| panic!("no key {name}"));
        key.set(&mut expected, key.parse(value).unwrap());
    }
    let fitted = |value, misfit| Fitted { value, misfit, accepted: true };
    // No slope and no asymmetry yet: without an encoder the drive has to learn again.
    expected.learned = Some(Learned {
        reference: ReferenceTable::default(),
        slope: None,
        slope_at_rest: 0.0,
        limit_a: Grid::REFERENCE.current(13),
        carrier: Some(CarrierTable::default()),
        points: 13,
        spread: 0.001,
        ripple: 0.0,
        asymmetry: Asymmetry::default(),
        at_start: None,
        positions: 1,
        gain_mismatch: fitted(0.01, 0.0002),
        current_saliency: fitted(0.03, 0.02),
        flux_saliency: -0.035,
        verdict: Verdict::Sound,
    });
    assert_eq!(load(&mut board_of_1abee12(changed)), Loaded::Settings(expected));
}

/// With high flux, direct current, current limit and table follow from rules that an earlier firmware had not: what it learned is of another
/// drive, which has to learn again. Its settings stay. The dissertation's flux has the rules that it had.
#[test]
fn a_result_of_other_rules_is_left_out_with_high_flux() {
    for (flux, is_kept) in [(Flux::Low, true), (Flux::High, false)] {
        let mut new = with_learned();
        new.drive.sequence.flux = flux;
        let mut record = codec::record(&new, 3);
        let mut fake = Fake::new();
        fake.hold(0, record);
        assert_eq!(load(&mut fake), Loaded::Settings(new));
        // The bit that an earlier firmware did not write.
        record[2 + keys::COUNT + 36] &= !(1 << (32 + 14));
        fake.hold(0, resealed(record));
        new.learned = new.learned.filter(|_| is_kept);
        assert_eq!(load(&mut fake), Loaded::Settings(new), "{flux:?}");
    }
}

/// Later firmware wrote the distance of the points, too, but no slope yet.
#[test]
fn records_without_a_slope_are_read_and_the_drive_has_to_learn_again() {
    /// Values of a learned result that were written first.
    const WITH_STEP: usize = 38;
    let mut new = with_learned();
    let learned = new.learned.as_mut().unwrap();
    (learned.slope, learned.slope_at_rest, learned.verdict) = (None, 0.0, Verdict::Sound);
    let mut record = codec::record(&new, 3);
    let missing = (learned_words::WORDS - WITH_STEP) as u64;
    record[codec::WORDS - missing as usize..].fill(u64::MAX);
    record[0] -= missing << 48;
    // That firmware had one rotor position.
    let flags = 2 + keys::COUNT + 36;
    record[flags] &= !(0xff << 48);
    let mut fake = Fake::new();
    fake.hold(0, resealed(record));
    let learned = new.learned.as_mut().unwrap();
    (learned.limit_a, learned.asymmetry, learned.positions) =
        (Grid::REFERENCE.current(13), Asymmetry::default(), 1);
    let Loaded::Settings(loaded) = load(&mut fake) else { panic!("not loaded") };
    assert_eq!(loaded, new);
    let mut drive = Drive::new(loaded.build().unwrap());
    let start = Command::Start(Mode::Torque);
    assert_eq!(drive.command(&start), Err(Refused::NotLearned));
    // With the encoder nothing has to be learned.
    let mut loaded = loaded;
    loaded.drive.angle_source = AngleSource::Encoder;
    assert!(Drive::new(loaded.build().unwrap()).command(&start).is_ok());
    // One value less than that is no result.
    record[flags + 1] = u64::MAX;
    record[0] -= 1 << 48;
    let mut fake = Fake::new();
    fake.hold(0, resealed(record));
    assert!(matches!(load(&mut fake), Loaded::Settings(_)), "as commit 1abee12 wrote it");
    record[flags] = u64::MAX;
    record[0] -= 1 << 48;
    fake.hold(0, resealed(record));
    assert_eq!(load(&mut fake), Loaded::Rejected(Rejected::Value("learned")));
}
