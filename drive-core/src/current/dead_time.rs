//! Dead-time compensation after Leggate and Kerkman (section 3.9).
//!
//! During the dead time the sign of the phase current determines the level of a leg. A leg that switches with a period `T` loses
//! `V_dc t_d / T` of its mean voltage if its current is positive, and gains as much if its current is negative (4.1 V at 311 V, 2.2 us
//! and 6 kHz, 12.3 V at 18 kHz). The compensation adds the same voltage in advance. Near zero current, where the sign is uncertain, and
//! where the injection takes the current through zero within a period, the compensation passes through zero linearly.

use crate::Abc;

/// Coefficients of the compensation.
///
/// ```
/// use induction_drive_core::{Abc, current::DeadTime, io::PERIOD_S};
///
/// // Dead time 2.2 us, full compensation from 30 mA on; 311 V dc link, no further drop.
/// let dead_time = DeadTime::new(2.2e-6, PERIOD_S, 0.03);
/// let signs = dead_time.signs(Abc::new(1.0, -0.015, -0.985), Abc::ZERO);
/// let v = dead_time.voltage(signs, 311.0, 0.0);
/// assert!((v.a - 4.105).abs() < 0.001);
/// assert!((v.b + 0.5 * v.a).abs() < 0.001); // half of it at half of 30 mA
/// assert_eq!(v.c, -v.a);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DeadTime {
    /// Lost share of the dc link: dead time / switching period.
    ratio: f32,
    /// Sign in units of [`Signs`] per ampere.
    per_ampere: f32,
}

/// Signs of the three phase currents, linear around zero and saturated at ±1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signs(Abc);

/// Units of [`Signs`]. The conversion to an integer saturates at ±2^31 in one instruction, whereas
/// comparisons take ten.
const ONE: f32 = 2_147_483_648.0;

impl Signs {
    /// Returns the signs as numbers from -1 to 1.
    pub fn to_abc(self) -> Abc {
        self.0 * (1.0 / ONE)
    }
}

impl DeadTime {
    /// Creates the compensation of a dead time in s for legs that switch with the period `carrier_s`, s. It is full for
    /// phase currents of at least `full_at_a`, A.
    pub fn new(dead_time_s: f32, carrier_s: f32, full_at_a: f32) -> Self {
        Self { ratio: dead_time_s / carrier_s, per_ampere: ONE / full_at_a }
    }

    /// No compensation.
    pub const NONE: Self = Self { ratio: 0.0, per_ampere: 0.0 };

    /// Returns the mean signs of the phase currents over a period. The currents change linearly from `i - half` to `i + half`, A,
    /// and a current that crosses zero has both signs in part. All signs are zero for [`DeadTime::NONE`].
    pub fn signs(&self, i: Abc, half: Abc) -> Signs {
        let sign = |i: f32, half: f32| {
            let crossing = ONE / half.abs();
            (i * if crossing < self.per_ampere { crossing } else { self.per_ampere }) as i32 as f32
        };
        Signs(Abc { a: sign(i.a, half.a), b: sign(i.b, half.b), c: sign(i.c, half.c) })
    }

    /// Returns the voltage to add, V per phase, for a dc link of `v_dc`, V. `drop` is the inverter voltage
    /// error beyond the dead time, V (see `crate::current::inverter_drop`).
    pub fn voltage(&self, signs: Signs, v_dc: f32, drop: f32) -> Abc {
        signs.0 * ((self.ratio * v_dc + drop) * (1.0 / ONE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_voltage_beyond_the_threshold_and_smooth_through_zero() {
        let dt = DeadTime::new(2.2e-6, crate::PERIOD_S, 0.05);
        let step = |dt: &DeadTime, i| dt.voltage(dt.signs(i, Abc::ZERO), 311.0, 0.0);
        let v = step(&dt, Abc::new(1.0, -0.5, 0.025));
        assert!((v.a - 4.105).abs() < 1e-3 && (v.b + 4.105).abs() < 1e-3);
        assert!((v.c - 0.5 * 4.105).abs() < 1e-3);
        assert_eq!(step(&dt, Abc::ZERO), Abc::ZERO);
        assert_eq!(step(&DeadTime::NONE, Abc::new(1.0, 1.0, 1.0)), Abc::ZERO);
        let more = dt.voltage(dt.signs(Abc::new(1.0, -0.5, 0.0), Abc::ZERO), 311.0, 1.0);
        assert!((more.a - 5.105).abs() < 1e-3 && (more.b + 5.105).abs() < 1e-3);
    }

    /// Compares with the mean of the signs at a thousand instants of the period.
    #[test]
    fn a_current_that_crosses_zero_within_a_period_has_the_mean_of_its_signs() {
        let dt = DeadTime::new(2.2e-6, crate::PERIOD_S, 1e-4);
        for (mean, half) in
            [(0.0, 0.2), (0.05, 0.2), (-0.15, 0.2), (-0.1, -0.4), (0.3, 0.2), (-0.3, 0.0)]
        {
            let moments = (0..1000).map(|n| mean + half * ((2 * n + 1) as f32 / 1000.0 - 1.0));
            let expected = moments.map(f32::signum).sum::<f32>() / 1000.0;
            let sign = dt.signs(Abc::new(0.0, mean, 0.0), Abc::new(0.0, half, 0.0)).to_abc().b;
            assert!((sign - expected).abs() < 2e-3, "{mean} {half}: {sign}, not {expected}");
        }
    }
}
