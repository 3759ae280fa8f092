//! Experiments of many independent runs. They are planned from configuration and seed alone, can run in any order and
//! on any machine, and are judged together.

pub mod fault_code;

use crate::context::Context;
use crate::error::Error;
use crate::outcome::Outcome;
use serde::de::DeserializeOwned;
use serde::{Deserialize as _, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// A statistical experiment.
pub trait Study: Sized + Sync {
    /// Everything that the outcome needs from a run. Written as JSON, it must be read back exactly: see
    /// [`exact`](crate::stats::exact).
    type Record: Serialize + DeserializeOwned + Send;
    /// Name of the experiment on the command line.
    const NAME: &'static str;

    /// Plans the runs, and returns their number.
    ///
    /// # Errors
    /// If the configuration is refused.
    fn new(context: &Context<'_>) -> Result<(Self, usize), Error>;

    /// Does one of the runs, counted from 0. It does not depend on the other runs.
    ///
    /// # Errors
    /// If the run cannot be done; the experiment fails then.
    fn run(&self, number: usize) -> Result<Self::Record, Error>;

    /// Computes the outcome of all runs, in their order.
    ///
    /// # Errors
    /// If there is no outcome.
    fn outcome(&self, context: &Context<'_>, records: Vec<Self::Record>) -> Result<Outcome, Error>;
}

/// Turns a refusal of the drive into a result; other errors stay errors.
///
/// # Errors
/// All errors but [`Error::Refused`].
pub fn or_refusal<T>(result: Result<T, Error>) -> Result<Result<T, String>, Error> {
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(Error::Refused(why)) => Ok(Err(why)),
        Err(other) => Err(other),
    }
}

/// Returns the seed of a run of an experiment with this seed.
pub fn seed_of(seed: u64, number: usize) -> u64 {
    seed.wrapping_mul(1_000_003).wrapping_add(number as u64)
}

/// Does all runs on all cores.
///
/// # Errors
/// The errors of the study.
pub fn whole<S: Study>(context: &Context<'_>) -> Result<Outcome, Error> {
    let (study, runs) = S::new(context)?;
    let numbers: Vec<usize> = (0..runs).collect();
    let records = context.in_parallel(S::NAME, &numbers, |_, &number| study.run(number))?;
    study.outcome(context, records)
}

/// Stored records of runs, by the number of the run.
pub type Stored = BTreeMap<usize, Value>;
/// A function that stores the record of a run.
pub type Keep<'a> = &'a (dyn Fn(usize, Value) -> Result<(), Error> + Sync);

/// The runs of a statistical experiment, kept as JSON.
pub struct Statistical {
    /// Returns the number of its runs.
    pub runs: fn(&Context<'_>) -> Result<usize, Error>,
    /// Does the runs that have no stored record on all cores, passes each record on as soon as it is complete, and computes the
    /// outcome of all runs.
    pub resumed: fn(&Context<'_>, &Stored, Keep<'_>) -> Result<Outcome, Error>,
}

impl Statistical {
    /// Makes the runs of a study.
    pub fn of<S: Study>() -> Self {
        Self { runs: |context| Ok(S::new(context)?.1), resumed: resumed::<S> }
    }
}

fn resumed<S: Study>(
    context: &Context<'_>,
    stored: &Stored,
    keep: Keep<'_>,
) -> Result<Outcome, Error> {
    let (study, runs) = S::new(context)?;
    let numbers: Vec<usize> = (0..runs).collect();
    let records = context.in_parallel(S::NAME, &numbers, |_, &number| {
        if let Some(record) = stored.get(&number) {
            return S::Record::deserialize(record)
                .map_err(|e| Error::Refused(format!("the record of run {number}: {e}")));
        }
        let record = study.run(number)?;
        keep(number, value::<S>(number, &record)?)?;
        Ok(record)
    })?;
    study.outcome(context, records)
}

/// Converts a record to JSON, after a check that it is read back unchanged.
fn value<S: Study>(number: usize, record: &S::Record) -> Result<Value, Error> {
    let lost = |e| Error::Internal(format!("the record of run {number} is not kept exactly: {e}"));
    let value = serde_json::to_value(record).map_err(lost)?;
    let again = serde_json::from_value::<S::Record>(value.clone())
        .and_then(serde_json::to_value)
        .map_err(lost)?;
    let changes = || Error::Internal(format!("the record of run {number} changes: {again}"));
    if again == value { Ok(value) } else { Err(changes()) }
}
