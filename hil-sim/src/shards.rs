//! Shards: the runs of a statistical experiment are shared between processes or machines, stored one by one, and merged.
//!
//! Run `k`, counted from 0, belongs to shard `1 + k mod n` of `n`. A run depends on its number, the seed and the
//! settings, not on the shard. A shard is a [`Header`] and the records of its runs, one per line. Merging puts the
//! records of all shards in their order and computes their outcome, as the whole run does.

mod header;
mod journal;
mod merge;
mod rows;

use std::fmt;
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

pub use header::Header;
pub use journal::Journal;
pub use merge::{Merged, merge};
pub use rows::rows;

use crate::experiments::statistics::Statistical;
use crate::prelude::*;

/// One of the parts into which the runs are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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

    /// Returns a shard, if there is one with these numbers.
    pub fn new(index: u32, count: u32) -> Option<Self> {
        Some(Self { index, count }).filter(Self::exists)
    }

    /// Whether its numbers are possible; those from a file may not be.
    pub fn exists(&self) -> bool {
        (1..=Self::MOST).contains(&self.count) && (1..=self.count).contains(&self.index)
    }

    /// Returns the shard of this process in a job array, from the variables of the scheduler.
    fn of_array(variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let found = ARRAYS.iter().find(|(index, ..)| variable(index).is_some());
        let Some((index, count, first)) = found else {
            let names = ARRAYS.map(|(index, ..)| index).join(", ");
            return Err(format!("this is no array of jobs: none of {names} is set"));
        };
        let number = |name: &str| {
            let text = variable(name).ok_or_else(|| format!("{index} is set, but not {name}"))?;
            text.parse::<u32>().map_err(|_| format!("{name} = {text} is not a number"))
        };
        let from = if first.is_empty() { 0 } else { number(first)? };
        let (job, jobs) = (number(index)?, number(count)?);
        let shard = job.checked_sub(from).and_then(|place| Self::new(place + 1, jobs));
        shard.ok_or_else(|| format!("job {job} of {jobs} from {from} on is no shard"))
    }

    /// Returns the numbers of its runs.
    pub fn numbers(self, runs: usize) -> impl Iterator<Item = usize> {
        (self.index as usize - 1..runs).step_by(self.count as usize)
    }

    /// Whether a run belongs to the shard.
    pub fn has(self, run: usize) -> bool {
        run % self.count as usize == self.index as usize - 1
    }

    /// Returns the numbers as part of a file name.
    pub fn file_name(self) -> String {
        format!("{}-of-{}", self.index, self.count)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "env" {
            return Self::of_array(|name| std::env::var(name).ok());
        }
        let numbers = text.split_once('/');
        let shard =
            numbers.and_then(|(index, count)| Self::new(index.parse().ok()?, count.parse().ok()?));
        let most = Self::MOST;
        shard.ok_or_else(|| {
            format!("allowed: env, or I/N with N from 1 to {most} and I from 1 to N")
        })
    }
}

/// Variables of Slurm, Kubernetes and AWS Batch: index of a job in the array, number of jobs, and the first index if it
/// is not 0. Kubernetes does not give the number of jobs: the job sets it.
const ARRAYS: [(&str, &str, &str); 3] = [
    ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN"),
    ("JOB_COMPLETION_INDEX", "JOB_COMPLETIONS", ""),
    ("AWS_BATCH_JOB_ARRAY_INDEX", "AWS_BATCH_JOB_ARRAY_SIZE", ""),
];

/// A run and its record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Its number, from 0.
    pub run: usize,
    /// Its record.
    pub record: Value,
}

/// Does the runs of a shard that the journal does not have yet, and returns all of them in their order.
///
/// # Errors
/// The errors of the experiment; [`Error::Write`] if the journal cannot be written.
pub fn runs(
    statistical: &Statistical,
    context: &Context<'_>,
    header: &Header,
    journal: Option<&Journal>,
) -> Result<Vec<Run>, Error> {
    let before = journal.iter().flat_map(|journal| &journal.runs);
    let mut done: BTreeMap<_, _> = before.map(|run| (run.run, run.record.clone())).collect();
    let numbers = header.shard.numbers(header.runs);
    let missing: Vec<usize> = numbers.filter(|run| !done.contains_key(run)).collect();
    let new = Mutex::new(Vec::new());
    (statistical.some)(context, &missing, &|run, record| {
        let run = Run { run, record };
        journal.map_or(Ok(()), |journal| journal.append(&run))?;
        new.lock().unwrap_or_else(PoisonError::into_inner).push((run.run, run.record));
        Ok(())
    })?;
    done.extend(new.into_inner().unwrap_or_else(PoisonError::into_inner));
    Ok(done.into_iter().map(|(run, record)| Run { run, record }).collect())
}

/// Writes a shard as text, JSON Lines.
///
/// # Errors
/// [`Error::Internal`] if JSON cannot be made.
pub fn text(header: &Header, runs: &[Run]) -> Result<String, Error> {
    let mut bytes = journal::line(header)?;
    for run in runs {
        bytes.extend(journal::line(run)?);
    }
    String::from_utf8(bytes).map_err(|e| Error::Internal(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shards_of_any_number_are_all_runs_once() {
        for (runs, count) in [(48, 1), (48, 5), (7, 8), (0, 3), (1, 1)] {
            let shards = (1..=count).map(|index| Shard::new(index, count).unwrap());
            let mut all: Vec<usize> =
                shards.clone().flat_map(|shard| shard.numbers(runs)).collect();
            assert!(shards.clone().all(|shard| shard.numbers(runs).all(|run| shard.has(run))));
            all.sort_unstable();
            assert!(all.into_iter().eq(0..runs), "{runs} runs in {count}");
        }
    }

    #[test]
    fn a_shard_is_read_as_it_is_shown() {
        assert_eq!("3/8".parse(), Ok(Shard { index: 3, count: 8 }));
        assert_eq!(Shard::new(3, 8).unwrap().to_string(), "3/8");
        for wrong in ["0/3", "4/3", "1/0", "3", "a/b", "1/100001", "-1/2", "1/2/3", ""] {
            let error = wrong.parse::<Shard>().unwrap_err();
            assert_eq!(
                error, "allowed: env, or I/N with N from 1 to 100000 and I from 1 to N",
                "{wrong}"
            );
        }
    }

    /// Indices of Slurm begin at the user's choice, those of the other schedulers at 0.
    #[test]
    fn a_job_of_an_array_knows_its_shard() {
        let shard = |set: &[(&str, &str)]| {
            Shard::of_array(|name| {
                set.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned())
            })
        };
        let slurm = |id| {
            [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_COUNT", "8"),
                ("SLURM_ARRAY_TASK_MIN", "5"),
            ]
        };
        assert_eq!(shard(&slurm("5")), Ok(Shard { index: 1, count: 8 }));
        assert_eq!(shard(&slurm("12")), Ok(Shard { index: 8, count: 8 }));
        assert_eq!(shard(&slurm("13")).unwrap_err(), "job 13 of 8 from 5 on is no shard");
        assert!(shard(&slurm("4")).is_err());
        let kubernetes = [("JOB_COMPLETION_INDEX", "0"), ("JOB_COMPLETIONS", "3")];
        assert_eq!(shard(&kubernetes), Ok(Shard { index: 1, count: 3 }));
        let error = shard(&kubernetes[..1]).unwrap_err();
        assert_eq!(error, "JOB_COMPLETION_INDEX is set, but not JOB_COMPLETIONS");
        let aws = [("AWS_BATCH_JOB_ARRAY_INDEX", "2"), ("AWS_BATCH_JOB_ARRAY_SIZE", "3")];
        assert_eq!(shard(&aws), Ok(Shard { index: 3, count: 3 }));
        let error = shard(&[("AWS_BATCH_JOB_ARRAY_INDEX", "x"), ("AWS_BATCH_JOB_ARRAY_SIZE", "3")]);
        assert_eq!(error.unwrap_err(), "AWS_BATCH_JOB_ARRAY_INDEX = x is not a number");
        assert!(
            shard(&[]).unwrap_err().contains("none of SLURM_ARRAY_TASK_ID, JOB_COMPLETION_INDEX")
        );
    }
}
