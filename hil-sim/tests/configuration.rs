//! Keys, files and motors of the configuration.

use hil_sim::config::motors::Motor;
use hil_sim::config::{BENCH, Key, flattened, plant_settings};
use hil_sim::error::nearest;
use hil_sim::{Config, Error};

fn set(assignment: &str) -> Result<Config, Error> {
    let mut config = Config::default();
    let (key, value) = assignment.split_once('=').unwrap();
    config.set(key, value)?;
    Ok(config)
}

fn set_table(config: &mut Config, table: &toml::Table) -> Result<(), Error> {
    flattened(table).iter().try_for_each(|(name, value)| config.set(name, value))
}

#[test]
fn every_default_is_allowed_and_every_key_round_trips() {
    assert_eq!(Config::default().changes(), [""; 0]);
    assert!(Config::default().drive.check().is_ok());
    for key in Key::all().chain(Key::after()) {
        let (mut config, name) = (Config::default(), key.name());
        let value = key.get(&config);
        assert_eq!(key.set(&mut config, &value.to_string()), Ok(()), "{name}");
        assert_eq!(config, Config::default(), "{name}");
        assert!(!key.help().is_empty(), "{name}");
        // The value passes through text, as with --set, and is not the default.
        let text =
            key.range().map_or(key.words().last().map(|word| word.to_string()), |(_, max)| {
                Some(max.to_string())
            });
        let text = text.expect(name);
        let config = set(&format!("{}={text}", key.assigned_name())).expect(name);
        let found = key.get(&config).to_string();
        let same = found == text
            || found.parse::<f64>().unwrap() as f32 == text.parse::<f64>().unwrap() as f32;
        assert!(same, "{name}: {found}, not {text}");
        // The changes give the same configuration again.
        let again = Config::load(None, None, &config.changes());
        assert_eq!(again.expect(name), config, "{name}");
    }
}

#[test]
fn names_are_unique() {
    let names: Vec<String> = Key::all().chain(Key::after()).map(Key::assigned_name).collect();
    for (i, name) in names.iter().enumerate() {
        assert!(!names[..i].contains(name), "{name}");
    }
}

#[test]
fn just_outside_the_range_is_refused() {
    for key in BENCH {
        if let Some((min, max)) = key.range(&Config::default()) {
            for value in [min - 1.0, max + 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(set(&format!("{}={value}", key.name)).is_err(), "{} {value}", key.name);
            }
        }
    }
}

#[test]
fn toml_and_assignments_say_the_same() {
    let mut from_toml = Config::default();
    let table = "runs = 3\nload.mode = \"speed\"\n[motor]\nr_s = 6\n[drive.motor]\nr_r = 1.3\n";
    set_table(&mut from_toml, &table.parse().unwrap()).unwrap();
    let changes = from_toml.changes();
    assert_eq!(changes, ["motor.r_s=6", "load.mode=speed", "runs=3", "drive.motor.r_r=1.3"]);
    assert_eq!(Config::load(None, None, &changes).unwrap(), from_toml);
    // The drive knows its motor, except for the value that it is given.
    assert_eq!((from_toml.drive.motor.r_s, from_toml.drive.motor.r_r), (6.0, 1.3));
    assert_eq!((from_toml.motor.r_s, from_toml.motor.r_r), (6.0, 1.1));
}

#[test]
fn toml_of_the_wrong_type_or_name_is_refused() {
    for bad in ["motor.r_s = \"5.4\"", "motor.r_s = [1]", "motor = 3", "moter.r_s = 1"] {
        let table = bad.parse().unwrap();
        assert!(set_table(&mut Config::default(), &table).is_err(), "{bad}");
    }
}

#[test]
fn the_scales_of_the_drive_follow_the_sensors() {
    let config = set("measurement.range_a=50").unwrap();
    assert!((config.drive.sensor_range_a() - 50.0).abs() < 1e-3);
    let sensors = plant_settings(&config).measurement;
    assert!((sensors.noise_a / 0.005 - 50.0 / 4.4727).abs() < 1e-3);
    let config = set("inverter.dc_link_v=540").unwrap();
    assert!((config.drive.dc_link_range_v() - 450.45 * 540.0 / 311.0).abs() < 0.1);
    assert!((config.drive.dc_over_v() - 400.0 * 540.0 / 311.0).abs() < 0.1);
}

#[test]
fn every_file_is_a_motor_whose_numbers_all_have_one_source() {
    let all = Motor::all();
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../motors")).unwrap();
    let files = folder.filter(|file| file.as_ref().unwrap().path().is_file());
    assert_eq!(all.len(), files.count());
    assert!(all.len() >= 9);
    for motor in all {
        let mut config = Config::default();
        motor.apply(&mut config).unwrap();
        let named: Vec<&String> = motor.source.iter().flat_map(|source| &source.keys).collect();
        assert_eq!(named.len(), motor.settings().len(), "{}", motor.name);
        assert!(config.drive.check().is_ok(), "{}: {:?}", motor.name, config.drive.check());
        assert!(config.drive.build().is_ok(), "{}", motor.name);
        let implied: Vec<_> = motor.implied(&config).into_iter().map(|(key, ..)| key).collect();
        let high: &[&str] =
            if motor.name == "dissertation" { &[] } else { &["current_plant", "sequence.flux"] };
        assert_eq!(implied, high, "{}", motor.name);
        assert!(!motor.title.is_empty());
        assert!(!motor.about.trim().is_empty() && motor.console_lines().len() < 20);
    }
}

#[test]
fn the_default_is_the_dissertations() {
    let mut config = Config::default();
    Motor::find("dissertation").unwrap().apply(&mut config).unwrap();
    assert_eq!(config.changes(), [""; 0]);
}

#[test]
fn errors_name_motor_key_and_file() {
    let error = Motor::find("motulator").unwrap_err().to_string();
    assert!(error.contains("did you mean `motulator-2kw2`"), "{error}");
    let error = Motor::find("missing.toml").unwrap_err().to_string();
    assert!(error.starts_with("missing.toml: "), "{error}");
    let text = "title = \"x\"\nabout = \"y\"\nsource = []\n[motor]\nr_s = 1\n";
    let error = Motor::from_text("mine", text).unwrap().apply(&mut Config::default()).unwrap_err();
    assert!(error.to_string().contains("motor mine: motor.r_s has 0 sources"), "{error}");
}

#[test]
fn the_console_is_set_to_the_motor() {
    let lines = Motor::find("motulator-2kw2").unwrap().console_lines();
    for line in ["set motor.r_s 3.7", "set nameplate.current_a 5", "set sequence.flux high"] {
        assert!(lines.iter().any(|found| found == line), "{line} in {lines:?}");
    }
}

#[test]
fn the_nearest_name_is_found_and_a_far_one_is_not() {
    let known = ["motor.rs", "motor.rr", "inverter.vdc"];
    assert_eq!(nearest("motor.sr", known.into_iter()), Some("motor.rr"));
    assert_eq!(nearest("inverter.vcd", known.into_iter()), Some("inverter.vdc"));
    assert_eq!(nearest("xylophone", known.into_iter()), None);
    assert_eq!(nearest("MOTOR.RS", known.into_iter()), Some("motor.rs"));
}
