//! Gauss-Newton fit of a machine model to the coefficients of recursive least squares, one step per call.
//!
//! It runs ten times a second, outside the control interrupt.

use crate::rls::Rls;
use crate::rls::ud::N;
use drive_core::limited;
use num_complex::Complex32;

/// Fitted parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknowns {
    /// Stator resistance, ohm.
    pub r_s: f32,
    /// 1 / tau_r, 1/s.
    pub rate: f32,
    /// Speed of the rotor, electrical rad/s.
    pub omega_m: f32,
}

/// Known parameters of the machine.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Transient inductance of the stator, H.
    pub sigma_l_s: f32,
    /// l_m² / l_r, H.
    pub coupled: f32,
    /// Sampling period, s.
    pub period: f32,
}

/// Result of one step of the fit.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Parameters after the step.
    pub unknowns: Unknowns,
    /// Relative standard deviation of the rate, from prediction error and excitation.
    pub uncertainty: f32,
    /// Relative change of the rate or of the resistance in this step, the larger of both.
    pub moved: f32,
}

type Column = [Complex32; N];

const ONE: Complex32 = Complex32::new(1.0, 0.0);

impl Machine {
    /// Coefficients of this machine in the form of [`Rls`]: Eq. 9 sampled by the series up to h^5 (the
    /// largest element of A h is 0.07: the truncation error is 1e-9), Eq. 15 to 18 in differences.
    ///
    /// With the trace t and the determinant d of A h, (A h)² = t A h - d (Cayley and Hamilton), so that the
    /// series X = 1 + A h/2 + (A h)²/6 + ... is p A h + q. F - 1 is A h X, and H is X b in its first
    /// column. The subtractions of Eq. 16 and 18 cancel analytically and leave the determinant of X.
    pub fn coefficients(&self, x: &Unknowns) -> Column {
        let h = self.period;
        let rotor = Complex32::new(x.rate * h, -x.omega_m * h);
        let stator = x.r_s / self.sigma_l_s * h;
        let a11 = -stator - self.coupled / self.sigma_l_s * x.rate * h;
        let t = Complex32::new(a11, 0.0) - rotor;
        let d = rotor * stator;
        let (mut p, mut q) = (Complex32::ZERO, ONE);
        for n in [1.0 / 5.0, 1.0 / 4.0, 1.0 / 3.0, 1.0 / 2.0] {
            (p, q) = ((q + p * t) * n, ONE - p * d * n);
        }
        let along = q + p * t;
        let turned = rotor * (q * along + p * p * d);
        let b = h / self.sigma_l_s;
        [along * t - p * d * 2.0 + ONE, turned * -stator, (q + p * a11) * b, turned * b]
    }

    /// One Gauss-Newton step from the parameters `from`. `scale` holds typical values of the unknowns;
    /// `free_speed` adds the speed to them. `None` if the data do not determine the unknowns.
    pub fn step(
        &self,
        rls: &Rls,
        from: &Unknowns,
        scale: &Unknowns,
        free_speed: bool,
    ) -> Option<Fit> {
        // Difference quotient over a hundredth of the scale: nearly linear, and far above rounding.
        const PART: f32 = 0.01;
        // The rate comes last: the last pivot is its information with the other unknowns free.
        let shifted = [
            Unknowns { omega_m: from.omega_m + PART * scale.rate, ..*from },
            Unknowns { r_s: from.r_s + PART * scale.r_s, ..*from },
            Unknowns { rate: from.rate + PART * scale.rate, ..*from },
        ];
        let first = if free_speed { 0 } else { 1 };
        let here = self.coefficients(from);
        let difference = |there: Column, factor: f32| {
            rls.whitened(core::array::from_fn(|n| (there[n] - here[n]) * factor))
        };
        // The right-hand side comes last.
        let mut columns = [difference(rls.latest(), 1.0); UNKNOWNS + 1];
        for (column, x) in columns.iter_mut().zip(&shifted).skip(first) {
            *column = difference(self.coefficients(x), 1.0 / PART);
        }
        let (step, information) = solve(&columns, first)?;
        // The step is limited; the next calls continue.
        let unknowns = Unknowns {
            rate: from.rate + limited(step[2] * scale.rate, 0.3 * from.rate),
            r_s: from.r_s + limited(step[1], 0.3) * scale.r_s,
            omega_m: from.omega_m + limited(step[0], 10.0) * scale.rate,
        };
        if !(unknowns.rate + unknowns.r_s + unknowns.omega_m).is_finite() {
            return None;
        }
        // The filtered prediction errors are correlated over about 1/corner samples.
        let noise = rls.error_square() / rls.settings().corner;
        let uncertainty = fpu_sqrt::sqrtf(noise / information);
        let rate_moved = (unknowns.rate / from.rate - 1.0).abs();
        let r_s_moved = ((unknowns.r_s - from.r_s) / scale.r_s).abs();
        let moved = if rate_moved > r_s_moved { rate_moved } else { r_s_moved };
        Some(Fit { unknowns, uncertainty, moved })
    }
}

/// Number of unknowns: speed, resistance and rate, in this order.
const UNKNOWNS: usize = 3;

/// Solves the normal equations for the unknowns from `first` on by Cholesky decomposition. `columns` holds
/// the derivatives by each unknown, then the right-hand side. Returns the
/// solution in units of the scale, and the information (inverse variance) of the last unknown with the others free; `None` if
/// they are singular.
#[expect(clippy::needless_range_loop, reason = "matrix indices read as in the equations")]
fn solve(columns: &[Column; UNKNOWNS + 1], first: usize) -> Option<([f32; UNKNOWNS], f32)> {
    // The last row is the right-hand side after forward substitution.
    let mut l = [[0.0f32; UNKNOWNS]; UNKNOWNS + 1];
    let mut information = 0.0;
    for i in first..=UNKNOWNS {
        for j in first..UNKNOWNS.min(i + 1) {
            let mut sum = dot(&columns[i], &columns[j]);
            for k in first..j {
                sum -= l[i][k] * l[j][k];
            }
            if i == j {
                // A remainder at the level of rounding carries no information; NaN neither.
                if sum.is_nan() || sum <= 1e-5 * dot(&columns[i], &columns[i]) {
                    return None;
                }
                information = sum;
                l[i][i] = fpu_sqrt::sqrtf(sum);
            } else {
                l[i][j] = sum / l[j][j];
            }
        }
    }
    let mut step = [0.0; UNKNOWNS];
    for i in (first..UNKNOWNS).rev() {
        let mut sum = l[UNKNOWNS][i];
        for k in i + 1..UNKNOWNS {
            sum -= l[k][i] * step[k];
        }
        step[i] = sum / l[i][i];
    }
    Some((step, information))
}

/// Real part of the scalar product.
fn dot(a: &Column, b: &Column) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with numbers of a simulation in `f64`, of the machine in the tables of the paper, at
    /// 375 rad/s and 50 µs: 0.39 and 1.41 ohm, 94 mH each, 91 mH between them.
    #[test]
    fn the_sampled_machine_is_that_of_the_series() {
        let f1 = [1.984_696_196_81, 0.018_526_703_998_9];
        let f0 = [-0.984_699_229_9, -0.018_465_274_510_6];
        let h1 = [0.008_407_409_217_99, -2.938_939_91e-7];
        let h0 = [-0.008_399_632_072_26, -0.000_157_217_614_529];
        let expected = [0, 1].map(|k: usize| {
            let one = if k == 0 { 1.0 } else { 0.0 };
            [f1[k] - one, f1[k] + f0[k] - one, h1[k], h1[k] + h0[k]]
        });
        let machine =
            Machine { sigma_l_s: 0.005_904_255_3, coupled: 0.091 * 0.091 / 0.094, period: 50e-6 };
        let x = Unknowns { r_s: 0.39, rate: 1.41 / 0.094, omega_m: 375.0 };
        for (n, got) in machine.coefficients(&x).into_iter().enumerate() {
            let [re, im] = [expected[0][n], expected[1][n]];
            let error = libm::hypot(f64::from(got.re) - re, f64::from(got.im) - im);
            // The error is a few roundings, although two of the four are differences of numbers up
            // to 30 000 times as large.
            assert!(error < 1e-6 * libm::hypot(re, im), "{n}: {got:?} for {re} {im}");
        }
    }

    /// An estimate is published only when the fit has settled, and the resistance still changes long after the rate is right.
    #[test]
    fn a_resistance_that_travels_counts_as_a_move() {
        let machine = Machine { sigma_l_s: 0.0515, coupled: 0.1532, period: 10.0 / 6000.0 };
        let truth = Unknowns { r_s: 5.4, rate: 1.0 / 0.186, omega_m: 31.4 };
        let settings = drive_settings::Settings::default();
        let mut rls = *crate::online::Online::new(&settings).unwrap().rls();
        rls.begin_at(machine.coefficients(&truth));
        for (r_s, at_least, at_most) in [(2.7, 0.29, 0.31), (5.4, 0.0, 0.001)] {
            let fit = machine.step(&rls, &Unknowns { r_s, ..truth }, &truth, false).unwrap();
            assert!((at_least..=at_most).contains(&fit.moved), "{r_s}: {fit:?}");
            assert!((fit.unknowns.rate / truth.rate - 1.0).abs() < 0.04, "{r_s}: {fit:?}");
        }
    }
}
