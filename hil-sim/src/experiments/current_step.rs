//! Step of the current loop on the identified plant.

use drive_core::FirstOrder;

use super::bode::roots;
use super::{Context, Experiment};
use crate::error::Error;
use crate::outcome::{Cell, Figure, Outcome, Panel, Series, Table};

/// Figures 26 and 27, Eq. 3.34, 3.39, 3.40.
pub const EXPERIMENT: Experiment = Experiment {
    name: "current-step",
    stands_for: "Figures 26, 27",
    about: "Step of the closed current loop on the identified plant, with and without reference \
            filter, and with a pole 3 % larger.",
    uses: &[],
    not: &[],
    run,
};

/// Eq. 3.34, A/V.
const PLANT: FirstOrder = FirstOrder { k: 0.0040532, p: 0.93916 };
/// Eq. 3.39.
const K_C: f64 = 52.48;
/// Eq. 3.39, and the pole of the reference filter (3.40).
const Z_C: f64 = 0.94786;
const SAMPLES: usize = 240;
const PERIOD_MS: f64 = 1.0 / 6.0;

/// Unit step: controller, plant without any other delay, reference filter or none.
fn step(plant: FirstOrder, filtered: bool) -> Vec<f64> {
    let (mut y, mut u, mut before, mut reference) = (0.0, 0.0, 0.0, 0.0);
    let mut response = Vec::with_capacity(SAMPLES);
    for _ in 0..SAMPLES {
        response.push(y);
        let r = if filtered { reference } else { 1.0 };
        reference = Z_C * reference + (1.0 - Z_C);
        let e = r - y;
        u += K_C * (e - Z_C * before);
        before = e;
        y = plant.p * y + plant.k * u;
    }
    response
}

fn overshoot(response: &[f64]) -> f64 {
    response.iter().map(|y| y - 1.0).fold(0.0, f64::max)
}

/// Samples until the response stays within 2 % of its end.
fn settling(response: &[f64]) -> usize {
    response.iter().rposition(|y| (y - 1.0).abs() > 0.02).map_or(0, |k| k + 1)
}

fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let mut table = Table::new("Unit step, C(z) = 52.48 (z − 0.94786)/(z − 1)", &[]);
    let larger = FirstOrder { p: 1.03 * PLANT.p, ..PLANT };
    let plants = [("Eq. 3.34", "nominal", PLANT), ("pole × 1.03", "larger_pole", larger)];
    let mut figure = Figure::new(
        "step",
        "Current after a unit step: plant of Eq. 3.34 (top) and with its pole 3 % larger (bottom)",
        "Figures 26, 27",
    );
    for (name, key, plant) in plants {
        // (z - 1)(z - p) + k_c k (z - z_c)
        let gain = K_C * plant.k;
        let mut poles = roots(&[gain - 1.0 - plant.p, plant.p - gain * Z_C]);
        poles.sort_by(|p, q| q.re.total_cmp(&p.re));
        let [p, q] = [poles[0], poles[1]];
        let poles = match p.im.abs() {
            0.0 => format!("{:.4}, {:.4}", p.re, q.re),
            im => format!("{:.4} ± j{im:.4}", p.re),
        };
        let end = PERIOD_MS * (SAMPLES - 1) as f64;
        let mut panel = Panel::new("time (ms)", "current (A)");
        for (label, filter_key, filtered) in
            [("without filter", "plain", false), ("with filter", "filtered", true)]
        {
            let response = step(plant, filtered);
            let samples = settling(&response);
            table.record([
                ("plant", Cell::from(name)),
                ("reference filter", Cell::from(if filtered { "Eq. 3.40" } else { "none" })),
                ("overshoot (%)", Cell::fixed(100.0 * overshoot(&response), 2)),
                ("within 2 % (samples)", Cell::fixed(samples as f64, 0)),
                ("within 2 % (ms)", Cell::fixed(samples as f64 * PERIOD_MS, 1)),
                ("closed-loop poles", Cell::from(poles.as_str())),
            ]);
            let prefix = format!("{key}_{filter_key}");
            outcome
                .metrics
                .set(format!("{prefix}_overshoot_percent"), 100.0 * overshoot(&response));
            outcome.metrics.set(format!("{prefix}_settling_samples"), samples as f64);
            let points = (0..).map(|k| PERIOD_MS * f64::from(k)).zip(response).collect();
            panel = panel.with(Series::line(label, points));
        }
        figure =
            figure.panel(panel.with(Series::reference("reference", vec![(0.0, 1.0), (end, 1.0)])));
    }
    outcome.tables.push(table);
    outcome.figures.push(figure);
    outcome.remark(
        "The identified plant has no delay and no current filter in it; with those the same rule \
         leaves less margin (see pi-design).",
    );
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_26_and_27() {
        let plain = step(PLANT, false);
        assert_eq!((overshoot(&plain), settling(&plain)), (0.0, 25));
        let filtered = step(PLANT, true);
        assert_eq!((overshoot(&filtered), settling(&filtered)), (0.0, 82));
        let larger = FirstOrder { p: 1.03 * PLANT.p, ..PLANT };
        assert!((overshoot(&step(larger, false)) - 0.0427).abs() < 1e-4);
        assert_eq!(overshoot(&step(larger, true)), 0.0);
    }
}
