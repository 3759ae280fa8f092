use proptest::prelude::*;

use super::entry::{Change, Entry};
use super::value::Value;
use super::*;
use drive_core::printed::DemodulatorKind;
use drive_core::{Abc, AlphaBeta, AngleSource, Line};

#[test]
fn what_a_learning_depends_on_is_compared_and_nothing_else() {
    let changed = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        settings.learned_with_another(&Settings::default()).is_none()
    };
    let same: [fn(&mut Settings); 6] = [
        |_| {},
        |s| s.inertia = Some(1.0),
        |s| s.limits.trip_a = Some(4.0),
        |s| s.angle_source = AngleSource::Encoder,
        |s| s.injection.synchronous.bandwidth_hz = 2.0,
        |s| s.speed.limit_rpm = Some(100.0),
    ];
    assert!(same.into_iter().all(changed));
    let other: [fn(&mut Settings); 11] = [
        |s| s.motor.r_r = 1.4,
        |s| s.motor.pole_pairs = 3,
        |s| s.inverter.compensate = false,
        |s| s.scales.current_b.gain *= 1.01,
        |s| s.scales.current_delay_s = 0.0,
        |s| s.scales.both_zero_vectors = true,
        |s| s.ignore_delays = true,
        |s| s.sequence.i_d = Some(0.6),
        |s| s.injection.amplitude_v = Some(60.0),
        |s| s.injection.demodulator = DemodulatorKind::Envelope,
        |s| s.injection.synchronous.current_saliency = Some(0.02),
    ];
    assert!(!other.into_iter().any(changed));
    // NaN is never the same.
    assert!(!changed(|s| s.motor.r_s = f32::NAN));
}

/// Returns another value of a setting, inside its range.
fn another(entry: &Entry<Settings>, settings: &Settings) -> Value {
    match (entry.get(settings), entry.range(settings)) {
        (Value::Word(word), _) => {
            let words = entry.words();
            let place = words.iter().position(|other| *other == word).unwrap();
            Value::Word(words[(place + 1) % words.len()])
        }
        (Value::Whole(value), Some((min, _))) => {
            Value::Whole(if value as f32 == min { value + 1 } else { min as u32 })
        }
        (_, Some((min, max))) => Value::Number(0.25 * min + 0.75 * max),
        (_, None) => unreachable!("{}", entry.name),
    }
}

/// Returns the paths of all numbers and words in the settings, with their values, from the debug text.
fn fields(settings: &Settings) -> Vec<(String, String)> {
    let text = format!("{settings:#?}");
    let (mut path, mut fields): (Vec<&str>, Vec<(String, String)>) = (Vec::new(), Vec::new());
    for line in text.lines().skip(1).map(str::trim) {
        match line.split_once(": ") {
            Some((name, rest)) if rest.ends_with('{') => path.push(name),
            Some((name, rest)) => {
                let full = path.iter().chain([&name]).copied().collect::<Vec<_>>().join(".");
                fields.push((full, rest.to_owned()));
            }
            None if line.starts_with('}') => drop(path.pop()),
            // This is the value of an `Option`, on separate lines.
            None => fields.last_mut().unwrap().1.push_str(line),
        }
    }
    fields
}

/// Every field except the tables has a row, and a row changes its own field only.
#[test]
fn the_table_is_complete() {
    let before = Settings::default();
    let mut missing: Vec<String> = fields(&before).into_iter().map(|(path, _)| path).collect();
    for entry in SETTINGS {
        let mut after = before;
        let value = another(entry, &before);
        entry.set(&mut after, value);
        assert_eq!(entry.get(&after), value, "{}", entry.name);
        let pairs = fields(&before).into_iter().zip(fields(&after));
        let moved: Vec<String> =
            pairs.filter(|(one, other)| one != other).map(|(one, _)| one.0).collect();
        assert_eq!(moved.len(), 1, "{} moves {moved:?}", entry.name);
        missing.retain(|path| *path != moved[0]);
    }
    let tables = [
        "injection.printed.learned",
        "injection.synchronous.reference",
        "injection.synchronous.carrier",
    ];
    assert_eq!(missing, tables);
}

#[test]
fn names_are_unique_and_every_default_is_in_its_range() {
    let settings = Settings::default();
    for entry in SETTINGS {
        assert!(core::ptr::eq(find(entry.name).unwrap(), entry), "{}", entry.name);
        assert_eq!(entry.check(&settings), Ok(()));
        assert!(!entry.help.is_empty() && !entry.help.ends_with('.'), "{}", entry.name);
        assert_eq!(entry.words().is_empty(), entry.range(&settings).is_some(), "{}", entry.name);
    }
    assert!(find("motor").is_none());
    assert_eq!(find("inverter.dead_time_s").unwrap().change, Change::FromReset);
}

/// A value outside the range, beyond either end or NaN, is named with the range and the unit.
#[test]
fn values_out_of_range_are_named() {
    for entry in SETTINGS {
        let good = Settings::default();
        let Some((min, max)) = entry.range(&good) else { continue };
        for bad in [f32::NAN, f32::INFINITY, min - 3.0 - 0.1 * min.abs(), max * 1.1 + 1.0] {
            let mut settings = good;
            match entry.get(&good) {
                Value::Whole(_) if bad.is_finite() => entry.set(&mut settings, Value::Whole(0)),
                Value::Whole(_) => continue,
                _ => entry.set(&mut settings, Value::Number(bad)),
            }
            let error = entry.check(&settings).unwrap_err().to_string();
            assert!(error.starts_with(entry.name) && error.contains("allowed is"), "{error}");
            assert!(error.ends_with(entry.unit), "{error}");
        }
    }
}

#[test]
fn auto_is_a_value_of_what_has_a_rule() {
    for entry in SETTINGS {
        let mut settings = Settings::default();
        assert_eq!(entry.parse("auto").is_ok(), entry.has_rule(), "{}", entry.name);
        if entry.has_rule() {
            let by_rule = entry.number(&settings);
            entry.set(&mut settings, another(entry, &Settings::default()));
            assert_ne!(entry.number(&settings), by_rule, "{}", entry.name);
            entry.set(&mut settings, entry.parse("auto").unwrap());
            assert_eq!(entry.number(&settings), by_rule);
        }
    }
}

proptest! {
    #[test]
    fn any_text_is_a_value_or_refused(text in ".*", i in 0..SETTINGS.len()) {
        let mut settings = Settings::default();
        if let Ok(value) = SETTINGS[i].parse(&text) {
            SETTINGS[i].set(&mut settings, value);
            prop_assert_eq!(SETTINGS[i].get(&settings), value);
        }
    }

    #[test]
    fn values_survive_the_way_through_text(bits in 0_u32..4_000_000, i in 0..SETTINGS.len()) {
        for text in [(bits as f32 * 1e-3).to_string(), bits.to_string()] {
            if let Ok(value) = SETTINGS[i].parse(&text) {
                prop_assert_eq!(SETTINGS[i].parse(&value.to_string()), Ok(value));
            }
        }
    }
}

/// The error names the setting that was changed, not one whose rule follows from it, with a range that is not empty.
#[test]
fn the_changed_setting_is_the_one_that_is_named() {
    let refused = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        match settings.build().map(|_| ()) {
            Err(error @ SettingsError::Range { name, min, max, .. }) => {
                assert!(min < max, "{error}");
                name
            }
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(|s| s.scales.current_a.offset = 0.0), "scales.current_a.offset");
    assert_eq!(refused(|s| s.scales.current_b.offset = 4.5), "scales.current_b.offset");
    assert_eq!(refused(|s| s.scales.current_a.gain = 0.0), "scales.current_a.gain");
    let third_without_zero: fn(&mut Settings) = |s| {
        s.scales.sensors = CurrentSensors::LowSide;
        s.scales.current_c.offset = -0.1;
    };
    assert_eq!(refused(third_without_zero), "scales.current_c.offset");
    assert_eq!(refused(|s| s.limits.dc_under_v = Some(330.0)), "limits.dc_under_v");
    assert_eq!(refused(|s| s.limits.dc_under_v = Some(290.0)), "limits.dc_under_v");
    assert_eq!(refused(|s| s.limits.dc_over_v = Some(320.0)), "limits.dc_over_v");
    let low_set: fn(&mut Settings) = |s| s.braking.low_v = Some(205.0);
    assert_eq!(refused(low_set), "braking.low_v");
    // This is an amplifier whose output falls with the current.
    let mut falling = Settings::default();
    falling.scales.current_a = Line { gain: -0.0024, offset: 4.9 };
    assert!(falling.build().is_ok());
}

#[test]
fn a_range_without_a_value_says_so() {
    let (min, max) = (346.5, 295.45);
    let error = SettingsError::Range { name: "braking.low_v", unit: "V", value: 379.5, min, max };
    let text = error.to_string();
    let whole =
        "braking.low_v = 379.5: allowed is nothing beside other settings: 346.5 to 295.45 V";
    assert_eq!(text, whole);
}

/// The ADC counts are the sum of two conversions: half the gain, twice the range, and a mean that is a quarter of a period
/// older. The currents are the same.
#[test]
fn the_mean_of_both_zero_vectors_is_half_the_sum_and_a_quarter_of_a_period_older() {
    let mut settings = Settings::default();
    let one = settings.build().unwrap();
    settings.scales.both_zero_vectors = true;
    let two = settings.build().unwrap();
    let (a, b) = (&one.front_end, &two.front_end);
    assert!(b.both_zero_vectors && !a.both_zero_vectors);
    assert_eq!(b.full_scale, 2 * a.full_scale);
    for (before, now) in [(3000, 3001), (0, 1), (4095, 4095)] {
        let mean = 0.5 * (a.current_a.at(before) + a.current_a.at(now));
        assert!((b.current_a.at(before + now) - mean).abs() < 1e-6, "{before} {now}");
        let mean = 0.5 * (a.current_b.at(before) + a.current_b.at(now));
        assert!((b.current_b.at(before + now) - mean).abs() < 1e-6, "{before} {now}");
    }
    assert!((two.current_lag - one.current_lag - 0.25).abs() < 1e-6);
    assert!((two.estimator.lag - one.estimator.lag - 0.25).abs() < 1e-6);
}

/// Every pulse has a dead time and a least length, so their share grows with the switching frequency. With both zero vectors, the
/// upper one is that of the last pulse.
#[test]
fn the_share_of_the_dead_time_grows_with_the_carrier() {
    let of = |switching_khz| {
        let mut settings = Settings::default();
        settings.inverter.switching_khz = switching_khz;
        let lag = settings.build().unwrap().current_lag;
        settings.scales.both_zero_vectors = true;
        let built = settings.build().unwrap();
        let signs = built.dead_time.signs(Abc::new(1.0, -0.5, -0.5), Abc::ZERO);
        settings.inverter.compensate = false;
        let plain = settings.build().unwrap().modulator;
        let lost = built.dead_time.voltage(signs, 311.0, 0.0).a;
        (lost, built.modulator.circle(311.0), plain, built.current_lag - lag)
    };
    for (switching_khz, times) in
        [(Carrier::Khz6, 1.0), (Carrier::Khz12, 2.0), (Carrier::Khz18, 3.0)]
    {
        let (lost, circle, plain, older) = of(switching_khz);
        assert!((lost - times * 4.105).abs() < 0.01, "{switching_khz:?}: {lost} V");
        assert!((older - 0.25 / times).abs() < 1e-6, "{switching_khz:?}: {older} periods");
        let circle = circle * 1.732_050_8 / 311.0;
        assert!((circle - (1.0 - times * 0.0264)).abs() < 1e-4, "{switching_khz:?}: {circle}");
        // The shortest pulse is 3.2 us, a duty of 1.92 % at 6 kHz.
        let shortest = times * 3.2e-6 * 6000.0;
        for (duty, wanted) in [(0.99 * shortest, shortest), (0.49 * shortest, 0.0)] {
            let along = AlphaBeta::new((1.0 - 2.0 * duty) * 311.0 * 2.0 / 3.0, 0.0);
            let made = plain.step(along, Abc::ZERO, 311.0).duties[1];
            assert!((made - wanted).abs() < 1e-4, "{switching_khz:?}: {duty} {made}");
        }
    }
}

/// An image that is built without the feature `printed` refuses the words of its demodulations, but the words keep their
/// positions.
#[test]
fn a_word_without_code_is_refused_by_name() {
    let mut settings = Settings::default();
    assert_eq!(settings.check_words(false), Ok(()));
    settings.injection.demodulator = DemodulatorKind::Envelope;
    assert_eq!(settings.check_words(true), Ok(()));
    let error = settings.check_words(false).unwrap_err().to_string();
    let text = "injection.demodulator = envelope: this image is built with synchronous alone; `cargo firmware --loop printed` builds one with all";
    assert_eq!(error, text);
}
