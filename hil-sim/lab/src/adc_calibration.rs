//! The calibration lines of the current sensors, from the printed readings.

use sim_bench::stats::StraightLine as Line;

use crate::prelude::*;

/// Largest count of the ADC: 12 bits.
const LAST_CODE: f64 = 4095.0;

/// Runs the experiment: Table 4, Figure 17, Eq. 3.5.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let mut readings = Panel::new("converter code", "current (A)");
    let mut residuals = Panel::new("converter code", "residual (mA)");
    for name in ["A", "B"] {
        let codes = source::column("S1", "Table 4", &format!("n_ADC, channel {name}"));
        let points: Vec<_> =
            codes.into_iter().zip(-3..).map(|(code, i)| (code, f64::from(i))).collect();
        let fitted = Line::through(&points);
        let of = |part: &str| format!("{part} of I_{name}");
        for (part, value) in [("slope", fitted.slope), ("offset", fitted.intercept)] {
            outcome.compared.push(Compared::with("S1", "Eq. 3.5", of(part)).recomputed(value));
        }
        let residual = |&(code, current): &(f64, f64)| (code, 1e3 * (fitted.at(code) - current));
        let left: Vec<_> = points.iter().map(residual).collect();
        let ends = [0.0, LAST_CODE].map(|code| (code, fitted.at(code)));
        readings =
            readings.with(Series::line(format!("line {name}"), ends.to_vec())).with(Series {
                like_previous: true,
                ..Series::points(format!("readings {name}"), points.clone())
            });
        residuals = residuals.with(Series::points(format!("channel {name}"), left));
        let key = name.to_lowercase();
        outcome.metrics.set(format!("slope_{key}_a"), fitted.slope);
    }
    let slope = |name: &str| outcome.metrics.get(name).unwrap_or(f64::NAN);
    let mismatch = slope("slope_b_a") / slope("slope_a_a") - 1.0;
    outcome.metrics.set("gain_mismatch", mismatch);
    let figure = texts::figure("adc-calibration", "calibration");
    outcome.figures.push(figure.panel(readings).panel(residuals));
    texts::add_remarks(&mut outcome, "adc-calibration", &[("mismatch", 100.0 * mismatch)]);
    Ok(outcome)
}
