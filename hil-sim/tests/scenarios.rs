//! Scenarios: the files of the program used as files of a user, and a user's own scenario.

use crate::cli_common::{files, folder, hil_sim, object, text};
use hil_sim::experiments::scenario::QUANTITIES;

/// A file of the program, used as a file of a user, gives the result of the experiment of its name.
#[test]
fn a_shipped_file_runs_as_its_experiment() {
    let folder = folder("scenario-shipped");
    for name in ["torque-steps", "speed-profile", "position-step"] {
        let file = format!("{}/scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let more = ["--json", "--quiet", "--seconds", "2"];
        let own = hil_sim(&folder, &[&["run", &file][..], &more].concat());
        assert_eq!(own.status.code(), Some(0), "{}", text(&own.stderr));
        let known = hil_sim(&folder, &[&["run", name][..], &more].concat());
        assert_eq!(text(&own.stdout), text(&known.stdout), "{name}");
    }
    assert!(files(&folder).is_empty());
}

/// A spindle passes 300 Hz, where the rotor is counted and the currents are sampled twice per revolution, and returns.
/// The rotor follows, judged by its true speed, not by the drive's estimate. This also holds after a saliency
/// self-commissioning with saturation, because nothing holds the rotor while it starts.
#[test]
fn a_spindle_runs_to_its_rated_speed_and_back() {
    let folder = folder("scenario-spindle");
    let file = format!("{}/scenarios/spindle.toml", env!("CARGO_MANIFEST_DIR"));
    for (plant, seed) in [("a", "1"), ("a", "2"), ("r", "1"), ("g7", "1")] {
        let of = ["--motor", "spindle-2kw2", "--plant", plant, "--seed", seed];
        let arguments = [&["run", &file, "--json", "--quiet"], &of[..]].concat();
        let output = hil_sim(&folder, &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let result = object(&output);
        let metric = |name: &str| result["metrics"][name].as_f64().unwrap();
        assert!((23_400.0..24_500.0).contains(&metric("speed_highest_rpm")), "{result}");
        assert!(metric("speed_error_in_the_end_rpm").abs() < 60.0, "{result}");
        let most = if plant == "a" { 2.5 } else { 3.0 };
        assert!(metric("angle_error_rms_deg") < most, "{plant}: {result}");
    }
}

/// Speed regulated with a ramp, a slowly rising load, and a stop: the drive follows, is off at the end, and only the
/// requested columns are shown.
const OWN: &str = r#"
columns = ["speed_rpm", "torque_nm"]
metrics = [
    { name = "settled_error_rms_rpm", of = "reference_error", over = "settled" },
    { name = "last_rpm", of = "speed_rpm", statistic = "last" },
    { name = "last_nm", of = "torque_nm", statistic = "last" },
]

[settings]
angle_source = "encoder"

[[part]]
seconds = 2
speed_rpm = [0, 200]
load_nm = 0

[[part]]
seconds = 2
load_nm = [0, 0.4]

[[part]]
seconds = 3
load_nm = 0
stop = "ramp"
"#;

#[test]
fn an_own_scenario_follows_its_parts_and_stops() {
    let folder = folder("scenario-own");
    std::fs::write(folder.join("lift.toml"), OWN).unwrap();
    let output =
        hil_sim(&folder, &["run", "lift.toml", "--out", "page", "--csv", "data", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let result = object(&output);
    assert_eq!(result["experiment"], "lift");
    let metric = |name: &str| result["metrics"][name].as_f64().unwrap();
    // The last half second of the ramp, of the load, and of the time after the stop, when the reference is still 200 rpm.
    assert!((metric("settled_error_rms_rpm") - 200.0 / 3f64.sqrt()).abs() < 6.0, "{result}");
    assert!(metric("last_rpm").abs() < 5.0 && metric("last_nm").abs() < 0.05);
    assert_eq!(metric("lost"), 0.0);
    let series = result["series"].as_object().unwrap();
    assert_eq!(series.keys().collect::<Vec<_>>(), ["profile/speed_rpm", "profile/torque_nm"]);
    // At 4 s the motor carries the load of 0.4 Nm and the friction of 0.001 Nm s/rad.
    let torque = &series["profile/torque_nm"];
    let at = |array: &str, n: usize| torque[array][n].as_f64().unwrap();
    let last = (0..).find(|&n| at("x", n) > 3.99).unwrap();
    let mean = (last - 30..last).map(|n| at("y", n)).sum::<f64>() / 30.0;
    assert!((mean - 0.42).abs() < 0.04, "{mean}");
    let page = std::fs::read_to_string(folder.join("page/lift.html")).unwrap();
    assert!(page.contains("run lift.toml"), "the command that repeats it");
    let csv = std::fs::read_to_string(folder.join("data/lift-profile.csv")).unwrap();
    assert!(csv.starts_with("time_s,speed_rpm,torque_nm\n"), "{}", &csv[..80]);
}

/// With the locked shaft of the default, a torque beyond a bound of the judgement is lost; the bound is the only difference.
#[test]
fn a_judge_decides_what_is_lost() {
    let folder = folder("scenario-judge");
    let run = |within: f64| {
        let text = format!(
            "judge = [{{ of = \"torque_nm\", within = {within} }}]\n[[part]]\nseconds = 1\ntorque_current_a = 1.0\n"
        );
        std::fs::write(folder.join("judged.toml"), text).unwrap();
        hil_sim(&folder, &["run", "judged.toml", "--json"])
    };
    assert_eq!(object(&run(10.0))["metrics"]["lost"], 0.0);
    let lost = run(0.1);
    assert_eq!((lost.status.code(), &object(&lost)["metrics"]["lost"]), (Some(1), &1.0.into()));
}

/// The page has a row for each column.
#[test]
fn every_column_is_documented() {
    let page = include_str!("../scenarios/README.md");
    for quantity in QUANTITIES {
        assert!(page.contains(&format!("`{}`", quantity.name)), "{}", quantity.name);
    }
}
