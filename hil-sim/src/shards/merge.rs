//! The outcome of a whole run from its shards.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{Header, Shard, ShardFile};
use crate::config::Config;
use crate::error::Error;
use crate::experiments::{Context, Experiment, statistical};
use crate::outcome::Outcome;
use crate::progress::Progress;

/// A whole run, put together.
pub struct Merged {
    /// The experiment.
    pub experiment: &'static Experiment,
    /// Its configuration.
    pub config: Config,
    /// Its seed.
    pub seed: u64,
    /// Its outcome, the same as that of a run in one piece.
    pub outcome: Outcome,
}

/// Merges the shards of one run; the order of the files does not matter.
///
/// # Errors
/// [`Error::Data`] with the file that is no shard, torn, of another run, or there twice; [`Error::Refused`] with the
/// shards that are missing.
pub fn merge(paths: &[PathBuf]) -> Result<Merged, Error> {
    let files: Vec<(&Path, ShardFile)> =
        paths.iter().map(|path| Ok((path.as_path(), read(path)?))).collect::<Result<_, Error>>()?;
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
        let found: Vec<usize> = file.records.iter().map(|run| run.run).collect();
        check_runs(path, shard, &found, header.runs)?;
        records.extend(file.records.into_iter().map(|run| (run.run, run.record)));
    }
    let count = header.shard.count;
    let missing: Vec<String> = (1..=count)
        .filter(|index| !places.contains_key(index))
        .map(|index| format!("{index}/{count}"))
        .collect();
    if !missing.is_empty() {
        let (number, some) = (missing.len(), missing[..missing.len().min(LISTED)].join(", "));
        let more = if number > LISTED { ", ..." } else { "" };
        return Err(Error::Refused(format!(
            "{number} of {count} shards are missing: {some}{more}"
        )));
    }
    let statistical = statistical(&header.experiment)?;
    let (seed, seconds) = (header.seed, config.extent.seconds);
    let context =
        Context { config: &config, seed, seconds, progress: Progress::hidden(), file: None };
    let outcome = (statistical.outcome)(&context, records.into_values().collect())?;
    Ok(Merged { experiment: statistical.experiment, config, seed, outcome })
}

/// Missing shards and runs that a message lists.
const LISTED: usize = 10;

fn read(path: &Path) -> Result<ShardFile, Error> {
    let text = std::fs::read_to_string(path).map_err(|e| data(path, e.to_string()))?;
    serde_json::from_str(&text).map_err(|e| {
        let problem = match e.classify() {
            serde_json::error::Category::Eof => {
                "the file is torn: its end is missing; do this shard again".to_owned()
            }
            serde_json::error::Category::Data => {
                format!("not a shard, which `run NAME --shard I/N` prints: {e}")
            }
            _ => format!("not JSON: {e}"),
        };
        data(path, problem)
    })
}

/// Checks that this program is the one that made the shards: the outcome is computed here.
fn check_program(path: &Path, header: &Header, config: &Config) -> Result<(), Error> {
    let own = Header::new(&header.experiment, config, header.seed, header.shard, header.runs)?;
    match header.difference(&own) {
        Some(difference) => Err(data(
            path,
            format!("not made by this program, which has to merge it: {difference}"),
        )),
        None => Ok(()),
    }
}

/// Checks that a shard has each of its runs once.
fn check_runs(path: &Path, shard: Shard, found: &[usize], runs: usize) -> Result<(), Error> {
    let wanted: Vec<usize> = shard.numbers(runs).collect();
    if found == wanted {
        return Ok(());
    }
    let listed = |numbers: Vec<usize>| {
        let some = numbers[..numbers.len().min(LISTED)].iter().map(usize::to_string);
        let more = if numbers.len() > LISTED { ", ..." } else { "" };
        format!("{}{more}", some.collect::<Vec<_>>().join(", "))
    };
    let missing: Vec<usize> = wanted.iter().copied().filter(|run| !found.contains(run)).collect();
    let foreign: Vec<usize> = found.iter().copied().filter(|run| !wanted.contains(run)).collect();
    let problem = match (missing.is_empty(), foreign.is_empty()) {
        (false, _) => format!("shard {shard} has not its runs {}", listed(missing)),
        (_, false) => format!("runs {} do not belong to shard {shard}", listed(foreign)),
        _ => format!("shard {shard} has a run twice, or not in order"),
    };
    Err(data(path, problem))
}

fn data(path: &Path, problem: String) -> Error {
    Error::Data { path: path.to_owned(), line: None, problem }
}
