//! Recursive least squares in `f64`, as reference for `rotor_id::rls`.

use sim_lab::identification::{Complex, Delta};

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
    /// Starts with all coefficients of Eq. 14 zero and P0 = `p0` I.
    pub fn new(lambda: f64, p0: f64) -> Self {
        let theta =
            [Complex::new(-1.0, 0.0), Complex::new(-1.0, 0.0), Complex::ZERO, Complex::ZERO];
        let (u, samples) = ([[Complex::ZERO; 4]; 4], [[Complex::ZERO; 3]; 2]);
        Self { lambda, theta, u, d: [p0; 4], samples, count: 0 }
    }

    /// Processes one filtered sample.
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

    /// Returns the estimate.
    pub fn delta(&self) -> Delta {
        Delta::from_array(self.theta)
    }
}
