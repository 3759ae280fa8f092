//! Covariance of the states of a Kalman filter.

/// Number of states.
pub const N: usize = 6;
/// Number of different elements.
const SIZE: usize = N * (N + 1) / 2;

/// The lower triangle of the covariance, row by row. (With both triangles, each rounded separately, the covariance loses its definiteness
/// within a minute.)
#[derive(Clone, Copy, Debug, Default)]
pub struct Covariance(pub(super) [f32; SIZE]);

/// Covariances of a measurement `z = h x + noise` with the states.
#[derive(Clone, Copy, Debug, Default)]
pub struct Weights {
    /// `P h'`.
    pub states: [f32; N],
    /// `h P h'`, the variance that the states explain.
    pub explained: f32,
}

/// Place of an element in the triangle.
pub(super) const fn place(n: usize, m: usize) -> usize {
    if n > m { n * (n + 1) / 2 + m } else { m * (m + 1) / 2 + n }
}

impl Covariance {
    /// The covariance of independent states.
    pub fn of(variances: [f32; N]) -> Self {
        let mut p = [0.0; SIZE];
        for (n, variance) in variances.into_iter().enumerate() {
            p[place(n, n)] = variance;
        }
        Self(p)
    }

    /// `x_TO += factor x_FROM`.
    #[inline(always)] // with its places as constants
    pub fn add<const TO: usize, const FROM: usize>(&mut self, factor: f32) {
        let p = &mut self.0;
        let (both, from) = (p[place(TO, FROM)], p[place(FROM, FROM)]);
        for n in 0..N {
            if n != TO {
                p[place(TO, n)] += factor * p[place(FROM, n)];
            }
        }
        p[place(TO, TO)] += factor * (2.0 * both + factor * from);
    }

    /// `x_OF *= factor`, and then noise of this variance.
    #[inline(always)] // with its places as constants
    pub fn keep<const OF: usize>(&mut self, factor: f32, noise: f32) {
        let p = &mut self.0;
        for n in 0..N {
            p[place(OF, n)] *= factor;
        }
        p[place(OF, OF)] = factor * p[place(OF, OF)] + noise;
    }

    /// Returns the covariances of a state with all states.
    #[inline(always)] // with its places as constants
    pub fn row<const OF: usize>(&self) -> [f32; N] {
        core::array::from_fn(|n| self.0[place(OF, n)])
    }

    /// Reduces the covariance by the `information` of measurements with these weights, `P -= P h' h P/(1/information + h P h')`.
    #[inline(never)] // in the control memory once for two calls: 470 bytes, and 240 cycles less than from the flash
    pub fn reduce(&mut self, weights: &Weights, information: f32) {
        let share = information / (1.0 + weights.explained * information);
        let mut covariance = self.0.iter_mut();
        for n in 0..N {
            let gain = weights.states[n] * share;
            for (p, state) in covariance.by_ref().take(n + 1).zip(&weights.states) {
                *p -= gain * state;
            }
        }
    }
}
