//! Model A on simulated measurements: Tables 1 and 4 of Jacobina, Lima, Ribeiro 1996.

use crate::identification::study::tables;
use crate::prelude::*;

/// Runs the experiment: Tables 1 and 4.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let (_, mut outcome) = tables(context, &["A"])?;
    outcome.remark(
        "h_1b is never estimated: it is 3e-5 of h_1a. h_1b and h_0b with S_s at 100 and 200 µs come out worse than in \
         Table 1 with either noise; they fix the small phase of h_1, which depends on how the tones of the Schroeder signal \
         are phased and laid on the axes, and that is not printed.",
    );
    Ok(outcome)
}
