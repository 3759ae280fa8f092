//! The outcome of a whole run from its shards.

use serde_json::Value;

use super::Header;
use super::journal::Lines;
use crate::experiments::statistical;
use crate::prelude::*;

/// A whole run, merged from its shards.
pub struct Merged {
    /// The experiment.
    pub experiment: &'static Experiment,
    /// Its configuration.
    pub config: Config,
    /// Its seed.
    pub seed: u64,
    /// Its outcome, which equals that of a run in one piece.
    pub outcome: Outcome,
}

/// Merges the shards of one run; the order of the files does not matter.
///
/// # Errors
/// [`Error::Data`] with the file that is no shard, torn, from another run, or given twice; [`Error::Refused`] with the
/// missing shards.
pub fn merge(paths: &[PathBuf]) -> Result<Merged, Error> {
    let mut files: Vec<(&Path, Lines)> = Vec::new();
    for path in paths {
        let bytes = bounded::bytes(path, bounded::RUNS_MIB);
        let bytes = bytes.map_err(|e| data(path, e.to_string()))?;
        files.push((path, Lines::of(path, &bytes)?));
    }
    let Some((first_path, first)) = files.first() else {
        return Err(Error::Refused("there are no shards to merge".to_owned()));
    };
    let (first_path, header) = (*first_path, first.header.clone());
    let config = header.config()?;
    check_program(first_path, &header, &config)?;
    let mut places: BTreeMap<u32, &Path> = BTreeMap::new();
    let mut records: BTreeMap<usize, Value> = BTreeMap::new();
    for (path, file) in files {
        if let Some(difference) = file.header.difference(&header) {
            let there = first_path.display();
            return Err(data(path, format!("not of the same run as {there}: {difference}")));
        }
        let shard = file.header.shard;
        if let Some(before) = places.insert(shard.index, path) {
            return Err(data(path, format!("shard {shard} is in {} already", before.display())));
        }
        if let Some(line) = file.torn {
            let remedy = "do this shard again, or continue it with --resume";
            return Err(data(path, format!("line {line} is torn; {remedy}")));
        }
        records.extend(file.runs.into_iter().map(|run| (run.run, run.record)));
        let missing = shard.numbers(header.runs).filter(|run| !records.contains_key(run));
        // Only as many as are listed, because the number of runs comes from the file.
        let missing = missing.map(|run| run.to_string()).take(LISTED + 1).collect::<Vec<_>>();
        if !missing.is_empty() {
            return Err(data(path, format!("shard {shard} has not its runs {}", listed(&missing))));
        }
    }
    let count = header.shard.count;
    let missing = (1..=count).filter(|index| !places.contains_key(index));
    let missing: Vec<_> = missing.map(|index| format!("{index}/{count}")).collect();
    if !missing.is_empty() {
        let (number, some) = (missing.len(), listed(&missing));
        return Err(Error::Refused(format!("{number} of {count} shards are missing: {some}")));
    }
    let statistical = statistical(&header.experiment)?;
    let seed = header.seed;
    let context = Context::new(&config, seed, Progress::hidden());
    let outcome = (statistical.outcome)(&context, records.into_values().collect())?;
    Ok(Merged { experiment: statistical.experiment, config, seed, outcome })
}

/// Largest number of missing shards and runs in a message.
const LISTED: usize = 10;

/// Joins the first of these.
fn listed(all: &[String]) -> String {
    let more = if all.len() > LISTED { ", ..." } else { "" };
    format!("{}{more}", all[..all.len().min(LISTED)].join(", "))
}

/// Checks that this program made the shards, because it computes the outcome here.
fn check_program(path: &Path, header: &Header, config: &Config) -> Result<(), Error> {
    let own = Header::new(&header.experiment, config, header.seed, header.shard, header.runs)?;
    let what = "not made by this program, which has to merge it";
    let problem = |difference| Err(data(path, format!("{what}: {difference}")));
    header.difference(&own).map_or(Ok(()), problem)
}

fn data(path: &Path, problem: String) -> Error {
    Error::data(path, None, problem)
}
