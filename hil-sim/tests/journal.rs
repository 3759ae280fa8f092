//! Stored runs of statistical experiments: continued runs that give the whole, byte for byte; refusals; records.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::cli_common::{folder, hil_sim, object, text};

/// Every statistical experiment, with options that make it small.
const SMALL: [(&str, &str); 8] = [
    ("monte-carlo", "--set runs=7 --seconds 0.2 --set spread.motor=0.1 --set drive.motor.r_s=5"),
    ("machines", "--set runs=2 --set spread.machine=1.5 --seconds 0.2"),
    ("commission", "--set runs=4"),
    ("commission-refusals", "--set runs=1"),
    ("battery", "--set runs=14 --set disturbed.drawn=0.5 --set after.motor.r_r=1.2"),
    ("full-range", "--set runs=1 --set full_range.kind=constant --set angle_source=encoder"),
    ("lock-monitor", "--set runs=1"),
    ("foreign-motors", "--set runs=3"),
];

/// A small run whose outcome depends on every record.
const MONTE_CARLO: &[&str] = &["run", "monte-carlo", "--set", "runs=6", "--seconds", "0.1", "-q"];

fn run(folder: &Path, name: &str, options: &[&str], more: &[&str]) -> Vec<u8> {
    let output = hil_sim(folder, &[&["run", name, "-q"], options, more].concat());
    assert!(output.stderr.is_empty(), "{name}: {}", text(&output.stderr));
    output.stdout
}

#[test]
fn every_statistical_experiment_is_in_the_list() {
    for experiment in hil_sim::experiments::EXPERIMENTS.iter() {
        let is_stored = SMALL.iter().any(|(name, _)| *name == experiment.name);
        assert_eq!(experiment.study.is_some(), is_stored, "{}", experiment.name);
        // The runs of all experiments with a number of runs can be stored.
        let takes_runs = experiment.uses.contains(&"runs");
        assert!(!takes_runs || is_stored, "{}", experiment.name);
    }
}

/// Whether even its smallest run takes ten seconds.
fn is_long(name: &str) -> bool {
    name == "foreign-motors"
}

/// Interrupts each experiment after the first third of its runs, and compares the continued run with an uninterrupted
/// one: percentiles, tables, figures and all.
fn continued_runs_are_the_whole_run(which: impl Fn(&str) -> bool) {
    for (name, options) in SMALL.into_iter().filter(|(name, _)| which(name)) {
        let options: &[&str] = &options.split(' ').collect::<Vec<_>>();
        let folder = folder(&format!("journal-{name}"));
        let journal = ["--json", "--seed", "5", "--resume", "runs.jsonl"];
        let whole = run(&folder, name, options, &journal[..3]);
        assert_eq!(text(&run(&folder, name, options, &journal)), text(&whole), "{name}");
        let path = folder.join("runs.jsonl");
        let kept = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = kept.split_inclusive('\n').collect();
        let (head, runs) = lines.split_first().unwrap();
        // In another order.
        let stored = runs[..runs.len().div_ceil(3)].iter().rev().copied();
        let stored: String = std::iter::once(*head).chain(stored).collect();
        std::fs::write(&path, &stored).unwrap();
        assert_eq!(text(&run(&folder, name, options, &journal)), text(&whole), "{name}");
        let continued = std::fs::read_to_string(&path).unwrap();
        assert!(continued.starts_with(&stored), "{name}: stored runs are not done again");
        assert_eq!(continued.lines().count(), lines.len(), "{name}");
    }
}

#[test]
fn continued_runs_are_the_whole_run_byte_for_byte() {
    continued_runs_are_the_whole_run(|name| !is_long(name));
}

#[test]
#[ignore = "cargo xtask prove long-tests"]
fn continued_runs_of_the_long_experiments_are_the_whole_run() {
    continued_runs_are_the_whole_run(is_long);
}

/// A file is refused by its name, and left as it is, if it belongs to another run.
#[test]
fn files_of_other_runs_are_refused_by_name() {
    let folder = folder("journal-refused");
    let resume = [MONTE_CARLO, &["--json", "--resume", "runs.jsonl"]].concat();
    hil_sim(&folder, &resume);
    let path = folder.join("runs.jsonl");
    let kept = std::fs::read_to_string(&path).unwrap();
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    let refused = |text: &str, more: &[&str], part: &str| {
        std::fs::write(&path, text).unwrap();
        let output = hil_sim(&folder, &[&resume[..], more].concat());
        let message = self::text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("runs.jsonl") && message.contains(part), "{part}: {message}");
        assert!(output.stdout.is_empty() && std::fs::read_to_string(&path).unwrap() == text);
    };
    refused(&kept, &["--set", "motor.r_s=6"], "motor.r_s is 6, there not set");
    refused(&kept, &["--set", "runs=7"], "runs is 7, there 6");
    refused(&kept.replace(&version, "\"version\":\"0.0.7\""), &[], "there 0.0.7");
    refused(&kept.replace("\"sources\":\"", "\"sources\":\"0"), &[], "there 0");
    refused(&kept.replace("\"run\":4", "\"run\":6"), &[], "no record of this run");
}

/// The records of the file count: a changed record appears in the outcome, so its run was not done again; a torn one is.
#[test]
fn finished_runs_are_not_done_again_and_a_torn_line_is() {
    let folder = folder("journal-resume");
    let whole = hil_sim(&folder, &[MONTE_CARLO, &["--json"]].concat()).stdout;
    let resumed =
        || hil_sim(&folder, &[MONTE_CARLO, &["--json", "--resume", "runs/kept.jsonl"]].concat());
    let first = resumed();
    assert_eq!((text(&first.stdout), text(&first.stderr)), (text(&whole), ""));
    let path = folder.join("runs/kept.jsonl");
    let kept = std::fs::read_to_string(&path).unwrap();
    assert_eq!(kept.lines().count(), 7, "a head and six runs");

    let marked = kept.replacen("\"lost\":false", "\"lost\":true", 1);
    std::fs::write(&path, &marked).unwrap();
    let output = resumed();
    assert_eq!(object(&output)["metrics"]["lost_runs"], 1.0);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), marked);

    std::fs::write(&path, &kept[..kept.len() - 30]).unwrap();
    let output = resumed();
    assert_eq!(text(&output.stdout), text(&whole));
    let note = "runs/kept.jsonl, line 7, was torn; its run is done again";
    assert!(text(&output.stderr).contains(note), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), kept);

    let other = ["--json", "--resume", "runs/kept.jsonl", "--seed", "2"];
    let output = hil_sim(&folder, &[MONTE_CARLO, &other].concat());
    let message = text(&output.stderr);
    assert!(
        message.contains("here seed is 2, there 1") && output.status.code() == Some(2),
        "{message}"
    );
}

#[test]
#[cfg(unix)]
fn an_interrupt_says_how_many_runs_are_kept() {
    let folder = folder("journal-interrupt");
    let mut long = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
    long.current_dir(&folder).args(MONTE_CARLO).args(["--set", "runs=90000", "--resume", "kept"]);
    let child = long.stderr(Stdio::piped()).spawn().unwrap();
    while std::fs::metadata(folder.join("kept")).map_or(0, |kept| kept.len()) < 2000 {
        std::thread::yield_now();
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(text(&output.stderr).contains("of 90000 runs; the same command"), "{output:?}");
    assert_eq!(output.status.code(), Some(130));
}

/// The file has the random values and the results of each run, by the names that the documentation explains.
#[test]
fn records_of_runs_can_be_analysed() {
    let folder = folder("journal-records");
    let all = hil_sim(&folder, &[MONTE_CARLO, &["--json", "--resume", "runs.jsonl"]].concat());
    assert_eq!(all.status.code(), Some(0), "{}", text(&all.stderr));
    let kept = std::fs::read_to_string(folder.join("runs.jsonl")).unwrap();
    let mut runs: Vec<serde_json::Value> =
        kept.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect();
    runs.sort_by_key(|run| run["run"].as_u64());
    assert_eq!(runs.len(), 6);
    let third = &runs[2]["record"];
    assert_eq!((&runs[2]["run"], &third["case"]["seed"]), (&2.into(), &1_000_005.into()));
    assert!((0.5..=3.0).contains(&third["case"]["iq_a"].as_f64().unwrap().abs()));
    let page = include_str!("../../docs/simulator.md");
    for (name, value) in third.as_object().unwrap() {
        let inner = value.as_object().into_iter().flatten();
        let names = inner.map(|(inner, _)| format!("`{name}.{inner}`")).collect::<Vec<_>>();
        let names = if names.is_empty() { vec![format!("`{name}`")] } else { names };
        assert!(names.iter().all(|name| page.contains(name)), "{names:?}");
    }
    // The worst of the records is the worst of the result.
    let rms = |run: &serde_json::Value| {
        let of = |name: &str| run["record"]["error"][name].as_f64().unwrap();
        (of("squares") / of("count")).sqrt()
    };
    let worst = runs.iter().map(rms).fold(0.0, f64::max);
    assert_eq!(object(&all)["metrics"]["worst_run_rms_deg"], worst);
    let output = hil_sim(&folder, &["run", "torque-steps", "--resume", "x.jsonl"]);
    assert!(text(&output.stderr).contains("does not consist of independent runs"));
}
