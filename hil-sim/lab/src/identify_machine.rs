//! Identification of the machine with which the tables of Jacobina, Lima, Ribeiro 1996 were made.

use crate::identification::ratios;
use crate::identification::{Parameters, claims};
use crate::prelude::*;

/// Runs the experiment, of numbers that do not depend on the noise.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let ratios = ratios::all();
    let table = texts::table("identify-machine", "ratios").records(ratios.iter().map(|ratio| {
        [
            ("quantity", Cell::from(ratio.quantity)),
            ("h (µs)", Cell::fixed(1e6 * ratio.h, 0)),
            ("printed", Cell::significant(ratio.printed, 3)),
            ("PX", Cell::significant(ratio.px, 3)),
            ("PX/printed", Cell::fixed(ratio.px / ratio.printed, 3)),
            ("rbv", Cell::significant(ratio.rbv, 3)),
            ("rbv/printed", Cell::fixed(ratio.rbv / ratio.printed, 3)),
        ]
    }));
    outcome.tables.push(table);
    let px = Parameters::PX;
    outcome.metrics.set("px_r_s_over_sigma_l_s", px.r_s / px.sigma_l_s);
    outcome.metrics.set("px_tau_r_s", px.tau_r);
    for (table, name) in [("Table 6", "tau_r_60_hz"), ("Table 7", "tau_r_10_hz")] {
        let [ours, rbv] =
            ["Sg", "rbv"].map(|row| source::number("S0", &format!("{table}, {row}"), "tau_r"));
        outcome.metrics.set(format!("{name}_below_rbv_pct"), 100.0 * (1.0 - ours / rbv));
    }
    claims::add(context.seed, &mut outcome.compared, &mut outcome.metrics);
    Ok(outcome)
}
