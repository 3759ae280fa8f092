//! `cargo sim board` with scripts: the data that a session keeps, shows and refuses, and the failures of a script.

use std::path::Path;
use std::process::Stdio;

use crate::common::program::{command, folder};
use virtual_board::interactive::own::Own;
use virtual_board::interactive::script::{Script, Step, failure};

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
    let first = "[until: last run]\n\
                 > set command.timeout_s 1234\n~ ok\n\
                 [unplug]\n\
                 [until: last run: reset by power-on]\n\
                 > get command.timeout_s\n~ command.timeout_s = 0\n\
                 > set command.timeout_s 1234\n~ ok\n\
                 > save\n...\nok\n\
                 [reset]\n\
                 [until: last run: reset by reset pin]\n\
                 > get command.timeout_s\n~ command.timeout_s = 1234\n";
    let (code, shown) = play(&folder, first, &["--flash", &flash]);
    assert_eq!(code, Some(0), "{shown}");
    assert!(!shown.contains("INFO"), "the log is calm: {shown}");
    let later = "[until: last run]\n> get command.timeout_s\n~ command.timeout_s = 1234\n";
    let (code, shown) = play(&folder, later, &["--flash", &flash]);
    assert_eq!(code, Some(0), "{shown}");
    let (code, shown) = play(&folder, later, &[]);
    assert_eq!(code, Some(1), "without the file: {shown}");
}

/// A stream on the wire is no text of the session, and a new session reports the initial state of its flash.
#[test]
fn frames_of_a_stream_are_no_text_of_the_session() {
    let folder = folder("stream");
    let script = "[until: last run]\n> stream i_q_a speed_rpm 200\n...\n\
                  [2 s]\n> @1 stream i_q_a 500\n...\n[2 s]\n> stream\n~ ok: on\n\
                  > stream off\n~ ok\n> status\n~ off;\n\
                  > defaults\n...\n> start\n...\n~ error: nothing is learned\n";
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
    let script = "[3 s]\n> torqe 1\n> status\n";
    let (code, shown) = play(&folder, script, &[]);
    assert_eq!(code, Some(1), "{shown}");
    assert!(shown.contains("line 2: `> torqe 1`: answered `error:"), "{shown}");
    assert!(!shown.contains("> status"), "it has ended: {shown}");
    let (code, shown) = play(&folder, script, &["--lenient"]);
    assert_eq!(code, Some(0), "{shown}");
    assert!(shown.contains("> status"), "it goes on: {shown}");
}

#[test]
fn a_motor_with_other_sensors_is_told_its_settings() {
    let folder = folder("sensors");
    let keys = ["--set", "measurement.range_a=12", "--set", "inverter.dc_link_v=540"];
    let shown = play(&folder, "[500 ms]\n[help]\n", &keys).1;
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
    assert!(!play(&folder, "[100 ms]\n[help]\n", &[]).1.contains("set scales"));
}

#[test]
fn each_request_has_a_meaning() {
    let typed = |line: &str| Step { typed: Some(line.to_owned()), ..Step::default() };
    let own = |own| Step { own: Some(own), within: 1e-3, ..Step::default() };
    let until = |text: &str, within| Step { until: Some(text.into()), within, ..Step::default() };
    for (line, expected) in [
        ("> torque 1", Step { asks: true, within: 5.0, ..typed("torque 1") }),
        (">", typed("")),
        (">> a: b", typed("a: b")),
        ("> !reset", own(Own::Reset)),
        ("[stage: off]", own(Own::Stage(false))),
        // The effect of contacts comes after the program's filter.
        ("[wires: START 12]", Step { within: 0.0, ..own(Own::Wires("START 12".into())) }),
        ("[500 ms]", Step { within: 0.5, ..Step::default() }),
        ("[until: ok: 1]", until("ok: 1", 30.0)),
        ("[until 2 s: ok]", until("ok", 2.0)),
    ] {
        assert_eq!(Step::parse(line), Ok(expected), "{line}");
    }
    for (line, said) in [
        ("stop", "not behind a request"),
        ("[1]", "`1`: not a time from 0 s to 3600 s"),
        ("[-1 s]", "no such command"),
        ("[4000 s]", "`4000 s`: not a time"),
        ("[until: ]", "[until: TEXT]"),
        ("[until]", "[until: TEXT]"),
        ("[until nan s: ok]", "`nan s`: not a time"),
        ("bus> read 1", "write `> LINE`"),
        ("[rest]", "`!rest`: no such command of the board; there are !help"),
    ] {
        let why = Script::parse(&format!("# a\n{line}\n"), true).unwrap_err();
        assert!(why.contains("line 2") && why.contains(line) && why.contains(said), "{why}");
    }
}

/// Returns the reason why an answer to `status` is a failure.
fn wrong(written: &str, said: &[&str]) -> Option<String> {
    let script = Script::parse(&format!("> status\n{written}"), false).unwrap();
    failure(&script.lines[0].1, &said.iter().map(ToString::to_string).collect::<Vec<_>>())
}

#[test]
fn an_answer_is_as_written_and_no_error_where_none_is_written() {
    for (written, said) in [
        ("", &["off", "* running: torque"][..]),
        ("ok", &["ok"]),
        ("error: out of range", &["error: out of range"]),
        ("...\n~ start\n...\nok", &["help", "stop", "start MODE", "ok"]),
        ("~ is {1.9 to 2.1} A, {-4 to -3}.", &["it is 2.000 A, -3.5."]),
        ("{0} and {a to b}", &["{0} and {a to b}"]),
    ] {
        assert_eq!(wrong(written, said), None, "{written}");
    }
    for (written, said) in [
        ("", &["error: no such command"][..]),
        ("", &["* fault 4: dc link above its limit"]),
        ("", &["-> nothing said `a` within 2 s"]),
        ("ok", &[]),
        ("ok", &["ok", "ok"]),
        ("ok", &["ok: limited"]),
        ("~ start\nok", &["stop", "ok"]),
        ("{1.9 to 2.1} A", &["2.2 A"]),
        ("{1.9 to 2.1} A", &["2.0 V"]),
        ("{1.9 to 2.1} A", &["A"]),
    ] {
        assert!(wrong(written, said).is_some(), "{written}");
    }
}

/// A strict script fails if a text does not come, if a fault is latched at its end, and if the time is over before its last line.
#[test]
fn a_script_fails_at_its_line() {
    let folder = folder("failures");
    for (script, arguments, why) in [
        (
            "[until: last run]\n> status\n~ on;\n",
            &[][..],
            "line 2: `> status`: the answer is\noff;",
        ),
        ("[until 1 s: hello]\n", &[], "line 1: `[until 1 s: hello]`: answered `-> nothing said"),
        ("[1 s]\n[2 s]\n", &["--seconds", "1.5"], "line 2: `[2 s]`: the time is over"),
        (
            "[until: last run]\n> start\n> !stage off\n[1 s]\n...\n",
            &[],
            "line 6: `> faults`: the answer is\nlatched: ",
        ),
        ("[until: last run]\n> start\n> !stage off\n[1 s]\n...\n[quit]\n> torqe", &[], "latched: "),
    ] {
        let (code, shown) = play(&folder, script, arguments);
        assert!(code == Some(1) && shown.contains(why), "{code:?}, {script}: {shown}");
    }
    let (code, shown) = play(&folder, "[until: last run]\n[quit]\n> torqe", &[]);
    assert!(code == Some(0) && shown.contains("# end: quit"), "{shown}");
}
