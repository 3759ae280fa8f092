//! Tests with the time that each of their modules takes.

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use crate::{budget, run};

/// Modules below this many seconds are not listed.
const LISTED: f64 = 3.0;

/// Runs a command `cargo test` that has no options for the tests themselves; lists the slow modules.
pub fn test(name: &str, mut command: Command) -> Result<()> {
    // A stable harness shows times only with this variable. As a runner's it does not reach the compiler.
    let host = run::output("rustc", &["--print", "host-tuple"])?.to_uppercase().replace('-', "_");
    command.env(format!("CARGO_TARGET_{host}_RUNNER"), "env RUSTC_BOOTSTRAP=1");
    command.args(["--", "-Zunstable-options", "--report-time"]).stdout(Stdio::piped());
    println!("\n==> {name}: {}", run::shown(&command));
    let began = Instant::now();
    let mut child = command.spawn().with_context(|| format!("cannot run: {command:?}"))?;
    let mut modules: BTreeMap<String, f64> = BTreeMap::new();
    for line in BufReader::new(child.stdout.take().context("no output")?).lines() {
        let line = line?;
        println!("{line}");
        if let Some((module, seconds)) = time_of(&line) {
            *modules.entry(module.to_owned()).or_default() += seconds;
        }
    }
    let status = child.wait()?;
    let budget = budget::read()?.seconds.test_module;
    let mut modules: Vec<_> = modules.into_iter().filter(|(_, s)| *s > LISTED).collect();
    modules.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    println!("\n{name}: modules by seconds; the budget of each is {budget} on two quiet cores");
    for (module, seconds) in &modules {
        println!("{module:<30}{seconds:>8.1}{}", if *seconds > budget { "  above" } else { "" });
    }
    println!("    {name}: done in {:.0} s", began.elapsed().as_secs_f64());
    ensure!(status.success(), "{name}, {status}\n    {command:?}");
    Ok(())
}

/// Module of the first level and seconds, from a line such as `test drive::tests::a_start ... ok <1.200s>`.
fn time_of(line: &str) -> Option<(&str, f64)> {
    let (test, result) = line.strip_prefix("test ")?.split_once(" ... ")?;
    let seconds = result.rsplit_once('<')?.1.strip_suffix("s>")?;
    Some((test.split_once("::").map_or(test, |(module, _)| module), seconds.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_harness_are_read() {
        assert_eq!(time_of("test a::b::c ... ok <1.200s>"), Some(("a", 1.2)));
        assert_eq!(
            time_of("test a - should panic ... ok <0.100s>"),
            Some(("a - should panic", 0.1))
        );
        assert_eq!(time_of("test a::b ... ignored, why"), None);
    }
}
