//! Step 4: the fit of a transient between two current levels along phase a, with the shaft at rest.
//!
//! Inverse-Gamma circuit, with a voltage `e` of the inverter that is constant as long as all phases carry current:
//!
//! ```text
//! v = r_s i + e + R_R (i - i_m) + L di/dt        d i_m/dt = (i - i_m) / tau_r
//! ```
//!
//! For a given rotor time constant `i_m` follows from the measured current, exactly over bins of constant current, and the
//! rest is linear in the four unknowns. The time constant with the least misfit is searched for.

use super::collector::{Bin, Collector};
use super::report::Refusal;
use drive_core::PERIOD_S;

/// Bins that begin earlier in a half are left out, because the current still moves fast and a saliency changes the
/// inductance meanwhile: a share of the rotor time constant, from 12 ms to 60 ms.
const FROM_OF_TAU_R: f32 = 0.08;
const FROM_S: (f32, f32) = (0.012, 0.060);
/// Range of the search, s, and its points: first over the range, then around the best of the last.
const TAU_R: (f32, f32) = (0.01, 4.0);
const POINTS: u8 = 40;
const CLOSER_POINTS: u8 = 9;
/// Rounds of the search: the spacing shrinks from 15 % to 0.06 %.
const ROUNDS: u8 = 5;

/// Unknowns of the linear fit: r_s, e, R_R, L.
const N: usize = 4;

/// The values of the best fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fitted {
    /// ohm.
    pub r_s: f32,
    /// Voltage of the inverter along phase a, V.
    pub e: f32,
    /// Voltage times current that e lacks at a small current, V A; see [`levels`](super::levels).
    pub bend: f32,
    /// Gain mismatch of the sensors; see [`levels`](super::levels).
    pub mismatch: f32,
    /// ohm.
    pub r_r: f32,
    /// s.
    pub tau_r: f32,
    /// Rms of the residual, V.
    pub misfit: f32,
    /// Standard deviations of r_s, e, R_R by what the fit leaves.
    pub deviations: [f32; 3],
    /// That of tau_r, s.
    pub tau_deviation: f32,
}

/// A fit for one time constant.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Sum of the squares that are left, weighted by the periods, V^2.
    left: f64,
    values: [f64; N],
    variances: [f64; N],
    /// Periods, and bins.
    weight: f64,
    bins: f64,
}

/// The search for the time constant: one fit a call, so that the main loop goes on meanwhile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Search {
    /// Magnetising current at the beginning, A.
    steady: f32,
    round: u8,
    point: u8,
    /// Bins from here on count, control periods.
    begins: f32,
    /// Logarithm of the first time constant of this round, and spacing.
    from: f32,
    step: f32,
    best: Option<(f32, Candidate)>,
    /// What the neighbours of the best left.
    last_left: f64,
    neighbours: f64,
    after_best: bool,
}

impl Search {
    /// With the flux of the current `steady`, A, at the beginning.
    pub fn new(steady: f32) -> Self {
        let (from, to) = (libm::logf(TAU_R.0), libm::logf(TAU_R.1));
        let step = (to - from) / f32::from(POINTS - 1);
        Self { steady, begins: FROM_S.0 / PERIOD_S, from, step, ..Self::default() }
    }

    /// One fit; the result after the last. Refused where nothing can be fitted.
    pub fn step(&mut self, sums: &Collector) -> Result<Option<Fitted>, Refusal> {
        let x = self.from + self.step * f32::from(self.point);
        if let Some(candidate) = fit(sums, self.steady, libm::expf(x), self.begins) {
            let better = self.best.is_none_or(|(_, best)| candidate.left < best.left);
            if better {
                self.best = Some((x, candidate));
                self.neighbours = self.last_left;
            } else if self.after_best {
                self.neighbours += candidate.left;
            }
            self.after_best = better;
            self.last_left = candidate.left;
        }
        self.point += 1;
        let points = if self.round == 0 { POINTS } else { CLOSER_POINTS };
        if self.point < points {
            return Ok(None);
        }
        let (x, best) = self.best.ok_or(Refusal::SamplesLost)?;
        if self.round + 1 == ROUNDS {
            return Ok(Some(self.fitted(x, &best)));
        }
        if self.round == 0 {
            let (least, most) = FROM_S;
            self.begins = (FROM_OF_TAU_R * libm::expf(x)).clamp(least, most) / PERIOD_S;
        }
        // From one spacing below the best to one above.
        self.from = x - self.step;
        self.step *= 2.0 / f32::from(CLOSER_POINTS - 1);
        (self.round, self.point, self.best) = (self.round + 1, 0, None);
        (self.after_best, self.last_left) = (false, 0.0);
        Ok(None)
    }

    fn fitted(&self, x: f32, best: &Candidate) -> Fitted {
        let [r_s, e, r_r, _] = best.values.map(|value| value as f32);
        let variance = best.left / (best.bins - N as f64);
        let [d_r_s, d_e, d_r_r, _] = best.variances.map(|v| libm::sqrt(v * variance) as f32);
        let tau_r = libm::expf(x);
        let step = f64::from(self.step);
        let curvature = (self.neighbours - 2.0 * best.left) / (step * step);
        let misfit = libm::sqrt(best.left / best.weight) as f32;
        let tau_deviation = tau_r * libm::sqrt(2.0 * variance / curvature.max(1e-12)) as f32;
        let deviations = [d_r_s, d_e, d_r_r];
        Fitted { r_s, e, r_r, tau_r, misfit, deviations, tau_deviation, ..Fitted::default() }
    }
}

/// The linear fit for this time constant, s, over the bins that begin so many periods after a change of the level.
fn fit(sums: &Collector, mut magnetising: f32, tau_r: f32, begins: f32) -> Option<Candidate> {
    // Products of i, 1, i - i_m, di/dt and v.
    let (mut products, mut count) = ([[0.0_f64; N + 1]; N + 1], 0.0_f64);
    for half in 0..2 {
        let mut bins = sums.bins(half).peekable();
        let (mut start, mut before) = (0.0_f32, None::<Bin>);
        while let Some(bin) = bins.next() {
            let i = bin.current.alpha;
            // Exact for a constant current: end and mean of i_m over the bin.
            let turned = bin.periods * PERIOD_S / tau_r;
            let decayed = -libm::expm1f(-turned);
            let mean = i + (magnetising - i) * (decayed / turned);
            magnetising += (i - magnetising) * decayed;
            let counts = start >= begins;
            start += bin.periods;
            if let (Some(before), Some(after)) = (before.replace(bin), bins.peek())
                && counts
            {
                let apart = bin.periods + 0.5 * (before.periods + after.periods);
                let slope = (after.current.alpha - before.current.alpha) / (apart * PERIOD_S);
                let x = [i, 1.0, i - mean, slope, bin.voltage].map(f64::from);
                let w = f64::from(bin.periods);
                // The upper half, and few operations: in software they take some 60 cycles each, and the main loop
                // must be back within 4 ms.
                for n in 0..=N {
                    let weighted = w * x[n];
                    for m in n..=N {
                        products[n][m] += weighted * x[m];
                    }
                }
                count += 1.0;
            }
        }
    }
    if count <= N as f64 {
        return None;
    }
    let inverse = inverse(&products)?;
    let xy: [f64; N] = core::array::from_fn(|n| products[n][N]);
    let values = inverse.map(|row| row.iter().zip(&xy).map(|(a, b)| a * b).sum::<f64>());
    let explained: f64 = values.iter().zip(&xy).map(|(a, b)| a * b).sum();
    let left = (products[N][N] - explained).max(0.0);
    let variances = core::array::from_fn(|n| inverse[n][n]);
    Some(Candidate { left, values, variances, weight: products[1][1], bins: count })
}

/// The inverse of a positive definite matrix, given by its upper half, by Gauss and Jordan; none where it is not one.
fn inverse(a: &[[f64; N + 1]; N + 1]) -> Option<[[f64; N]; N]> {
    // A and the identity beside it become the identity and the inverse.
    let mut rows = [[0.0; 2 * N]; N];
    for n in 0..N {
        for m in 0..N {
            rows[n][m] = a[n.min(m)][n.max(m)];
        }
        rows[n][N + n] = 1.0;
    }
    for n in 0..N {
        let pivot = 1.0 / rows[n][n];
        if !(rows[n][n] > 0.0 && pivot.is_finite()) {
            return None;
        }
        let own = rows[n].map(|x| x * pivot);
        for row in &mut rows {
            let factor = row[n];
            row.iter_mut().zip(own).for_each(|(x, own)| *x -= factor * own);
        }
        rows[n] = own;
    }
    Some(rows.map(|row| core::array::from_fn(|m| row[N + m])))
}
