//! The battery with the drive of an earlier commit, on the plants of an independent study of that drive: does it fail on
//! our plants as it failed there? Prints a page of documentation; fails if a finding is not reproduced.

mod cases;
mod drive;

use anyhow::{Result, ensure};
use hil_sim::Config;
use hil_sim::config::plant_settings;
use hil_sim::experiments::battery::{KINDS, RUNS, Summary, Trial, learned, seed_of, trial};
use rayon::prelude::*;

use cases::{CASES, Case};
use drive::Before;

const SEED: u64 = 1;

/// Text above the table.
const HEAD: &str = include_str!("head.md");

fn main() -> Result<()> {
    let only = std::env::args().nth(1).unwrap_or_default();
    let config = Config::default();
    println!("{}", HEAD.trim_end());
    println!("\n| finding | plant, tables of the drive | study, on its plants | here |");
    println!("|---|---|---|---|");
    let mut failed = Vec::new();
    for case in CASES.iter().filter(|case| case.name.contains(&only)) {
        let summary = run(case, &config)?;
        let Case { finding, name, study, .. } = case;
        println!("| {finding} | {name} | {study} | {} |", text(&summary));
        if !(case.holds)(&summary) {
            failed.push(case.name);
        }
    }
    ensure!(failed.is_empty(), "not reproduced: {}", failed.join("; "));
    Ok(())
}

fn run(case: &Case, config: &Config) -> Result<Summary> {
    let mut plant = case.plant(&plant_settings(config))?;
    let mut drive = Ok(Before::new(config)?);
    if let (Some(after), Ok(unlearned)) = (case.learned, &drive) {
        drive = learned(config, &plant, unlearned.clone(), SEED)?;
        after(&mut plant);
    }
    let kinds = if case.kinds.is_empty() { &KINDS[..] } else { case.kinds };
    let one = |number: usize| {
        let (kind, seed) = (kinds[number % kinds.len()], seed_of(SEED, number));
        match &drive {
            Ok(drive) => trial(config, &plant, drive, kind, seed),
            Err(fault) => Ok(Trial::refused(kind, seed, *fault)),
        }
    };
    let trials: Vec<Trial> = (0..RUNS).into_par_iter().map(one).collect::<Result<_, _>>()?;
    Ok(Summary::of(&trials))
}

/// A summary in words, in the order of the study.
fn text(s: &Summary) -> String {
    let mut parts = Vec::new();
    if s.error.count() > 0 {
        let (rms, p99, largest) = (s.error.rms(), s.p99_deg, s.error.largest());
        parts.push(format!("{rms:.2} rms, {p99:.1} / {largest:.1}; {} lost", s.lost));
        parts.push(lasting("wrong", s.wrong));
        parts.push(lasting("flux off", s.flux_off));
        let trips: Vec<_> =
            s.trips.iter().map(|(fault, runs)| format!("{fault}: {runs}")).collect();
        parts.push(if trips.is_empty() {
            "0 trips".into()
        } else {
            format!("trips {}", trips.join(", "))
        });
    }
    parts.extend(s.refused.iter().map(|(fault, runs)| format!("{runs} refused by {fault}")));
    parts.join(", ")
}

fn lasting(what: &str, (runs, longest): (usize, f64)) -> String {
    if runs == 0 { format!("0 {what}") } else { format!("{runs} {what} ({longest:.2} s)") }
}
