//! Settings in SI units.
//!
//! [`Settings::build`] makes [`Coefficients`](crate::Coefficients) of them, outside the interrupt: it checks every
//! value against its range and runs the design rules. [`Settings::default`] is the drive of the
//! dissertation.

mod check;
mod hardware;
mod injection;
mod learned;
mod motor;
pub mod table;

use core::fmt;

use crate::tuning::{FirstOrder, TuningError};

pub use hardware::{Inverter, Line, Scales};
pub use injection::{InjectionSettings, PrintedChain, SynchronousTracking};
pub use motor::Motor;

/// The source of the flux angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AngleSource {
    /// Encoder and slip, Eq. 2.10.
    Encoder,
    /// The injected carrier: no sensor on the shaft.
    #[default]
    Injection,
}

/// The plant that the current controllers are designed for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CurrentPlant {
    /// First-order plants k / (z - p) identified on the motor with the filters in place
    /// (Eq. 3.41 and 3.42).
    Identified {
        /// Direct axis.
        d: FirstOrder,
        /// Quadrature axis.
        q: FirstOrder,
    },
    /// The plant computed from the parameters of the motor.
    Motor,
}

impl Default for CurrentPlant {
    fn default() -> Self {
        Self::Identified {
            d: FirstOrder { k: 0.002_837, p: 0.9511 },
            q: FirstOrder { k: 0.003_721, p: 0.9503 },
        }
    }
}

/// Limits and protections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest current vector that is regulated, A peak.
    pub current_a: f32,
    /// Phase current that trips, A.
    pub trip_a: f32,
    /// Dc link above which the drive trips, V.
    pub dc_over_v: f32,
    /// Dc link below which it trips while the outputs are on, V.
    pub dc_under_v: f32,
    /// Speed of the rotor that trips, rpm.
    pub speed_rpm: f32,
    /// Largest voltage that the model of the motor does not explain at standstill, V.
    pub unexplained_v: f32,
}

impl Default for Limits {
    /// The trip is below the end of the sensors' range (4.47 A); 3.5 A and the carrier's 0.26 A stay clear of
    /// it. The unexplained 12 V are 3 A on an error of 30 % of the resistance and a full step on an error of
    /// 15 % of the inductance.
    fn default() -> Self {
        Self {
            current_a: 3.5,
            trip_a: 4.3,
            dc_over_v: 400.0,
            dc_under_v: 200.0,
            speed_rpm: 2000.0,
            unexplained_v: 12.0,
        }
    }
}

/// The sequence between `start` and regulation, and at `stop`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sequence {
    /// Time for the offset calibration, s.
    pub calibrate_s: f32,
    /// Time with the low sides on, s.
    pub precharge_s: f32,
    /// Time with current on the direct axis alone, s.
    pub magnetise_s: f32,
    /// Current on the direct axis, A peak.
    pub i_d: f32,
    /// Slope of the torque current at a stop, A/s.
    pub stop_a_per_s: f32,
}

impl Default for Sequence {
    /// 0.7 A is the magnetising current of section 3.10; 0.8 s are four rotor time constants.
    fn default() -> Self {
        Self {
            calibrate_s: 0.1,
            precharge_s: 0.010,
            magnetise_s: 0.8,
            i_d: 0.7,
            stop_a_per_s: 30.0,
        }
    }
}

/// The speed loop, and the position loop around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedSettings {
    /// Largest current on the quadrature axis, A.
    pub i_q_limit_a: f32,
    /// Largest speed that is asked for, in either mode, rpm.
    pub limit_rpm: f32,
    /// Largest acceleration that is asked for, rpm/s.
    pub ramp_rpm_per_s: f32,
    /// Phase margin that the speed loop is designed for, degrees: more is calmer and slower.
    pub phase_margin_deg: f32,
}

impl Default for SpeedSettings {
    /// 3 A of section 4.1. Without a sensor the angle is good to 300 rpm, and lags by 5.7° while the
    /// speed changes by 300 rpm/s (four poles, 4 Hz): with an encoder both may be larger.
    fn default() -> Self {
        Self { i_q_limit_a: 3.0, limit_rpm: 300.0, ramp_rpm_per_s: 300.0, phase_margin_deg: 60.0 }
    }
}

/// All settings of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// The motor.
    pub motor: Motor,
    /// The timer and the power stage.
    pub inverter: Inverter,
    /// Scales of converters and encoder.
    pub scales: Scales,
    /// The source of the flux angle.
    pub angle_source: AngleSource,
    /// The plant that the current controllers are designed for.
    pub current_plant: CurrentPlant,
    /// Leave the delays of the current measurement and of the demodulation uncompensated, as the
    /// dissertation does, to show what they cost: with the encoder 4.7° at 1440 rpm, with the
    /// injection some 9° at standstill already (the flux slips) and 35° at 150 rpm.
    pub ignore_delays: bool,
    /// Whether the drive takes the rotor time constant that [`online`](crate::identify::online) finds.
    pub track_rotor: bool,
    /// The injection.
    pub injection: InjectionSettings,
    /// Limits and protections.
    pub limits: Limits,
    /// Start and stop.
    pub sequence: Sequence,
    /// The speed and the position loop.
    pub speed: SpeedSettings,
}

/// The reason why settings were refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingsError {
    /// A value outside its range.
    Range {
        /// Name of the setting.
        name: &'static str,
        /// The value.
        value: f32,
        /// Smallest allowed.
        min: f32,
        /// Largest allowed.
        max: f32,
    },
    /// The design of the controllers failed.
    Tuning(TuningError),
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { name, value, min, max } => {
                write!(f, "{name} = {value}: allowed is {min} to {max}")
            }
            Self::Tuning(error) => write!(f, "controllers: {error}"),
        }
    }
}

impl core::error::Error for SettingsError {}

impl From<TuningError> for SettingsError {
    fn from(error: TuningError) -> Self {
        Self::Tuning(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f32, expected: f32) {
        assert!((value / expected - 1.0).abs() < 1e-5, "{value}, not {expected}");
    }

    /// Table 5, worked out by hand.
    #[test]
    fn derived_parameters_of_the_motor() {
        let motor = Motor::default();
        near(motor.l_r(), 0.2047);
        near(motor.sigma_l_s(), 0.051_478_7);
        near(motor.coupled_inductance(), 0.153_221_3);
        near(motor.l_m + motor.l_ls, motor.sigma_l_s() + motor.coupled_inductance());
        near(motor.tau_r(), 0.186_090_9);
        near(motor.torque_per_ampere(0.7), 0.321_764_7);
        near(motor.torque_per_ampere(1.4), 0.643_529_4);
    }

    #[test]
    fn a_line_gives_the_value_of_a_code() {
        let line = Line { gain: 0.002, offset: -4.0 };
        near(line.at(3000), 2.0);
        near(line.at(0), -4.0);
        near(line.scaled(1.5).at(3000), 3.0);
        near(line.scaled(1.5).at(0), -6.0);
    }
}
