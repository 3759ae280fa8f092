//! Model A on simulated measurements: Tables 1 and 4 of Jacobina, Lima, Ribeiro 1996.

use crate::identification::study::tables;
use crate::prelude::*;

/// Runs the experiment: Tables 1 and 4.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    tables(context, &["A"]).map(|(_, outcome)| outcome)
}
