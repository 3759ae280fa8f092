//! The covariance of recursive least squares as P = U D Uᴴ (Bierman): U upper triangular with ones
//! on its diagonal, D real. P stays positive whatever the rounding, as long as D does, and every
//! element of D is only ever multiplied by positive numbers.
//!
//! The plain recursion on P fails with the settings of the paper: P loses its symmetry and then its
//! sign, in `f32` after 42 to 87 samples, in `f64` after 62 to 385, and ends as NaN.

use num_complex::Complex32;

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
    /// Above the diagonal of U, column by column.
    u: [Complex32; N * (N - 1) / 2],
    /// D, and its largest element.
    d: [f32; N],
    largest: f32,
}

impl Ud {
    /// This estimate, with P = `p0` times the unit matrix.
    pub const fn new(theta: [Complex32; N], p0: f32) -> Self {
        Self {
            theta,
            lost: [Complex32::ZERO; N],
            u: [Complex32::ZERO; N * (N - 1) / 2],
            d: [p0; N],
            largest: p0,
        }
    }

    /// Largest element of D: how uncertain the least certain direction is.
    pub fn largest(&self) -> f32 {
        self.largest
    }

    /// D^-1/2 U^-1 x: where P is the covariance of x, numbers of size one that know nothing of each
    /// other. Where P is large, x counts for little. Not for the control step: it takes roots.
    pub fn whitened(&self, mut x: [Complex32; N]) -> [Complex32; N] {
        for j in (1..N).rev() {
            for i in 0..j {
                x[i] -= self.u[above(i, j)] * x[j];
            }
        }
        core::array::from_fn(|k| x[k] * (1.0 / libm::sqrtf(self.d[k])))
    }

    /// Takes y = sum x theta in, forgetting by `lambda`, whose inverse is `forget`. The error of the
    /// prediction; nothing if estimate or P are no longer finite and positive.
    ///
    /// About 290 multiplications and additions and 4 divisions.
    pub fn update(
        &mut self,
        x: [Complex32; N],
        y: Complex32,
        (lambda, forget): (f32, f32),
    ) -> Option<Complex32> {
        let mut pass = Pass { alpha: lambda, inverse: forget, gain: [Complex32::ZERO; N] };
        self.column::<0>(&x, forget, &mut pass);
        self.column::<1>(&x, forget, &mut pass);
        self.column::<2>(&x, forget, &mut pass);
        self.column::<3>(&x, forget, &mut pass);
        // (Before the columns, it would hold registers that they need.)
        let mut error = y;
        for (x, theta) in x.iter().zip(&self.theta) {
            error -= *x * *theta;
        }
        let step = error * pass.inverse;
        // Of one that is infinite or not a number, the sum is neither finite.
        let (mut sum, mut positive) = (0.0, true);
        self.largest = 0.0;
        for d in self.d {
            sum += d;
            positive &= d > 0.0;
            if d > self.largest {
                self.largest = d;
            }
        }
        for ((theta, lost), gain) in self.theta.iter_mut().zip(&mut self.lost).zip(&pass.gain) {
            let (old, change) = (*theta, *gain * step + *lost);
            *theta = old + change;
            *lost = change - (*theta - old);
            sum += theta.re + theta.im;
        }
        (positive && sum.is_finite()).then_some(error)
    }

    /// Column `J` of U: of one function, so that its loops are known to the compiler and unrolled.
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

/// From column to column.
struct Pass {
    alpha: f32,
    inverse: f32,
    /// P conj(x), as far as it is known.
    gain: [Complex32; N],
}

/// Where U's element of row i, column j is kept, i < j.
const fn above(i: usize, j: usize) -> usize {
    j * (j - 1) / 2 + i
}
