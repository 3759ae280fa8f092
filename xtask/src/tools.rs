//! Programs from crates.io that do not come with cargo, and their tasks.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::{run, sources};

/// Least share of the viable mutants that the tests must catch.
const CAUGHT: f64 = 0.9;

/// `cargo xtask book`: builds the pages in `docs/`; returns their folder.
pub fn book() -> Result<PathBuf> {
    let docs = run::root().join("docs");
    ensure!(docs.join("book.toml").is_file(), "there is no book: docs/book.toml is missing");
    let html = run::target_dir()?.join("book");
    let mdbook = tool("mdbook", "0.5.4")?;
    run::step("book", run::command(mdbook).arg("build").arg(docs).arg("--dest-dir").arg(&html))?;
    println!("\n{}", html.join("index.html").display());
    Ok(html)
}

/// `cargo xtask mutants`: changes `drive-core` in the places of one shard, `K/N`, and runs unit tests, filters and
/// procedures on each change; fails if they catch too few.
pub fn mutants(shard: &str) -> Result<()> {
    let output = run::folder("mutants")?;
    let mut command = run::command(tool("cargo-mutants", "27.1.0")?);
    command
        .args(["mutants", "--package", "induction-drive-core", "--test-tool", "cargo", "-j2"])
        .args(["--exclude", "**/tests.rs", "--exclude", "**/tests/**"])
        // A baseline would run only the tests of the first package.
        .args(["--test-package", "induction-drive-core,induction-drive", "--baseline", "skip"])
        .args(["--timeout", "300", "--sharding", "round-robin", "--shard", shard, "--output"])
        .arg(&output)
        .args(["--", "--lib", "--test", "filters", "--test", "procedures"])
        // With one target directory the two would wait for each other.
        .env_remove("CARGO_TARGET_DIR");
    // Missed mutants are judged below. Any code other than 0, missed (2) or time-out (3) is a failure.
    let status = command.status().context("cargo-mutants")?;
    ensure!(matches!(status.code(), Some(0 | 2 | 3)), "cargo-mutants: {status}");
    let results = output.join("mutants.out");
    let outcomes: Value = serde_json::from_str(&sources::read(results.join("outcomes.json"))?)?;
    let count = |kind: &str| outcomes[kind].as_f64().with_context(|| format!("no number {kind}"));
    let (caught, missed) = (count("caught")? + count("timeout")?, count("missed")?);
    let viable = caught + missed;
    println!("\nmissed:\n{}", sources::read(results.join("missed.txt"))?);
    println!("caught: {caught} of {viable}, {} of them by time-out", count("timeout")?);
    ensure!(caught >= CAUGHT * viable, "{caught} of {viable} are under {:.0} %", 100.0 * CAUGHT);
    Ok(())
}

/// Finds or builds a program of crates.io, in the target directory.
fn tool(name: &str, version: &str) -> Result<PathBuf> {
    let root = run::target_dir()?.join("tools").join(format!("{name}-{version}"));
    let program = root.join("bin").join(name);
    if !program.is_file() {
        println!(
            "\n{name} {version} is missing: cargo builds it from crates.io into {}",
            root.display()
        );
        let install = format!("install {name} --version {version} --locked --root");
        run::step(name, run::cargo(&install).arg(&root))?;
    }
    Ok(program)
}
