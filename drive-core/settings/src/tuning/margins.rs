//! Margins of an open loop by a frequency scan with refinement.

use core::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::bisected;

/// Stability margins of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Phase margin, degrees: smallest angle to -180° of all crossovers; negative if the closed loop is
    /// unstable.
    pub phase_margin_deg: f64,
    /// Frequency of the crossover with that margin, Hz.
    pub crossover_hz: f64,
    /// Sensitivity peak, max |1/(1 + L)|: the inverse of the smallest distance to -1.
    pub ms: f64,
    /// Frequency of the sensitivity peak, Hz.
    pub ms_hz: f64,
    /// Smallest factor on the gain above 1 that puts the open loop on -1; infinite if none does.
    pub gain_margin: f64,
    /// Whether the closed loop is stable, by counting encirclements of -1.
    pub stable: bool,
}

/// Number of grid points below `SPLIT`, spaced logarithmically.
const LOW: u32 = 200;
/// Number of grid points above `SPLIT`, spaced linearly: 3.7 Hz at 6 kHz.
const HIGH: u32 = 800;
/// Lowest frequency of the grid, rad/sample.
const START: f64 = 1e-5;
/// Frequency at which the spacing changes, rad/sample.
const SPLIT: f64 = 0.05;
/// ln(SPLIT / START), asserted in a test.
const LN_SPLIT_OVER_START: f64 = 8.517_193_191_416_238;

/// Frequency of grid point `n`, rad/sample.
fn grid(n: u32) -> f64 {
    if n < LOW {
        // START (SPLIT / START)^(n / LOW).
        START * (1.0 + libm::expm1(LN_SPLIT_OVER_START * (f64::from(n) / f64::from(LOW))))
    } else {
        SPLIT + (PI - SPLIT) * (f64::from(n - LOW) / f64::from(HIGH))
    }
}

impl Margins {
    /// Margins of `open_loop`, a function of ωT in rad/sample, with `integrators` poles at z = 1 and no pole
    /// outside the unit circle. `None` if its gain never crosses 1 on the grid.
    pub fn of(
        open_loop: &dyn Fn(f64) -> Complex64,
        integrators: u8,
        period_s: f64,
    ) -> Option<Self> {
        let hz = |omega_t: f64| omega_t / (TAU * period_s);
        let distance = |w: f64| (Complex64::ONE + open_loop(w)).norm();

        let mut nearest = (grid(0), f64::INFINITY, 0);
        let mut phase_margin: Option<(f64, f64)> = None;
        let (mut gain_margin, mut turned) = (f64::INFINITY, 0.0);

        let (mut w_before, mut before) = (grid(0), open_loop(grid(0)));
        for n in 1..=LOW + HIGH {
            let w = grid(n);
            let l = open_loop(w);
            // Argument of 1 + L, summed over the small steps.
            turned += ((Complex64::ONE + l) / (Complex64::ONE + before)).arg();
            let d = (Complex64::ONE + l).norm();
            if d < nearest.1 {
                nearest = (w, d, n);
            }
            if (before.norm() >= 1.0) != (l.norm() >= 1.0) {
                let w = crossing(&|w| open_loop(w).norm() - 1.0, w_before, w);
                let angle = 180.0 - open_loop(w).arg().to_degrees().abs();
                if phase_margin.is_none_or(|(smallest, _)| angle < smallest) {
                    phase_margin = Some((angle, w));
                }
            }
            if (before.im < 0.0) != (l.im < 0.0) && before.re < 0.0 && l.re < 0.0 {
                let gain = open_loop(crossing(&|w| open_loop(w).im, w_before, w)).norm();
                if gain < 1.0 && 1.0 / gain < gain_margin {
                    gain_margin = 1.0 / gain;
                }
            }
            (w_before, before) = (w, l);
        }

        let (phase_margin, crossover) = phase_margin?;
        let (w, d, n) = nearest;
        let (ms_w, least) = if n == 0 { (w, d) } else { minimum_near(&distance, n) };
        // Argument principle: with all closed-loop poles inside, the phase of 1 + L changes by +90° per
        // integrator along the upper half circle, and by 180° less per pole outside.
        let stable = 0.5 * PI * f64::from(integrators) - turned < 0.5 * PI;
        Some(Self {
            phase_margin_deg: if stable { phase_margin } else { -phase_margin },
            crossover_hz: hz(crossover),
            ms: 1.0 / least,
            ms_hz: hz(ms_w),
            gain_margin,
            stable,
        })
    }
}

/// Largest gain up to which, from zero on, an open loop keeps a phase margin, degrees, and a sensitivity
/// peak `ms`.
///
/// No search over the gain is needed: at each frequency the violating gains are known in closed form. With
/// gain g, |1 + g L| >= 1/Ms is a quadratic in g; the phase margin excludes g = 1/|L| wherever L lies
/// within the margin of the negative real axis.
pub(super) fn gain_limit(
    open_loop: &dyn Fn(f64) -> Complex64,
    phase_margin_deg: f64,
    ms: f64,
) -> f64 {
    let limit = |w: f64| {
        let l = open_loop(w);
        let a = l.re * l.re + l.im * l.im;
        let c = 1.0 - 1.0 / (ms * ms);
        let root = l.re * l.re - a * c;
        // Smaller root of a g² + 2 re g + c = 0, written without cancellation.
        let by_ms =
            if l.re < 0.0 && root >= 0.0 { c / (libm::sqrt(root) - l.re) } else { f64::INFINITY };
        let in_margin = 180.0 - l.arg().to_degrees().abs() < phase_margin_deg;
        f64::min(by_ms, if in_margin { 1.0 / libm::sqrt(a) } else { f64::INFINITY })
    };
    let (least, n) = (0..=LOW + HIGH)
        .map(|n| (limit(grid(n)), n))
        .fold((f64::INFINITY, 0), |least, here| if here.0 < least.0 { here } else { least });
    // Where the phase margin limits the gain, the limit jumps to infinity beside its minimum; the golden
    // section still ends on the lower side.
    let (_, refined) = minimum_near(&limit, n);
    if refined < least { refined } else { least }
}

/// Zero of `f` between `low` and `high`.
fn crossing(f: &dyn Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let sign = f(low) < 0.0;
    let (low, high) = bisected((low, high), 40, &|w| (f(w) < 0.0) == sign);
    0.5 * (low + high)
}

/// Position and value of the minimum of `f` beside grid point `n`, by golden section; `f` is unimodal there.
fn minimum_near(f: &dyn Fn(f64) -> f64, n: u32) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (grid(n.max(1) - 1), grid((n + 1).min(LOW + HIGH)));
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut f_a, mut f_b) = (f(a), f(b));
    for _ in 0..40 {
        if f_a < f_b {
            high = b;
            (b, f_b) = (a, f_a);
            a = high - GOLDEN * (high - low);
            f_a = f(a);
        } else {
            low = a;
            (a, f_a) = (b, f_b);
            b = low + GOLDEN * (high - low);
            f_b = f(b);
        }
    }
    if f_a < f_b { (a, f_a) } else { (b, f_b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tuning::{FirstOrder, pi_response};

    #[test]
    fn the_logarithm_is_that_of_the_grid() {
        assert!((LN_SPLIT_OVER_START - libm::log(SPLIT / START)).abs() < 1e-14);
        assert!((grid(LOW) / SPLIT - 1.0).abs() < 1e-12 && (grid(0) / START - 1.0).abs() < 1e-12);
    }

    /// Compares the closed form with a bisection over the gain, for cases limited by the peak and
    /// by the phase margin.
    #[test]
    fn gain_limit_agrees_with_a_search() {
        let plant = FirstOrder { k: 0.003_205_2, p: 0.980_053 };
        let open_loop = |w: f64| {
            // The filter is represented by its delay of 1.53 samples, to which one period is added.
            pi_response(1.0, 0.9538, w) * plant.response(w) * Complex64::cis(-2.53 * w)
        };
        for (phase_margin_deg, ms) in
            [(45.0, 2.2), (55.0, 2.2), (50.0, 5.0), (20.0, 1.5), (1.0, 50.0)]
        {
            let holds = |gain: f64| {
                let m = Margins::of(&|w| open_loop(w) * gain, 1, 1.0 / 6000.0).expect("crosses");
                m.stable && m.phase_margin_deg >= phase_margin_deg && m.ms <= ms
            };
            let (mut low, mut high) = (20.0, 200.0);
            assert!(holds(low) && !holds(high));
            for _ in 0..30 {
                let middle = 0.5 * (low + high);
                if holds(middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let closed = gain_limit(&open_loop, phase_margin_deg, ms);
            assert!((closed / low - 1.0).abs() < 1e-6, "{phase_margin_deg}°, {ms}: {closed} {low}");
        }
    }
}
