//! The battery with the drive of an earlier commit, on the plants of an independent study of that drive: does it fail on
//! our plants as it failed there? Prints a page of documentation; fails if a finding is not reproduced.

mod cases;
mod drive;

use anyhow::{Result, ensure};
use hil_sim::Config;
use hil_sim::config::plant_settings;
use hil_sim::experiments::battery::{Summary, Trial, learned, seed_of, trial};
use rayon::prelude::*;

use cases::{CASES, Case};
use drive::Before;

const SEED: u64 = 1;

/// Text above the table.
const HEAD: &str = include_str!("head.md");

fn main() -> Result<()> {
    let only = std::env::args().nth(1).unwrap_or_default();
    println!("{}", HEAD.trim_end());
    println!("\n| finding | plant, tables of the drive | study, on its plants | here |");
    println!("|---|---|---|---|");
    let mut failed = Vec::new();
    for case in CASES.iter().filter(|case| case.name.contains(&only)) {
        let summary = run(case)?;
        let Case { finding, name, study, .. } = case;
        println!("| {finding} | {name} | {study} | {} |", text(&summary));
        if !(case.holds)(&summary) {
            failed.push(case.name);
        }
    }
    ensure!(failed.is_empty(), "not reproduced: {}", failed.join("; "));
    Ok(())
}

fn run(case: &Case) -> Result<Summary> {
    let mut set: Vec<String> = case.set.iter().map(|&set| set.to_owned()).collect();
    let config = Config::load(None, None, &set)?;
    let mut plant = plant_settings(&config);
    let mut drive = Ok(Before::new(&config)?);
    if let (Some(after), Ok(unlearned)) = (case.learned, &drive) {
        drive = learned(&config, &plant, unlearned.clone(), SEED)?;
        set.extend(after.iter().map(|&set| set.to_owned()));
        plant = plant_settings(&Config::load(None, None, &set)?);
    }
    let one = |number: usize| {
        let (kind, seed) = (case.kinds[number % case.kinds.len()], seed_of(SEED, number));
        match &drive {
            Ok(drive) => trial(&config, &plant, drive, kind, seed),
            Err(fault) => Ok(Trial::refused(kind, seed, *fault)),
        }
    };
    let trials: Vec<Trial> = (0..case.runs).into_par_iter().map(one).collect::<Result<_, _>>()?;
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
