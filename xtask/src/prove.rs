//! `cargo xtask prove`: long proofs in shards, not part of the test. `xtask/proofs.toml` states them.
//!
//! The output of each finished shard is kept in `target/prove/NAME/COMMIT/`. A later call continues with the missing ones. With `K/N` it
//! does the Kth of N parts, so that N machines share a proof.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::Value;

use crate::results::{self, Outdated, outdated};
use crate::{run, sources};

/// The file of the proofs.
const FILE: &str = "xtask/proofs.toml";

/// All proofs.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Proofs {
    proof: Vec<Proof>,
}

/// A proof in shards: each command with each seed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Proof {
    name: String,
    about: String,
    /// Arguments of cargo; `{seed}` stands for the seed.
    commands: Vec<String>,
    #[serde(default = "one")]
    seeds: usize,
    /// Distance between seeds; the first is 1.
    #[serde(default = "one")]
    step: usize,
    /// Metrics of a shard: the least and the largest value.
    #[serde(default)]
    bounds: BTreeMap<String, [f64; 2]>,
}

fn one() -> usize {
    1
}

impl Proof {
    fn shards(&self) -> usize {
        self.commands.len() * self.seeds
    }

    /// The arguments of cargo for a shard, counted from 0.
    fn command(&self, shard: usize) -> String {
        let seed = 1 + shard % self.seeds * self.step;
        self.commands[shard / self.seeds].replace("{seed}", &seed.to_string())
    }
}

fn proofs() -> Result<Vec<Proof>> {
    let Proofs { proof } = toml::from_str(&sources::read(FILE)?).context(FILE)?;
    Ok(proof)
}

/// Prints the proofs and how many of their shards are done.
pub fn list() -> Result<()> {
    for proof in proofs()? {
        let (Proof { name, about, .. }, shards) = (&proof, proof.shards());
        let done = outputs(&proof)?;
        let done = done.iter().filter(|file| file.is_file()).count();
        println!("{name:<16}{done:>3} of {shards:>2} shards done   {about}");
    }
    for Outdated { name, command, is_automatic } in outdated()? {
        let copied = if is_automatic { "" } else { "; its numbers are copied by hand" };
        println!("results/{name}.json is older than its inputs: {command}{copied}");
    }
    Ok(())
}

/// Runs the missing shards of a part (`K/N`) of a proof, or measures a part of the older results again; fails if one fails.
pub fn prove(name: &str, part: &str) -> Result<()> {
    if name == "results" {
        let mut older = outdated()?;
        older.retain(|result| result.is_automatic);
        shards(older.len(), part)?.into_iter().try_for_each(|k| results::renew(&older[k]))?;
        return list();
    }
    let proof = proofs()?.into_iter().find(|proof| proof.name == name);
    let proof = proof.with_context(|| format!("no proof is named {name}: cargo xtask prove"))?;
    let changes = run::output("git", &["status", "--porcelain", "--untracked-files=no"]);
    ensure!(changes?.is_empty(), "commit first: results hold for a commit");
    let results = outputs(&proof)?;
    for shard in shards(proof.shards(), part)? {
        let done = &results[shard];
        if !done.is_file() {
            let output = done.with_extension("unfinished");
            fs::create_dir_all(done.with_file_name(""))?;
            let mut command = run::cargo(&proof.command(shard));
            command.stdout(File::create(&output)?);
            run::step(&format!("{name}, shard {} of {}", shard + 1, proof.shards()), &mut command)?;
            judge(&fs::read_to_string(&output)?, &proof.bounds)?;
            fs::rename(output, done)?;
        }
    }
    list()
}

/// The files of the results of all shards. They are valid for one commit.
fn outputs(proof: &Proof) -> Result<Vec<PathBuf>> {
    let commit = run::output("git", &["rev-parse", "--short=10", "HEAD"])?;
    let dir = run::target_dir()?.join("prove").join(&proof.name).join(commit);
    Ok((1..=proof.shards()).map(|number| dir.join(format!("{number}.txt"))).collect())
}

/// The shards of a part, `K/N`: every Nth.
fn shards(count: usize, part: &str) -> Result<Vec<usize>> {
    let numbers = part.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    let (k, n): (usize, usize) = numbers.with_context(|| format!("{part} is no part: K/N"))?;
    ensure!((1..=n).contains(&k), "{part} is no part: K is from 1 to N");
    Ok((k - 1..count).step_by(n).collect())
}

/// Fails if a metric in a `--json` output is outside its bounds.
fn judge(output: &str, bounds: &BTreeMap<String, [f64; 2]>) -> Result<()> {
    for (name, &[least, largest]) in bounds {
        let json: Value = serde_json::from_str(output)?;
        let value = json["metrics"][name].as_f64().with_context(|| format!("no {name}"))?;
        let is_inside = (least..=largest).contains(&value);
        ensure!(is_inside, "{name} is {value}, not {least} to {largest}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_outside_its_bounds_fails() {
        let json = r#"{"experiment":"monte-carlo","metrics":{"lost_runs":0.0,"rms_deg":1.7}}"#;
        let judged = |name: &str, bounds| judge(json, &BTreeMap::from([(name.to_owned(), bounds)]));
        assert!(judged("lost_runs", [0.0, 0.0]).is_ok() && judged("rms", [0.0, 9.0]).is_err());
        let error = judged("rms_deg", [0.0, 1.6]).unwrap_err().to_string();
        assert_eq!(error, "rms_deg is 1.7, not 0 to 1.6");
        assert!(judge("a table", &BTreeMap::new()).is_ok());
    }

    #[test]
    fn every_shard_has_its_command_and_its_seed() {
        let proofs = proofs().unwrap();
        let of = |name: &str| proofs.iter().find(|proof| proof.name == name).unwrap();
        assert_eq!(of("campaign").shards(), 80);
        assert_eq!(of("campaign").command(19), "xtask campaign 100 1901");
        assert_eq!(of("campaign").command(20), "xtask campaign 100 1 --rpm 900");
        let boards = crate::image::boards().unwrap();
        assert!(
            boards[1..]
                .iter()
                .all(|board| of("boards").commands.iter().any(|c| c.ends_with(board)))
        );
    }

    #[test]
    fn the_parts_of_a_proof_are_all_its_shards() {
        let mut all: Vec<usize> =
            (1..=3).flat_map(|k| shards(10, &format!("{k}/3")).unwrap()).collect();
        all.sort_unstable();
        assert_eq!(all, (0..10).collect::<Vec<_>>());
        assert!(["0/3", "4/3", "1/0", "3", "a/b"].iter().all(|part| shards(10, part).is_err()));
    }

    #[test]
    fn a_published_package_has_its_licences_and_the_one_address() {
        let read = |path: std::path::PathBuf| sources::read(path).unwrap_or_default();
        let address = "https://github.com/induction-drive/induction-drive";
        let citation = read("CITATION.cff".into());
        let version = format!("\nversion: {}\n", env!("CARGO_PKG_VERSION"));
        assert!(read("Cargo.toml".into()).contains(&format!("repository = \"{address}\"")));
        assert!(citation.contains(address) && citation.contains(&version));
        for manifest in sources::files("toml").unwrap() {
            let folder = manifest.parent().unwrap();
            let text = read(manifest.clone());
            if !manifest.ends_with("Cargo.toml") || text.contains("publish = false") {
                continue;
            }
            for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
                let (own, of_all) = (read(folder.join(name)), read(name.into()));
                assert!(own == of_all && !own.is_empty(), "{}: {name}", folder.display());
            }
            assert!(!read(folder.join("README.md")).is_empty(), "{}: README", folder.display());
        }
        for page in sources::files("md").unwrap() {
            let text = read(page.clone()).replace('\n', " ");
            for (at, _) in text.match_indices("github.com/induction-drive") {
                let near: String = text[at..].chars().take(130).collect();
                let is_ours = text[..at + 32].contains(address)
                    || near.contains("induction-drive/induction-drive");
                assert!(is_ours && near.contains("not public yet"), "{}: {near}", page.display());
            }
        }
    }
}
