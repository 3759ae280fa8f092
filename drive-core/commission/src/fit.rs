//! Step 4: fit of the motor's parameters to the transient between two levels of a dc current along phase a, with the shaft at rest.
//!
//! The model is the inverse-Gamma circuit, with a voltage error `e` of the inverter that is constant as long as all phases carry
//! current:
//!
//! ```text
//! v = r_s i + e + R_R (i - i_m) + L di/dt        d i_m/dt = (i - i_m) / tau_r
//! ```
//!
//! For a given rotor time constant, `i_m` follows from the measured current (exactly, if the current is constant over a
//! bin), and the equation is linear in the four unknowns r_s, e, R_R and L. [`Search`] finds the time constant with the
//! least misfit.
//!
//! No voltage is applied across phase a. The current that flows there, `i'`, and its magnetising current `i_m'` obey an equation
//! with four other unknowns, which is linear too:
//!
//! ```text
//! r_s i' + R_R (i' - i_m') = c i + v' + g (i - i_m) - w L_M di_w/dt        di_w/dt = i_m - i_w / tau_r
//! ```
//!
//! `c` is due to sensors and resistances that differ between the phases b and c, `v'` to inverter legs that differ, and `g`
//! to sensors alone. A shaft that rotates at `w` turns the flux out of phase a, which makes a current that changes and
//! decays, but no steady current.

use super::GAIN_RAD_PER_S;
use super::collector::{Bin, Collector};
use super::report::Refusal;
use drive_core::{AlphaBeta, PERIOD_S, SQRT_3};

/// Bins that begin earlier than this share of the rotor time constant are left out, because the current still changes fast there and a
/// saliency changes the inductance with it. The time is limited to 60 ms above and to a least time below: 12 ms for the levels of a
/// linear motor, and twice the time constant of the current loop for small changes of a motor that saturates, whose small-signal rotor
/// time constant may be 10 ms.
const FROM_OF_TAU_R: f32 = 0.08;
const LATEST_S: f32 = 0.060;
const LINEAR_S: f32 = 0.012;
const SMALL_S: f32 = 2.0 / GAIN_RAD_PER_S;
/// Range of the search, s, and number of its points: first over the range, then around the best point of the round before.
const TAU_R: (f32, f32) = (0.003, 4.0);
const POINTS: u8 = 40;
const CLOSER_POINTS: u8 = 9;
/// Rounds of the search. The spacing of the points shrinks from 15 % to 0.06 %.
const ROUNDS: u8 = 5;

/// Unknowns of the linear fit: r_s, e, R_R, L.
const N: usize = 4;

/// Values of the best fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fitted {
    /// ohm.
    pub r_s: f32,
    /// Voltage error of the inverter along phase a, V.
    pub e: f32,
    /// Voltage by which e is smaller at a small current, times that current, V A; see [`levels`](super::levels).
    pub bend: f32,
    /// ohm.
    pub r_r: f32,
    /// s.
    pub tau_r: f32,
    /// Magnetising current at the end of the bins, A.
    pub magnetising: f32,
    /// Relative difference of the currents of phases b and c; see [`levels`](super::levels).
    pub difference: f32,
    /// Rms of the residual, V.
    pub misfit: f32,
    /// Standard deviations of r_s, e, R_R and L that follow from the residual of the fit.
    pub deviations: [f32; N],
    /// Standard deviation of tau_r, s.
    pub tau_deviation: f32,
}

impl Fitted {
    /// Fits the equation across phase a to bins that began without flux. Returns the relative difference of the currents of
    /// phases b and c, the voltage, V, the electrical speed of the shaft, rad/s, and the rms of the residual, V; none if the
    /// equations have no solution.
    pub fn across(&self, sums: &Collector) -> Option<[f32; 4]> {
        let resistances = Some([self.r_s, self.r_r]);
        let best = fit(sums, 0.0, self.tau_r, begins(self.tau_r, LINEAR_S), resistances)?;
        let [c, volts, _, turning] = best.values.map(|value| value as f32);
        Some([SQRT_3 * c / self.r_s, volts, -turning, libm::sqrt(best.left / best.weight) as f32])
    }
}

/// Returns the time from which on bins count with this time constant and this least time, s, in control periods.
fn begins(tau_r: f32, least: f32) -> f32 {
    (FROM_OF_TAU_R * tau_r).clamp(least, LATEST_S) / PERIOD_S
}

/// A fit for one time constant.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Sum of the squares of the residual, weighted by the periods, V^2.
    left: f64,
    values: [f64; N],
    variances: [f64; N],
    /// Magnetising current at the end, A.
    magnetising: f32,
    /// Number of periods, and of bins.
    weight: f64,
    bins: f64,
}

/// Search for the time constant: one fit a call, so that the main loop continues meanwhile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Search {
    /// Magnetising current at the beginning, A.
    steady: f32,
    round: u8,
    point: u8,
    /// Time from which on bins count, control periods, and its least value, s.
    begins: f32,
    least: f32,
    /// Logarithm of the first time constant of this round, and spacing of the points.
    from: f32,
    step: f32,
    best: Option<(f32, Candidate)>,
    /// Sums of squares of the last point and of the neighbours of the best point.
    last_left: f64,
    neighbours: f64,
    after_best: bool,
}

impl Search {
    /// Creates a search for a transient that begins with the flux of the current `steady`, A. `small`: small changes of a motor
    /// that saturates, not the levels of a linear motor.
    pub fn new(steady: f32, small: bool) -> Self {
        let (from, to) = (libm::logf(TAU_R.0), libm::logf(TAU_R.1));
        let step = (to - from) / f32::from(POINTS - 1);
        let least = if small { SMALL_S } else { LINEAR_S };
        Self { steady, begins: least / PERIOD_S, least, from, step, ..Self::default() }
    }

    /// Makes one fit. The call after the last fit returns the result, which leaves time for another fit to the same bins. Refused if
    /// the equations have no solution.
    pub fn step(&mut self, sums: &Collector) -> Result<Option<Fitted>, Refusal> {
        if self.round == ROUNDS {
            return Ok(self.best.map(|(x, best)| self.fitted(x, &best)));
        }
        let x = self.from + self.step * f32::from(self.point);
        if let Some(candidate) = fit(sums, self.steady, libm::expf(x), self.begins, None) {
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
        let (x, _) = self.best.ok_or(Refusal::SamplesLost)?;
        self.round += 1;
        if self.round < ROUNDS {
            let Self { steady, round, least, .. } = *self;
            let begins = if round == 1 { begins(libm::expf(x), least) } else { self.begins };
            // From one spacing below the best to one above.
            let (from, step) = (x - self.step, self.step * (2.0 / f32::from(CLOSER_POINTS - 1)));
            *self = Self { steady, round, begins, least, from, step, ..Self::default() };
        }
        Ok(None)
    }

    fn fitted(&self, x: f32, best: &Candidate) -> Fitted {
        let [r_s, e, r_r, _] = best.values.map(|value| value as f32);
        let variance = best.left / (best.bins - N as f64);
        let deviations = best.variances.map(|v| libm::sqrt(v * variance) as f32);
        let tau_r = libm::expf(x);
        let step = f64::from(self.step);
        let curvature = (self.neighbours - 2.0 * best.left) / (step * step);
        let misfit = libm::sqrt(best.left / best.weight) as f32;
        let tau_deviation = tau_r * libm::sqrt(2.0 * variance / curvature.max(1e-12)) as f32;
        let (magnetising, default) = (best.magnetising, Fitted::default());
        Fitted { r_s, e, r_r, tau_r, magnetising, misfit, deviations, tau_deviation, ..default }
    }
}

/// Makes the linear fit for this time constant, s, over the bins that begin so many periods after a change of the level.
/// It is along phase a, or across it if the resistances r_s and R_R, ohm, are given.
fn fit(
    sums: &Collector,
    mut magnetising: f32,
    tau_r: f32,
    begins: f32,
    across: Option<[f32; 2]>,
) -> Option<Candidate> {
    // Sums of the products of the four regressors and the voltage.
    let (mut products, mut count) = (Products::default(), 0.0_f64);
    // i_m' and i_w.
    let (mut beside, mut turning) = (0.0_f32, 0.0_f32);
    for half in 0..2 {
        let mut bins = sums.bins(half).peekable();
        let (mut start, mut before) = (0.0_f32, None::<Bin>);
        while let Some(bin) = bins.next() {
            let AlphaBeta { alpha: i, beta: j } = bin.current;
            // These are exact for a constant current: the values of all three at the end of the bin, and the means of i_m and i' -
            // i_m'.
            let turned = bin.periods * PERIOD_S / tau_r;
            let decayed = -libm::expm1f(-turned);
            let mean = i + (magnetising - i) * (decayed / turned);
            let late = turned * (1.0 - decayed) * (magnetising - i);
            let grown = tau_r * (i * decayed + late) - decayed * turning;
            turning += grown;
            let fresh = (j - beside) * decayed;
            beside += fresh;
            magnetising += (i - magnetising) * decayed;
            let counts = start >= begins;
            start += bin.periods;
            if let (Some(before), Some(after)) = (before.replace(bin), bins.peek())
                && counts
            {
                let apart = bin.periods + 0.5 * (before.periods + after.periods);
                let slope = (after.current.alpha - before.current.alpha) / (apart * PERIOD_S);
                let [last, v] = match across {
                    None => [slope, bin.voltage],
                    Some([r_s, r_r]) => [r_r * grown / turned, r_s * j + r_r * fresh / turned],
                };
                let x = [i, 1.0, i - mean, last, v].map(f64::from);
                let w = f64::from(bin.periods);
                add(&mut products, x, w);
                count += 1.0;
            }
        }
    }
    if count <= N as f64 {
        return None;
    }
    let (inverse, values) = solved(&products)?;
    let explained: f64 = values.iter().zip(&products).map(|(a, row)| a * row[N]).sum();
    let left = (products[N][N] - explained).max(0.0);
    let variances = core::array::from_fn(|n| inverse[n][n]);
    Some(Candidate { left, values, variances, magnetising, weight: products[1][1], bins: count })
}

/// Sums of the products of the regressors and the voltage: the upper half of the matrix, as [`solved`] expects it.
type Products = [[f64; N + 1]; N + 1];

/// Adds an equation with this weight.
fn add(products: &mut Products, x: [f64; N + 1], weight: f64) {
    // There are few operations: in software each takes about 60 cycles, and the main loop must continue within 4 ms.
    for n in 0..=N {
        let weighted = weight * x[n];
        for m in n..=N {
            products[n][m] += weighted * x[m];
        }
    }
}

/// Returns the resistance r_s, ohm, e, V, and d, V A, of steady voltages r_s i + e - d/i at these currents, by least squares.
/// The term d/i is that of an inverter whose current has to charge the capacitance of its output nodes.
pub(super) fn bent(points: &[(f32, f32)]) -> Result<[f32; 3], Refusal> {
    let mut products = Products::default();
    // There is no fourth unknown.
    products[N - 1][N - 1] = 1.0;
    for &(i, v) in points {
        add(&mut products, [i, 1.0, -1.0 / i, 0.0, v].map(f64::from), 1.0);
    }
    let (_, values) = solved(&products).ok_or(Refusal::SamplesLost)?;
    let [r_s, e, d, _] = values.map(|value| value as f32);
    Ok([r_s, e, d])
}

/// Returns the inverse of the matrix of the regressors, by Gauss-Jordan elimination, and the unknowns; none if the matrix
/// is not positive definite.
fn solved(products: &Products) -> Option<([[f64; N]; N], [f64; N])> {
    // The matrix A with the identity beside it becomes the identity with the inverse beside it.
    let mut rows = [[0.0; 2 * N]; N];
    for n in 0..N {
        for m in 0..N {
            rows[n][m] = products[n.min(m)][n.max(m)];
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
    let inverse: [[f64; N]; N] = rows.map(|row| core::array::from_fn(|m| row[N + m]));
    let value = |row: [f64; N]| row.iter().zip(products).map(|(a, sums)| a * sums[N]).sum();
    Some((inverse, inverse.map(value)))
}
