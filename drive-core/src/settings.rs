//! Settings in SI units.
//!
//! [`Settings::build`] makes [`Coefficients`](crate::Coefficients) of them, outside the interrupt: it checks every
//! value against its range and runs the design rules. [`Settings::default`] is the drive of the
//! dissertation.

mod check;
pub mod entry;
mod hardware;
mod injection;
mod list;
mod motor;
mod nameplate;
mod ntc;
pub mod rules;
pub mod table;
#[cfg(test)]
mod tests;
pub mod value;

use core::fmt;

use self::value::words;
use crate::tuning::TuningError;

pub use hardware::{CurrentSensors, Inverter, Line, Scales};
pub use injection::{InjectionSettings, PrintedChain, SynchronousTracking};
pub use list::{SETTINGS, find};
pub use motor::Motor;
pub use nameplate::Nameplate;
pub use ntc::{HeatSink, Ntc};

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlantSource {
    /// First-order plants identified on the motor with the filters in place (section 3.7).
    #[default]
    Identified,
    /// The plant computed from the parameters of the motor. The current loop of the dissertation's motor is a third slower
    /// with it.
    Motor,
}

/// An identified plant k / (z - p) at 6 kHz. Unset values follow [`rules`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IdentifiedPlant {
    /// Gain, A/V.
    pub k: Option<f32>,
    /// Pole.
    pub p: Option<f32>,
}

/// The plants of the current controllers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentPlant {
    /// The one in use.
    pub source: PlantSource,
    /// Identified plant of the direct axis.
    pub d: IdentifiedPlant,
    /// Identified plant of the quadrature axis.
    pub q: IdentifiedPlant,
}

/// The flux that the drive magnetises the motor with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flux {
    /// That of the dissertation: 15 % of the rated flux of its motor.
    #[default]
    Low,
    /// The rated flux, or that of 0.55 times the rated current where it is smaller: a motor of iron can be tracked with it
    /// where it hardly has a saliency at the low one.
    High,
}

words!(Flux { Self::Low => Flux::Low, "low"; Self::High => Flux::High, "high"; });
words!(AngleSource { Self::Encoder => AngleSource::Encoder, "encoder"; Self::Injection => AngleSource::Injection, "injection"; });
words!(PlantSource { Self::Identified => PlantSource::Identified, "identified"; Self::Motor => PlantSource::Motor, "motor"; });

/// Limits and protections. Unset ones follow [`rules`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest current vector that is regulated, A peak.
    pub current_a: Option<f32>,
    /// Phase current that trips, A.
    pub trip_a: Option<f32>,
    /// Dc link above which the drive trips, V.
    pub dc_over_v: Option<f32>,
    /// Dc link below which it trips while the outputs are on, V.
    pub dc_under_v: Option<f32>,
    /// Speed of the rotor that trips, rpm.
    pub speed_rpm: Option<f32>,
    /// Largest voltage that the model of the motor does not explain at standstill, V.
    pub unexplained_v: Option<f32>,
    /// Current that the motor carries for any time at standstill, A peak.
    pub motor_a: Option<f32>,
    /// Thermal time constant of its windings, s.
    pub motor_s: f32,
    /// Current that the inverter carries for any time, A peak.
    pub inverter_a: Option<f32>,
    /// Thermal time constant of its switches to the heat sink, s.
    pub inverter_s: f32,
    /// Temperature of the heat sink that trips, °C.
    pub heat_sink_c: f32,
    /// Temperature of the heat sink from which on the current limit falls, to nothing where it trips, °C.
    pub derate_c: Option<f32>,
}

impl Default for Limits {
    /// The heat sink's limit suits most power modules.
    fn default() -> Self {
        Self {
            current_a: None,
            trip_a: None,
            dc_over_v: None,
            dc_under_v: None,
            speed_rpm: None,
            unexplained_v: None,
            motor_a: None,
            motor_s: 300.0,
            inverter_a: None,
            inverter_s: 5.0,
            heat_sink_c: 85.0,
            derate_c: None,
        }
    }
}

/// The sequence between `start` and regulation, and at `stop`. Unset values follow [`rules`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sequence {
    /// Time for the offset calibration, s.
    pub calibrate_s: f32,
    /// Time with the low sides on, s.
    pub precharge_s: f32,
    /// Time with current on the direct axis alone, s.
    pub magnetise_s: Option<f32>,
    /// Flux that the rule for the direct current aims at.
    pub flux: Flux,
    /// Current on the direct axis, A peak.
    pub i_d: Option<f32>,
    /// Slope of the torque current at a stop, A/s.
    pub stop_a_per_s: Option<f32>,
    /// Whether a start without an encoder looks for a turning shaft first, for 0.25 s.
    pub catch: bool,
}

impl Default for Sequence {
    fn default() -> Self {
        Self {
            calibrate_s: 0.1,
            precharge_s: 0.010,
            magnetise_s: None,
            flux: Flux::Low,
            i_d: None,
            stop_a_per_s: None,
            catch: true,
        }
    }
}

/// The speed loop, and the position loop around it. Unset values follow [`rules`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedSettings {
    /// Largest current on the quadrature axis, A.
    pub i_q_limit_a: Option<f32>,
    /// Largest speed that is asked for, in either mode, rpm.
    pub limit_rpm: Option<f32>,
    /// Largest acceleration that is asked for, rpm/s.
    pub ramp_rpm_per_s: Option<f32>,
    /// Deceleration of a quick stop, rpm/s.
    pub quick_rpm_per_s: Option<f32>,
    /// Time in which the acceleration comes to its full value in speed mode and in a stop by the ramp, s; 0 for at once.
    pub s_ramp_s: f32,
    /// Phase margin that the speed loop is designed for, degrees: more is calmer and slower.
    pub phase_margin_deg: f32,
}

impl Default for SpeedSettings {
    fn default() -> Self {
        Self {
            i_q_limit_a: None,
            limit_rpm: None,
            ramp_rpm_per_s: None,
            quick_rpm_per_s: None,
            s_ramp_s: 0.0,
            phase_margin_deg: 60.0,
        }
    }
}

/// The observer that takes the angle over from the injection at speed; see [`crate::flux::observer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverSettings {
    /// Whether it does. Without it the drive trips at [`tracked_rpm`](SynchronousTracking::tracked_rpm).
    pub enabled: bool,
    /// Leakage inductance of the fundamental wave at no current, as a share of that of the motor's parameters.
    pub leakage_share: f32,
    /// Change of that share per ampere of stator current, peak, 1/A.
    pub leakage_slope: f32,
}

impl Default for ObserverSettings {
    fn default() -> Self {
        Self { enabled: true, leakage_share: 1.0, leakage_slope: 0.0 }
    }
}

/// Limits of the torque by the voltage of the dc link, and the brake resistor; see [`crate::dc_link`]. Unset values follow [`rules`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingSettings {
    /// Voltage without generating torque, V.
    pub high_v: Option<f32>,
    /// Voltage without motoring torque, V, below which the shaft feeds the link.
    pub low_v: Option<f32>,
    /// Direct current that is added while generating torque is limited, A.
    pub flux_a: Option<f32>,
    /// Brake resistor behind the chopper, ohm; 0 for none.
    pub ohm: f32,
    /// Energy that it takes from cold, J.
    pub energy_j: f32,
    /// Power that it takes for ever, W.
    pub power_w: f32,
}

/// The supply of the dc link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SupplySettings {
    /// Time that the link must be steady before the precharge relay closes, s; 0 without a relay. See [`crate::supply`].
    pub relay_s: f32,
}

impl Default for BrakingSettings {
    /// No brake resistor. Where one is fitted, its energy and power stand on it.
    fn default() -> Self {
        Self { high_v: None, low_v: None, flux_a: None, ohm: 0.0, energy_j: 1000.0, power_w: 50.0 }
    }
}

/// The mode for a motor that nobody has identified; see [`crate::flux::volts_per_hertz`]. Unset values follow [`rules`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltsPerHertzMode {
    /// Voltage between lines, rms, per frequency, V/Hz.
    pub volts_per_hz: Option<f32>,
    /// Current of the standing motor, A peak.
    pub boost_a: Option<f32>,
    /// Share of the slip that is compensated.
    pub slip_share: f32,
}

impl Default for VoltsPerHertzMode {
    fn default() -> Self {
        Self { volts_per_hz: None, boost_a: None, slip_share: 1.0 }
    }
}

/// All settings of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// The motor.
    pub motor: Motor,
    /// Its nameplate.
    pub nameplate: Nameplate,
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
    /// The observer.
    pub observer: ObserverSettings,
    /// Limits and protections.
    pub limits: Limits,
    /// Start and stop.
    pub sequence: Sequence,
    /// The speed and the position loop.
    pub speed: SpeedSettings,
    /// The limits by the dc link.
    pub braking: BrakingSettings,
    /// The supply of the dc link.
    pub supply: SupplySettings,
    /// The mode for a motor that nobody has identified.
    pub vf: VoltsPerHertzMode,
}

/// The reason why settings were refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingsError {
    /// A value outside its range.
    Range {
        /// Name of the setting.
        name: &'static str,
        /// Its unit; empty if there is none.
        unit: &'static str,
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
            Self::Range { name, unit, value, min, max } => {
                let space = if unit.is_empty() { "" } else { " " };
                // NaN counts as none.
                let beside = if min <= max { "" } else { "nothing beside other settings: " };
                write!(f, "{name} = {value}: allowed is {beside}{min} to {max}{space}{unit}")
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
