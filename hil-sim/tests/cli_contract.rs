//! Guarantees of the command line: exit codes, messages, one JSON object, no half-written files.

use crate::cli_common::{files, folder, hil_sim, text};
use hil_sim::experiments::{EVERYDAY, EXPERIMENTS, WITH_INPUT};

#[test]
fn a_run_prints_its_table_and_writes_its_page() {
    let folder = folder("run");
    let output = hil_sim(&folder, &["run", "adc-calibration"]);
    assert_eq!(output.status.code(), Some(0));
    let printed = text(&output.stdout);
    assert!(printed.contains("-4.472713") && printed.contains("out/adc-calibration.html"));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    let mut written = files(&folder.join("out"));
    written.sort();
    assert_eq!(written, ["adc-calibration-calibration.svg", "adc-calibration.html"]);
    let page = std::fs::read_to_string(folder.join("out/adc-calibration.html")).unwrap();
    assert!(page.contains("<svg") && page.trim_end().ends_with("</html>"));
    let outside = ["src=", "href=\"http", "url(", "<script", "@import"];
    assert!(outside.iter().all(|word| !page.contains(word)), "the page is self-contained");
}

#[test]
fn json_is_one_object_and_nothing_else() {
    let folder = folder("json");
    let arguments = ["run", "anti-windup", "--json", "--seed", "42"];
    let output = hil_sim(&folder, &arguments);
    assert_eq!(output.status.code(), Some(0));
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(object["experiment"], "anti-windup");
    assert_eq!(object["seed"], 42);
    assert!((object["metrics"]["plain_y_max"].as_f64().unwrap() - 2.005).abs() < 1e-3);
    assert!(output.stderr.is_empty() && files(&folder).is_empty());
    assert_eq!(
        hil_sim(&folder, &arguments).stdout,
        output.stdout,
        "the same seed, the same result"
    );
}

#[test]
fn a_group_is_one_json_object_too() {
    let folder = folder("group");
    let arguments = ["run", "identify", "--json", "--seconds", "0.5"];
    let output = hil_sim(&folder, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    let experiments = object["experiments"].as_array().expect("a list");
    assert_eq!(experiments.len(), hil_sim::experiments::named("identify").len());
    assert!(
        experiments
            .iter()
            .all(|one| one["settings"]["seconds"] == 0.5 && one["version"].is_string())
    );
}

#[test]
fn csv_has_a_file_for_every_figure_and_table() {
    let folder = folder("csv");
    let output = hil_sim(&folder, &["run", "torque-steps", "--seconds", "1", "--csv", "data"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(printed.contains("Metrics") && printed.contains("angle_error_rms_deg"), "{printed}");
    let read = |name: &str| std::fs::read_to_string(folder.join("data").join(name)).expect(name);
    assert!(read("torque-steps-levels.csv").starts_with("iq_ref_a,iq_a,torque_nm,"));
    let figure = read("torque-steps-steps.csv");
    let mut lines = figure.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heads = lines.next().expect("heads");
    assert!(heads.contains(&"time_s") && heads.contains(&"torque_motor_nm"), "{heads:?}");
    assert!(lines.all(|row| row.len() == heads.len()));
    assert_eq!(figure.lines().count(), 601, "a mean every injection period of 1/600 s");
}

#[test]
fn a_page_names_itself_its_origin_and_its_settings() {
    let folder = folder("origin");
    let arguments =
        ["run", "torque-steps", "--seconds", "0.5", "--seed", "5", "--set", "motor.r_s=6"];
    assert_eq!(hil_sim(&folder, &arguments).status.code(), Some(0));
    let page = std::fs::read_to_string(folder.join("out/torque-steps.html")).unwrap();
    let version = format!("hil-sim {}", env!("CARGO_PKG_VERSION"));
    for part in ["<title>torque-steps – ", &version, "UTC with seed 5", "motor.r_s = 6"] {
        assert!(page.contains(part), "{part}");
    }
}

/// A load of 2 Nm, more than the torque limit, accelerates a light rotor without bound.
#[test]
fn a_lost_run_names_its_fault_and_prints_no_nan() {
    let folder = folder("lost");
    let set = ["--set", "motor.inertia=0.001", "--set", "load.torque_nm=2"];
    let output = hil_sim(&folder, &[&["run", "speed-profile"][..], &set].concat());
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(printed.contains("\nLost: fault ") && !printed.contains("NaN"), "{printed}");
    let page = std::fs::read_to_string(folder.join("out/speed-profile.html")).unwrap();
    assert!(page.contains("<p class=\"lost\">Lost: fault ") && !page.contains("NaN"));
    let output = hil_sim(&folder, &[&["run", "speed-profile", "--json"][..], &set].concat());
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    let fault = object["faults"][0].as_str().expect("a fault");
    assert!(printed.contains(fault), "{fault}");
    let events = object["events"]["profile"].as_array().expect("events");
    assert_eq!(events.last().expect("an event")[1], fault, "{events:?}");
    // The event comes with the load, at 3 s, not at the end of the part of the profile, at 5 s.
    let stop = events.last().and_then(|event| event[0].as_f64()).expect("a time");
    assert!((3.0..3.5).contains(&stop), "{events:?}");
}

#[test]
fn a_page_that_cannot_be_written_is_a_failure_of_its_own() {
    let folder = folder("unwritable");
    std::fs::write(folder.join("taken"), "a file").unwrap();
    let output = hil_sim(&folder, &["run", "adc-calibration", "--out", "taken"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("taken"), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_to_string(folder.join("taken")).unwrap(), "a file");
}

#[test]
fn lists_name_every_experiment_and_key() {
    let folder = folder("lists");
    let names = |options: &[&str]| {
        let output = hil_sim(&folder, options);
        let list = text(&output.stdout);
        let heads = list.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
        heads.map(|line| line.split(' ').next().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let everyday = names(&["list"]);
    assert_eq!(everyday, *EVERYDAY);
    let both = [everyday, names(&["list", "--lab"])].concat();
    assert_eq!(both.len(), EXPERIMENTS.len() + WITH_INPUT.len(), "each in one of the lists");
    for experiment in EXPERIMENTS.iter() {
        assert!(both.iter().any(|name| name == experiment.name), "{}", experiment.name);
    }
    let keys = hil_sim(&folder, &["keys"]);
    for key in hil_sim::config::Key::all() {
        assert!(text(&keys.stdout).contains(&key.assigned_name()));
    }
}
