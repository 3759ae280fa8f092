//! Recursive least squares with the covariance factored as P = U D Uᴴ (Bierman): U upper triangular with
//! unit diagonal, D real. P stays positive definite under rounding as long as D is positive, and every
//! element of D is multiplied by positive numbers only.
//!
//! The plain recursion on P fails with the settings of the paper: P loses its symmetry and then its
//! definiteness, in `f32` after 42 to 87 samples, in `f64` after 62 to 385, and becomes NaN.

use num_complex::Complex32;

/// Number of unknowns.
pub const N: usize = 4;

/// Estimate and covariance.
#[derive(Clone, Copy, Debug)]
pub struct Ud {
    /// The estimate.
    pub theta: [Complex32; N],
    /// Rounding error of the last addition to the estimate. Without it, corrections below half a unit in
    /// the last place are lost and the estimate stops with an error of 1e-6.
    lost: [Complex32; N],
    /// Elements of U above the diagonal, column by column.
    u: [Complex32; N * (N - 1) / 2],
    /// Diagonal of D.
    d: [f32; N],
    /// Largest element of D.
    largest: f32,
}

impl Ud {
    /// Estimate `theta` with P = `p0` I.
    pub const fn new(theta: [Complex32; N], p0: f32) -> Self {
        Self {
            theta,
            lost: [Complex32::ZERO; N],
            u: [Complex32::ZERO; N * (N - 1) / 2],
            d: [p0; N],
            largest: p0,
        }
    }

    /// Largest element of D: the variance of the least certain direction.
    pub fn largest(&self) -> f32 {
        self.largest
    }

    /// Whitened vector D^-1/2 U^-1 x: uncorrelated with unit variance if P is the covariance of x. Not for
    /// the control step: it takes square roots.
    pub fn whitened(&self, mut x: [Complex32; N]) -> [Complex32; N] {
        for j in (1..N).rev() {
            for i in 0..j {
                x[i] -= self.u[above(i, j)] * x[j];
            }
        }
        core::array::from_fn(|k| x[k] * (1.0 / fpu_sqrt::sqrtf(self.d[k])))
    }

    /// Updates the estimate with the equation y = sum x theta and the forgetting factor `lambda`; with 1 nothing
    /// is forgotten. Returns the prediction error before the update; `None` if the estimate is no longer finite
    /// or P no longer positive.
    ///
    /// About 290 multiplications and additions and 5 divisions.
    pub fn update(&mut self, x: [Complex32; N], y: Complex32, lambda: f32) -> Option<Complex32> {
        let inverse = 1.0 / lambda;
        let mut pass = Pass { alpha: lambda, inverse, gain: [Complex32::ZERO; N] };
        self.column::<0>(&x, inverse, &mut pass);
        self.column::<1>(&x, inverse, &mut pass);
        self.column::<2>(&x, inverse, &mut pass);
        self.column::<3>(&x, inverse, &mut pass);
        let error = x.iter().zip(&self.theta).fold(y, |rest, (x, theta)| rest - x * theta);
        let step = error * pass.inverse;
        let positive = self.d.iter().all(|d| *d > 0.0);
        self.largest = self.d.into_iter().fold(0.0, |most, d| if d > most { d } else { most });
        // The sum is finite only if all summands are.
        let mut sum: f32 = self.d.iter().sum();
        for ((theta, lost), gain) in self.theta.iter_mut().zip(&mut self.lost).zip(&pass.gain) {
            let (old, change) = (*theta, *gain * step + *lost);
            *theta = old + change;
            *lost = change - (*theta - old);
            sum += theta.re + theta.im;
        }
        (positive && sum.is_finite()).then_some(error)
    }

    /// Updates column `J` of U; a constant `J` lets the compiler unroll the loops. `forget` is 1 / lambda.
    #[expect(clippy::needless_range_loop, reason = "matrix indices read as in the equations")]
    fn column<const J: usize>(&mut self, x: &[Complex32; N], forget: f32, pass: &mut Pass) {
        let mut w = x[J];
        for i in 0..J {
            w += self.u[above(i, J)] * x[i];
        }
        let g = w.conj() * self.d[J];
        let next = pass.alpha + (w.re * g.re - w.im * g.im);
        let next_inverse = 1.0 / next;
        self.d[J] *= pass.alpha * next_inverse * forget;
        let mu = w * -pass.inverse;
        for i in 0..J {
            let u = self.u[above(i, J)];
            self.u[above(i, J)] = u + pass.gain[i] * mu;
            pass.gain[i] += u * g;
        }
        pass.gain[J] = g;
        (pass.alpha, pass.inverse) = (next, next_inverse);
    }
}

/// Intermediate results passed from column to column.
struct Pass {
    alpha: f32,
    inverse: f32,
    /// P conj(x), accumulated over the columns.
    gain: [Complex32; N],
}

/// Index of element (i, j) of U, i < j.
const fn above(i: usize, j: usize) -> usize {
    j * (j - 1) / 2 + i
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;
    use num_complex::Complex64;

    const LAMBDA: f64 = 0.9;
    const P0: f64 = 10.0;

    fn double(x: Complex32) -> Complex64 {
        Complex64::new(x.re.into(), x.im.into())
    }

    /// Random regressors and outputs.
    fn data() -> Vec<([Complex32; N], Complex32)> {
        let mut random = 1_u32;
        let mut uniform = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut complex = || Complex32::new(uniform(), uniform());
        (0..30).map(|_| (core::array::from_fn(|_| complex()), complex())).collect()
    }

    fn updated(data: &[([Complex32; N], Complex32)]) -> Ud {
        let mut ud = Ud::new([ONE; N], P0 as f32);
        for (x, y) in data {
            ud.update(*x, *y, LAMBDA as f32).unwrap();
        }
        ud
    }

    const ONE: Complex32 = Complex32::new(1.0, 0.0);

    fn product(x: &[Complex32; N], z: &[Complex32; N]) -> Complex64 {
        x.iter().zip(z).map(|(x, z)| double(*x) * double(*z)).sum()
    }

    /// P^-1 = sum lambda^(n-k) conj(x_k) x_k^T + lambda^n / p0.
    #[test]
    fn the_covariance_is_the_inverse_of_the_information() {
        let data = data();
        for count in 0..data.len() {
            let ud = updated(&data[..count]);
            let (z, _) = data[data.len() - 1 - count];
            let mut information = product(&z, &z.map(|z| z.conj())).re / P0;
            for (x, _) in &data[..count] {
                information = LAMBDA * information + product(x, &z).norm_sqr();
            }
            let whitened = ud.whitened(z);
            let got = product(&whitened, &whitened.map(|z| z.conj())).re;
            assert!((got / information - 1.0).abs() < 1e-5, "{count}: {got} for {information}");
        }
    }

    /// The estimate solves the normal equations; the error is that of the estimate before.
    #[test]
    fn the_estimate_is_that_of_weighted_least_squares() {
        let data = data();
        let mut ud = updated(&data);
        let mut rest = ud.theta.map(|theta| double(ONE - theta) / P0);
        for (x, y) in &data {
            let error = double(*y) - product(x, &ud.theta);
            for (rest, x) in rest.iter_mut().zip(x) {
                *rest = *rest * LAMBDA + double(x.conj()) * error;
            }
        }
        assert!(rest.iter().all(|rest| rest.norm() < 1e-5), "{rest:?}");
        let (x, y) = data[3];
        let expected = double(y) - product(&x, &ud.theta);
        let error = ud.update(x, y, 1.0).unwrap();
        assert!((double(error) - expected).norm() < 1e-6);
    }

    #[test]
    fn unexcited_directions_grow_more_uncertain() {
        for left_out in 0..N {
            let mut data = data();
            for (x, _) in &mut data {
                x[left_out] = Complex32::ZERO;
            }
            let expected = P0 / LAMBDA.powi(data.len() as i32);
            let largest = f64::from(updated(&data).largest());
            assert!((largest / expected - 1.0).abs() < 1e-5, "{left_out}: {largest}");
        }
    }

    /// Corrections below half a unit in the last place add up: 1e-8 at a time.
    #[test]
    fn small_corrections_are_not_lost() {
        let mut ud = Ud::new([ONE, Complex32::ZERO, Complex32::ZERO, Complex32::ZERO], 1e-8);
        let x = [ONE, Complex32::ZERO, Complex32::ZERO, Complex32::ZERO];
        for _ in 0..1000 {
            ud.update(x, Complex32::new(2.0, -1.0), 1.0).unwrap();
        }
        let moved = ud.theta[0] - ONE;
        assert!((moved - Complex32::new(1e-5, -1e-5)).norm() < 2e-7, "{moved}");
    }

    #[test]
    fn non_finite_input_is_reported() {
        let (x, y) = data()[0];
        for bad in [f32::NAN, f32::INFINITY] {
            let mut spoilt = x;
            spoilt[2].im = bad;
            assert_eq!(updated(&[]).update(spoilt, y, 1.0), None);
            assert_eq!(updated(&[]).update(x, Complex32::new(bad, 0.0), 1.0), None);
        }
    }
}
