//! `cargo xtask fuzz`: runs each fuzz target for some minutes, with the stock toolchain.
//!
//! libFuzzer needs no nightly compiler: its instrumentation is a pass of LLVM that rustc takes by name. (The address sanitizer would need
//! one; the fuzzed code has no `unsafe`.)

use std::fs::{self, File};
use std::process::{Command, Stdio};

use anyhow::{Result, ensure};

use crate::run;

/// The files in `fuzz/fuzz_targets`.
const TARGETS: [&str; 6] = ["bus", "console", "files", "restore", "settings", "stream"];

/// Flags of the instrumentation: counters at every edge, and the comparisons.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 --cfg fuzzing";

/// Fuzzes each target for `seconds`, two at a time.
pub fn fuzz(seconds: u32) -> Result<()> {
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    // If a target is named, the flags are not used for build scripts.
    let mut build = run::cargo(&format!("build --release --bins --target {host} --target-dir"));
    build.current_dir(run::root().join("fuzz")).env("RUSTFLAGS", FLAGS).arg(run::folder("fuzz")?);
    run::step("fuzz targets", &mut build)?;
    for some in TARGETS.chunks(2) {
        println!("\n==> fuzzing for {seconds} s: {}", some.join(", "));
        let run = |name: &&'static str| {
            let log = run::folder("fuzz/log")?.join(name);
            let mut command = command(name, &host, seconds)?;
            let child = command.stdout(Stdio::null()).stderr(File::create(&log)?).spawn()?;
            Ok((*name, child, log))
        };
        for (name, mut child, log) in some.iter().map(run).collect::<Result<Vec<_>>>()? {
            let status = child.wait()?;
            let told = String::from_utf8_lossy(&fs::read(&log)?).into_owned();
            ensure!(status.success(), "{name}, {status}\n{told}");
            println!("    {name}: {}", told.lines().last().unwrap_or_default());
        }
    }
    Ok(())
}

/// The command that fuzzes one target for `seconds`, and continues from the inputs found so far.
fn command(name: &str, host: &str, seconds: u32) -> Result<Command> {
    let corpus = run::folder(format!("fuzz/corpus/{name}"))?;
    let findings = run::folder(format!("fuzz/findings/{name}"))?;
    let mut command = run::command(run::target_dir()?.join(format!("fuzz/{host}/release/{name}")));
    command.arg(&corpus).arg(format!("-artifact_prefix={}/", findings.display()));
    command.args([format!("-max_total_time={seconds}"), "-max_len=4096".into()]);
    Ok(command)
}
