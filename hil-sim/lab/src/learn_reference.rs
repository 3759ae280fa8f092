//! The drive learns the reference of its angle tracking.

use drive_core::learned::Fitted;
use sim_bench::learning;
use sim_bench::prelude::*;

/// Section 5.2 asks for a detection that works at every operating point.
pub const EXPERIMENT: Experiment = Experiment {
    name: "learn-reference",
    stands_for: "section 3.3, section 5.2",
    about: "The drive learns reference, sensor mismatch and saliency with the shaft locked.",
    uses: &[BENCH, DRIVE],
    not: &[TURNING, SPEED_LOOP, &["injection.bandwidth_hz", "injection.current_saliency"]],
    run,
};

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let learned = learning::learned(context.config, context.seed)?;
    let mut outcome = Outcome::default();
    let points: Vec<(f64, f64)> = learned
        .reference
        .points()
        .iter()
        .take(learned.points + 1)
        .enumerate()
        .map(|(n, &q)| (f64::from(learned.reference.grid().current(n)), f64::from(q)))
        .collect();
    let mut table = Table::new(
        "Over the torque current",
        &["iq (A)", "reference", "slope (1/rad)", "carrier ratio"],
    )
    .note("What the carrier shows at the right angle, odd in iq; the carrier current, as a ratio to that at 0 A, even.");
    for (n, &(i_q, q)) in points.iter().enumerate() {
        let ratio = learned.carrier.map_or(f64::NAN, |table| f64::from(table.points()[n]));
        let slope = learned.slope.map_or(f64::NAN, |table| f64::from(table.points()[n]));
        table.row([
            Cell::fixed(i_q, 2),
            Cell::fixed(q, 5),
            Cell::fixed(slope, 5),
            Cell::fixed(ratio, 5),
        ]);
    }
    outcome.tables.push(table);

    let mut table = Table::new("Other values", &["value", "found", "misfit", "used"]).note(
        "The saliency fixed to the flux is what the check at the start saw, within 5 %; it is for \
         the reader.",
    );
    let mut fitted = |name: &str, fitted: Fitted| {
        table.row([
            Cell::from(name),
            Cell::fixed(f64::from(fitted.value), 5),
            Cell::fixed(f64::from(fitted.misfit), 5),
            Cell::from(if fitted.accepted { "yes" } else { "no" }),
        ]);
    };
    fitted("gain of sensor a over b, less one", learned.gain_mismatch);
    fitted("saliency of the current (1/A)", learned.current_saliency);
    table.row([
        Cell::from("saliency fixed to the flux"),
        Cell::fixed(f64::from(learned.flux_saliency), 4),
        Cell::from(""),
        Cell::from("no"),
    ]);
    outcome.tables.push(table);

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
    outcome
        .figures
        .push(Figure::new("reference", "Reference over the torque current", "section 3.3").panel(
            Panel::new("quadrature current (A)", "q").with(Series::line("learned", points)),
        ));
    outcome.remarks = assumptions(context.config);
    Ok(outcome)
}
