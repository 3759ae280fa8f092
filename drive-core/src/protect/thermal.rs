//! Thermal load of motor and inverter by the current, i²t.
//!
//! Each is a body with one time constant. Its load follows the square of the current vector relative to its continuous
//! current; 1 is the load at the continuous current:
//!
//! ```text
//! tau d(load)/dt = |i|^2 / i_c^2 - load
//! ```
//!
//! The vector counts, not the phase: at standstill a phase may carry its peak continuously, and the copper losses of the
//! motor are those of the vector. The load is kept over stops and starts, but not over a reset.
//!
//! Above a load of 1 the q-axis current is reduced, and with it the load: the drive settles at the continuous current of
//! the body, at most 2.5 % above it. The trip is for a load that this cannot limit, due to a d-axis current that is too
//! large.

use crate::{Fault, Limiting};

/// Load that trips: 5 % more than the continuous current, with a margin for ripple.
const TRIP: f32 = 1.1;
/// Load at which no q-axis current is left. Its square falls from a load of 1 on.
const NOTHING_LEFT: f32 = 1.05;

/// Coefficients of a body.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Body {
    /// Steady load per squared current, 1/A^2.
    per_square: f32,
    /// Share of the newest value.
    smoothing: f32,
}

impl Body {
    /// Creates a body with the continuous current `current_a`, A peak, and a thermal time constant of `tau_s`, s, for
    /// steps `period_s` apart.
    pub fn new(current_a: f32, tau_s: f32, period_s: f32) -> Self {
        Self { per_square: 1.0 / (current_a * current_a), smoothing: period_s / tau_s }
    }

    fn step(&self, load: &mut f32, square: f32) {
        *load += self.smoothing * (self.per_square * square - *load);
    }
}

/// Coefficients of motor and inverter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Thermal {
    /// The motor.
    pub motor: Body,
    /// The inverter.
    pub inverter: Body,
}

/// Loads of motor and inverter; 1 is the load at the continuous current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThermalLoads {
    /// The motor.
    pub motor: f32,
    /// The inverter.
    pub inverter: f32,
}

impl ThermalLoads {
    /// Returns the share of the square of the largest current that both allow, 1 or more for all of it, and the one that allows
    /// less.
    #[inline]
    pub fn share(&self) -> (f32, Limiting) {
        let (load, why) = if self.motor > self.inverter {
            (self.motor, Limiting::Motor)
        } else {
            (self.inverter, Limiting::Inverter)
        };
        ((NOTHING_LEFT - load) * (1.0 / (NOTHING_LEFT - 1.0)), why)
    }
}

impl Thermal {
    /// Control periods between two steps.
    pub const EVERY: u32 = 60;

    /// Advances by a period with the `square` of the current vector, A^2.
    ///
    /// # Errors
    /// [`Fault::MotorOverload`] or [`Fault::InverterOverload`] above a load of 1.1, or if the load is NaN.
    pub fn step(&self, loads: &mut ThermalLoads, square: f32) -> Result<(), Fault> {
        self.motor.step(&mut loads.motor, square);
        self.inverter.step(&mut loads.inverter, square);
        Fault::MotorOverload.unless(loads.motor <= TRIP)?;
        Fault::InverterOverload.unless(loads.inverter <= TRIP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f32 = 0.01;

    /// Returns the seconds until the fault at a constant current, A, at most an hour.
    fn until(current: f32) -> Option<(f32, Fault)> {
        let thermal = Thermal {
            motor: Body::new(3.0, 300.0, PERIOD_S),
            inverter: Body::new(5.0, 5.0, PERIOD_S),
        };
        let mut loads = ThermalLoads::default();
        (1..360_000_u32).find_map(|n| {
            let fault = thermal.step(&mut loads, current * current).err()?;
            Some((n as f32 * PERIOD_S, fault))
        })
    }

    #[test]
    fn what_is_borne_for_ever_does_not_trip_and_more_does_in_time() {
        assert_eq!(until(3.0), None);
        assert_eq!(until(0.0), None);
        // The time is tau ln(1 / (1 - 1.1 / x)), with x the square of the relative current.
        let time = |tau: f32, x: f32| -tau * libm::logf(1.0 - 1.1 / x);
        for (current, tau, carried, fault) in [
            (4.0, 300.0, 3.0, Fault::MotorOverload),
            (6.0, 5.0, 5.0, Fault::InverterOverload),
            (20.0, 5.0, 5.0, Fault::InverterOverload),
        ] {
            let x: f32 = current * current / (carried * carried);
            let (s, found) = until(current).unwrap();
            assert_eq!(found, fault, "{current}");
            assert!((s / time(tau, x) - 1.0).abs() < 0.03, "{current}: {s}");
        }
        assert_eq!(until(f32::NAN).map(|(_, fault)| fault), Some(Fault::MotorOverload));
    }
}
