//! Reference frames as types, with the transformations of Clarke and Park (section 2.1).
//!
//! The transformations are amplitude-invariant: a component is a peak phase value. Each frame has
//! its own type, so frames cannot be mixed by accident; only a transformation converts one into
//! another.
//!
//! ```
//! use induction_drive_core::{Abc, Angle};
//!
//! // A balanced set with peak 2 at angle 0, in the frame of a flux at 30°, a twelfth of a turn: it lies 30° behind d.
//! let i = Abc::new(2.0, -1.0, -1.0).to_alpha_beta();
//! let dq = i.to_dq(Angle::from_turns(1.0 / 12.0).unit_vector());
//! assert!((dq.d - 1.732).abs() < 1e-3 && (dq.q + 1.0).abs() < 1e-3);
//! ```

use num_complex::Complex32;

use crate::math::angle::UnitVector;

macro_rules! frame {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident),+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[repr(C)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: f32,)+
        }

        super::field_by_field!($name { $($field),+ });

        impl core::ops::Mul<f32> for $name {
            type Output = Self;
            #[inline]
            fn mul(self, factor: f32) -> Self {
                Self { $($field: self.$field * factor),+ }
            }
        }

        impl $name {
            /// The zero vector.
            pub const ZERO: Self = Self { $($field: 0.0,)+ };

            /// Returns the vector of the given components.
            pub const fn new($($field: f32),+) -> Self {
                Self { $($field,)+ }
            }

            /// Whether every component is finite.
            pub fn is_finite(self) -> bool {
                $(self.$field.is_finite() &)+ true
            }
        }
    };
}

frame! {
    /// Values of the three phases.
    Abc {
        /// Phase a.
        a,
        /// Phase b.
        b,
        /// Phase c.
        c
    }
}

frame! {
    /// The stator frame: alpha along the magnetic axis of phase a, beta 90° ahead of it.
    AlphaBeta {
        /// Along the axis of phase a.
        alpha,
        /// 90° ahead of phase a.
        beta
    }
}

frame! {
    /// The frame of the (estimated) rotor flux: d along the flux, q 90° ahead of it.
    Dq {
        /// Along the rotor flux.
        d,
        /// 90° ahead of the rotor flux.
        q
    }
}

frame! {
    /// The measuring frame of the injection: dm lies 45° behind and qm 45° ahead of the injected
    /// voltage, their bisector (section 2.4, Figure 8).
    DmQm {
        /// 45° behind the injection axis.
        dm,
        /// 45° ahead of the injection axis.
        qm
    }
}

/// sqrt(3)
pub const SQRT_3: f32 = 1.732_050_8;
/// 1 / sqrt(3)
pub const FRAC_1_SQRT_3: f32 = 0.577_350_26;

impl Abc {
    /// Applies the Clarke transformation, Eq. 2.3. The zero-sequence component is dropped.
    pub fn to_alpha_beta(self) -> AlphaBeta {
        AlphaBeta {
            alpha: (2.0 / 3.0) * self.a - (1.0 / 3.0) * (self.b + self.c),
            beta: FRAC_1_SQRT_3 * (self.b - self.c),
        }
    }
}

impl AlphaBeta {
    /// Applies the Clarke transformation to two measured phases, Eq. 2.4, with a + b + c = 0.
    pub fn from_two_phases(a: f32, b: f32) -> Self {
        Self { alpha: a, beta: FRAC_1_SQRT_3 * a + (2.0 * FRAC_1_SQRT_3) * b }
    }

    /// Applies the inverse of Eq. 2.3, without zero-sequence component.
    pub fn to_abc(self) -> Abc {
        let (half_alpha, other) = (0.5 * self.alpha, (0.5 * SQRT_3) * self.beta);
        Abc { a: self.alpha, b: other - half_alpha, c: -other - half_alpha }
    }

    /// Applies the Park transformation, Eq. 2.5 / 2.6, into the frame whose d axis lies along `axis`.
    pub fn to_dq(self, axis: UnitVector) -> Dq {
        let (d, q) = self.seen_from(axis);
        Dq { d, q }
    }

    /// Rotates the vector into the measuring frame whose dm axis is `axis` = `e^(j (theta - 45°))`.
    #[doc(hidden)]
    pub fn to_dm_qm(self, axis: UnitVector) -> DmQm {
        let (dm, qm) = self.seen_from(axis);
        DmQm { dm, qm }
    }

    /// Returns the vector of signed `length` along `axis`.
    pub fn along(axis: UnitVector, length: f32) -> Self {
        Self { alpha: axis.cos * length, beta: axis.sin * length }
    }

    /// Returns the square of the length.
    pub fn length_squared(self) -> f32 {
        self.alpha * self.alpha + self.beta * self.beta
    }

    /// Returns the components along `axis` and across it, 90° ahead.
    pub(crate) fn seen_from(self, axis: UnitVector) -> (f32, f32) {
        (axis.cos * self.alpha + axis.sin * self.beta, axis.cos * self.beta - axis.sin * self.alpha)
    }
}

impl core::ops::Mul<f32> for UnitVector {
    type Output = Dq;
    /// Returns the vector of this length along an axis given in the flux frame.
    fn mul(self, length: f32) -> Dq {
        Dq { d: self.cos * length, q: self.sin * length }
    }
}

impl Dq {
    /// Returns the same vector in a frame that is ahead by `lead`.
    pub(crate) fn seen_from(self, lead: UnitVector) -> Self {
        Self { d: self.d * lead.cos + self.q * lead.sin, q: self.q * lead.cos - self.d * lead.sin }
    }

    /// Applies the inverse Park transformation from the frame whose d axis lies along `axis`.
    pub fn to_alpha_beta(self, axis: UnitVector) -> AlphaBeta {
        AlphaBeta {
            alpha: axis.cos * self.d - axis.sin * self.q,
            beta: axis.sin * self.d + axis.cos * self.q,
        }
    }

    /// Returns the square of the length.
    pub fn length_squared(self) -> f32 {
        self.d * self.d + self.q * self.q
    }
}

impl From<AlphaBeta> for Complex32 {
    fn from(x: AlphaBeta) -> Self {
        Self::new(x.alpha, x.beta)
    }
}

impl From<Complex32> for AlphaBeta {
    fn from(x: Complex32) -> Self {
        Self::new(x.re, x.im)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::angle::Angle;
    use proptest::prelude::*;

    #[test]
    fn clarke_agrees_with_the_printed_matrices() {
        // Eq. 2.3 on a balanced set of peak 1 at angle 0: alpha = 1, beta = 0.
        let i = Abc::new(1.0, -0.5, -0.5).to_alpha_beta();
        assert!((i.alpha - 1.0).abs() < 1e-7 && i.beta.abs() < 1e-7);
        // Phase b alone, -c: beta = 2/sqrt(3).
        let i = Abc::new(0.0, 1.0, -1.0).to_alpha_beta();
        assert!(i.alpha.abs() < 1e-7 && (i.beta - 2.0 * FRAC_1_SQRT_3).abs() < 1e-7);
    }

    #[test]
    fn q_is_ahead_of_d() {
        // A vector at 90° seen from a frame at 30°: d = cos 60°, q = sin 60°.
        let v = AlphaBeta::new(0.0, 1.0).to_dq(Angle::from_degrees(30.0).unit_vector());
        assert!((v.d - 0.5).abs() < 2e-5 && (v.q - 0.866_025_4).abs() < 2e-5);
    }

    #[test]
    fn the_injection_axis_is_the_bisector_of_dm_and_qm() {
        let theta = Angle::from_degrees(73.0);
        let i = AlphaBeta::along(theta.unit_vector(), 1.0)
            .to_dm_qm((theta - Angle::EIGHTH).unit_vector());
        assert!(
            (i.dm - i.qm).abs() < 2e-5 && (i.dm - core::f32::consts::FRAC_1_SQRT_2).abs() < 2e-5
        );
    }

    proptest! {
        #[test]
        fn clarke_and_back(a in -5f32..5.0, b in -5f32..5.0) {
            let abc = Abc::new(a, b, -a - b);
            let two = AlphaBeta::from_two_phases(a, b);
            let three = abc.to_alpha_beta();
            prop_assert!((two.alpha - three.alpha).abs() < 2e-6 && (two.beta - three.beta).abs() < 2e-6);
            let back = two.to_abc();
            for (x, y) in [(back.a, a), (back.b, b), (back.c, -a - b)] {
                prop_assert!((x - y).abs() < 2e-6);
            }
        }

        #[test]
        fn park_and_back(alpha in -5f32..5.0, beta in -5f32..5.0, bits in any::<i32>()) {
            let axis = Angle::from_bits(bits).unit_vector();
            let v = AlphaBeta::new(alpha, beta);
            let back = v.to_dq(axis).to_alpha_beta(axis);
            // |axis|^2 differs from 1 by up to 2.4e-5.
            prop_assert!((back.alpha - alpha).abs() < 1.5e-4 && (back.beta - beta).abs() < 1.5e-4);
        }
    }
}
