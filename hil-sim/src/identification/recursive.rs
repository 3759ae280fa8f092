//! Recursive least squares in `f64`, the reference of `rotor_id::rls`, and the plain recursion as
//! it is printed in textbooks, which fails.

use rustfft::num_complex::Complex as Of;
use rustfft::num_traits::Float;

use super::{Complex, Delta};

/// U D Uᴴ recursion in differences, the algorithm of `rotor_id::rls` without its guards.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    lambda: f64,
    theta: [Complex; 4],
    u: [[Complex; 4]; 4],
    d: [f64; 4],
    /// Voltage and current of the last three samples, newest first.
    samples: [[Complex; 3]; 2],
    count: u32,
}

impl Reference {
    /// All coefficients of Eq. 14 zero, P0 = `p0` I.
    pub fn new(lambda: f64, p0: f64) -> Self {
        let theta =
            [Complex::new(-1.0, 0.0), Complex::new(-1.0, 0.0), Complex::ZERO, Complex::ZERO];
        let (u, samples) = ([[Complex::ZERO; 4]; 4], [[Complex::ZERO; 3]; 2]);
        Self { lambda, theta, u, d: [p0; 4], samples, count: 0 }
    }

    /// One filtered sample.
    pub fn step(&mut self, v: Complex, i: Complex) {
        for (samples, x) in self.samples.iter_mut().zip([v, i]) {
            *samples = [x, samples[0], samples[1]];
        }
        self.count = self.count.saturating_add(1);
        if self.count > 3 {
            let [[_, v1, v2], [i0, i1, i2]] = self.samples;
            self.update([i1 - i2, i2, v1 - v2, v2], i0 - i1);
        }
    }

    #[expect(clippy::needless_range_loop, reason = "matrix indices read as in the equations")]
    fn update(&mut self, x: [Complex; 4], y: Complex) {
        let predicted: Complex = (0..4).map(|k| x[k] * self.theta[k]).sum();
        let mut alpha = self.lambda;
        let mut gain = [Complex::ZERO; 4];
        for j in 0..4 {
            let w = x[j] + (0..j).map(|i| self.u[i][j] * x[i]).sum::<Complex>();
            let g = w.conj() * self.d[j];
            let next = alpha + self.d[j] * w.norm_sqr();
            self.d[j] *= alpha / (next * self.lambda);
            for i in 0..j {
                let u = self.u[i][j];
                self.u[i][j] = u - gain[i] * w / alpha;
                gain[i] += u * g;
            }
            gain[j] = g;
            alpha = next;
        }
        for k in 0..4 {
            self.theta[k] += gain[k] * (y - predicted) / alpha;
        }
    }

    /// The estimate.
    pub fn delta(&self) -> Delta {
        Delta::from_array(self.theta)
    }
}

/// The plain recursion on Eq. 14: with g = P conj(x), K = g / (lambda + x g) and
/// P = (P - K gᴴ) / lambda.
///
/// Kept to show that it fails, in `f32` and in `f64`: P loses its symmetry, then its sign.
#[derive(Clone, Copy, Debug)]
pub struct Plain<T> {
    lambda: T,
    theta: [Of<T>; 4],
    p: [[Of<T>; 4]; 4],
    /// Voltage and current of the last two samples, newest first.
    samples: [[Of<T>; 2]; 2],
    count: u32,
}

impl<T: Float> Plain<T> {
    /// All coefficients zero, P0 = `p0` I.
    pub fn new(lambda: T, p0: T) -> Self {
        let zero = Of::new(T::zero(), T::zero());
        let mut p = [[zero; 4]; 4];
        for (k, row) in p.iter_mut().enumerate() {
            row[k].re = p0;
        }
        Self { lambda, theta: [zero; 4], p, samples: [[zero; 2]; 2], count: 0 }
    }

    /// One filtered sample.
    pub fn step(&mut self, v: Of<T>, i: Of<T>) {
        let [[v1, v2], [i1, i2]] = self.samples;
        self.samples = [[v, v1], [i, i1]];
        self.count = self.count.saturating_add(1);
        if self.count > 3 {
            self.update([i1, i2, v1, v2], i);
        }
    }

    fn update(&mut self, x: [Of<T>; 4], y: Of<T>) {
        let zero = Of::new(T::zero(), T::zero());
        let sum = |f: &dyn Fn(usize) -> Of<T>| (0..4).fold(zero, |sum, k| sum + f(k));
        let p = self.p;
        let column: [Of<T>; 4] = std::array::from_fn(|i| sum(&|k| p[i][k] * x[k].conj()));
        let alpha = sum(&|k| x[k] * column[k]) + self.lambda;
        let error = y - sum(&|k| x[k] * self.theta[k]);
        for i in 0..4 {
            let gain = column[i] / alpha;
            self.theta[i] = self.theta[i] + gain * error;
            for j in 0..4 {
                self.p[i][j] = (p[i][j] - gain * column[j].conj()) / self.lambda;
            }
        }
    }

    /// f1, f0, h1, h0.
    pub fn theta(&self) -> [Of<T>; 4] {
        self.theta
    }

    /// Smallest real part on the diagonal of P: positive as long as P is a covariance.
    pub fn smallest(&self) -> T {
        (0..4).map(|k| self.p[k][k].re).fold(T::infinity(), |a, b| if b < a { b } else { a })
    }

    /// Whether P and the estimate are finite.
    pub fn is_finite(&self) -> bool {
        self.p.iter().flatten().chain(&self.theta).all(|x| x.re.is_finite() && x.im.is_finite())
    }
}
