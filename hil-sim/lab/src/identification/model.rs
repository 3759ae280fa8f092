//! The machine in continuous time (Eq. 7 to 9), sampled (Eq. 10 to 13), and as the sampled equation between current and
//! voltage alone (Eq. 14 to 18).

use nalgebra::{Matrix2, Vector2};

use super::Complex;

/// The parameters of a symmetric machine that its terminals determine, as Eq. 9 needs them; or an estimate of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters<T = f64> {
    /// Stator resistance, ohm.
    pub r_s: T,
    /// Rotor time constant l_r / r_r, s.
    pub tau_r: T,
    /// Transient inductance of the stator l_s - l_m² / l_r, H.
    pub sigma_l_s: T,
    /// Inductance of the stator, H.
    pub l_s: T,
    /// Speed of the rotor, electrical rad/s.
    pub omega_m: T,
}

impl<T: Copy> Parameters<T> {
    /// Makes parameters from these five values, in the order of [`Parameters::NAMES`].
    pub const fn of([r_s, tau_r, sigma_l_s, l_s, omega_m]: [T; 5]) -> Self {
        Self { r_s, tau_r, sigma_l_s, l_s, omega_m }
    }

    /// Returns the five values, in the order of [`Parameters::NAMES`].
    pub const fn array(&self) -> [T; 5] {
        [self.r_s, self.tau_r, self.sigma_l_s, self.l_s, self.omega_m]
    }
}

impl Parameters {
    /// Names of the five values, in the order of the tables of the paper and of [`Self::array`].
    pub const NAMES: [&str; 5] = ["r_s", "tau_r", "sigma_l_s", "l_s", "omega_m"];

    /// The machine whose numbers (`r_s` 0.39, `r_r` 1.41 ohm, `l_s` = `l_r` 94, `l_m` 91 mH) agree with the
    /// deterministic ratios of Tables 1 to 5. It is inferred from the tables: the paper does not state which machine it
    /// simulated, and it was not [`Self::RBV`].
    pub const PX: Self = Self {
        r_s: 0.39,
        tau_r: 0.094 / 1.41,
        sigma_l_s: 0.094 - 0.091 * 0.091 / 0.094,
        l_s: 0.094,
        omega_m: 375.0,
    };

    /// The machine of the experiments, from the classical locked-rotor and no-load tests (column "rbv" of Table 6).
    pub const RBV: Self =
        Self { r_s: 2.0, tau_r: 0.0427, sigma_l_s: 0.0213, l_s: 0.1279, omega_m: 366.0 };

    /// The same machine at another speed, electrical rad/s.
    pub const fn at(self, omega_m: f64) -> Self {
        Self { omega_m, ..self }
    }

    /// Eq. 9 with these numbers.
    pub fn continuous(&self) -> Continuous {
        let k = (self.l_s - self.sigma_l_s) / self.sigma_l_s;
        let rotor = Complex::new(1.0 / self.tau_r, -self.omega_m);
        let a11 = -(self.r_s / self.sigma_l_s + k / self.tau_r);
        Continuous {
            a: Matrix2::new(a11.into(), rotor * k, (1.0 / self.tau_r).into(), -rotor),
            b: Vector2::new((1.0 / self.sigma_l_s).into(), Complex::ZERO),
        }
    }

    /// The exact sampled equation between current and voltage in differences, with `h` s between samples.
    pub fn delta(&self, h: f64) -> Delta {
        self.continuous().exact(h).delta()
    }
}

type Matrix = Matrix2<Complex>;
type Column = Vector2<Complex>;

/// The state equation dx/dt = A x + B v, with x = [i_s, phi_r / l_m] in A (Eq. 9).
#[derive(Clone, Copy, Debug)]
pub struct Continuous {
    /// Matrix A, 1/s.
    pub a: Matrix,
    /// Matrix B, 1/H and 1.
    pub b: Column,
}

impl Continuous {
    /// Eq. 11 and 12 up to the power `order` of `h` s. With order 5 the largest error of F and H, relative to their
    /// largest entry, is 4.1e-12 at 50 µs, 1.3e-10 at 100 µs and 7.5e-9 at 200 µs (PX at 375 rad/s; RBV: 3 to 5 times
    /// less).
    pub fn series(&self, h: f64, order: u32) -> Step {
        let ah = self.a.scale(h);
        // term = (A h)^(n-1) / n!, so F gains term A h and H gains term B h.
        let mut term = Matrix::identity();
        let mut integral = Matrix::zeros();
        for n in 1..=order {
            if n > 1 {
                term = (term * ah).scale(1.0 / f64::from(n));
            }
            integral += term;
        }
        Step { e: integral * ah, h: integral * self.b.scale(h) }
    }

    /// Change of the state, A, over `h` s by a voltage that rises by 1 V from 0: the sum of `(A h)^n B h/(n + 2)!`, up
    /// to the power `order` of `h`.
    pub fn ramp(&self, h: f64, order: u32) -> Column {
        let mut term = self.b.scale(0.5 * h);
        let mut sum = term;
        for n in 2..=order {
            term = (self.a * term).scale(h / f64::from(n + 1));
            sum += term;
        }
        sum
    }

    /// The exact step over `h` s at constant voltage: F = e^(A h) by scaling and squaring.
    pub fn exact(&self, h: f64) -> Step {
        let norm = self.a.iter().map(|x| x.norm()).fold(0.0, f64::max) * h;
        // More than 60 doublings occur only with a matrix that overflows anyway.
        let doublings = if norm > 0.25 { ((norm * 4.0).log2().ceil() as i32).min(60) } else { 0 };
        let mut step = self.series(h / f64::from(doublings).exp2(), 14);
        for _ in 0..doublings {
            step = step.then(&step);
        }
        step
    }
}

/// A sampled step, x(t+h) = F x(t) + H v(t) (Eq. 10). It stores F - I instead of F, so that the part that a short
/// period changes keeps its digits.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Matrix F - I.
    pub e: Matrix,
    /// Matrix H, S.
    pub h: Column,
}

impl Step {
    /// Returns F.
    pub fn f(&self) -> Matrix {
        Matrix::identity() + self.e
    }

    /// Combines this step with a following one at the same voltage.
    pub fn then(&self, next: &Self) -> Self {
        let e = self.e + next.e + next.e * self.e;
        Self { e, h: self.h + (next.e * self.h + next.h) }
    }

    /// Combines `count` of these steps at the same voltage; at least one.
    pub fn repeated(&self, count: u32) -> Self {
        (1..count).fold(*self, |step, _| step.then(self))
    }

    /// Does one step of the state x, A, at the voltage `v`, V.
    #[inline]
    pub fn advance(&self, x: Column, v: Complex) -> Column {
        x + (self.e * x + self.h * v)
    }

    /// Computes Eq. 15 to 18.
    pub fn current_voltage(&self) -> CurrentVoltage {
        self.delta().current_voltage()
    }

    /// Computes Eq. 15 to 18 in differences. The small sums are computed as products, without cancellation: f1 + f0 - 1
    /// = -det(F - I), h1 + h0 = f12 h21 - (f22 - 1) h11.
    pub fn delta(&self) -> Delta {
        let [[e11, e21], [e12, e22]] = self.e.into();
        let [h11, h21] = self.h.into();
        Delta { g1: e11 + e22 + 1.0, g0: e12 * e21 - e11 * e22, h1: h11, u0: e12 * h21 - e22 * h11 }
    }
}

/// The equation i(t+h) = f1 i(t) + f0 i(t-h) + h1 v(t) + h0 v(t-h) (Eq. 14; its printed subscripts f11, f01, h11 and
/// h01 are misprints). Model A estimates its coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentVoltage {
    /// Coefficient of i(t).
    pub f1: Complex,
    /// Coefficient of i(t-h).
    pub f0: Complex,
    /// Coefficient of v(t), S.
    pub h1: Complex,
    /// Coefficient of v(t-h), S.
    pub h0: Complex,
}

impl CurrentVoltage {
    /// Names of the eight real coefficients, in the order of Tables 1 and 4 and of [`Self::array`].
    pub const NAMES: [&str; 8] = ["f_1a", "f_1b", "f_0a", "f_0b", "h_1a", "h_1b", "h_0a", "h_0b"];

    /// Returns real and imaginary parts (theta of Eq. 24).
    pub fn array(&self) -> [f64; 8] {
        let Self { f1, f0, h1, h0 } = *self;
        [f1.re, f1.im, f0.re, f0.im, h1.re, h1.im, h0.re, h0.im]
    }

    /// Returns the coefficients of the equation in differences.
    pub fn delta(&self) -> Delta {
        let Self { f1, f0, h1, h0 } = *self;
        Delta { g1: f1 - 1.0, g0: f1 + f0 - 1.0, h1, u0: h1 + h0 }
    }
}

/// [`CurrentVoltage`] in differences: with D x(t) = x(t) - x(t-h), D i(t+h) = g1 D i(t) + g0 i(t-h) + h1 D v(t) + u0
/// v(t-h).
///
/// The least-squares problem is the same, but `g0` and `u0`, small sums that contain `r_s` and `tau_r`, are estimated
/// directly and are not the result of a cancellation. In `f32` this makes the speed 55 to 660 times more accurate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delta {
    /// Coefficient f1 - 1.
    pub g1: Complex,
    /// Coefficient f1 + f0 - 1.
    pub g0: Complex,
    /// Coefficient h1, S.
    pub h1: Complex,
    /// Coefficient h1 + h0, S.
    pub u0: Complex,
}

impl Delta {
    /// Poles minus one, the larger first: roots of e² + (1 - g1) e - g0. The smaller root comes from the product of the
    /// two, so that it keeps its digits. The poles, roots of z² - f1 z - f0, and their conjugates are the four roots of
    /// Eq. 25, which is |z² - f1 z - f0|² written out for real z.
    pub fn poles_minus_one(&self) -> [Complex; 2] {
        let half = (Complex::ONE - self.g1) * 0.5;
        let root = (half * half + self.g0).sqrt();
        // The sign with which the terms add up.
        let sum = if (half * root.conj()).re >= 0.0 { half + root } else { half - root };
        if sum == Complex::ZERO {
            return [Complex::ZERO; 2];
        }
        [-sum, self.g0 / sum]
    }

    /// Returns the coefficients of Eq. 14.
    pub fn current_voltage(&self) -> CurrentVoltage {
        let Self { g1, g0, h1, u0 } = *self;
        CurrentVoltage { f1: g1 + 1.0, f0: g0 - g1, h1, h0: u0 - h1 }
    }

    /// Returns the four coefficients, in the order of the fields.
    pub fn array(&self) -> [Complex; 4] {
        [self.g1, self.g0, self.h1, self.u0]
    }

    /// Makes it from the four coefficients, in the order of the fields.
    pub fn from_array([g1, g0, h1, u0]: [Complex; 4]) -> Self {
        Self { g1, g0, h1, u0 }
    }
}

/// The unknowns of Model B (Eq. 32) from which a machine follows. The first, third, fourth and sixth are stored as the
/// small differences and sums that Eq. 34 to 37 use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrderTheta {
    /// The value theta_1 - 1.
    pub t1_minus_1: f64,
    /// The value theta_2.
    pub t2: f64,
    /// The value theta_2 + theta_4.
    pub t2_t4: f64,
    /// The value theta_5, S.
    pub t5: f64,
    /// The value theta_5 + theta_6, S.
    pub t5_t6: f64,
}

impl From<Delta> for FirstOrderTheta {
    /// Computes Eq. 32 from the coefficients of Model A, without the terms in h_1b.
    fn from(delta: Delta) -> Self {
        let Delta { g1, g0, h1, u0 } = delta;
        Self { t1_minus_1: g1.re, t2: -g1.im, t2_t4: -g0.im, t5: h1.re, t5_t6: u0.re }
    }
}
