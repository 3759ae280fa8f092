//! Files of a user: profiles, recorded traces, configuration files.

use std::fmt::Write as _;

use crate::cli_common::{files, folder, hil_sim, object, text};
use drive_core::{Command, Mode};
use hil_sim::Config;
use hil_sim::rig::Rig;

/// Returns the trace of one second of a drive with an encoder on a dynamometer that changes speed, while torque and
/// flux change; it is as the console records it, each period.
fn recorded_trace(changes: &[(&str, &str)]) -> String {
    let mut config = Config::default();
    let set = [
        ("angle_source", "encoder"),
        ("load.mode", "speed"),
        ("load.speed_rpm", "200"),
        ("saliency.a_psi", "0"),
        ("saliency.b1", "0"),
    ];
    for (key, value) in set.iter().chain(changes) {
        config.set(key, value).expect("a key");
    }
    let mut rig = Rig::started(&config, 3, Mode::Torque).expect("a start");
    let mut trace = "time_s,i_alpha_a,i_beta_a,u_alpha_v,u_beta_v,speed_rpm\n".to_owned();
    let mut row = 0;
    for (magnetising, torque) in [(0.7, 0.5), (1.0, 2.0), (0.6, 1.0), (0.9, 0.4)] {
        rig.command(&Command::Magnetising(magnetising)).expect("a command");
        rig.command(&Command::Torque(torque)).expect("a command");
        for _ in 0..1500 {
            rig.step();
            let t = rig.drive.telemetry();
            let rpm = rig.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
            let ([i_a, i_b], [u_a, u_b]) =
                ([t.measured.alpha, t.measured.beta], [t.realised.alpha, t.realised.beta]);
            let time = f64::from(row) / 6000.0;
            writeln!(trace, "{time:.6},{i_a:.5},{i_b:.5},{u_a:.4},{u_b:.4},{rpm:.2}").unwrap();
            row += 1;
        }
    }
    trace
}

/// True parameters are found within 2 % from 6000 noisy samples of the default inverter, for the motor of the settings
/// and for another one.
#[test]
fn a_simulated_trace_is_identified() {
    let folder = folder("trace");
    for (name, changes, [r_s, tau_r, sigma_l_s, l_s]) in [
        ("a.csv", &[][..], [5.4, 0.18609, 51.478, 204.7]),
        (
            "b.csv",
            &[("motor.r_s", "4"), ("motor.r_r", "1.6"), ("motor.l_ls", "0.02")][..],
            [4.0, 0.12794, 43.878, 197.1],
        ),
    ] {
        std::fs::write(folder.join(name), recorded_trace(changes)).unwrap();
        let output = hil_sim(&folder, &["identify-trace", "--input", name, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let metrics = object(&output)["metrics"].clone();
        for (metric, truth, share) in [
            ("r_s_ohm", r_s, 0.02),
            ("tau_r_s", tau_r, 0.02),
            ("sigma_l_s_mh", sigma_l_s, 0.02),
            ("l_s_mh", l_s, 0.02),
        ] {
            let found = metrics[metric].as_f64().expect(metric);
            assert!((found / truth - 1.0).abs() < share, "{name} {metric}: {found}, true {truth}");
        }
        // The drive has already subtracted its own inverter voltage error.
        assert!(metrics["drop_v"].as_f64().unwrap() < 0.5);
    }
    // The columns of other tools, by their names; the settings are now those of the second motor.
    let trace = std::fs::read_to_string(folder.join("b.csv")).unwrap();
    let renamed = trace.replacen("speed_rpm", "n", 1).replacen("u_alpha_v", "ua", 1);
    std::fs::write(folder.join("c.csv"), renamed).unwrap();
    let arguments = ["identify-trace", "--input", "c.csv", "--column", "speed_rpm=n"];
    let output = hil_sim(&folder, &arguments);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr)
            .contains("c.csv: there is no column `u_alpha_v or u_a_v or u_ab_v`; the file has: ")
    );
    let more = ["--column", "u_alpha_v=ua", "--set", "motor.r_s=4"];
    let output = hil_sim(&folder, &[&arguments[..], &more].concat());
    let printed = text(&output.stdout);
    assert!(printed.contains("stator resistance r_s") && printed.contains("difference (%)"));
    let page = std::fs::read_to_string(folder.join("out/identify-trace.html")).unwrap();
    let command = "identify-trace --input c.csv --column speed_rpm=n --column u_alpha_v=ua";
    assert!(page.contains(command), "the command that repeats it");
}

#[test]
fn the_example_profile_runs_and_is_followed() {
    let folder = folder("profile");
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/profile.csv");
    let output = hil_sim(&folder, &["run", "profile", "--input", example, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let object = object(&output);
    let rms = object["metrics"]["speed_error_rms_rpm"].as_f64().unwrap();
    assert!(rms < 20.0, "{rms}");
    assert!(object["faults"].as_array().unwrap().is_empty());
    let actual = &object["series"]["profile/speed_actual_rpm"]["y"];
    let largest = actual.as_array().unwrap().iter().filter_map(|y| y.as_f64()).fold(0.0, f64::max);
    assert!((150.0..220.0).contains(&largest), "{largest}");
    assert!(files(&folder).is_empty());
}

/// The dynamometer holds torque; a shaft driven far above the speed range of the saliency tracking loses the lock.
#[test]
fn a_lost_profile_names_its_fault_and_exits_with_1() {
    let folder = folder("lost-profile");
    let rows = "time_s,torque_current_a,load_rpm\n0,1,0\n1,1,0\n4,1,3000\n";
    std::fs::write(folder.join("p.csv"), rows).unwrap();
    let output = hil_sim(&folder, &["run", "profile", "--input", "p.csv", "--json"]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let object = object(&output);
    let fault = object["faults"][0].as_str().expect("a fault");
    assert!(fault.starts_with("fault "), "{fault}");
    assert!(text(&output.stderr).contains(fault), "{}", text(&output.stderr));
    assert_eq!(object["metrics"]["lost"], 1.0);
}

#[test]
fn the_example_configuration_is_read_and_a_written_one_comes_back() {
    let folder = folder("configuration");
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/bench.toml");
    let output = hil_sim(&folder, &["run", "torque-steps", "--config", example, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    let settings = object(&output)["settings"].clone();
    assert_eq!(settings["motor.r_s"], 6.1, "{settings}");
    let toml = hil_sim(&folder, &["keys", "--toml", "--config", example]);
    std::fs::write(folder.join("all.toml"), &toml.stdout).unwrap();
    let output = hil_sim(&folder, &["run", "torque-steps", "--config", "all.toml", "--json"]);
    assert_eq!(object(&output)["settings"], settings);
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    // A file may contain more than an experiment uses; a note says so, except in quiet mode.
    let arguments = ["run", "adc-calibration", "--json", "--config", example];
    let note = hil_sim(&folder, &arguments);
    assert!(text(&note.stderr).contains("note: adc-calibration does not use "));
    assert!(hil_sim(&folder, &[&arguments[..], &["--quiet"]].concat()).stderr.is_empty());
}
