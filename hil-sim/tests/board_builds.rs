//! `cargo sim board`: the messages while image and emulator are built, and the call of the built program. A script
//! replaces cargo.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Output};

use crate::cli_common::{folder, hil_sim, text};

fn program(path: &Path, text: &str) {
    fs::write(path, format!("#!/bin/sh\n{text}")).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

/// Runs `cargo sim board` with a cargo that runs this script.
fn board(folder: &Path, cargo: &str, arguments: &[&str]) -> Output {
    let path = folder.join("cargo");
    program(&path, cargo);
    let mut command = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
    command.env("CARGO", path).arg("board").args(arguments).output().unwrap()
}

#[test]
fn builds_are_announced_and_the_board_gets_image_and_options() {
    let folder = folder("announced");
    program(&folder.join("fake-board"), "echo board \"$@\"\n");
    let cargo = format!(
        "case $1 in\n\
         run) echo '==> firmware: a long command'; echo /some/image;;\n\
         build) echo '{{\"reason\":\"compiler-artifact\",\"executable\":null}}'\n\
         echo '{{\"reason\":\"compiler-artifact\",\"executable\":\"{}\"}}'\n\
         echo '{{\"reason\":\"build-finished\",\"success\":true}}';;\n\
         esac\n",
        folder.join("fake-board").display()
    );
    for verbose in [false, true] {
        let mut arguments = vec!["--seed", "3"];
        arguments.extend(verbose.then_some("--verbose"));
        let output = board(&folder, &cargo, &arguments);
        let (out, err) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{err}");
        let given = arguments.join(" ");
        assert_eq!(out, format!("board {given} --elf /some/image\n"));
        assert!(err.contains("firmware: rebuilt where its source has changed"), "{err}");
        assert_eq!(err.contains("a long command"), verbose, "{err}");
    }
}

#[test]
fn a_build_that_fails_is_named() {
    let output = board(&folder("failing"), "echo no compiler >&2; exit 101\n", &[]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    for said in ["no compiler", "build of the firmware", "101"] {
        assert!(error.contains(said), "{said} is not in {error}");
    }
}

#[test]
fn a_cargo_that_does_not_run_is_named() {
    for arguments in [&["board"][..], &["board", "--elf", "some.elf"]] {
        let output = hil_sim(&folder("no-cargo"), arguments);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.contains("cargo"), "{error}");
    }
}
