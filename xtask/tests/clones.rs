//! Two clones that share a folder of build results: each tests itself.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A small package of the workspace, and its source.
const PACKAGE: &str = "fpu-sqrt";
const SOURCE: &str = "drive-core/sqrt/src/lib.rs";
/// Text that the second clone has in addition.
const FAILING: &str = "\n#[test]\nfn of_the_second_clone() {\n    panic!(\"on purpose\");\n}\n";

/// A copy of the tracked files.
fn clone(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let tracked = Command::new("git").arg("ls-files").current_dir(root).output().unwrap().stdout;
    for file in String::from_utf8(tracked).unwrap().lines() {
        let (from, to) = (root.join(file), copy.join(file));
        if from.is_file() {
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::copy(from, to).unwrap();
        }
    }
    copy
}

/// Whether the tests of a clone pass.
fn passes(clone: &Path, shared: &Path) -> bool {
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--package", PACKAGE, "--lib"]);
    command.current_dir(clone).env("CARGO_TARGET_DIR", shared);
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    // A failure must come from a test, not from the build.
    assert!(text.contains("test result: "), "{text}{}", String::from_utf8_lossy(&output.stderr));
    output.status.success()
}

/// The lines that `cargo xtask lines` counts in a clone, with a program that was built elsewhere.
fn lines(clone: &Path) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
    command.arg("lines").env("CARGO_MANIFEST_DIR", clone.join("xtask"));
    String::from_utf8(command.output().unwrap().stdout).unwrap()
}

#[test]
fn each_of_two_clones_with_one_target_directory_tests_itself() {
    let (whole, broken, shared) =
        (clone("whole"), clone("broken"), Path::new(env!("CARGO_TARGET_TMPDIR")).join("shared"));
    let source = broken.join(SOURCE);
    let text = fs::read_to_string(&source).unwrap();
    fs::write(source, text + FAILING).unwrap();
    for round in 1..=2 {
        assert!(
            passes(&whole, &shared),
            "round {round}: the first clone has run the second one's tests"
        );
        assert!(
            !passes(&broken, &shared),
            "round {round}: the second clone has run the first one's tests"
        );
    }
    assert_ne!(lines(&whole), lines(&broken), "a task has worked on another clone");
}
