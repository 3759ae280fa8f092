//! Saliency self-commissioning of the drive.

use drive_core::learned::Fitted;
use sim_bench::learning;

use crate::prelude::*;

/// Runs the experiment: Section 5.2 asks for a detection that works at every operating point.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let learned = learning::learned(context.config, context.seed)?;
    let mut outcome = Outcome::default();
    let reference = learned.reference.points().iter().take(learned.points + 1).enumerate();
    let of = |(n, &q): (usize, &f32)| (learned.reference.grid().current(n).into(), q.into());
    let points: Vec<(f64, f64)> = reference.map(of).collect();
    let rows = points.iter().enumerate().map(|(n, &(i_q, q))| {
        let ratio = learned.carrier.map_or(f64::NAN, |table| table.points()[n].into());
        let slope = learned.slope.map_or(f64::NAN, |table| table.points()[n].into());
        [
            ("iq (A)", Cell::fixed(i_q, 2)),
            ("reference", Cell::fixed(q, 5)),
            ("slope (1/rad)", Cell::fixed(slope, 5)),
            ("carrier ratio", Cell::fixed(ratio, 5)),
        ]
    });
    outcome.tables.push(texts::table("learn-reference", "over_current").records(rows));
    let row = |name: &str, value: f32, decimals, misfit: Cell, used: bool| {
        let used = Cell::from(if used { "yes" } else { "no" });
        let value = Cell::fixed(value.into(), decimals);
        [("value", name.into()), ("found", value), ("misfit", misfit), ("used", used)]
    };
    let fitted =
        |name: &str, f: Fitted| row(name, f.value, 5, Cell::fixed(f.misfit.into(), 5), f.accepted);
    let rows = [
        fitted("gain of sensor a over b, less one", learned.gain_mismatch),
        fitted("saliency of the current (1/A)", learned.current_saliency),
        row("saliency fixed to the flux", learned.flux_saliency, 4, "".into(), false),
    ];
    outcome.tables.push(texts::table("learn-reference", "others").records(rows));

    let m = &mut outcome.metrics;
    m.set("spread", learned.spread.into());
    m.set("ripple", learned.ripple.into());
    m.set("asymmetry", learned.asymmetry.size().into());
    m.set("slope_at_rest_per_rad", learned.slope_at_rest.into());
    m.set("limit_a", learned.limit_a.into());
    m.set("gain_mismatch", learned.gain_mismatch.value.into());
    m.set("gain_mismatch_misfit", learned.gain_mismatch.misfit.into());
    m.set("current_saliency_per_a", learned.current_saliency.value.into());
    m.set("current_saliency_misfit", learned.current_saliency.misfit.into());
    m.set("flux_saliency", learned.flux_saliency.into());
    let panel = Panel::new("quadrature current (A)", "q").with(Series::line("learned", points));
    let figure = texts::figure("learn-reference", "reference");
    outcome.figures.push(figure.panel(panel));
    Ok(outcome)
}
