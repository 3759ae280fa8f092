//! `cargo xtask fuzz`: each fuzz target for some minutes, with the stock toolchain.
//!
//! libFuzzer needs no nightly compiler: its instrumentation is a pass of LLVM that rustc takes by
//! name. (The address sanitizer would; there is no `unsafe` in what is fuzzed.)

use std::fs;

use anyhow::{Context, Result};

use crate::run::{self, Step};

/// What is fuzzed: the files in `fuzz/fuzz_targets`.
const TARGETS: [&str; 2] = ["console", "settings"];

/// Flags of the instrumentation: counters at every edge, and the comparisons.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 --cfg fuzzing";

/// Each target for `seconds`.
pub fn fuzz(seconds: u32) -> Result<()> {
    let dir = run::root().join("fuzz");
    let target_dir = run::target_dir()?.join("fuzz");
    let host = run::output("rustc", &["--print", "host-tuple"]).context("rustc does not run")?;
    for name in TARGETS {
        let corpus = target_dir.join("corpus").join(name);
        let findings = target_dir.join("findings").join(name);
        for dir in [&corpus, &findings] {
            fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        }
        // With a target named, the flags are not for build scripts.
        Step::new(name).run(
            run::cargo()()
                .current_dir(&dir)
                .env("RUSTFLAGS", FLAGS)
                .args(["run", "--release", "--bin", name, "--target", &host, "--target-dir"])
                .arg(&target_dir)
                .arg("--")
                .arg(&corpus)
                .arg(format!("-artifact_prefix={}/", findings.display()))
                .args([format!("-max_total_time={seconds}"), "-max_len=4096".into()]),
        )?;
    }
    Ok(())
}
