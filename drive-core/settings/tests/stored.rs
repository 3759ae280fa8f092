//! Tests that stored settings, commands and states are restored bit for bit, and that the refusal of a name or value names it.

use drive_core::{Command, Dq, Fault, Mode, State, Stop};
use induction_drive_core as drive_core;
use induction_drive_settings::value::Value;
use induction_drive_settings::{Flux, SETTINGS, Settings, SettingsError};
use proptest::prelude::*;

fn read(text: &str) -> Result<Settings, String> {
    serde_json::from_str(text).map_err(|why| why.to_string())
}

/// Returns settings that all differ from their defaults, by the kind of the value.
fn all_changed(factor: f32) -> Settings {
    let mut settings = Settings::default();
    for entry in SETTINGS {
        let value = match entry.get(&settings) {
            Value::Number(value) => Value::Number((value + 0.1) * factor),
            Value::Auto => Value::Number(factor),
            Value::Whole(value) => Value::Whole(value - 1),
            Value::Word(word) => {
                Value::Word(entry.words().iter().rfind(|other| **other != word).unwrap())
            }
        };
        entry.set(&mut settings, value);
        assert_eq!(entry.get(&settings), value, "{}", entry.name);
    }
    settings
}

proptest! {
    #[test]
    fn settings_come_back_to_the_bit(factor in 1e-6f32..1e6) {
        for settings in [Settings::default(), all_changed(factor)] {
            let text = serde_json::to_string(&settings).unwrap();
            prop_assert_eq!(read(&text), Ok(settings));
        }
    }
}

#[test]
fn a_map_names_what_is_set_as_the_console_does() {
    let (mut settings, mut expected) = (Settings::default(), serde_json::Map::new());
    settings.limits.trip_a = Some(2.5);
    settings.sequence.flux = Flux::High;
    for (name, value) in [("limits.trip_a", "2.5"), ("sequence.flux", "\"high\"")] {
        expected.insert(name.into(), serde_json::from_str(value).unwrap());
    }
    let map = serde_json::to_value(settings).unwrap();
    assert_eq!(
        (&map["limits.trip_a"], &map["sequence.flux"]),
        (&expected["limits.trip_a"], &expected["sequence.flux"])
    );
    // A rule is not stored, since it follows from the other settings of the reader.
    assert_eq!(map.get("limits.current_a"), None);
    assert_eq!(serde_json::from_value::<Settings>(expected.into()).unwrap(), settings);
}

#[test]
fn what_is_no_setting_is_refused_by_its_name() {
    for (text, why) in [
        (r#"{"limits.trip": 1}"#, "limits.trip = 1: no such setting"),
        (r#"{"motor.r_s": "five"}"#, "motor.r_s = five: not a number"),
        (r#"{"motor.pole_pairs": 300}"#, "motor.pole_pairs = 300: not a whole number from 0 to 6"),
        (r#"{"sequence.flux": "rated"}"#, "sequence.flux = rated: not one of: low high"),
    ] {
        assert_eq!(read(text).unwrap_err().split(" at line").next(), Some(why));
    }
    // Ranges depend on other settings and are checked later, as always.
    let settings = read(r#"{"motor.r_s": -1}"#).unwrap();
    assert!(matches!(settings.build(), Err(SettingsError::Range { name: "motor.r_s", .. })));
}

#[test]
fn commands_and_states_come_back() {
    let commands = [
        Command::Start(Mode::Speed),
        Command::Stop(Stop::Quick),
        Command::Clear,
        Command::Speed(-1234.5678),
        Command::Press(60.0, 0.1),
        Command::TestVoltage(Dq::new(0.1, -0.2)),
        Command::MotorTemperature(Err(Fault::MotorSensorOpen)),
        Command::MotorTemperature(Ok(80.1)),
    ];
    for command in commands {
        let text = serde_json::to_string(&command).unwrap();
        assert_eq!(serde_json::from_str::<Command>(&text).unwrap(), command, "{text}");
    }
    for &fault in Fault::ALL {
        let text = serde_json::to_string(&State::Fault(fault)).unwrap();
        assert_eq!(serde_json::from_str::<State>(&text).unwrap(), State::Fault(fault));
    }
    // Coefficients are computed from settings and not stored.
    let coefficients = Settings::default().build().unwrap();
    assert!(serde_json::to_string(&Command::Configure(coefficients)).is_err());
}
