//! `cargo sim board`: errors in its options are reported before anything is built.

use std::process::{Command, Output};

fn board(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
    // There is no cargo, so nothing is built.
    command.env("CARGO", "/nonexistent/cargo").arg("board").args(arguments);
    command.output().expect("the binary runs")
}

#[test]
fn bad_options_are_refused_before_the_build() {
    for (arguments, said) in [
        (&["--load", "speed"][..], "--load speed: write --load speed RPM"),
        (&["--load", "free", "3"], "--load free: only speed takes a number"),
        (&["--load", "heavy"], "load.mode = heavy: not one of the words"),
        (&["--load", "speed", "fast"], "load.speed_rpm = fast: not a number"),
        (&["--seconds", "0"], "seconds = 0: out of range; allowed: 0.001 to 3600 s"),
        (&["--set", "motor.r_s=-1"], "motor.r_s = -1: out of range"),
    ] {
        let output = board(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn a_cargo_that_does_not_run_is_named() {
    for arguments in [&[][..], &["--elf", "some.elf"]] {
        let output = board(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.contains("cargo"), "{error}");
    }
}
