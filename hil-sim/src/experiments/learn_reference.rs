//! Learning the reference of the synchronous demodulation.

use super::torque::assumptions;
use super::{Context, Experiment};
use crate::error::Error;
use crate::learn;
use crate::outcome::{Cell, Figure, Outcome, Panel, Series, Table};

/// Section 5.2 asks for a detection that works at every operating point.
pub const EXPERIMENT: Experiment = Experiment {
    name: "learn-reference",
    stands_for: "section 3.3, section 5.2",
    about: "The saliency over the torque current, learned with the shaft locked.",
    run,
};

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let learned = learn::reference(context.config, context.seed)?;
    let mut outcome = Outcome::default();
    let heads = ["iq (A)", "q", "scatter", "carrier ratio"];
    let mut table = Table::new("Reference of the synchronous demodulation", &heads).note(
        "q is the saliency that the carrier sees at the right angle; the table is odd in iq. The \
             carrier current, as a ratio to that at 0 A, is even.",
    );
    let mut scatter = 0.0_f64;
    for point in &learned {
        table.row([
            Cell::fixed(point.i_q, 2),
            Cell::fixed(point.q, 5),
            Cell::fixed(point.scatter, 5),
            Cell::fixed(point.carrier / learned[0].carrier, 5),
        ]);
        scatter = scatter.max(point.scatter);
    }
    outcome.metrics.set("scatter_max", scatter);
    outcome.tables.push(table);
    let line = learned.iter().map(|p| (p.i_q, p.q)).collect();
    outcome.figures.push(
        Figure::new("reference", "Saliency over the torque current", "section 3.3")
            .panel(Panel::new("quadrature current (A)", "q").with(Series::line("learned", line))),
    );
    outcome.remarks = assumptions(context.config);
    Ok(outcome)
}
