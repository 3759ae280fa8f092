//! `cargo xtask fuzz`: each fuzz target for some minutes, with the stock toolchain.
//!
//! libFuzzer needs no nightly compiler: its instrumentation is a pass of LLVM that rustc takes by
//! name. (The address sanitizer would; the fuzzed code has no `unsafe`.)

use std::process::Command;

use anyhow::Result;

use crate::run;

/// The files in `fuzz/fuzz_targets`.
const TARGETS: [&str; 3] = ["console", "settings", "stream"];

/// Flags of the instrumentation: counters at every edge, and the comparisons.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 --cfg fuzzing";

/// Fuzzes each target for `seconds`.
pub fn fuzz(seconds: u32) -> Result<()> {
    TARGETS.iter().try_for_each(|name| run::step(name, &mut command(name, seconds)?))
}

/// The command that fuzzes one target for `seconds`, and goes on from the inputs found so far.
fn command(name: &str, seconds: u32) -> Result<Command> {
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let corpus = run::folder(format!("fuzz/corpus/{name}"))?;
    let findings = run::folder(format!("fuzz/findings/{name}"))?;
    // With a target named, the flags are not for build scripts.
    let mut command = run::cargo(&format!("run --release --bin {name} --target {host}"));
    command
        .current_dir(run::root().join("fuzz"))
        .env("RUSTFLAGS", FLAGS)
        .arg("--target-dir")
        .arg(run::folder("fuzz")?)
        .arg("--")
        .arg(&corpus)
        .arg(format!("-artifact_prefix={}/", findings.display()))
        .args([format!("-max_total_time={seconds}"), "-max_len=4096".into()]);
    Ok(command)
}
