//! Identification of Eq. 3.43 from data, and the controller of Eq. 3.44 for it.

use super::measure::Record;
use crate::identification::arx::{Orders, fit};
use crate::poles::roots;
use crate::prelude::*;

/// The plant k / ((z - p1)(z - p2)) = k / (z^2 + a1 z + a2).
#[derive(Clone, Copy, Debug)]
pub struct Model {
    /// Gain, A/rad or 1/rad.
    pub k: f64,
    /// Coefficients of the denominator.
    pub a: [f64; 2],
}

/// PII controller, Eq. 3.44.
#[derive(Clone, Copy, Debug)]
pub struct Pii {
    /// Gain, rad/A or rad.
    pub k_s: f64,
    /// Zero.
    pub z_s: f64,
}

impl Pii {
    /// The controller of section 3.11.
    pub fn printed() -> Self {
        let [k_s, z_s] = ["k_s", "z_s"].map(|gain| source::number("S1", "Eq. 3.44", gain));
        Self { k_s, z_s }
    }
}

/// q-axis currents of Table 6, A.
pub const TABLE_6_A: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// Number of iterations, in each of which the data are filtered by the last denominator.
const ITERATIONS: usize = 40;

impl Model {
    /// Returns a row of Table 6.
    pub fn printed(row: usize) -> Self {
        let place = format!("Table 6, {:.1} A", TABLE_6_A[row]);
        let [k, re, im] = ["k_phi", "Re p", "Im p"].map(|of| source::number("S1", &place, of));
        Self { k: 1e-5 * k, a: [-2.0 * re, re * re + im * im] }
    }

    /// Fits Eq. 3.43 by least squares as in Appendix A, which minimises the equation error. Then it iterates with the
    /// data filtered by the last denominator (Steiglitz and McBride), which minimises the output error.
    ///
    /// # Errors
    /// [`Error::Refused`] if the data do not excite the model.
    pub fn identify(record: &Record) -> Result<[Self; 2], Error> {
        let refused = |error: crate::identification::NotIdentifiable| {
            Error::Refused(format!("the data do not give Eq. 3.43: {error}"))
        };
        let orders = Orders { outputs: 2, inputs: 1, delay: 1 };
        // Three periods of the sequence, so that the transients of the filters decay in the first.
        let (u, y) = (record.u.repeat(3), record.y.repeat(3));
        let period = record.u.len();
        let solve = |u: &[f64], y: &[f64]| {
            let arx = fit(&u[period..], &y[period..], orders).map_err(refused)?;
            Ok::<_, Error>(Self { k: arx.b[0], a: [arx.a[0], arx.a[1]] })
        };
        let first = solve(&u, &y)?;
        let mut model = first;
        for _ in 0..ITERATIONS {
            if !model.is_stable() {
                break;
            }
            let filter = Self { k: 1.0, a: model.a };
            model = solve(&filter.simulate(&u), &filter.simulate(&y))?;
        }
        Ok([first, model])
    }

    /// Computes the output for this input, from rest.
    pub fn simulate(&self, u: &[f64]) -> Vec<f64> {
        let mut y = Vec::with_capacity(u.len());
        for k in 0..u.len() {
            let [y1, y2] = [1, 2].map(|n| if k >= n { y[k - n] } else { 0.0 });
            let u2 = if k >= 2 { u[k - 2] } else { 0.0 };
            y.push(self.k * u2 - self.a[0] * y1 - self.a[1] * y2);
        }
        y
    }

    /// Returns the quality of the fit over a period of the sequence: 100 % minus the rms error divided by the rms of the signal.
    pub fn fit(&self, record: &Record) -> f64 {
        let n = record.u.len();
        let y = self.simulate(&record.u.repeat(3)).split_off(2 * n);
        let square = |of: &dyn Fn(usize) -> f64| (0..n).map(|k| of(k).powi(2)).sum::<f64>();
        let left = square(&|k| record.y[k] - y[k]) / square(&|k| record.y[k]);
        100.0 * (1.0 - left.sqrt())
    }

    /// Returns the gain at dc, per rad.
    pub fn static_gain(&self) -> f64 {
        self.k / (1.0 + self.a[0] + self.a[1])
    }

    /// Returns both poles, the pole with the larger imaginary part (or the larger real one) first.
    pub fn poles(&self) -> [Complex64; 2] {
        let poles = roots(&self.a);
        let [p, q] = [poles[0], poles[1]];
        if (p.im, p.re) < (q.im, q.re) { [q, p] } else { [p, q] }
    }

    fn is_stable(&self) -> bool {
        let [a1, a2] = self.a;
        a2.abs() < 1.0 && a1.abs() < 1.0 + a2
    }

    /// Returns the frequency response at an angle in rad/sample.
    pub fn response(&self, omega_t: f64) -> Complex64 {
        let z = Complex64::cis(omega_t);
        let [a1, a2] = self.a.map(|a| Complex64::new(a, 0.0));
        Complex64::new(self.k, 0.0) / (z * z + a1 * z + a2)
    }

    /// Returns the coefficients of the characteristic polynomial of this plant with a controller, without the first
    /// one: (z - 1)^2 (z^2 + a1 z + a2) + k_s k (z - z_s).
    pub fn closed_loop(&self, pii: Pii) -> [f64; 4] {
        let [a1, a2] = self.a;
        let gain = pii.k_s * self.k;
        [a1 - 2.0, a2 - 2.0 * a1 + 1.0, a1 - 2.0 * a2 + gain, a2 - gain * pii.z_s]
    }

    /// Designs the fastest controller that is stable and keeps the sensitivity peak below `MS`, with its zero a factor
    /// `LEAD` below the crossover. Also returns that crossover, rad/sample. (A phase margin alone would not suffice,
    /// because an identified plant may have a peak above the crossover.)
    pub fn design(&self) -> Option<(Pii, f64)> {
        let sign = self.static_gain().signum();
        let candidates = (0..200).map(|n| 0.3 * 0.97_f64.powi(n)).map(|crossover| {
            let open = self.open_loop(Pii { k_s: 1.0, z_s: 1.0 - crossover / LEAD }, crossover);
            (Pii { k_s: sign / open.norm(), z_s: 1.0 - crossover / LEAD }, crossover)
        });
        let fits = |pii: Pii| {
            largest_pole(&self.closed_loop(pii)) < 1.0
                && (1..300).all(|n| {
                    let w = std::f64::consts::PI * 0.97_f64.powi(n);
                    (Complex64::ONE + self.open_loop(pii, w)).norm() > 1.0 / MS
                })
        };
        candidates.into_iter().find(|&(pii, _)| fits(pii))
    }

    /// Frequency response of controller and plant, at an angle in rad/sample.
    pub fn open_loop(&self, pii: Pii, omega_t: f64) -> Complex64 {
        let z = Complex64::cis(omega_t);
        let integrator = z - Complex64::ONE;
        let controller = (z - Complex64::new(pii.z_s, 0.0)) / (integrator * integrator);
        controller * Complex64::new(pii.k_s, 0.0) * self.response(omega_t)
    }
}

/// Crossover frequency divided by the zero of the designed controller.
const LEAD: f64 = 4.0;
/// Largest sensitivity peak of the design.
const MS: f64 = 2.0;
