//! Computation of the machine from the sampled equation: Models B and C of the paper, and Model D, the exact algebraic
//! inverse.
//!
//! Bias without noise, in % of (r_s, tau_r, sigma_l_s, l_s, omega_m), for the machine
//! [`Parameters::PX`](super::Parameters::PX) at 375 rad/s:
//!
//! | h (µs) | B | C | D |
//! |---|---|---|---|
//! | 50 | 1.12, -18.92, 0.73, -18.01, -1.19 | 0.40, -0.62, 0.00, -0.22, -1.19 | 0 |
//! | 100 | 2.26, -31.76, 1.46, -30.24, -2.38 | 0.80, -1.36, 0.01, -0.59, -2.38 | 0 |
//! | 200 | 4.55, -48.07, 2.92, -45.78, -4.73 | 1.62, -3.23, 0.04, -1.80, -4.73 | 0 |
//!
//! D is exact to 1e-9 on exact coefficients. It removes the bias, not the noise.

use super::{Complex, Delta, FirstOrderTheta, Parameters};

/// The reason why a parameter cannot be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotIdentifiable {
    /// Fewer rows than unknowns.
    #[error("there are fewer samples than unknowns")]
    TooFewSamples,
    /// A sample, a coefficient or a result is infinite or not a number.
    #[error("a number is not finite")]
    NotFinite,
    /// The regression has (nearly) dependent columns.
    #[error("the signals do not excite all unknowns: the regression is singular")]
    PoorExcitation,
    /// The voltage has no effect on the current: h_1 is zero.
    #[error("the voltage has no effect on the current")]
    NoGain,
    /// Equations 36, 39 and 40 divide by a coefficient that vanishes with the speed.
    #[error("the formula divides by the speed, which is zero")]
    NoSpeed,
    /// The quadratic equation 39 does not open downwards: noise outweighs h / tau_r.
    #[error("the quadratic for the rotor time constant has no positive root")]
    NoPositiveRoot,
    /// Two poles coincide, or one lies at z = 1: the residues do not exist.
    #[error("two discrete poles coincide or one is at 1")]
    DegeneratePoles,
    /// The nonlinear fit did not converge, or it converged to parameters that no machine has.
    #[error("the nonlinear fit did not converge to a machine")]
    NotConverged,
}

/// A finite number, or the reason why it cannot be estimated.
pub type Value = Result<f64, NotIdentifiable>;

/// An estimate of [`Parameters`], each with its own result: noise can make one parameter unidentifiable and not affect
/// the others. Noise can also make a number negative.
pub type Estimate = Parameters<Value>;

impl Estimate {
    /// Makes an estimate without values, for this reason.
    pub const fn none(reason: NotIdentifiable) -> Self {
        Self::of([Err(reason); 5])
    }

    /// Returns all five parameters, if all are identifiable.
    ///
    /// # Errors
    /// The reason of the first parameter that is not identifiable.
    pub fn parameters(&self) -> Result<Parameters, NotIdentifiable> {
        let [r_s, tau_r, sigma_l_s, l_s, omega_m] = self.array();
        Ok(Parameters::of([r_s?, tau_r?, sigma_l_s?, l_s?, omega_m?]))
    }
}

impl From<Parameters> for Estimate {
    fn from(p: Parameters) -> Self {
        Self::of(p.array().map(Ok))
    }
}

/// Returns a finite number, or the error that it is not finite.
fn finite(x: f64) -> Value {
    if x.is_finite() { Ok(x) } else { Err(NotIdentifiable::NotFinite) }
}

/// Returns a quotient, or `reason` if the divisor is zero.
fn ratio(x: f64, y: f64, reason: NotIdentifiable) -> Value {
    if y == 0.0 { Err(reason) } else { finite(x / y) }
}

/// Model B (Eq. 33 to 37): first order in `h` s. It is exact on Eq. 32. On a real machine tau_r and l_s are 18 to 48 %
/// too low at 375 rad/s.
pub fn model_b(theta: &FirstOrderTheta, h: f64) -> Estimate {
    let FirstOrderTheta { t1_minus_1, t2, t2_t4, t5, t5_t6 } = *theta;
    let sigma_l_s = ratio(h, t5, NotIdentifiable::NoGain);
    let tau_r = ratio(h * t5, t5_t6, NotIdentifiable::NoGain);
    let speed = ratio(t2_t4, t2, NotIdentifiable::NoSpeed);
    let r_s = speed.and_then(|x| ratio(x, t5, NotIdentifiable::NoGain));
    let l_s = sigma_l_s.and_then(|s| finite((s * (1.0 - t1_minus_1) / h - r_s?) * tau_r?));
    Estimate { r_s, tau_r, sigma_l_s, l_s, omega_m: finite(-t2 / h) }
}

/// Model C (Eq. 38 to 42): sigma_l_s and tau_r to second order in `h` s, the others to first order. It uses the
/// coefficients in differences, so that no small sum results from a cancellation.
///
/// It takes the root of Eq. 39 with the minus sign; the other root is about h/2. The speed of Eq. 42 is too low by
/// about h (r_s/sigma_l_s + (l_s/sigma_l_s - 1)/tau_r) / 2 relative, 1.19 % at 50 µs for [`Parameters::PX`]; more data
/// do not reduce this error.
pub fn model_c(delta: &Delta, h: f64) -> Estimate {
    let Delta { g1, g0, h1, u0 } = *delta;
    if h1.norm_sqr() == 0.0 {
        return Estimate { omega_m: finite(g1.im / h), ..Estimate::none(NotIdentifiable::NoGain) };
    }
    // 1 - f22 (Eq. 27), f11 (Eq. 28) and fd (Eq. 29).
    let u = u0 / h1;
    let f11 = g1 + u;
    let fd = g0 + u * (Complex::ONE - f11);
    let sigma_l_s = ratio(h * (1.0 + f11.re), 2.0 * h1.re, NotIdentifiable::NoGain);
    // A discriminant that noise has made negative counts as zero.
    let tau_r = time_constant_roots(u, fd, h).map(|[_, root]| root);
    let speed = ratio(g0.im, h * g1.im, NotIdentifiable::NoSpeed);
    let r_s = speed.and_then(|x| finite(x * sigma_l_s?));
    let l_s = sigma_l_s.and_then(|s| finite((s * (1.0 - g1.re) / h - r_s?) * tau_r?));
    Estimate { r_s, tau_r, sigma_l_s, l_s, omega_m: finite(g1.im / h) }
}

/// Returns both roots of Eq. 39 from u = 1 - f22 and fd: the root with the plus sign, about h/2, and the root with the
/// minus sign, the time constant.
///
/// # Errors
/// [`NotIdentifiable::NoSpeed`]; [`NotIdentifiable::NoPositiveRoot`].
pub fn time_constant_roots(u: Complex, fd: Complex, h: f64) -> Result<[f64; 2], NotIdentifiable> {
    let a = -u.re + 0.5 * u.im * u.im;
    let b = h * (1.0 + ratio(fd.im, -2.0 * u.im, NotIdentifiable::NoSpeed)?);
    if a.is_nan() || a >= 0.0 {
        return Err(NotIdentifiable::NoPositiveRoot);
    }
    let root = (b * b + 2.0 * h * h * a).max(0.0).sqrt();
    Ok([finite((root - b) / (2.0 * a))?, finite((-b - root) / (2.0 * a))?])
}

/// Model D: the exact inverse. Poles and residues of the sampled equation give the poles and residues of i/v = (b1 s +
/// b0) / (s² + a1 s + a0) with b1 = 1/sigma_l_s, b0 = (1/tau_r - j omega_m) b1, a0 = r_s b0 and a1 = r_s/sigma_l_s +
/// l_s/(sigma_l_s tau_r) - j omega_m. The relative error is 4e-12 on exact coefficients and 1.2e-7 on those of the
/// series to h^5.
pub fn model_d(delta: &Delta, h: f64) -> Estimate {
    let [e1, e2] = delta.poles_minus_one();
    let apart = e1 - e2;
    let tiny = |x: Complex| x.norm() <= 1e-12 * (e1.norm() + e2.norm());
    if tiny(apart) || tiny(e2) {
        return Estimate::none(NotIdentifiable::DegeneratePoles);
    }
    if delta.h1.norm_sqr() == 0.0 {
        return Estimate::none(NotIdentifiable::NoGain);
    }
    let [s1, s2] = [e1, e2].map(|e| ln_1p(e) / h);
    // h1 z + h0 = h1 e + u0 at a pole z = 1 + e.
    let residue =
        |e: Complex, s: Complex, apart: Complex| (delta.h1 * e + delta.u0) / apart * s / e;
    let (r1, r2) = (residue(e1, s1, apart), residue(e2, s2, -apart));
    let (b1, b0) = (r1 + r2, -(r1 * s2 + r2 * s1));
    let (a1, a0) = (-(s1 + s2), s1 * s2);
    let sigma_l_s = ratio(1.0, b1.re, NotIdentifiable::NoGain);
    let tau_r = ratio(1.0, (b0 / b1).re, NotIdentifiable::NotFinite);
    let r_s = finite((a0 / b0).re);
    let l_s = r_s.and_then(|r_s| finite((a1.re * sigma_l_s? - r_s) * tau_r?));
    Estimate { r_s, tau_r, sigma_l_s, l_s, omega_m: finite(-a1.im) }
}

/// Computes ln(1 + e) without losing a small `e`.
fn ln_1p(e: Complex) -> Complex {
    let re = 0.5 * (2.0 * e.re + e.norm_sqr()).ln_1p();
    Complex::new(re, e.im.atan2(1.0 + e.re))
}
