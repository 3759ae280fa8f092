//! Shards: the runs of a statistical experiment are shared between processes or machines, and stored one by one.
//!
//! Run `k`, counted from 0, belongs to shard `1 + k mod n` of `n`. A run depends on its number, the seed and the
//! settings, not on the shard. So a run with `--resume FOLDER/` takes the runs of all shards whose files are there, does
//! those that are missing, and computes the outcome of the whole.

mod header;
mod journal;
mod rows;

use std::fmt;
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

pub use header::Header;
pub use journal::Journal;
pub use rows::rows;

use crate::experiments::statistics::Statistical;
use crate::prelude::*;

/// One of the parts into which the runs are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of this shard, from 1 to `count`.
    index: u32,
    /// Number of shards.
    count: u32,
}

impl Shard {
    /// The shard with all runs.
    pub const WHOLE: Self = Self { index: 1, count: 1 };
    /// Largest number of shards.
    pub const MOST: u32 = 100_000;

    /// Returns the numbers of its runs.
    pub fn numbers(self, runs: usize) -> impl Iterator<Item = usize> + Clone {
        (self.index as usize - 1..runs).step_by(self.count as usize)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-of-{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let most = Self::MOST;
        let numbers = text.split_once('/').and_then(|(index, count)| {
            let (index, count) = (index.parse().ok()?, count.parse().ok()?);
            let exists = (1..=most).contains(&count) && (1..=count).contains(&index);
            exists.then_some(Self { index, count })
        });
        numbers.ok_or_else(|| format!("allowed: I/N with N from 1 to {most} and I from 1 to N"))
    }
}

/// A run and its record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Its number, from 0.
    pub run: usize,
    /// Its record.
    pub record: Value,
}

/// Does the runs of a shard that are not stored yet, and returns all runs of the shard in their order.
///
/// # Errors
/// The errors of the experiment; [`Error::Write`] if the journal cannot be written.
pub fn runs(
    statistical: &Statistical,
    context: &Context<'_>,
    numbers: impl Iterator<Item = usize> + Clone,
    journal: Option<&Journal>,
) -> Result<Vec<Run>, Error> {
    let stored = journal.map(|journal| journal.runs.clone()).unwrap_or_default();
    let missing: Vec<usize> = numbers.clone().filter(|run| !stored.contains_key(run)).collect();
    let done = Mutex::new(stored);
    (statistical.some)(context, &missing, &|run, record| {
        let run = Run { run, record };
        journal.map_or(Ok(()), |journal| journal.append(&run))?;
        done.lock().unwrap_or_else(PoisonError::into_inner).insert(run.run, run.record);
        Ok(())
    })?;
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(numbers.filter_map(|run| Some(Run { run, record: done.remove(&run)? })).collect())
}

/// Writes runs as text, in the form of a file for `--resume`.
///
/// # Errors
/// [`Error::Internal`] if JSON cannot be made.
pub fn text(header: &Header, runs: &[Run]) -> Result<String, Error> {
    let lines = runs.iter().map(journal::line);
    let bytes =
        std::iter::once(journal::line(header)).chain(lines).collect::<Result<Vec<_>, _>>()?;
    String::from_utf8(bytes.concat()).map_err(|e| Error::Internal(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shards_of_any_number_are_all_runs_once() {
        for (runs, count) in [(48, 1), (48, 5), (7, 8), (0, 3), (1, 1)] {
            let shards = (1..=count).map(|index| Shard { index, count });
            let mut all: Vec<usize> = shards.flat_map(|shard| shard.numbers(runs)).collect();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..runs), "{runs} runs in {count}");
        }
    }

    #[test]
    fn a_shard_is_read_from_its_numbers() {
        assert_eq!("3/8".parse(), Ok(Shard { index: 3, count: 8 }));
        for wrong in ["0/3", "4/3", "1/0", "3", "a/b", "1/100001", "-1/2", "1/2/3", ""] {
            let error = wrong.parse::<Shard>().unwrap_err();
            assert_eq!(error, "allowed: I/N with N from 1 to 100000 and I from 1 to N", "{wrong}");
        }
    }
}
