//! A user's motor, for which a file states nameplate, circuit and dc link: its rules, and the example of the page. That it
//! works at the first attempt is in `bounds.toml`.

use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::path::Path;

use crate::cli_common::{folder, hil_sim, object, text};
use drive_settings::PlantSource;
use hil_sim::Config;
use hil_sim::config::{motors, motors::Motor, plate};

const LARGE: &str = include_str!("own-motor/large.toml");

fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    path.to_str().expect("a path of letters").to_owned()
}

/// The sensors of the dissertation's bench reach 1.12 times the sum of rated current, injection current and ripple of its motor, and so do
/// those of a user's motor. The drive has learned the motor, at high flux, and its current limit is the same share of the sensors' range.
#[test]
fn sensors_and_flux_follow_the_nameplate() {
    let folder = folder("own-motor-rules");
    let config = Config::of_motor(Some(&written(&folder, "m.toml", LARGE))).unwrap();
    let rated_a = 3.4 * 2.0_f64.sqrt();
    let sigma_l_s = f64::from(config.drive.motor.sigma_l_s());
    let injection_a = 560.0 * 50.0 / 311.0 / (1200.0 * PI * sigma_l_s);
    let ripple_a = 560.0 / (8.0 * 6000.0 * sigma_l_s);
    let range_a = 1.1172 * (rated_a + injection_a + ripple_a);
    assert!((config.measurement.range_a / range_a - 1.0).abs() < 1e-3);
    assert!((f64::from(config.drive.sensor_range_a()) / range_a - 1.0).abs() < 1e-3);
    let limit_a = f64::from(config.drive.current_limit_a());
    assert!((limit_a / range_a - 0.7306).abs() < 2e-3);
    // The current of the rated flux, 0.95 of the largest d-axis current.
    assert!((config.drive.i_d() - 3.15).abs() < 5e-3 && 3.15 < limit_a * FRAC_1_SQRT_2);
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

/// The nameplates, and where they are from.
fn plates() -> Vec<(&'static str, &'static str)> {
    let lines = include_str!("plates.txt").lines().filter(|line| !line.starts_with('#'));
    lines.map(|line| line.split_once(" => ").expect("PLATE => SOURCE")).collect()
}

/// Commissions motors of which only the nameplate is known, and holds their torque on saturating iron.
fn commission_and_run(plates: &[(&str, &str)]) {
    let folder = folder(&format!("own-motor-plates-{}", plates.len()));
    for (plate, _) in plates {
        let made = hil_sim(&folder, &["motors", "--plate", plate]);
        assert_eq!(made.status.code(), Some(0), "{plate}: {}", text(&made.stderr));
        written(&folder, "plate.toml", text(&made.stdout));
        let run = |experiment: &str, plant: &str| {
            let of_motor = ["--motor", "plate.toml", "--plant", plant, "--json", "--quiet"];
            object(&hil_sim(&folder, &[&["run", experiment][..], &of_motor].concat()))
        };
        assert_eq!(run("commission", "a")["metrics"]["accepted"], 1.0, "{plate}");
        let steps = run("torque-steps", "r");
        let error = |name: &str| steps["metrics"][name].as_f64().expect("an angle");
        assert!(error("angle_error_rms_deg") < 2.5, "{plate}: {steps}");
        assert!(error("angle_error_max_deg") < 8.5, "{plate}: {steps}");
    }
}

/// The two with the largest slip, and the fastest.
#[test]
fn a_nameplate_is_enough() {
    let chosen =
        |text: &str| [" 670 rpm", " 850 rpm", " 400 Hz"].iter().any(|it| text.contains(it));
    let few: Vec<_> = plates().into_iter().filter(|(plate, _)| chosen(plate)).collect();
    assert_eq!(few.len(), 3);
    commission_and_run(&few);
}

#[test]
#[ignore = "cargo xtask prove long-tests"]
fn every_nameplate_is_enough() {
    assert!(plates().len() >= 12);
    commission_and_run(&plates());
}

/// The nameplate alone as a motor file is the same motor.
#[test]
fn a_file_with_the_nameplate_alone_is_completed() {
    let folder = folder("own-motor-plate");
    let alone = LARGE.split("[motor]").next().expect("the nameplate");
    let file = written(&folder, "alone.toml", alone);
    let made = motors::motor_file("1,5 kW, 400 V, 3.4 A, 50 Hz, 1435 rpm").unwrap();
    let made = Config::of_motor(Some(&written(&folder, "made.toml", &made))).unwrap();
    assert_eq!(Config::of_motor(Some(&file)).unwrap(), made);
    // The circuit draws the rated current and gives the rated power at the rated speed.
    let (m, z) = (&made.motor, 400.0 / 3_f64.sqrt() / 3.4);
    let x = [m.l_ls, m.l_lr, m.l_m].map(|l| l * 100.0 * PI / z);
    let (slip, power) = plate::rated([m.r_s / z, m.r_r / z, x[0], x[1], x[2]]);
    assert!((slip / (65.0 / 1500.0) - 1.0).abs() < 0.01, "{slip}");
    assert!((power / (1500.0 / (3_f64.sqrt() * 400.0 * 3.4)) - 1.0).abs() < 0.01, "{power}");
    let run =
        object(&hil_sim(&folder, &["run", "torque-steps", "--motor", "alone.toml", "--json"]));
    assert!(run["remarks"].to_string().contains("alone.toml: circuit and dc link are estimated"));
}

/// The page that leads through the first hour states what its commands show.
#[test]
fn the_first_hour_states_what_its_commands_show() {
    let folder = folder("own-motor-first-hour");
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/first-hour.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let plate = page.split("--plate \"").nth(1).and_then(|rest| rest.split('"').next());
    let made = hil_sim(&folder, &["motors", "--plate", plate.expect("a nameplate")]);
    written(&folder, "my-motor.toml", text(&made.stdout));
    let run = |experiment: &str, more: &[&str]| {
        let of_motor = ["run", experiment, "--motor", "my-motor.toml", "--json", "--quiet"];
        object(&hil_sim(&folder, &[&of_motor[..], more].concat()))
    };
    let found = run("commission", &["--set", "prepare.learn=yes"]);
    let number = |run: &serde_json::Value, name: &str| run["metrics"][name].as_f64().expect(name);
    let apart = ["r_s", "sigma_ls", "rr", "lm", "tau_r"]
        .map(|of| number(&found, &format!("error_max_pct.{of}")));
    let (steps, speeds) = (run("torque-steps", &[]), run("speed-profile", &[]));
    let torque = |n: usize| steps["steps"][n]["torque_nm"].as_f64().expect("a torque");
    for part in [
        format!(
            "differ from the true ones by at most {:.1} %",
            apart.into_iter().fold(0.0, f64::max)
        ),
        format!("takes another {:.0} s", number(&found, "learning_seconds_max")),
        format!("`good_after {}`", number(&found, "good_after")),
        format!("five levels from {:.1} to {:.1} Nm", torque(0), torque(4)),
        format!(
            "angle error is {:.1}° rms, {:.1}° at most",
            number(&steps, "angle_error_rms_deg"),
            number(&steps, "angle_error_max_deg")
        ),
        format!("angle error is {:.1}° rms:", number(&speeds, "angle_error_rms_deg")),
    ] {
        assert!(page.contains(&part), "docs/first-hour.md: {part}");
    }
    let listed = hil_sim(&folder, &["motors", "my-motor.toml"]);
    assert!(text(&listed.stdout).contains("UNVERIFIED: estimated from the nameplate"));
}
