//! Output-error fit: the machine whose simulated current is nearest to a recorded one, at the recorded voltage and speed.
//!
//! The unknowns are the four parameters, the voltage drop of the inverter that goes with the sign of each phase current,
//! and the state at the first sample. Minimised is the sum of the squared differences of the currents, by Levenberg and
//! Marquardt's method. Noise of the current does not bias the fit, as it does a regression with measured currents as
//! regressors. Uncertainties are standard deviations from the residual and the sensitivity of the current (L. Ljung,
//! "System Identification", 1999, section 9.4), for a white residual.

use nalgebra::{DMatrix, DVector};

use super::batch::parts;
use super::models::NotIdentifiable;
use super::{Complex, Parameters};

/// Most steps from one start.
const STEPS: u32 = 60;
/// A fit has converged when a step lowers the squared error by less than this share.
const CONVERGED: f64 = 1e-8;
/// The sampled equation is computed anew when the speed has changed by this much, rad/s.
const SPEED_STEP: f64 = 0.05;
/// Order of the series of the sampled equation; see [`Continuous::series`](super::Continuous::series).
const ORDER: u32 = 5;
/// Parameters, drop, rotor state, current.
const UNKNOWNS: usize = 9;
/// Steps of the numeric derivative: relative, V, A.
const DERIVATIVE: [f64; UNKNOWNS] = [1e-5, 1e-5, 1e-5, 1e-5, 1e-3, 1e-4, 1e-4, 1e-4, 1e-4];

/// A record of a machine, one value a sampling period.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Sampling period, s.
    pub h: f64,
    /// Stator voltage that acts from sample k to k+1, V.
    pub v: Vec<Complex>,
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
    /// Drop of a phase with the sign of its current, V.
    pub drop_v: f64,
    /// Standard deviations: of the first four parameters in their units, and of the drop, V.
    pub deviations: [f64; 5],
    /// Simulated current, A.
    pub current: Vec<Complex>,
    /// Difference of the currents, rms of the length, A.
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
        let mut state = [Complex::new(x[7], x[8]), Complex::new(x[5], x[6])];
        let mut speed = f64::INFINITY;
        let mut step = Self::machine(x, 0.0).continuous().series(self.h, 1);
        let mut current = Vec::with_capacity(self.i.len());
        for ((v, i), omega_m) in self.v.iter().zip(&self.i).zip(&self.omega_m) {
            current.push(state[0]);
            if (omega_m - speed).abs() > SPEED_STEP || !speed.is_finite() {
                speed = *omega_m;
                step = Self::machine(x, speed).continuous().series(self.h, ORDER);
            }
            state = step.advance(state, v - signs(*i) * x[4]);
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

    fn jacobian(&self, x: &DVector<f64>, at: &DVector<f64>) -> Option<DMatrix<f64>> {
        let mut jacobian = DMatrix::zeros(at.len(), UNKNOWNS);
        for (column, step) in DERIVATIVE.into_iter().enumerate() {
            let mut moved = x.clone();
            moved[column] += step;
            jacobian.set_column(column, &((self.residual(&moved)? - at) / step));
        }
        Some(jacobian)
    }

    /// The machine that fits best, from this start.
    ///
    /// # Errors
    /// [`NotIdentifiable::TooFewSamples`]; [`NotIdentifiable::NotFinite`]; [`NotIdentifiable::PoorExcitation`] when the
    /// record leaves a parameter open; [`NotIdentifiable::NotConverged`].
    pub fn fit(&self, start: &Parameters) -> Result<OutputErrorFit, NotIdentifiable> {
        let count = self.i.len();
        if count < 2 * UNKNOWNS || self.v.len() != count || self.omega_m.len() != count {
            return Err(NotIdentifiable::TooFewSamples);
        }
        let k = start.l_s / start.sigma_l_s - 1.0;
        let logs = [start.r_s, start.tau_r, start.sigma_l_s, k].map(f64::ln);
        let mut x = DVector::zeros(UNKNOWNS);
        x.rows_mut(0, 4).copy_from_slice(&logs);
        (x[7], x[8]) = (self.i[0].re, self.i[0].im);
        let mut residual = self.residual(&x).ok_or(NotIdentifiable::NotFinite)?;
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let jacobian = self.jacobian(&x, &residual).ok_or(NotIdentifiable::NotFinite)?;
            let normal = jacobian.tr_mul(&jacobian);
            let gradient = jacobian.tr_mul(&residual);
            loop {
                let mut damped = normal.clone();
                for n in 0..UNKNOWNS {
                    damped[(n, n)] += damping * normal[(n, n)].max(1e-12);
                }
                let factor = damped.cholesky().ok_or(NotIdentifiable::PoorExcitation)?;
                let mut step = -factor.solve(&gradient);
                // No leap of more than a factor e in any parameter.
                let leap = step.rows(0, 4).amax();
                step *= (1.0 / leap).min(1.0);
                let next = &x + &step;
                let there = self.residual(&next);
                let lower = there.filter(|there| there.norm_squared() < residual.norm_squared());
                if let Some(there) = lower {
                    let gain = 1.0 - there.norm_squared() / residual.norm_squared();
                    (x, residual) = (next, there);
                    damping = (damping * 0.2).max(1e-12);
                    if gain < CONVERGED {
                        return self.finished(&x, &residual);
                    }
                    break;
                }
                if damping > 1e6 {
                    // No direction leads down: the minimum to rounding.
                    return self.finished(&x, &residual);
                }
                damping *= 8.0;
            }
        }
        Err(NotIdentifiable::NotConverged)
    }

    fn finished(
        &self,
        x: &DVector<f64>,
        residual: &DVector<f64>,
    ) -> Result<OutputErrorFit, NotIdentifiable> {
        let jacobian = self.jacobian(x, residual).ok_or(NotIdentifiable::NotFinite)?;
        let inverse = jacobian.tr_mul(&jacobian).try_inverse();
        let inverse = inverse.ok_or(NotIdentifiable::PoorExcitation)?;
        let variance = residual.norm_squared() / (residual.len() - UNKNOWNS) as f64;
        let omega_m = self.omega_m.iter().sum::<f64>() / self.omega_m.len() as f64;
        let parameters = Self::machine(x, omega_m);
        let deviation = |n: usize| (variance * inverse[(n, n)]).sqrt();
        // l_s = sigma_l_s (1 + k), both unknown as logarithms.
        let share = 1.0 - parameters.sigma_l_s / parameters.l_s;
        let of_l_s =
            inverse[(2, 2)] + 2.0 * share * inverse[(2, 3)] + share.powi(2) * inverse[(3, 3)];
        let deviations = [
            parameters.r_s * deviation(0),
            parameters.tau_r * deviation(1),
            parameters.sigma_l_s * deviation(2),
            parameters.l_s * (variance * of_l_s).sqrt(),
            deviation(4),
        ];
        if !deviations.iter().all(|deviation| deviation.is_finite()) {
            return Err(NotIdentifiable::PoorExcitation);
        }
        let residual_a = (residual.norm_squared() / self.i.len() as f64).sqrt();
        let (current, drop_v) = (self.simulate(x), x[4]);
        Ok(OutputErrorFit { parameters, drop_v, deviations, current, residual_a })
    }
}

/// The signs of the three phase currents as a vector: two thirds of 2, or of the length of the hexagon's side.
fn signs(i: Complex) -> Complex {
    let half = 0.5 * 3.0_f64.sqrt();
    let [a, b, c] = [i.re, -0.5 * i.re + half * i.im, -0.5 * i.re - half * i.im].map(f64::signum);
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}
