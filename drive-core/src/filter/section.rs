//! Second-order sections and their frequency response.

use num_complex::Complex64;

/// Coefficients of one second-order section,
///
/// ```text
///          b0 + b1 z⁻¹ + b2 z⁻²
/// H(z) =  ----------------------
///           1 + a1 z⁻¹ + a2 z⁻²
/// ```
///
/// `a1` and `a2` have the sign of Eq. C.2 and are subtracted in the step, as in Eq. C.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Coefficient of the input.
    pub b0: f32,
    /// Coefficient of the input one sample ago.
    pub b1: f32,
    /// Coefficient of the input two samples ago.
    pub b2: f32,
    /// Coefficient of the output one sample ago.
    pub a1: f32,
    /// Coefficient of the output two samples ago.
    pub a2: f32,
}

impl Section {
    /// H(z) = 1.
    pub const IDENTITY: Self = Self { b0: 1.0, b1: 0.0, b2: 0.0, a1: 0.0, a2: 0.0 };

    /// From `[b0, b1, b2, a1, a2]`, each rounded to the nearest `f32`.
    pub const fn from_f64(c: [f64; 5]) -> Self {
        Self { b0: c[0] as f32, b1: c[1] as f32, b2: c[2] as f32, a1: c[3] as f32, a2: c[4] as f32 }
    }

    /// Gain at dc, H(1), of the rounded coefficients.
    pub const fn dc_gain(&self) -> f64 {
        (self.b0 as f64 + self.b1 as f64 + self.b2 as f64) / (1.0 + self.a1 as f64 + self.a2 as f64)
    }

    /// Section with the response `gain` H(z).
    pub const fn scaled(self, gain: f64) -> Self {
        Self {
            b0: (self.b0 as f64 * gain) as f32,
            b1: (self.b1 as f64 * gain) as f32,
            b2: (self.b2 as f64 * gain) as f32,
            ..self
        }
    }
}

/// Frequency response H(e^(j ωT)) of a cascade with its rounded coefficients; `omega_t` in rad/sample.
///
/// Not for the control step.
pub fn response(sections: &[Section], omega_t: f64) -> Complex64 {
    let delay = Complex64::cis(-omega_t);
    sections.iter().fold(Complex64::ONE, |h, s| {
        h * polynomial([s.b0, s.b1, s.b2], delay) / polynomial([1.0, s.a1, s.a2], delay)
    })
}

/// c0 + c1 x + c2 x².
#[cold]
fn polynomial(c: [f32; 3], x: Complex64) -> Complex64 {
    let [c0, c1, c2] = c.map(f64::from);
    Complex64::new(c0, 0.0) + x * (Complex64::new(c1, 0.0) + x * Complex64::new(c2, 0.0))
}
