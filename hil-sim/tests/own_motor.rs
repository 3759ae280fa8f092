//! A user's motor, for which a file states nameplate, circuit and dc link: its rules, its refusals, and the example of the page. That it
//! works at the first attempt is in `bounds.toml`.

use std::path::Path;

use crate::cli_common::{folder, hil_sim, text};
use drive_settings::PlantSource;
use hil_sim::Config;
use hil_sim::config::motors::Motor;

const LARGE: &str = include_str!("own-motor/large.toml");

fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    path.to_str().expect("a path of letters").to_owned()
}

/// The sensors of the dissertation's bench reach 1.24 times the rated current of its motor, and so do those of a user's
/// motor. The drive has learned the motor, at high flux, and its current limit is not set by the sensors.
#[test]
fn sensors_and_flux_follow_the_nameplate() {
    let folder = folder("own-motor-rules");
    let config = Config::of_motor(Some(&written(&folder, "m.toml", LARGE))).unwrap();
    let rated_a = 3.4 * 2.0_f64.sqrt();
    assert!((config.measurement.range_a / (1.2355 * rated_a) - 1.0).abs() < 1e-3);
    assert!((f64::from(config.drive.sensor_range_a()) / (1.2355 * rated_a) - 1.0).abs() < 1e-3);
    assert!((f64::from(config.drive.current_limit_a()) / rated_a - 0.9027).abs() < 2e-3);
    // 0.707 times the current limit; the rated flux would need 3.15 A.
    assert!((f64::from(config.drive.i_d()) / (0.6383 * rated_a) - 1.0).abs() < 2e-3);
    assert!(config.prepare.learn);
    assert_eq!(config.drive.current_plant.source, PlantSource::Motor);
    // The inertia of 0.012 kg m2 belongs to 6.1 Nm.
    let inertia = 0.012 * 9.982 / 6.107;
    assert!((config.motor.inertia / inertia - 1.0).abs() < 2e-3, "{}", config.motor.inertia);
    // Values in the file take precedence.
    let more = "[sequence]\ni_d = 1.0\n[measurement]\nrange_a = 20.0\n[prepare]\nlearn = false\n";
    let said = written(&folder, "said.toml", &format!("{LARGE}{more}"));
    let config = Config::of_motor(Some(&said)).unwrap();
    assert_eq!((config.measurement.range_a, config.drive.i_d()), (20.0, 1.0));
    assert!(!config.prepare.learn);
    // The other experiments of the full range use the same motor unchanged.
    let envelope = hil_sim(&folder, &["run", "torque-envelope", "--motor", "m.toml", "--json"]);
    assert_eq!(envelope.status.code(), Some(0), "{}", text(&envelope.stderr));
}

/// All missing keys of a file are reported at once, and a value that nobody set is reported as such.
#[test]
fn errors_name_what_was_set_and_all_that_is_missing() {
    let folder = folder("own-motor-errors");
    let told = |name: &str, file: &str, options: &[&str]| {
        written(&folder, name, file);
        let run = [&["run", "torque-steps", "--motor", name][..], options].concat();
        let output = hil_sim(&folder, &run);
        assert_eq!(output.status.code(), Some(2));
        text(&output.stderr).to_owned()
    };
    let missing = told("part.toml", "[motor]\nr_s = 4.6\nl_m = 0.33\n", &[]);
    for key in ["nameplate.power_w", "nameplate.speed_rpm", "motor.r_r", "motor.pole_pairs"] {
        assert!(missing.contains(key), "{key}: {missing}");
    }
    assert!(missing.contains("inverter.dc_link_v") && !missing.contains("motor.l_m"), "{missing}");
    // A rule whose value is not in its range.
    let rule = told("m.toml", LARGE, &["--set", "motor.r_r=0.01"]);
    assert!(rule.contains("sequence.magnetise_s") && rule.contains("was not set"), "{rule}");
    let low = told("m.toml", LARGE, &["--set", "limits.dc_under_v=594"]);
    assert!(low.contains("limits.dc_under_v = 594") && !low.contains("not set"), "{low}");
    let set = told("m.toml", LARGE, &["--set", "sequence.i_d=9"]);
    assert!(set.contains("sequence.i_d = 9") && !set.contains("not set"), "{set}");
}

/// The example of the page is a complete file.
#[test]
fn the_example_of_the_page_is_a_motor() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/motors.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let format = page.split("## Format").nth(1).expect("the section");
    let example = format.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next());
    let folder = folder("own-motor-page");
    let file = written(&folder, "example.toml", example.expect("an example"));
    let config = Config::of_motor(Some(&file)).expect("a motor");
    assert!(config.drive.build().is_ok());
    // It states everything that a motor of the program states: the rules add only the current loop and the flux, and
    // every number has its source.
    let motor = Motor::find(&file).expect("a motor");
    let implied: Vec<&str> = motor.implied(&config).iter().map(|(key, ..)| *key).collect();
    assert_eq!(implied, ["current_plant", "sequence.flux"]);
    assert!(motor.settings().iter().all(|(key, _)| motor.source_of(key).is_some()));
    let output = hil_sim(&folder, &["motors", "example.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}
