//! Effect of anti-windup in the example of Appendix B.

use drive_core::current::{Pi, PiState};

use sim_lab::source::{beside, named};

use super::poles::largest_pole;
use crate::prelude::*;

const K_C: f64 = 0.25;
const Z_C: f64 = 0.1;
const LIMIT: f64 = 0.15;
const SAMPLES: usize = 200;

/// A controller: from the error to the output before the limit.
type Controller = Box<dyn FnMut(f64) -> f64>;

/// Eq. B.1 in immediate form, which ignores the limit.
fn without() -> Controller {
    let (mut u, mut before) = (0.0, 0.0);
    Box::new(move |e| {
        u += K_C * (e - Z_C * before);
        before = e;
        u
    })
}

/// The controller of the drive.
fn with() -> Controller {
    let pi = Pi { k_c: K_C as f32, z_c: Z_C as f32 };
    let mut state = PiState::default();
    Box::new(move |e| {
        let u = pi.step(&mut state, e as f32);
        state.back_calculate(u.clamp(-LIMIT as f32, LIMIT as f32) - u);
        f64::from(u)
    })
}

/// Eq. B.3 as printed, with the limited output; without a limit it is Eq. B.1. The output of a step appears one step later.
fn literal(limit: f64) -> Controller {
    let (mut u, mut next, mut before) = (0.0_f64, 0.0_f64, 0.0);
    Box::new(move |e| {
        std::mem::swap(&mut u, &mut next);
        next = u.clamp(-limit, limit) + K_C * (e - Z_C * before);
        before = e;
        u
    })
}

/// Output of the plant and of the controller, over samples.
struct Response {
    y: Vec<f64>,
    u: Vec<f64>,
}

impl Response {
    /// Simulates a unit step on an integrator behind a limit.
    fn of(mut controller: Controller, limit: f64) -> Self {
        let (mut y, mut u) = (vec![0.0], Vec::new());
        let mut output = 0.0;
        for _ in 0..SAMPLES {
            u.push(controller(1.0 - output));
            output += u[u.len() - 1].clamp(-limit, limit);
            y.push(output);
        }
        y.pop();
        Self { y, u }
    }

    fn saturated(&self) -> f64 {
        // The controller of the drive is in f32, so its limit differs slightly from this one.
        let beyond = self.u.iter().filter(|u| u.abs() > LIMIT + 1e-6).count();
        beyond as f64 / self.u.len() as f64
    }

    fn u_at_crossing(&self) -> f64 {
        let crossing = self.y.iter().position(|&y| y >= 1.0);
        crossing.map_or(f64::NAN, |k| self.u[k])
    }
}

fn highest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// Runs the experiment: Figure 40, Eq. B.1 to B.3.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    // (z - 1)^2 + k_c (z - z_c), and z (z - 1)^2 + k_c (z - z_c) with the delayed index.
    let immediate = largest_pole(&[K_C - 2.0, 1.0 - K_C * Z_C]);
    let delayed = largest_pole(&[-2.0, 1.0 + K_C, -K_C * Z_C]);

    let mut table = texts::table("anti-windup", "step");
    let cases = [
        ("without anti-windup", "plain", without(), immediate),
        ("with anti-windup", "anti_windup", with(), immediate),
        ("Eq. B.1 with its printed index", "printed_index", literal(f64::INFINITY), delayed),
        ("Eq. B.3 with its printed index", "printed_anti_windup", literal(LIMIT), delayed),
    ];
    let mut figure = texts::figure("anti-windup", "step");
    for (name, key, controller, pole) in cases {
        let response = Response::of(controller, LIMIT);
        table.record([
            ("controller", Cell::from(name)),
            ("largest y", Cell::fixed(highest(&response.y), 3)),
            ("largest u", Cell::fixed(highest(&response.u), 3)),
            ("u where y reaches 1", Cell::fixed(response.u_at_crossing(), 3)),
            ("saturated (%)", Cell::fixed(100.0 * response.saturated(), 1)),
            ("largest pole |z|, no limit", Cell::fixed(pole, 4)),
        ]);
        outcome.metrics.set(format!("{key}_y_max"), highest(&response.y));
        outcome.metrics.set(format!("{key}_u_max"), highest(&response.u));
        outcome.metrics.set(format!("{key}_u_at_crossing"), response.u_at_crossing());
        outcome.metrics.set(format!("{key}_saturated_ratio"), response.saturated());
        outcome.metrics.set(format!("{key}_largest_pole"), pole);
        let over = |values: &[f64]| (0..).map(f64::from).zip(values.iter().copied()).collect();
        let level = |value: f64| vec![(0.0, value), ((SAMPLES - 1) as f64, value)];
        figure = figure.panel(
            Panel::new("sample", "y, u")
                .with(Series::line("output y", over(&response.y)))
                .with(Series::line("wanted u", over(&response.u)))
                .with(Series::reference("reference", level(1.0)))
                .with(Series::limit("limit of u", level(LIMIT)))
                .with(Series::limit("", level(-LIMIT))),
        );
    }
    outcome.tables.push(table);
    outcome.figures.push(figure);
    compared(&mut outcome);
    texts::add_remarks(&mut outcome, "anti-windup", &[("largest_pole", delayed)]);
    Ok(outcome)
}

/// Adds the statements of appendix B about Figure 40.
fn compared(outcome: &mut Outcome) {
    let plain = Response::of(without(), LIMIT);
    let of = |quantity, used| beside("Figure 40", quantity).used(used);
    let limit = of("limit of the control effort", LIMIT);
    outcome.compared.extend([of("K_c", K_C), of("z_c", Z_C), limit]);
    let late = Response::of(literal(LIMIT), LIMIT).y.split_off(SAMPLES - 40);
    let swing = highest(&late) - late.iter().copied().fold(f64::INFINITY, f64::min);
    outcome.metrics.set("printed_anti_windup_swing", swing);
    outcome.compared.push(named("effort_at_reference").recomputed(plain.u_at_crossing()));
    outcome.compared.push(named("mostly_saturated").recomputed(plain.saturated() > 0.5));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figure_40() {
        let plain = Response::of(without(), LIMIT);
        assert!((highest(&plain.y) - 2.005).abs() < 1e-3);
        assert!((highest(&plain.u) - 0.869).abs() < 1e-3);
        assert!((plain.u_at_crossing() - 0.854).abs() < 1e-3);
        assert!((plain.saturated() - 0.76).abs() < 1e-2);
        let cured = Response::of(with(), LIMIT);
        assert!((highest(&cured.y) - 1.301).abs() < 1e-3);
        assert!((cured.saturated() - 0.035).abs() < 1e-3);
    }

    #[test]
    fn the_printed_index_is_unstable_without_a_limit() {
        assert!((largest_pole(&[-2.0, 1.0 + K_C, -K_C * Z_C]) - 1.0996).abs() < 1e-4);
        let unlimited = Response::of(literal(f64::INFINITY), f64::INFINITY);
        assert!(highest(&unlimited.y) > 1e6);
    }
}
