//! Step of the current loop on the identified plant.

use drive_core::FirstOrder;
use sim_lab::recomputed::plant;
use sim_lab::source::{named, printed};

use super::poles::largest_pole;
use crate::prelude::*;

const SAMPLES: usize = 240;
const PERIOD_MS: f64 = 1.0 / 6.0;

/// Simulates a unit step: controller, plant without further delay, reference filter or none.
fn step(plant: FirstOrder, filtered: bool) -> Vec<f64> {
    let (k_c, z_c) = (printed("section 3.8", "k_c"), printed("Eq. 3.38", "z_c"));
    let (mut y, mut u, mut before, mut reference) = (0.0, 0.0, 0.0, 0.0);
    let mut response = Vec::with_capacity(SAMPLES);
    for _ in 0..SAMPLES {
        response.push(y);
        let r = if filtered { reference } else { 1.0 };
        reference = z_c * reference + (1.0 - z_c);
        let e = r - y;
        u += k_c * (e - z_c * before);
        before = e;
        y = plant.p * y + plant.k * u;
    }
    response
}

/// Returns the plant of Eq. 3.34, and the same plant with the pole of Figure 27.
fn plants() -> (FirstOrder, FirstOrder) {
    let plant = plant("Eq. 3.34");
    let more = printed("Figure 27", "increase of the pole of the plant") / 100.0;
    (plant, FirstOrder { p: (1.0 + more) * plant.p, ..plant })
}

fn overshoot(response: &[f64]) -> f64 {
    response.iter().map(|y| y - 1.0).fold(0.0, f64::max)
}

/// Number of samples until the response stays within 2 % of its final value.
fn settling(response: &[f64]) -> usize {
    response.iter().rposition(|y| (y - 1.0).abs() > 0.02).map_or(0, |k| k + 1)
}

/// Runs the experiment: Figures 26 and 27, Eq. 3.34, 3.39, 3.40.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let (nominal, larger) = plants();
    let z_c = printed("Eq. 3.38", "z_c");
    let mut figure = texts::figure("current-step", "step");
    for (key, plant) in [("nominal", nominal), ("larger_pole", larger)] {
        // (z - 1)(z - p) + k_c k (z - z_c)
        let gain = printed("section 3.8", "k_c") * plant.k;
        let pole = largest_pole(&[gain - 1.0 - plant.p, plant.p - gain * z_c]);
        outcome.metrics.set(format!("{key}_largest_pole"), pole);
        let end = PERIOD_MS * (SAMPLES - 1) as f64;
        let mut panel = Panel::new("time (ms)", "current (A)");
        for (label, filter_key, filtered) in
            [("without filter", "plain", false), ("with filter", "filtered", true)]
        {
            let response = step(plant, filtered);
            let samples = settling(&response);
            let prefix = format!("{key}_{filter_key}");
            let percent = 100.0 * overshoot(&response);
            outcome.metrics.set(format!("{prefix}_overshoot_percent"), percent);
            outcome.metrics.set(format!("{prefix}_settling_samples"), samples as f64);
            let points = (0..).map(|k| PERIOD_MS * f64::from(k)).zip(response).collect();
            panel = panel.with(Series::line(label, points));
        }
        figure =
            figure.panel(panel.with(Series::reference("reference", vec![(0.0, 1.0), (end, 1.0)])));
    }
    outcome.figures.push(figure);
    let [plain, filtered] = [false, true].map(|filtered| step(larger, filtered));
    let longer = settling(&step(nominal, true)) > settling(&step(nominal, false));
    outcome.compared.extend([
        named("margin_leaves_no_overshoot").recomputed(overshoot(&step(nominal, false)) < 0.001),
        named("overshoots_unfiltered").recomputed(overshoot(&plain) > 0.01),
        named("filter_removes_overshoot").recomputed(overshoot(&filtered) < 0.001),
        named("filter_settles_later").recomputed(longer),
    ]);
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_26_and_27() {
        let (nominal, larger) = plants();
        let plain = step(nominal, false);
        assert_eq!((overshoot(&plain), settling(&plain)), (0.0, 25));
        let filtered = step(nominal, true);
        assert_eq!((overshoot(&filtered), settling(&filtered)), (0.0, 82));
        assert!((overshoot(&step(larger, false)) - 0.0427).abs() < 1e-4);
        assert_eq!(overshoot(&step(larger, true)), 0.0);
    }
}
