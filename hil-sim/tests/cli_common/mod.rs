//! Runs the program as a user does.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub fn hil_sim(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
    // There is no cargo, so nothing is built.
    command
        .env("CARGO", "/nonexistent/cargo")
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("the binary runs")
}

/// Returns an empty folder for a test.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    folder
}

pub fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder can be read");
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

/// Parses the JSON on standard output.
pub fn object(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).expect("one object")
}
