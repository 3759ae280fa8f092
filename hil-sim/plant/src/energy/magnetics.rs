//! Currents as gradients of one magnetic energy.
//!
//! The stator flux is `s`, the gap-side rotor flux `r`, the flux of the iron's eddy currents `e` and the main flux `m`,
//! all in the stator frame, with `x = s - m`, `y = r - m`, `z = e - m`:
//!
//! ```text
//! W = Wl(x) + Wl(y) + |z|^2/(2 Le) + Wm(m) + c Re(x^2 m*^2)/(mn^2 + |m|^2) + 1/2 Re(A x*^2)/Ll
//! Wl:  gradient x/L (1 + b |x|)                    leakage, saturating with its current
//! Wm:  gradient m/L0 (1 + (|m|/mk)^n)              main flux
//! A = a_f e^(2 j angle) + a_s e^(j bars theta)     stator-fixed and rotor-slot saliency of the stator leakage
//! ```
//!
//! The currents are the gradients of `W` by `s`, `r` and `e`. The main flux `m` makes the gradient by `m` zero, which
//! means that the currents add up to the current of the main flux; Newton's rule finds it. Cross-saturation is
//! therefore included, and no term can create energy. The exception is a tooth term that does not follow `m`. It is
//! added to the stator current alone, and the balance of power is then off by its size (see
//! `IronSettings::conservative`).
//!
//! The derivative of a complex function is a real matrix, stored by its columns.

use crate::complex::{Complex, square};

/// Residual, A per ampere of current, below which one more linear correction ends the iteration. The error after the
/// correction is of second order: about 1e-7 of the current, a hundredth of the error of two integration steps a
/// period.
const CLOSE: f64 = 1e-3;
/// Largest number of iterations; one is usual, about ten after a jump of the flux.
const LIMIT: u32 = 60;
/// Flux, Wb, below which its direction is undefined.
const NO_FLUX: f64 = 1e-12;

/// A symmetric derivative, `df = direct du + conjugate du*`, as a gradient has by its own flux.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Curvature {
    direct: f64,
    conjugate: Complex,
}

impl std::ops::Add for Curvature {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { direct: self.direct + other.direct, conjugate: self.conjugate + other.conjugate }
    }
}

/// The derivative of a complex function, by the real and by the imaginary part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Slope {
    re: Complex,
    im: Complex,
}

impl From<Curvature> for Slope {
    #[inline]
    fn from(c: Curvature) -> Self {
        let Complex { re, im } = c.conjugate;
        Self { re: Complex::new(c.direct + re, im), im: Complex::new(im, c.direct - re) }
    }
}

impl std::ops::Sub for Slope {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Slope {
    #[inline]
    pub(crate) fn times(&self, d: Complex) -> Complex {
        self.re * d.re + self.im * d.im
    }

    /// Derivative of the function with the argument `by u`.
    #[inline]
    fn after(&self, by: Complex) -> Self {
        Self { re: self.times(by), im: self.times(by * Complex::I) }
    }

    /// Derivative of the inverse function.
    #[inline]
    fn inverse(&self) -> Self {
        let scale = 1.0 / (self.re.re * self.im.im - self.re.im * self.im.re);
        Self {
            re: Complex::new(self.im.im, -self.re.im) * scale,
            im: Complex::new(-self.im.re, self.re.re) * scale,
        }
    }

    #[inline]
    fn transposed(&self) -> Self {
        Self { re: Complex::new(self.re.re, self.im.re), im: Complex::new(self.re.im, self.im.im) }
    }
}

/// Derivatives of the currents at a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Slopes {
    /// Derivative of the stator current by `x` and, at fixed `x`, by `m`.
    stator_x: Slope,
    stator_m: Slope,
    /// Derivative of the stator current by `r`, if the teeth follow `r`.
    stator_r: Slope,
    /// Derivative of the rotor current by `y`.
    pub rotor: Slope,
    /// Derivative of the negative residual by `s` at fixed `m`.
    residual_s: Slope,
    /// Derivative of `m` by the residual.
    by_residual: Slope,
}

/// Saturating leakage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leakage {
    /// 1/L.
    pub inverse: f64,
    /// b, 1/Wb.
    pub saturation: f64,
}

impl Leakage {
    /// Makes a leakage from the chord inductance, H, at a current, A, and the relative decrease of the unsaturated inductance, 1/A.
    pub(crate) fn new(inductance: f64, at: f64, per_ampere: f64) -> Self {
        // In i = u (1 + b u) with u = x/L, u/i = 2/(1 + sqrt(1 + 4 b i)) is chord over unsaturated inductance.
        let unsaturated = 0.5 * (1.0 + (1.0 + 4.0 * per_ampere * at).sqrt()) * inductance;
        Self { inverse: 1.0 / unsaturated, saturation: per_ampere / unsaturated }
    }

    #[inline]
    fn current(&self, x: Complex) -> (Complex, Curvature) {
        if self.saturation == 0.0 {
            let straight = Curvature { direct: self.inverse, ..Curvature::default() };
            return (x * self.inverse, straight);
        }
        let squared = square(x);
        let length = squared.sqrt();
        let (bent, half) = (self.saturation * length, 0.5 * self.inverse * self.saturation);
        // The root and the quotient are independent, so the processor computes them at the same time.
        let conjugate = x * x * (half * length * (1.0 / squared.max(NO_FLUX * NO_FLUX)));
        let direct = self.inverse * (1.0 + 1.5 * bent);
        (x * (self.inverse * (1.0 + bent)), Curvature { direct, conjugate })
    }
}

/// The main-flux curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MainFlux {
    /// 1/L0.
    pub inverse: f64,
    /// 1/mk; 0 without saturation.
    pub inverse_knee: f64,
    pub exponent: i32,
}

impl MainFlux {
    #[inline]
    fn current(&self, m: Complex) -> (Complex, Curvature) {
        if self.inverse_knee == 0.0 {
            let straight = Curvature { direct: self.inverse, ..Curvature::default() };
            return (m * self.inverse, straight);
        }
        let knee_squared = self.inverse_knee * self.inverse_knee;
        let y = square(m) * knee_squared;
        // (|m|/mk)^(n - 2)
        let mut power = if self.exponent % 2 == 1 { y.sqrt() } else { 1.0 };
        for _ in 1..self.exponent / 2 {
            power *= y;
        }
        let half = 0.5 * f64::from(self.exponent) * self.inverse * power;
        let straight = self.inverse * (1.0 + power * y);
        let conjugate = m * m * (half * knee_squared);
        (m * straight, Curvature { direct: straight + half * y, conjugate })
    }
}

/// The tooth term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Teeth {
    /// 2 c, 1/H.
    pub twice: f64,
    /// mn^2.
    pub knee_squared: f64,
    /// Position between rotor flux (0) and main flux (1).
    pub gap: f64,
    /// Rotation of the axis: the constant part, rad, the part per ampere, and the load current of that part, A.
    pub turn: f64,
    pub turn_per_a: f64,
    pub load: f64,
    /// Whether the term is a gradient of the energy: it is if the teeth follow the main flux.
    pub conservative: bool,
}

impl Teeth {
    /// Unit vector by which the axis is rotated.
    #[inline]
    fn turned(&self) -> Complex {
        if self.turn == 0.0 && self.turn_per_a == 0.0 {
            return Complex::new(1.0, 0.0);
        }
        cis(self.turn + self.turn_per_a * self.load)
    }
}

/// Computes a unit vector. (It is out of line because sine and cosine would otherwise be computed where they are not needed.)
#[cold]
fn cis(angle: f64) -> Complex {
    Complex::cis(angle)
}

/// The magnetic circuit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Magnetics {
    pub stator: Leakage,
    pub rotor: Leakage,
    pub main: MainFlux,
    pub teeth: Option<Teeth>,
    /// Stator-fixed saliency, times 1/Ll.
    pub fixed: Complex,
    /// Rotor-slot saliency, times 1/Ll, and bars per pole pair.
    pub slots: f64,
    pub bars: f64,
    /// 1/Le; 0 without iron loss.
    pub eddy: f64,
}

/// A solution: currents for given fluxes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Solution {
    /// Main flux, Wb.
    pub m: Complex,
    /// Stator current, A.
    pub i: Complex,
    /// Rotor current, A.
    pub i_r: Complex,
    /// Saliency of the rotor's slots, times 1/Ll.
    pub slots: Complex,
    pub slopes: Slopes,
}

impl Magnetics {
    /// Saliency of the stator leakage by slots at the electrical rotor angle `theta`, times 1/Ll.
    #[inline]
    pub(crate) fn slot_vector(&self, theta: f64) -> Complex {
        if self.slots == 0.0 {
            return Complex::ZERO;
        }
        cis(self.bars * theta) * self.slots
    }

    /// Finds the currents for the fluxes `s`, `r`, `e`; `found` is the first guess.
    pub(crate) fn solve(&self, fluxes: [Complex; 3], found: &mut Solution) {
        for _ in 0..LIMIT {
            let residual = self.evaluate(fluxes, found);
            let step = -found.slopes.by_residual.times(residual);
            found.m += step;
            // The iteration also ends at a value that is not a number.
            let size = CLOSE * CLOSE * (CLOSE * CLOSE + square(found.i));
            if square(residual) <= size || residual.re.is_nan() {
                let slopes = &found.slopes;
                found.i += slopes.stator_m.times(step) - slopes.stator_x.times(step);
                found.i_r -= slopes.rotor.times(step);
                break;
            }
        }
    }

    /// Computes currents and derivatives at `found.m`; returns the gradient of the energy by `m`.
    #[inline(always)]
    pub(crate) fn evaluate(&self, [s, r, e]: [Complex; 3], found: &mut Solution) -> Complex {
        let m = found.m;
        let x = s - m;
        let geometric = self.fixed + found.slots;
        let (mut i, mut stator_x) = self.stator.current(x);
        i += geometric * x.conj();
        stator_x.conjugate += geometric;
        let (i_r, rotor) = self.rotor.current(r - m);
        let (i_m, main) = self.main.current(m);
        let mut residual = i_m - i_r;
        let mut own = main + rotor;
        // Derivatives of the stator current by m and by r, and of the gradient by m by x.
        let [mut stator_m, mut stator_r, mut m_stator] = [Slope::default(); 3];
        if let Some(t) = &self.teeth {
            let turn = if t.conservative { Complex::ONE } else { t.turned() };
            let f = if t.conservative { m } else { (r * (1.0 - t.gap) + m * t.gap) * turn };
            let length = square(f);
            let d = 1.0 / (t.knee_squared + length);
            let (once, twice) = (t.twice * d, t.twice * d * d);
            // The gradient by x, 2c x* f^2/D, and its derivatives.
            let (ff, xf) = (f * f, x.conj() * f);
            let xff = xf * f;
            i += xff * once;
            stator_x.conjugate += ff * once;
            let (straight, bent) = (xf * (2.0 * once), xff * (2.0 * twice));
            let by_f = Slope {
                re: straight - bent * f.re,
                im: Complex::new(-straight.im, straight.re) - bent * f.im,
            };
            if t.conservative {
                (stator_m, m_stator) = (by_f, by_f.transposed());
                // The gradient by m, 2c (m* x^2/D - q m/D^2) with q = Re(x^2 m*^2), and its derivatives.
                let q = xf.re * xf.re - xf.im * xf.im;
                residual += xf.conj() * x * once - m * (q * twice);
                own.direct += q * twice * (2.0 * length * d - 3.0);
                own.conjugate += x * x * (once - 2.0 * twice * length) + ff * (2.0 * q * twice * d);
            } else {
                stator_m = by_f.after(turn * t.gap);
                stator_r = by_f.after(turn * (1.0 - t.gap));
            }
        }
        residual -= i + (e - m) * self.eddy;
        own.direct += self.eddy;
        found.i = i;
        found.i_r = i_r;
        found.slopes = Slopes {
            stator_x: stator_x.into(),
            stator_m,
            stator_r,
            rotor: rotor.into(),
            residual_s: Slope::from(stator_x) - m_stator,
            by_residual: (Slope::from(own + stator_x) - m_stator - stator_m).inverse(),
        };
        residual
    }

    /// Rates of main flux and stator current at these rates of the fluxes; `turned` is the rate of the stator current
    /// that comes from the rotation of the slots alone.
    #[inline(always)]
    pub(crate) fn rates(
        &self,
        k: &Slopes,
        [s, r, e]: [Complex; 3],
        turned: Complex,
    ) -> (Complex, Complex) {
        let own = k.stator_r.times(r) + turned;
        let pull = k.residual_s.times(s) + k.rotor.times(r) + e * self.eddy + own;
        let m = k.by_residual.times(pull);
        (m, k.stator_x.times(s - m) + k.stator_m.times(m) + own)
    }

    /// The energy in Wb A; times 3/2 it is in J. It excludes a tooth term that is not a gradient.
    pub(crate) fn energy(&self, [s, r, e]: [Complex; 3], theta: f64, m: Complex) -> f64 {
        let leakage = |l: &Leakage, x: Complex| {
            let length = x.norm();
            l.inverse * length * length * (0.5 + l.saturation * length / 3.0)
        };
        let x = s - m;
        let length = m.norm();
        let bent = (length * self.main.inverse_knee).powi(self.main.exponent);
        let main = self.main.inverse
            * length
            * length
            * (0.5 + bent / (f64::from(self.main.exponent) + 2.0));
        let teeth = self.teeth.filter(|t| t.conservative).map_or(0.0, |t| {
            0.5 * t.twice * (x * x * m.conj() * m.conj()).re / (t.knee_squared + square(m))
        });
        let geometric = self.fixed + self.slot_vector(theta);
        let geometric = 0.5 * (geometric * x.conj() * x.conj()).re;
        leakage(&self.stator, x)
            + leakage(&self.rotor, r - m)
            + 0.5 * self.eddy * square(e - m)
            + main
            + teeth
            + geometric
    }
}
