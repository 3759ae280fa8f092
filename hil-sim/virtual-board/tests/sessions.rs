//! `cargo sim board` with scripts: the data that a session keeps, shows and refuses.

use std::path::Path;
use std::process::Stdio;

use crate::common::program::{command, folder};

/// Runs a session with a script, as fast as possible; returns the exit code and all its output.
fn play(folder: &Path, script: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let file = folder.join("script.txt");
    std::fs::write(&file, script).unwrap();
    let mut command = command(folder, &["--fast", "--script"]);
    let output = command.arg(&file).args(arguments).stdin(Stdio::null()).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    (output.status.code(), text.concat())
}

#[test]
fn saved_settings_outlast_reset_power_and_session() {
    let folder = folder("flash");
    let flash = folder.join("flash.bin").display().to_string();
    let first = "at 1: set command.timeout_s 1234\n\
                 expect ok\n\
                 at 3: !unplug\n\
                 expect last run: reset by power-on\n\
                 wait 1: get command.timeout_s\n\
                 expect command.timeout_s = 0\n\
                 wait 0.1: set command.timeout_s 1234\n\
                 expect ok\n\
                 wait 2: save\n\
                 expect ok\n\
                 wait 0.1: !reset\n\
                 expect last run: reset by reset pin\n\
                 wait 1: get command.timeout_s\n\
                 expect command.timeout_s = 1234\n";
    let (code, shown) = play(&folder, first, &["--flash", &flash]);
    assert_eq!(code, Some(0), "{shown}");
    assert!(!shown.contains("INFO"), "the log is calm: {shown}");
    let later = "at 1: get command.timeout_s\nexpect 1s command.timeout_s = 1234\n";
    let (code, shown) = play(&folder, later, &["--flash", &flash]);
    assert_eq!(code, Some(0), "{shown}");
    let (code, shown) = play(&folder, later, &[]);
    assert_eq!(code, Some(1), "without the file: {shown}");
}

/// A stream on the wire is no text of the session, and a new session reports the initial state of its flash.
#[test]
fn frames_of_a_stream_are_no_text_of_the_session() {
    let folder = folder("stream");
    let script = "at 1: stream i_q_a speed_rpm 200\nexpect ok\n\
                  wait 3: @1 stream i_q_a 500\nexpect ok\nwait 2: stream\nexpect ok: on\n\
                  wait 0.5: stream off\nexpect ok\nwait 0.2: status\nexpect off;\n\
                  wait 0.1: defaults\nexpect ok\nwait 0.2: start\nexpect error: nothing is learned\n";
    let (code, shown) = play(&folder, script, &[]);
    assert_eq!(code, Some(0), "{shown}");
    let told =
        |rate: &str| shown.matches(&format!("# stream: {rate} frames/s, not shown here\n")).count();
    assert_eq!((told("200"), told("500")), (1, 1), "{shown}");
    assert_eq!(shown.matches("# stream:").count(), 2, "{shown}");
    assert!(shown.contains("flash begins with `injection.allow_unlearned yes`"), "{shown}");
    let page = std::fs::read_to_string(folder.join("board.html")).unwrap();
    for text in [&shown, &page] {
        assert!(!text.contains("\\x"), "bytes of frames are shown: {text}");
    }
}

#[test]
fn an_error_in_a_script_ends_it_with_its_line() {
    let folder = folder("strict");
    let script = "at 3: torqe 1\nwait 0.5: status\n";
    let (code, shown) = play(&folder, script, &[]);
    assert_eq!(code, Some(1), "{shown}");
    assert!(shown.contains("line 1: `at 3: torqe 1`: answered `error:"), "{shown}");
    assert!(!shown.contains("> status"), "it has ended: {shown}");
    let (code, shown) = play(&folder, script, &["--lenient"]);
    assert_eq!(code, Some(0), "{shown}");
    assert!(shown.contains("> status"), "it goes on: {shown}");
}

#[test]
fn a_motor_with_other_sensors_is_told_its_settings() {
    let folder = folder("sensors");
    let keys = ["--set", "measurement.range_a=12", "--set", "inverter.dc_link_v=540"];
    let shown = play(&folder, "at 0.5: !help\n", &keys).1;
    // 12 A over 4.4727 A times the image's 2.4332 mA per count; 450 V times 540 over 311.
    for line in ["set inverter.dc_link_v 540", "set scales.current_a.offset -12", "!reset"] {
        assert!(shown.contains(line), "{line}: {shown}");
    }
    let value = |name: &str| -> f64 {
        let (_, rest) = shown.split_once(&format!("set {name} ")).expect(name);
        rest.lines().next().unwrap().parse().unwrap()
    };
    assert!((value("scales.current_a.gain") / (2.4332e-3 * 12.0 / 4.4727134) - 1.0).abs() < 1e-4);
    assert!((value("scales.dc_link.gain") / (0.11 * 540.0 / 311.0) - 1.0).abs() < 1e-4);
    assert!(!play(&folder, "at 0.1: !help\n", &[]).1.contains("set scales"));
}
