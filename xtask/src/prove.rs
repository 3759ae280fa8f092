//! `cargo xtask prove`: long proofs in shards, not part of the test.
//!
//! The output of each finished shard is kept in `target/prove/NAME/COMMIT/`. A later call goes on with
//! the missing ones. With `K/N` it does the Kth of N parts, so that N machines share a proof.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::{board, fuzz, image, run, toolchain};

/// Faults of a shard of the campaign, and shards of a speed, rpm.
const FAULTS: u32 = 100;
const CAMPAIGN: u32 = 20;
const SPEEDS: [Option<u32>; 4] = [None, Some(900), Some(1800), Some(3000)];
/// Seconds of a shard of fuzzing.
const FUZZ_S: u32 = 300;
/// Runs of a shard of the lock monitor.
const RUNS: u32 = 100;
/// Iron that is warmer than it was while the drive learned. The flux stands where that looks most like a drift of the gains: a follower
/// that takes it for one moves the angle by 3.4° on `r` and 5.6° on `g7`; at 30° by 0.6°.
const STANDSTILL: &str = "--set flux_level=high --set sequence.flux=high --set record.minutes=40 \
    --set record.flux_deg=75 --set record.reversal_s=10 \
    --set after.motor.r_r=1.43 --set after.motor.r_s=6.48";

/// A proof in shards.
struct Proof {
    name: &'static str,
    about: &'static str,
    shards: u32,
    /// The command of a shard, counted from 0.
    command: fn(u32) -> Result<Command>,
    /// Metrics in its `--json` output, by names with spaces between, and the least and the largest value.
    bounds: &'static [(&'static str, f64, f64)],
}

const PROOFS: [Proof; 7] = [
    Proof {
        name: "monte-carlo",
        about: "1000 random operating points each within 150, 300 and 600 rpm: angle error, none lost",
        shards: 3,
        command: |shard| {
            let speed = format!("load.speed_rpm={}", [150, 300, 600][shard as usize]);
            simulation(&format!("monte-carlo --seed 19322 --set runs=1000 --set {speed}"))
        },
        bounds: &[("lost_runs", 0.0, 0.0), ("angle_error_rms_deg", 0.8, 1.2)],
    },
    Proof {
        name: "campaign",
        about: "2000 faults at low speed, and at 900, 1800 and 3000 rpm: outputs off in time, or control correct",
        shards: CAMPAIGN * SPEEDS.len() as u32,
        command: |shard| {
            let rpm = SPEEDS[(shard / CAMPAIGN) as usize];
            faults(shard % CAMPAIGN, rpm).command(&image::build()?, image::REFERENCE)
        },
        bounds: &[],
    },
    Proof {
        name: "boards",
        about: "200 faults on every other board",
        shards: 4,
        command: |shard| {
            let boards = image::boards()?;
            let board = &boards[1 + shard as usize / 2];
            let elf = image::build_for(&toolchain::for_target()?, board)?;
            faults(shard % 2, None).command(&elf, board)
        },
        bounds: &[],
    },
    Proof {
        name: "lock-monitor",
        about: "5 forced angles 1000 times each, 10 000 sound runs: found in time, no false alarm",
        shards: 10,
        command: |shard| {
            simulation(&format!("lock-monitor --seed {} --set runs={RUNS}", 1 + shard))
        },
        bounds: &[
            ("not_in_time_p90 not_in_time_m90 not_in_time_p120 not_in_time_m120", 0.0, 0.0),
            ("not_in_time_180 false_alarms over_speed_late wrong_starts refused_at_rest", 0.0, 0.0),
        ],
    },
    Proof {
        name: "saliency-check",
        about: "1000 starts each: accepted with half of the saliency, refused with a tenth or none",
        shards: 1,
        command: |_| {
            Ok(run::cargo(
                "test --release --test procedures saliency_check -- --ignored --nocapture",
            ))
        },
        bounds: &[],
    },
    Proof {
        name: "standstill",
        about: "the drive's whole torque of either sign at zero stator frequency for 40 minutes, rotor resistance +30 %, stator +20 %",
        shards: 3,
        command: |shard| {
            let family = ["r", "g7", "m4b"][shard as usize];
            simulation(&format!("record --seed 1 --plant {family} {STANDSTILL}"))
        },
        bounds: &[
            ("hold_drift_deg", 0.0, 1.0),
            ("hold_error_mean_deg", 0.0, 5.0),
            ("hold_lost", 0.0, 0.0),
        ],
    },
    Proof {
        name: "fuzz",
        about: "console and saved settings: one hour each, from the inputs found before",
        shards: 24,
        command: |shard| fuzz::command(fuzz::TARGETS[shard as usize % 2], FUZZ_S),
        bounds: &[],
    },
];

/// The faults of a shard of a campaign.
fn faults(shard: u32, rpm: Option<u32>) -> board::Faults {
    board::Faults { count: FAULTS, seed: 1 + shard * FAULTS, rpm }
}

fn simulation(arguments: &str) -> Result<Command> {
    let simulator = "run --release --package hil-sim -- run --json";
    Ok(run::cargo(&format!("{simulator} {arguments}")))
}

/// Prints the proofs and how many of their shards are done.
pub fn list() -> Result<()> {
    for proof in &PROOFS {
        let Proof { name, about, shards, .. } = proof;
        let results = results(proof)?;
        let done = results.iter().filter(|file| file.is_file()).count();
        println!("{name:<16}{done:>3} of {shards:>2} shards done   {about}");
    }
    Ok(())
}

/// Runs the missing shards of a part (`K/N`) of a proof; fails if one fails.
pub fn prove(name: &str, part: &str) -> Result<()> {
    let proof = PROOFS.iter().find(|proof| proof.name == name);
    let proof = proof.with_context(|| format!("no proof is named {name}: cargo xtask prove"))?;
    let changes = run::output("git", &["status", "--porcelain", "--untracked-files=no"]);
    ensure!(changes?.is_empty(), "commit first: results hold for a commit");
    let results = results(proof)?;
    for shard in shards(proof.shards, part)? {
        let done = &results[shard as usize];
        if !done.is_file() {
            let output = done.with_extension("unfinished");
            fs::create_dir_all(done.with_file_name(""))?;
            let mut command = (proof.command)(shard)?;
            command.stdout(File::create(&output)?);
            run::step(&format!("{name}, shard {} of {}", shard + 1, proof.shards), &mut command)?;
            judge(&fs::read_to_string(&output)?, proof.bounds)?;
            fs::rename(output, done)?;
        }
    }
    list()
}

/// The files of the results of all shards. They hold for one commit.
fn results(proof: &Proof) -> Result<Vec<PathBuf>> {
    let commit = run::output("git", &["rev-parse", "--short=10", "HEAD"])?;
    let dir = run::target_dir()?.join("prove").join(proof.name).join(commit);
    Ok((1..=proof.shards).map(|number| dir.join(format!("{number}.txt"))).collect())
}

/// The shards of a part, `K/N`: every Nth.
fn shards(count: u32, part: &str) -> Result<Vec<u32>> {
    let numbers = part.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    let (k, n): (u32, u32) = numbers.with_context(|| format!("{part} is no part: K/N"))?;
    ensure!((1..=n).contains(&k), "{part} is no part: K is from 1 to N");
    Ok((k - 1..count).step_by(n as usize).collect())
}

/// Fails if a metric in a `--json` output is outside its bounds.
fn judge(output: &str, bounds: &[(&str, f64, f64)]) -> Result<()> {
    for &(metrics, least, largest) in bounds {
        let json: Value = serde_json::from_str(output)?;
        for name in metrics.split(' ') {
            let value = json["metrics"][name].as_f64().with_context(|| format!("no {name}"))?;
            let is_inside = (least..=largest).contains(&value);
            ensure!(is_inside, "{name} is {value}, not {least} to {largest}");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_outside_its_bounds_fails() {
        let json = r#"{"experiment":"monte-carlo","metrics":{"lost_runs":0.0,"rms_deg":1.7}}"#;
        assert!(judge(json, &[("lost_runs", 0.0, 0.0), ("rms_deg", 1.6, 1.8)]).is_ok());
        let error = judge(json, &[("lost_runs rms_deg", 0.0, 1.6)]).unwrap_err().to_string();
        assert_eq!(error, "rms_deg is 1.7, not 0 to 1.6");
        assert!(judge(json, &[("rms", 0.0, 9.0)]).is_err());
        assert!(judge("a table", &[]).is_ok());
    }

    #[test]
    fn the_parts_of_a_proof_are_all_its_shards() {
        let mut all: Vec<u32> =
            (1..=3).flat_map(|k| shards(10, &format!("{k}/3")).unwrap()).collect();
        all.sort_unstable();
        assert_eq!(all, (0..10).collect::<Vec<_>>());
        assert!(["0/3", "4/3", "1/0", "3", "a/b"].iter().all(|part| shards(10, part).is_err()));
    }
}
