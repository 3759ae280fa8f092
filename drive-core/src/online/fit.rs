//! One Gauss-Newton step of a machine towards what recursive least squares found.

use crate::rls::ud::N;
use crate::rls::{Complex32, Rls};

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknowns {
    /// Stator resistance, ohm.
    pub r_s: f32,
    /// 1 / tau_r, 1/s.
    pub rate: f32,
    /// Speed of the rotor, electrical rad/s.
    pub omega_m: f32,
}

/// What is known.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Transient inductance of the stator, H.
    pub sigma_l_s: f32,
    /// l_m² / l_r, H.
    pub coupled: f32,
    /// Sampling period, s.
    pub period: f32,
}

/// A step of the fit.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Where it leads.
    pub unknowns: Unknowns,
    /// Relative uncertainty of the rate, by the noise of the prediction and by what is excited.
    pub uncertainty: f32,
}

type Column = [Complex32; N];

const ONE: Complex32 = Complex32::new(1.0, 0.0);

impl Machine {
    /// The coefficients of [`Rls`] that this machine has: Eq. 9 sampled by the series to h^5 (the
    /// largest element of A h is 0.07: what is left out is 1e-9), Eq. 15 to 18 in differences.
    pub fn coefficients(&self, x: &Unknowns) -> Column {
        let h = self.period;
        let k = self.coupled / self.sigma_l_s;
        let rotor = Complex32::new(x.rate * h, -x.omega_m * h);
        let a = [
            [Complex32::new(-(x.r_s / self.sigma_l_s + k * x.rate) * h, 0.0), rotor * k],
            [Complex32::new(x.rate * h, 0.0), -rotor],
        ];
        // I + A h/2 (I + A h/3 (I + A h/4 (I + A h/5)))
        let mut integral = [[ONE, Complex32::ZERO], [Complex32::ZERO, ONE]];
        for n in [5.0, 4.0, 3.0, 2.0] {
            integral = product(&a, &integral).map(|row| row.map(|x| x * (1.0 / n)));
            integral[0][0] += ONE;
            integral[1][1] += ONE;
        }
        let [[e11, e12], [e21, e22]] = product(&integral, &a);
        let b = h / self.sigma_l_s;
        let (h11, h21) = (integral[0][0] * b, integral[1][0] * b);
        [e11 + e22 + ONE, e12 * e21 - e11 * e22, h11, e12 * h21 - e22 * h11]
    }

    /// A step from `from`; `scale` are sizes of the unknowns, and `free_speed` says whether the speed
    /// is one. Nothing where the data do not fix the unknowns.
    pub fn step(
        &self,
        rls: &Rls,
        from: &Unknowns,
        scale: &Unknowns,
        free_speed: bool,
    ) -> Option<Fit> {
        let here = self.coefficients(from);
        let residual = rls.whitened(difference(&rls.latest(), &here));
        let speed_scale = scale.rate;
        let sizes = [scale.rate, scale.r_s, speed_scale];
        let count = if free_speed { 3 } else { 2 };
        // A hundredth of their size: the coefficients are all but straight over that, and it is far
        // above rounding.
        const PART: f32 = 0.01;
        let mut slopes = [[Complex32::ZERO; N]; 3];
        for (k, (slope, size)) in slopes.iter_mut().zip(sizes).take(count).enumerate() {
            let mut x = *from;
            match k {
                0 => x.rate += PART * size,
                1 => x.r_s += PART * size,
                _ => x.omega_m += PART * size,
            }
            let change = difference(&self.coefficients(&x), &here);
            *slope = rls.whitened(change.map(|x| x * (1.0 / PART)));
        }
        let solution = solve(&slopes, &residual, count)?;
        let [rate, r_s, omega_m] = solution.step;
        // No further than a factor: the next calls go on.
        let limited = |x: f32, limit: f32| {
            if x > limit {
                limit
            } else if x < -limit {
                -limit
            } else {
                x
            }
        };
        let unknowns = Unknowns {
            rate: from.rate + limited(rate * scale.rate, 0.3 * from.rate),
            r_s: from.r_s + limited(r_s, 0.3) * scale.r_s,
            omega_m: from.omega_m + limited(omega_m, 10.0) * speed_scale,
        };
        let finite = unknowns.rate.is_finite() && unknowns.r_s.is_finite();
        if !(finite && unknowns.omega_m.is_finite()) {
            return None;
        }
        // The prediction errors behind the filters are alike for about 1/corner samples.
        let noise = rls.error_square() / rls.settings().corner;
        let uncertainty = libm::sqrtf(noise / solution.information);
        Some(Fit { unknowns, uncertainty })
    }
}

/// Least squares in units of the sizes.
struct Solution {
    step: [f32; 3],
    /// What the data say of the first unknown with the others free.
    information: f32,
}

/// Solves for `count` unknowns by Cholesky's method, the first unknown last, so that the last pivot is
/// the information about it.
#[expect(clippy::needless_range_loop, reason = "matrix indices read as in the equations")]
fn solve(slopes: &[Column; 3], residual: &Column, count: usize) -> Option<Solution> {
    let order = match count {
        3 => [2, 1, 0],
        _ => [1, 0, 2],
    };
    let mut l = [[0.0f32; 3]; 3];
    let mut y = [0.0f32; 3];
    let mut pivot = 0.0;
    for i in 0..count {
        let slope = &slopes[order[i]];
        let mut right = dot(slope, residual);
        for j in 0..=i {
            let mut sum = dot(slope, &slopes[order[j]]);
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            if i == j {
                // What rounding leaves of a sum that cancels says nothing; not-a-number neither.
                if sum.is_nan() || sum <= 1e-5 * dot(slope, slope) {
                    return None;
                }
                pivot = sum;
                l[i][i] = libm::sqrtf(sum);
            } else {
                l[i][j] = sum / l[j][j];
            }
        }
        for k in 0..i {
            right -= l[i][k] * y[k];
        }
        y[i] = right / l[i][i];
    }
    let mut step = [0.0; 3];
    for i in (0..count).rev() {
        let mut sum = y[i];
        for k in i + 1..count {
            sum -= l[k][i] * step[order[k]];
        }
        step[order[i]] = sum / l[i][i];
    }
    Some(Solution { step, information: pivot })
}

fn product(a: &[[Complex32; 2]; 2], b: &[[Complex32; 2]; 2]) -> [[Complex32; 2]; 2] {
    let entry = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j];
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

fn difference(a: &Column, b: &Column) -> Column {
    core::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: &Column, b: &Column) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}
