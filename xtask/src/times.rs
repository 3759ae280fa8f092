//! Tests with the time that each of their modules takes.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use crate::{budget, run};

/// Modules below this many seconds are not listed.
const LISTED: f64 = 3.0;

/// Runs a command `cargo test` that has no options for the tests themselves; lists the slow modules.
pub fn test(name: &str, command: Command) -> Result<()> {
    beside_simulated(name, command, Path::new(""))
}

/// As [`test()`]; also shows the simulated time of each test beside its run time. The tests append the simulated seconds to a file.
pub fn beside_simulated(name: &str, mut command: Command, simulated: &Path) -> Result<()> {
    // A stable harness shows times only with this variable. As a runner's variable it does not reach the compiler.
    let host = run::output("rustc", &["--print", "host-tuple"])?.to_uppercase().replace('-', "_");
    command.env(format!("CARGO_TARGET_{host}_RUNNER"), "env RUSTC_BOOTSTRAP=1");
    command.args(["--", "-Zunstable-options", "--report-time"]).stdout(Stdio::piped());
    println!("\n==> {name}: {}", run::shown(&command));
    let began = Instant::now();
    let mut child = command.spawn().with_context(|| format!("cannot run: {command:?}"))?;
    let mut modules: BTreeMap<String, f64> = BTreeMap::new();
    for line in BufReader::new(child.stdout.take().context("no output")?).lines() {
        let line = line?;
        let Some((test, seconds)) = time_of(&line) else {
            println!("{line}");
            continue;
        };
        let module = test.split_once("::").map_or(test, |(module, _)| module);
        *modules.entry(module.to_owned()).or_default() += seconds;
        match simulated_s(simulated, Some(test)) {
            0.0 => println!("{line}"),
            simulated => println!("{line}  {simulated:.1} s simulated"),
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
    let all = simulated_s(simulated, None);
    if all > 0.0 {
        println!("{name}: {all:.0} s simulated in all");
    }
    println!("    {name}: done in {:.0} s", began.elapsed().as_secs_f64());
    ensure!(status.success(), "{name}, {status}\n    {command:?}");
    Ok(())
}

/// Test and seconds, from a line such as `test drive::tests::a_start ... ok <1.200s>`.
fn time_of(line: &str) -> Option<(&str, f64)> {
    let (test, result) = line.strip_prefix("test ")?.split_once(" ... ")?;
    let seconds = result.rsplit_once('<')?.1.strip_suffix("s>")?;
    Some((test, seconds.parse().ok()?))
}

/// The sum of the lines `TEST SECONDS` of a file, for one test or for all; 0 if there is no such file.
fn simulated_s(file: &Path, test: Option<&str>) -> f64 {
    let text = fs::read_to_string(file).unwrap_or_default();
    let lines = text.lines().filter_map(|line| line.rsplit_once(' '));
    let of_it = lines.filter(|(name, _)| test.is_none_or(|test| *name == test));
    of_it.filter_map(|(_, seconds)| seconds.parse::<f64>().ok()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_harness_are_read() {
        assert_eq!(time_of("test a::b::c ... ok <1.200s>"), Some(("a::b::c", 1.2)));
        assert_eq!(
            time_of("test a - should panic ... ok <0.100s>"),
            Some(("a - should panic", 0.1))
        );
        assert_eq!(time_of("test a::b ... ignored, why"), None);
    }

    #[test]
    fn the_boards_of_a_test_add_up() {
        let file = std::env::temp_dir().join(format!("simulated-{}", std::process::id()));
        fs::write(&file, "a::b 1.5\nc 4\na::b 2\n").unwrap();
        assert_eq!((simulated_s(&file, Some("a::b")), simulated_s(&file, None)), (3.5, 7.5));
        fs::remove_file(&file).unwrap();
        assert_eq!(simulated_s(&file, None), 0.0);
    }
}
