//! Output-error fit: the machine whose simulated current is nearest to a recorded one, at the recorded voltage and speed.
//!
//! The unknowns are the four parameters, the state at the first sample and, unless it is given, the inverter voltage
//! error, which has the sign of each phase current. The fit minimises the sum of the squared differences of the
//! currents by Levenberg and Marquardt's method. Noise of the current does not bias this fit; it does bias a regression
//! with measured currents as regressors.
//!
//! A residual is seldom white: it contains harmonics, saturation and errors of the speed. The deviations are therefore
//! obtained from fits that each leave out a part of the record (delete-a-group jackknife: J. Shao, D. Tu, "The
//! Jackknife and Bootstrap", 1995, section 2.3), every part in turn, each by one Gauss-Newton step.

use nalgebra::{DMatrix, DVector, Vector2};

use super::batch::parts;
use super::{Complex, NotIdentifiable, Parameters};

/// Largest number of steps from one start.
const STEPS: u32 = 60;
/// A fit has converged when a step lowers the squared error by less than this share.
const CONVERGED: f64 = 1e-8;
/// Change of the speed, rad/s, after which the sampled equation is computed again.
const SPEED_STEP: f64 = 0.002;
/// Order of the series of the sampled equation; see [`Continuous::series`](super::Continuous::series).
const ORDER: u32 = 5;
/// Number of unknowns: parameters, rotor state, current, inverter voltage error.
const UNKNOWNS: usize = 9;
/// Steps of the numerical derivative: relative, A, V.
const DERIVATIVE: [f64; UNKNOWNS] = [1e-5, 1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 1e-4, 1e-3];
/// Number of parts of the record, each of which is left out once.
const PARTS: usize = 10;

/// A record of a machine, with one value per sampling period.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Sampling period, s.
    pub h: f64,
    /// Stator voltage, V: either the voltage that acts from sample k to k+1, or samples, between which it is a straight line.
    pub v: Vec<Complex>,
    /// Whether `v` are samples.
    pub sampled: bool,
    /// Stator current, A.
    pub i: Vec<Complex>,
    /// Speed of the rotor, electrical rad/s.
    pub omega_m: Vec<f64>,
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct OutputErrorFit {
    /// The machine; its speed is the mean of the record.
    pub parameters: Parameters,
    /// Inverter voltage error of a phase, with the sign of its current, V; not negative.
    pub drop_v: f64,
    /// Standard deviations of the first four parameters, in their units, and of the inverter voltage error, V; 0 if that error was given.
    pub deviations: [f64; 5],
    /// Change of the current that each parameter alone can cause, everything else fitted again: rms per relative change, A.
    pub told_a: [f64; 4],
    /// Whether further steps would change almost nothing.
    pub converged: bool,
    /// Simulated current, A.
    pub current: Vec<Complex>,
    /// Difference of the currents, rms of its magnitude, A.
    pub residual_a: f64,
}

impl Record {
    fn machine(x: &DVector<f64>, omega_m: f64) -> Parameters {
        let sigma_l_s = x[2].exp();
        let l_s = sigma_l_s * (1.0 + x[3].exp());
        Parameters { r_s: x[0].exp(), tau_r: x[1].exp(), sigma_l_s, l_s, omega_m }
    }

    /// The current that the machine would have had.
    fn simulate(&self, x: &DVector<f64>) -> Vec<Complex> {
        let mut state = Vector2::new(Complex::new(x[6], x[7]), Complex::new(x[4], x[5]));
        let mut speed = f64::INFINITY;
        let (mut step, mut ramp) = (Self::machine(x, 0.0).continuous().series(self.h, 1), None);
        let at = |k: usize| self.v[k] - signs(self.i[k]) * x[8];
        let mut current = Vec::with_capacity(self.i.len());
        for (k, omega_m) in self.omega_m.iter().enumerate() {
            current.push(state[0]);
            if (omega_m - speed).abs() > SPEED_STEP || !speed.is_finite() {
                speed = *omega_m;
                let machine = Self::machine(x, speed).continuous();
                step = machine.series(self.h, ORDER);
                ramp = self.sampled.then(|| machine.ramp(self.h, ORDER));
            }
            let v = at(k);
            state = step.advance(state, v);
            if let (Some(ramp), true) = (ramp, k + 1 < self.v.len()) {
                state += ramp * (at(k + 1) - v);
            }
        }
        current
    }

    fn residual(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
        let current = self.simulate(x);
        let apart: Vec<_> =
            self.i.iter().zip(&current).map(|(i, simulated)| i - simulated).collect();
        let residual = parts(apart.iter());
        residual.iter().all(|r| r.is_finite()).then_some(residual)
    }

    fn jacobian(&self, x: &DVector<f64>, at: &DVector<f64>, free: usize) -> Option<DMatrix<f64>> {
        let mut jacobian = DMatrix::zeros(at.len(), free);
        for (column, step) in DERIVATIVE.into_iter().enumerate().take(free) {
            let mut moved = x.clone();
            moved[column] += step;
            jacobian.set_column(column, &((self.residual(&moved)? - at) / step));
        }
        Some(jacobian)
    }

    /// Fits the machine from this start. The inverter voltage error, V, is given or fitted; if it would be negative, it is 0.
    ///
    /// # Errors
    /// [`NotIdentifiable::TooFewSamples`]; [`NotIdentifiable::NotFinite`]; [`NotIdentifiable::PoorExcitation`] if the
    /// record does not determine a parameter.
    pub fn fit(
        &self,
        start: &Parameters,
        drop_v: Option<f64>,
    ) -> Result<OutputErrorFit, NotIdentifiable> {
        let count = self.i.len();
        if count < 2 * UNKNOWNS || self.v.len() != count || self.omega_m.len() != count {
            return Err(NotIdentifiable::TooFewSamples);
        }
        let k = start.l_s / start.sigma_l_s - 1.0;
        let logs = [start.r_s, start.tau_r, start.sigma_l_s, k].map(f64::ln);
        let mut x = DVector::zeros(UNKNOWNS);
        x.rows_mut(0, 4).copy_from_slice(&logs);
        (x[6], x[7], x[8]) = (self.i[0].re, self.i[0].im, drop_v.unwrap_or(0.0));
        let free = UNKNOWNS - usize::from(drop_v.is_some());
        let mut residual = self.residual(&x).ok_or(NotIdentifiable::NotFinite)?;
        let (mut damping, mut converged) = (1e-3, false);
        for _ in 0..STEPS {
            let jacobian = self.jacobian(&x, &residual, free).ok_or(NotIdentifiable::NotFinite)?;
            let normal = jacobian.tr_mul(&jacobian);
            let gradient = jacobian.tr_mul(&residual);
            let gain = loop {
                let mut damped = normal.clone();
                for n in 0..free {
                    damped[(n, n)] += damping * normal[(n, n)].max(1e-12);
                }
                let factor = damped.cholesky().ok_or(NotIdentifiable::PoorExcitation)?;
                let mut step = -factor.solve(&gradient);
                // No parameter may change by more than a factor e in one step.
                let leap = step.rows(0, 4).amax();
                step *= (1.0 / leap).min(1.0);
                let mut next = x.clone();
                let mut moved = next.rows_mut(0, free);
                moved += step;
                let there = self.residual(&next);
                let lower = there.filter(|there| there.norm_squared() < residual.norm_squared());
                if let Some(there) = lower {
                    let gain = 1.0 - there.norm_squared() / residual.norm_squared();
                    (x, residual) = (next, there);
                    damping = (damping * 0.2).max(1e-12);
                    break gain;
                }
                if damping > 1e6 {
                    // No direction reduces the error: this is the minimum to within rounding.
                    break 0.0;
                }
                damping *= 8.0;
            };
            converged = gain < CONVERGED;
            if converged {
                break;
            }
        }
        if free == UNKNOWNS && x[8] < 0.0 {
            return self.fit(&Self::machine(&x, 0.0), Some(0.0));
        }
        self.finished(&x, &residual, free, converged)
    }

    fn finished(
        &self,
        x: &DVector<f64>,
        residual: &DVector<f64>,
        free: usize,
        converged: bool,
    ) -> Result<OutputErrorFit, NotIdentifiable> {
        let jacobian = self.jacobian(x, residual, free).ok_or(NotIdentifiable::NotFinite)?;
        let normal = jacobian.tr_mul(&jacobian);
        let inverse = normal.clone().try_inverse().ok_or(NotIdentifiable::PoorExcitation)?;
        let omega_m = self.omega_m.iter().sum::<f64>() / self.omega_m.len() as f64;
        let parameters = Self::machine(x, omega_m);
        let of = |x: &DVector<f64>| {
            let Parameters { r_s, tau_r, sigma_l_s, l_s, .. } = Self::machine(x, 0.0);
            [r_s, tau_r, sigma_l_s, l_s, x[8]]
        };
        let mut squares = [0.0; 5];
        for part in 0..PARTS {
            let edge = |part: usize| 2 * (part * self.i.len() / PARTS);
            let (from, count) = (edge(part), edge(part + 1) - edge(part));
            let (without, left) = (jacobian.rows(from, count), residual.rows(from, count));
            let mut rest = &normal - without.tr_mul(&without);
            for n in 0..free {
                // Only the first part contains the state at the first sample.
                rest[(n, n)] += 1e-9 * normal[(n, n)];
            }
            let moved = rest.cholesky().ok_or(NotIdentifiable::PoorExcitation)?;
            let mut other = x.clone();
            let mut changed = other.rows_mut(0, free);
            changed += moved.solve(&without.tr_mul(&left));
            let (here, there) = (of(x), of(&other));
            for n in 0..5 {
                squares[n] += (there[n] - here[n]).powi(2);
            }
        }
        let deviations = squares.map(|sum| (sum * (1.0 - 1.0 / PARTS as f64)).sqrt());
        let rows = self.i.len() as f64;
        let told_a = [0, 1, 2, 3].map(|n| (1.0 / (rows * inverse[(n, n)])).sqrt());
        if !told_a.iter().all(|told| told.is_finite()) {
            return Err(NotIdentifiable::PoorExcitation);
        }
        let residual_a = (residual.norm_squared() / rows).sqrt();
        let (current, drop_v) = (self.simulate(x), x[8]);
        Ok(OutputErrorFit {
            parameters,
            drop_v,
            deviations,
            told_a,
            converged,
            current,
            residual_a,
        })
    }
}

/// The signs of the three phase currents as a vector: two thirds of 2, or of the length of the hexagon's side.
fn signs(i: Complex) -> Complex {
    let half = 0.5 * 3.0_f64.sqrt();
    let [a, b, c] = [i.re, -0.5 * i.re + half * i.im, -0.5 * i.re - half * i.im].map(f64::signum);
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}
