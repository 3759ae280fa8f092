//! Scripts of the virtual board: times, awaited texts, and failures.

use virtual_board::interactive::script::{Due, Script};

#[test]
fn scripts_keep_their_times_and_wait_for_texts() {
    let mut script =
        Script::parse("at 1: a b\n\n# c\nwait 0.5: d: e\nwait for ok\nat 1: f").unwrap();
    let mut due = |now, heard: Option<&str>| {
        heard.into_iter().for_each(|line| script.hear(line));
        script.due(now)
    };
    assert_eq!(due(0.9, Some("ok")).unwrap(), Due::Nothing);
    assert_eq!(due(1.0, None).unwrap(), Due::Type("a b".into()));
    assert_eq!(due(1.4, None).unwrap(), Due::Nothing);
    assert_eq!(due(1.5, None).unwrap(), Due::Type("d: e".into()));
    assert_eq!(due(1.6, Some("error")).unwrap(), Due::Nothing);
    assert_eq!(due(2.0, Some("well, ok")).unwrap(), Due::Nothing);
    // Its time has passed.
    assert_eq!(due(2.1, None).unwrap(), Due::Type("f".into()));
    assert_eq!(due(2.2, None).unwrap(), Due::Nothing);
    assert_eq!(due(3.0, None).unwrap(), Due::End);

    let mut silent = Script::parse("wait for ok").unwrap();
    assert_eq!(silent.due(29.0).unwrap(), Due::Nothing);
    assert!(silent.due(31.0).unwrap_err().to_string().contains("`ok` within 30 s"));
    for bad in ["stop", "at 1 stop", "at -1: stop", "at nan: stop", "after 1: stop", "wait: stop"] {
        let why = Script::parse(bad).unwrap_err();
        assert!(why.contains("line 1") && why.contains(bad), "{why}");
    }
}

/// Plays a strict script with lines that come at given times; returns the typed lines and the result.
fn play(text: &str, said: &[(f64, &str)]) -> (Vec<String>, Result<f64, String>) {
    let mut script = Script::parse(text).unwrap().strict();
    let (mut typed, mut said) = (Vec::new(), said.iter().peekable());
    for step in 0..10_000 {
        let now = f64::from(step) * 0.01;
        while let Some((_, line)) = said.next_if(|(at, _)| *at <= now) {
            script.hear(line);
        }
        match script.due(now) {
            Ok(Due::Type(line)) if line == "quit" => return (typed, Ok(now)),
            Ok(Due::Type(line)) => typed.push(line),
            Ok(Due::End) => return (typed, Ok(now)),
            Ok(_) => {}
            Err(why) => return (typed, Err(why.to_string())),
        }
    }
    panic!("no end");
}

fn failure(text: &str, said: &[(f64, &str)]) -> String {
    play(text, said).1.expect_err("it fails")
}

#[test]
fn an_expected_text_comes_in_time() {
    let script = "at 1: help\nexpect start\nexpect ok\nexpect 2s ready\n";
    // Several lines at once are all remembered.
    let lines = [(1.1, "ok"), (1.1, "start MODE"), (3.0, "now ready")];
    let (typed, end) = play(script, &lines);
    assert_eq!(typed, ["help", "faults"]);
    assert!((3.0..5.0).contains(&end.unwrap()));
    let why = failure(script, &lines[..2]);
    assert!(why.contains("line 4: `expect 2s ready`: nothing said `ready` within 2 s"), "{why}");
    // A line from before the last typed one does not count.
    let why = failure("expect 0.5s hello\nat 1: status\nexpect 1s hello", &[(0.1, "hello")]);
    assert!(why.contains("line 3"), "{why}");
}

#[test]
fn a_text_that_must_not_come_is_watched_for() {
    let script = "at 1: start\nexpect not 2s fault\nat 9: stop\n";
    let (typed, end) = play(script, &[(1.1, "ok"), (3.5, "fault 4")]);
    assert_eq!((typed.len(), end.is_ok()), (3, true), "it comes later");
    let why = failure(script, &[(1.1, "ok"), (2.5, "fault 4")]);
    assert!(why.contains("line 2: `expect not 2s fault`: said `fault 4`"), "{why}");
}

#[test]
fn an_error_is_a_failure_unless_it_is_expected() {
    let script = "at 1: torque 99\nexpect out of range\nat 2: stop\n";
    let error = "error: torque 99 A: out of range";
    assert!(play(script, &[(1.2, error)]).1.is_ok());
    let why = failure(script, &[(1.2, "error: no such command")]);
    assert!(why.contains("line 1: `at 1: torque 99`: answered `error: no such command`"), "{why}");
    let why = failure(script, &[(1.2, error), (2.1, error)]);
    assert!(why.contains("line 3: `at 2: stop`"), "{why}");
    // A lenient script continues, and notes missing texts.
    let mut script = Script::parse("at 0: torque 99\nexpect 1s ok\nat 2: stop").unwrap();
    assert_eq!(script.due(0.0).unwrap(), Due::Type("torque 99".into()));
    script.hear(error);
    assert_eq!(script.due(0.5).unwrap(), Due::Nothing);
    assert!(matches!(script.due(1.5).unwrap(), Due::Note(why) if why.contains("line 2")));
    assert_eq!(script.due(2.0).unwrap(), Due::Type("stop".into()));
}

#[test]
fn a_fault_at_the_end_is_a_failure() {
    for end in ["wait 1: status", "wait 1: quit"] {
        let script = format!("at 1: start\n{end}\n");
        let (typed, result) = play(&script, &[(2.7, "none latched; last run: power-on")]);
        assert!(result.is_ok() && typed.contains(&"faults".to_owned()), "{typed:?}");
        let why = failure(&script, &[(2.7, "latched: fault 4, dc link above its limit")]);
        assert!(why.contains("fault 4, dc link") && why.contains("script, line"), "{why}");
    }
}

#[test]
fn a_script_that_is_cut_short_fails() {
    let mut script = Script::parse("at 1: start\nat 9: stop").unwrap().strict();
    script.due(1.0).unwrap();
    assert!(script.cut_short().unwrap().contains("line 2: `at 9: stop`: the time"));
    let mut lenient = Script::parse("at 1: start").unwrap();
    assert_eq!(lenient.cut_short(), None);
}

#[test]
fn lines_that_are_no_step_are_refused() {
    for (line, said) in [
        ("expect", "expect [SECONDSs] TEXT"),
        ("expect 2s", "the text is missing"),
        ("expect not 2s ", "the text is missing"),
        ("expect 4000s ok", "`4000`: not a number from 0 to 3600 s"),
        ("at 1: !rest", "`!rest`: no such command of the board; there are !help"),
    ] {
        let why = Script::parse(line).unwrap_err();
        assert!(why.contains("line 1") && why.contains(said), "{why}");
    }
}
