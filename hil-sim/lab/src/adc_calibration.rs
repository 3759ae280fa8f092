//! The calibration lines of the current sensors, from the printed readings.

use sim_bench::prelude::*;
use sim_bench::stats::StraightLine as Line;

/// Table 4, Figure 17, Eq. 3.5.
pub const EXPERIMENT: Experiment = Experiment {
    name: "adc-calibration",
    stands_for: "Table 4, Figure 17, Eq. 3.5",
    about: "Least-squares lines through the readings of both current channels.",
    uses: &[],
    not: &[],
    run,
};

/// Table 4: current (A), code of channel A, code of channel B.
const READINGS: [(f64, f64, f64); 7] = [
    (-3.0, 666.0, 671.0),
    (-2.0, 1117.0, 1118.0),
    (-1.0, 1567.0, 1566.0),
    (0.0, 2024.0, 2016.0),
    (1.0, 2478.0, 2463.0),
    (2.0, 2927.0, 2916.0),
    (3.0, 3375.0, 3356.0),
];

/// Eq. 3.5 as printed: slope (A per code), intercept (A).
const PRINTED: [(&str, f64, f64); 2] = [("A", 0.0022120, -4.4727134), ("B", 0.0022314, -4.4966238)];

/// Codes of the converter: 12 bits.
const LAST_CODE: f64 = 4095.0;

fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let mut lines = Table::new("Calibration lines, I = slope n + intercept", &[]);
    let mut readings = Panel::new("converter code", "current (A)");
    let mut residuals = Panel::new("converter code", "residual (mA)");
    for (channel, (name, slope, intercept)) in PRINTED.into_iter().enumerate() {
        let points = READINGS.map(|(i, a, b)| (if channel == 0 { a } else { b }, i));
        let fitted = Line::through(&points);
        let printed = Line { slope, intercept };
        let residual =
            |line: Line| points.map(|(code, current)| (code, 1e3 * (line.at(code) - current)));
        let largest = |line: Line| residual(line).iter().map(|p| p.1.abs()).fold(0.0, f64::max);
        for (kind, line) in [("least squares", fitted), ("printed", printed)] {
            lines.record([
                ("channel", Cell::from(name)),
                ("", Cell::from(kind)),
                ("slope (A)", Cell::fixed(line.slope, 8)),
                ("intercept (A)", Cell::fixed(line.intercept, 6)),
                ("largest residual (mA)", Cell::fixed(largest(line), 2)),
                ("code 0 (A)", Cell::fixed(line.at(0.0), 4)),
                ("code 4095 (A)", Cell::fixed(line.at(LAST_CODE), 4)),
            ]);
        }
        let ends = [0.0, LAST_CODE].map(|code| (code, fitted.at(code)));
        readings = readings
            .with(Series::line(format!("line {name}"), ends.to_vec()))
            .with(Series::points(format!("readings {name}"), points.to_vec()).like_previous());
        residuals =
            residuals.with(Series::points(format!("channel {name}"), residual(fitted).to_vec()));
        let key = name.to_lowercase();
        outcome.metrics.set(format!("slope_{key}_a"), fitted.slope);
        outcome.metrics.set(format!("intercept_{key}_a"), fitted.intercept);
        outcome.metrics.set(format!("largest_residual_{key}_a"), 1e-3 * largest(fitted));
        outcome.metrics.set(format!("full_scale_{key}_a"), fitted.at(LAST_CODE));
    }
    let mismatch = outcome.metrics.get("slope_b_a").zip(outcome.metrics.get("slope_a_a"));
    let mismatch = mismatch.map_or(f64::NAN, |(b, a)| b / a - 1.0);
    outcome.metrics.set("gain_mismatch", mismatch);
    outcome.tables.push(lines.note(
        "A 12-bit converter with a reference of 3.0 V (Eq. 3.4). The source takes full scale at \
         code 4096; the largest code is 4095.",
    ));
    outcome.figures.push(
        Figure::new("calibration", "Readings, calibration lines and what is left", "Figure 17")
            .panel(readings)
            .panel(residuals),
    );
    outcome.remarks.push(format!(
        "The two channels differ by {:.2} % in gain before calibration. A mismatch of 1 % costs a \
         sensorless drive several degrees, so it has to be calibrated.",
        100.0 * mismatch
    ));
    Ok(outcome)
}
