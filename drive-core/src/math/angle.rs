//! Angles as wrapping binary fractions of a turn, with sine and cosine.

use core::f32::consts::{PI, TAU};

use fixed::Wrapping;
use fixed::types::I0F32;

/// An angle in turns, in `[-0.5, 0.5)`; arithmetic wraps.
///
/// One unit in the last place is 2^-32 turn (84 n°). An angle is electrical unless the name of the
/// variable says `mechanical`. `idsp::cossin` takes the bits directly, so host and target compute
/// the same sine and cosine to the bit.
///
/// ```
/// use induction_drive_core::Angle;
///
/// let sum = Angle::from_turns(0.45) + Angle::from_turns(0.1);
/// assert!((sum.to_turns() + 0.45).abs() < 1e-6);
/// let axis = Angle::QUARTER.unit_vector();
/// assert!(axis.cos.abs() < 2e-5 && (axis.sin - 1.0).abs() < 2e-5);
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Angle(pub Wrapping<I0F32>);

super::field_by_field!(Angle { 0 });

/// 2^32: units in the last place of an [`Angle`] per turn.
const UNITS_PER_TURN: f32 = 4_294_967_296.0;

impl Angle {
    /// Zero.
    pub const ZERO: Self = Self::from_bits(0);
    /// A quarter turn, 90°.
    pub const QUARTER: Self = Self::from_bits(1 << 30);
    /// An eighth of a turn, 45°.
    pub const EIGHTH: Self = Self::from_bits(1 << 29);

    /// Returns the angle of `bits` / 2^32 turns.
    pub(crate) const fn from_bits(bits: i32) -> Self {
        Self(Wrapping(I0F32::from_bits(bits)))
    }

    /// Returns the angle in units of 2^-32 turn.
    pub const fn to_bits(self) -> i32 {
        self.0.0.to_bits()
    }

    /// Returns the angle from turns. Whole turns are removed exactly up to ±2^30 turns; NaN gives zero.
    ///
    /// The fraction keeps the precision of `f32` (relative 6e-8).
    pub fn from_turns(turns: f32) -> Self {
        // Saturating cast: beyond ±2^30 turns f32 has no fraction.
        let fraction = turns - (turns as i32) as f32;
        // Exact: both have the same exponent or the difference is smaller than either.
        Self::within_turn(if fraction >= 0.5 {
            fraction - 1.0
        } else if fraction < -0.5 {
            fraction + 1.0
        } else {
            fraction
        })
    }

    /// Returns the angle from turns known to lie within ±0.5, by one multiplication and one conversion.
    ///
    /// It saturates beyond that range; NaN gives zero.
    pub(crate) fn within_turn(turns: f32) -> Self {
        Self::from_bits((turns * UNITS_PER_TURN) as i32)
    }

    /// Returns the angle from radians; see [`Angle::from_turns`].
    pub fn from_radians(radians: f32) -> Self {
        Self::from_turns(radians * (1.0 / TAU))
    }

    /// Returns the angle from degrees; see [`Angle::from_turns`].
    pub(crate) fn from_degrees(degrees: f32) -> Self {
        Self::from_turns(degrees * (1.0 / 360.0))
    }

    /// Returns the angle in turns, `[-0.5, 0.5)`, exact to 2^-25 turn.
    pub fn to_turns(self) -> f32 {
        self.to_bits() as f32 * (1.0 / UNITS_PER_TURN)
    }

    /// Returns the angle in radians, `[-pi, pi)`.
    pub fn to_radians(self) -> f32 {
        self.to_turns() * (2.0 * PI)
    }

    /// Returns the angle in degrees, `[-180, 180)`.
    pub fn to_degrees(self) -> f32 {
        self.to_turns() * 360.0
    }

    /// Returns cosine and sine of the angle.
    ///
    /// The error of either component and of the length is below 1.2e-5 (tested against f64 over a turn):
    /// the table of `idsp` interpolates to 9e-6, and its amplitude of 2^31 - 0.85 * 2^15 is divided out
    /// here.
    pub fn unit_vector(self) -> UnitVector {
        const SCALE: f32 = 1.0 / (2_147_483_648.0 - 0.85 * 32_768.0);
        let (cos, sin) = idsp::cossin(self.to_bits());
        UnitVector { cos: cos as f32 * SCALE, sin: sin as f32 * SCALE }
    }
}

/// `e^(j angle)`: cosine and sine of an angle, computed once and used for every rotation by it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct UnitVector {
    /// Cosine.
    pub cos: f32,
    /// Sine.
    pub sin: f32,
}

impl Default for UnitVector {
    /// Returns the vector of the angle 0.
    fn default() -> Self {
        Self { cos: 1.0, sin: 0.0 }
    }
}

impl UnitVector {
    /// Returns the vector rotated by a small angle in turns, with the series `1 - x^2/2` and `x - x^3/6`
    /// instead of a table.
    ///
    /// The error is below 1e-5 up to 0.02 turns, not more than the error of [`Angle::unit_vector`];
    /// there the error of the length is x^4/72 = 4e-6.
    #[inline]
    pub(crate) fn turned_slightly(self, turns: f32) -> Self {
        let x = turns * TAU;
        let half = 0.5 * x * x;
        self.turned_by(Self { cos: 1.0 - half, sin: x - x * half * (1.0 / 3.0) })
    }

    /// Returns the vector rotated by the angle of `other`.
    pub(crate) fn turned_by(self, other: Self) -> Self {
        Self {
            cos: self.cos * other.cos - self.sin * other.sin,
            sin: self.sin * other.cos + self.cos * other.sin,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn unit_vector_error_over_the_turn() {
        let (mut worst, mut worst_length) = (0.0_f64, 0.0_f64);
        for i in 0..1_000_003_u64 {
            let angle = Angle::from_bits((i * 4294) as u32 as i32);
            let exact = f64::from(angle.to_bits()) / 4_294_967_296.0 * core::f64::consts::TAU;
            let v = angle.unit_vector();
            let (c, s) = (f64::from(v.cos), f64::from(v.sin));
            worst = worst.max((c - exact.cos()).abs()).max((s - exact.sin()).abs());
            worst_length = worst_length.max((c.hypot(s) - 1.0).abs());
        }
        // The documentation of idsp states 9e-6 for each component; the length is no worse.
        assert!(worst < 1.2e-5, "component error {worst:e}");
        assert!(worst_length < 1.2e-5, "length error {worst_length:e}");
    }

    #[test]
    fn non_finite_turns_do_not_panic() {
        assert_eq!(Angle::from_turns(f32::NAN), Angle::ZERO);
        let _ = Angle::from_turns(f32::INFINITY);
        let _ = Angle::from_turns(f32::MIN);
    }

    proptest! {
        #[test]
        fn turns_round_trip(turns in -0.5f32..0.499_999) {
            prop_assert!((Angle::from_turns(turns).to_turns() - turns).abs() < 6e-8);
        }

        #[test]
        fn whole_turns_vanish(turns in -0.49f32..0.49, whole in -100i32..100) {
            let moved = Angle::from_turns(turns + whole as f32) - Angle::from_turns(turns);
            // f32 keeps 24 bits of turns + whole.
            prop_assert!(moved.to_turns().abs() < 1e-5);
        }

        #[test]
        fn turned_vectors_agree_with_turned_angles(a in any::<i32>(), b in any::<i32>()) {
            let (a, b) = (Angle::from_bits(a), Angle::from_bits(b));
            let (v, w) = (a.unit_vector().turned_by(b.unit_vector()), (a + b).unit_vector());
            prop_assert!((v.cos - w.cos).abs() < 4e-5 && (v.sin - w.sin).abs() < 4e-5);
        }
    }

    #[test]
    fn degrees_radians_and_turns_are_the_same_angle() {
        for (degrees, turns) in [(0.0, 0.0), (90.0, 0.25), (-45.0, -0.125), (270.0, -0.25)] {
            let angle = Angle::from_degrees(degrees);
            assert_eq!(angle.to_turns(), turns);
            assert_eq!(angle.to_degrees(), 360.0 * turns);
            assert_eq!(angle.to_radians(), turns * TAU);
            let error = (Angle::from_radians(turns * TAU) - angle).to_turns();
            assert!(error.abs() < 1e-7, "{error}");
            assert_eq!(-angle + angle, Angle::ZERO);
        }
        let mut angle = Angle::QUARTER;
        angle += Angle::QUARTER;
        angle -= Angle::from_degrees(30.0);
        assert!((angle.to_degrees() - 150.0).abs() < 1e-4);
    }

    #[test]
    fn small_turns_are_turns() {
        for k in -20..=20 {
            let turns = 1e-3 * k as f32;
            let v = Angle::from_degrees(50.0).unit_vector().turned_slightly(turns);
            let exact = (50.0_f64 / 360.0 + f64::from(turns)) * core::f64::consts::TAU;
            let error = (f64::from(v.cos) - exact.cos()).hypot(f64::from(v.sin) - exact.sin());
            assert!(error < 2.5e-5, "{turns}: {error}");
        }
    }
}
