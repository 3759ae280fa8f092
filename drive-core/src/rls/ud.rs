//! The covariance of recursive least squares as P = U D Uᴴ (Bierman): U upper triangular with ones
//! on its diagonal, D real. P stays positive whatever the rounding, as long as D does, and every
//! element of D is only ever multiplied by positive numbers.
//!
//! The plain recursion on P fails with the settings of the paper: P loses its symmetry and then its
//! sign, in `f32` after 42 to 87 samples, in `f64` after 62 to 385, and ends as NaN.

use super::Complex32;

/// Unknowns.
pub const N: usize = 4;

/// Estimate and covariance.
#[derive(Clone, Copy, Debug)]
pub struct Ud {
    /// The estimate.
    pub theta: [Complex32; N],
    /// What the last addition to the estimate rounded off. Without it corrections below half a unit
    /// in the last place are lost and the estimate stands still 1e-6 off.
    lost: [Complex32; N],
    /// Above the diagonal of U.
    u: [[Complex32; N]; N],
    /// D.
    d: [f32; N],
}

impl Ud {
    /// This estimate, with P = `p0` times the unit matrix.
    pub const fn new(theta: [Complex32; N], p0: f32) -> Self {
        Self { theta, lost: [Complex32::ZERO; N], u: [[Complex32::ZERO; N]; N], d: [p0; N] }
    }

    /// Largest element of D: how uncertain the least certain direction is.
    #[inline]
    pub fn largest(&self) -> f32 {
        self.d.iter().fold(0.0, |largest, &d| if d > largest { d } else { largest })
    }

    /// Whether the estimate is finite and P is positive and finite.
    #[inline]
    pub fn is_sound(&self) -> bool {
        self.theta.iter().all(|x| x.is_finite()) && self.d.iter().all(|&d| d > 0.0 && d.is_finite())
    }

    /// D^-1/2 U^-1 x: where P is the covariance of x, numbers of size one that know nothing of each
    /// other. Where P is large, x counts for little. Not for the control step: it takes roots.
    pub fn whitened(&self, mut x: [Complex32; N]) -> [Complex32; N] {
        for j in (1..N).rev() {
            for i in 0..j {
                x[i] = x[i] - self.u[i][j] * x[j];
            }
        }
        core::array::from_fn(|k| x[k] * (1.0 / libm::sqrtf(self.d[k])))
    }

    /// Takes y = sum x theta in, forgetting by `lambda`. The error of the prediction.
    ///
    /// About 290 multiplications and additions and 5 divisions.
    #[inline]
    #[expect(clippy::needless_range_loop, reason = "matrix indices read as in the equations")]
    pub fn update(&mut self, x: [Complex32; N], y: Complex32, lambda: f32) -> Complex32 {
        let mut error = y;
        for (x, theta) in x.iter().zip(&self.theta) {
            error = error - *x * *theta;
        }
        let forget = 1.0 / lambda;
        let (mut alpha, mut inverse) = (lambda, forget);
        // P conj(x), a column of U at a time.
        let mut gain = [Complex32::ZERO; N];
        for j in 0..N {
            let mut w = x[j];
            for i in 0..j {
                w += self.u[i][j] * x[i];
            }
            let g = w.conj() * self.d[j];
            let next = alpha + self.d[j] * w.square();
            let next_inverse = 1.0 / next;
            self.d[j] *= alpha * next_inverse * forget;
            let mu = w * -inverse;
            for i in 0..j {
                let u = self.u[i][j];
                self.u[i][j] = u + gain[i] * mu;
                gain[i] += u * g;
            }
            gain[j] = g;
            (alpha, inverse) = (next, next_inverse);
        }
        let step = error * inverse;
        for ((theta, lost), gain) in self.theta.iter_mut().zip(&mut self.lost).zip(&gain) {
            let (old, change) = (*theta, *gain * step + *lost);
            *theta = old + change;
            *lost = change - (*theta - old);
        }
        error
    }
}
