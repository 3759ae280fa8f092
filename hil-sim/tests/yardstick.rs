//! Recorded statistics of the drive: the JSON must stay the same, to the last digit.
//!
//! A change that keeps the control keeps these statistics. They depend on the mathematics library, so they are checked
//! only after a change of the control:
//!
//! ```text
//! cargo test --release -p hil-sim yardstick -- --ignored
//! ```
//!
//! `YARDSTICK=write` records them again; the commit that does so states why.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

use serde_json::Value;

use crate::same_json::difference;

const HIGH_FLUX: [&str; 6] =
    ["--set", "flux_level=high", "--set", "sequence.flux=high", "--set", "prepare.learn=yes"];

/// Returns the recorded file, and the arguments of the run.
fn runs() -> Vec<(String, Vec<String>)> {
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let mut runs = Vec::new();
    for seed in 1..=3 {
        let line = format!("full-range --set runs=2 --seed {seed}");
        runs.push((format!("full-range-{seed}"), words(&line)));
    }
    runs.push(("monte-carlo".into(), words("monte-carlo --set runs=24 --seed 1")));
    for plant in ["r", "g7", "m4b"] {
        let mut all = words(&format!("battery --plant {plant} --set runs=48 --seed 4"));
        all.extend(HIGH_FLUX.map(str::to_owned));
        runs.push((format!("battery-{plant}"), all));
    }
    runs
}

#[test]
#[ignore = "its digits are those of one mathematics library"]
fn statistics_are_as_recorded() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recorded");
    let writes = env::var("YARDSTICK").is_ok_and(|value| value == "write");
    let mut differ = Vec::new();
    for (name, arguments) in runs() {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
        let output = command.args(["run", "--json", "--quiet"]).args(&arguments).output().unwrap();
        let object = |text: &[u8]| -> Value {
            let error = String::from_utf8_lossy(&output.stderr);
            serde_json::from_slice(text).unwrap_or_else(|why| panic!("{name}: {why}: {error}"))
        };
        let (file, now) = (folder.join(format!("{name}.json")), object(&output.stdout));
        if writes {
            fs::write(&file, &output.stdout).unwrap();
        }
        differ.extend(difference(&name, &now, &object(&fs::read(&file).unwrap())));
    }
    assert!(differ.is_empty(), "{}", differ.join("\n"));
}
