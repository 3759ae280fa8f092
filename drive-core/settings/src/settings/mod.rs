//! Settings in SI units.
//!
//! [`Settings::build`] computes the [`Coefficients`](drive_core::Coefficients) from them, outside the interrupt: it
//! checks every value against its range and runs the design rules. [`Settings::default`] is the drive of the
//! dissertation.

mod declare;
pub(crate) mod design;
pub mod entry;
mod list;
mod motor_sensor;
mod ntc;
mod numbers;
pub mod renamed;
pub mod rules;
#[cfg(feature = "serde")]
mod stored;
mod tracked;
pub mod value;

use self::value::{Words, words};
use crate::tuning::TuningError;
use drive_core::blocks::{Catch, Power};
use drive_core::printed::DemodulatorKind;
use drive_core::{AngleSource, Line, PERIOD_S};

pub use list::{
    BrakingSettings, CurrentPlant, FluxSettings, IdentifiedPlant, InjectionSettings, Inverter,
    Limits, MotorSensor, Nameplate, Ntc, ObserverSettings, PrintedChain, SETTINGS, Scales,
    Sequence, Settings, SpeedSettings, SupplySettings, SynchronousTracking, VoltsPerHertzMode,
    find,
};

words! {
    /// Sensors of the phase currents.
    pub enum CurrentSensors {
        /// Two sensors, in the lines a and b.
        InLine = "in-line",
        /// Three shunts below the low sides.
        LowSide = "low-side",
    }

    /// Switching frequencies, kHz.
    pub enum Carrier {
        /// One pulse per control period.
        Khz6 = "6",
        /// Two pulses.
        Khz12 = "12",
        /// Three pulses.
        Khz18 = "18",
    }
}

impl Carrier {
    /// Returns the pulses of a leg in a control period.
    pub const fn pulses(self) -> u16 {
        self as u16 + 1
    }
}

impl Inverter {
    /// Returns the switching period, s.
    pub fn carrier_s(&self) -> f32 {
        PERIOD_S / f32::from(self.switching_khz.pulses())
    }
}

words! {
    /// Plants for which the current controllers can be designed.
    pub enum PlantSource {
        /// First-order plants identified on the motor with the filters in place (section 3.7).
        Identified = "identified",
        /// The plant computed from the parameters of the motor. The current loop of the dissertation's motor is a third slower
        /// with it.
        Motor = "motor",
    }

    /// Temperature sensors of a motor.
    pub enum SensorKind {
        /// There is none.
        None = "none",
        /// Thermistor of 10 kohm at 25 °C, B 3435 K.
        Ntc10k = "ntc-10k",
        /// Platinum, 1000 ohm at 0 °C.
        Pt1000 = "pt1000",
        /// Silicon, 1000 ohm at 100 °C.
        Kty84 = "kty84",
    }

    /// Flux with which the drive magnetises the motor.
    pub enum Flux {
        /// The flux of the dissertation, 15 % of the rated flux of its motor, with the current limit and trip of its drive.
        Low = "low",
        /// The rated flux, or the flux of 0.707 times the rated current if that is smaller. A motor that saturates can be
        /// tracked with this flux even if it has hardly any saliency at the low one. Current limit and trip allow 150 % of the
        /// rated torque.
        High = "high",
    }
}

words! {
    /// Axis of the injection in the frame of the flux.
    pub enum InjectionAxis {
        /// Across the flux.
        Q = "q",
        /// Along the flux.
        D = "d",
    }
}

impl InjectionAxis {
    /// Returns the sign of the saliency along this axis, relative to the q axis.
    pub const fn sign(self) -> f32 {
        if matches!(self, Self::Q) { 1.0 } else { -1.0 }
    }
}

words!(AngleSource { Encoder = "encoder", Injection = "injection", });
words!(DemodulatorKind {
    Literal = "literal",
    Rectified = "rectified",
    Synchronous = "synchronous",
    RmsImpedance = "rms-impedance",
    Envelope = "envelope",
});

/// Reasons why shunts below the low sides are sampled in one zero vector and at 6 kHz only, and why a demodulation is missing.
const BLIND: &str = "shunts below the low sides see nothing in the upper zero vector; set it to no";
const SLOW: &str = "shunts below the low sides settle too slowly for shorter pulses; set it to 6";
/// Reasons why the injection does not lie along the flux.
const SYNCHRONOUS_ALONE: &str = "only the synchronous demodulation reads it; set injection.demodulator to synchronous, or this to q";
const BEYOND_I_D: &str = "the injection current would be larger than the d-axis current (sequence.i_d); set injection.amplitude_v lower, or this to q";
const LEFT_OUT: &str = "this build is without this block";
const ABSENT: &str = "this image is built with synchronous alone; `cargo firmware --loop printed` builds one with all";

impl Scales {
    /// Returns the calibration of a current by its ADC counts from the calibration `line` of one conversion. With both zero vectors
    /// the counts are the sum of two conversions.
    pub fn of_code(&self, line: Line) -> Line {
        Line { gain: if self.both_zero_vectors { 0.5 } else { 1.0 } * line.gain, ..line }
    }
}

impl Settings {
    /// Returns the age of the currents at the top of the counter, s: the delay of their filters. The mean of both zero vectors
    /// is a quarter of a switching period older.
    pub fn current_age_s(&self) -> f32 {
        let both = if self.scales.both_zero_vectors { 0.25 } else { 0.0 };
        self.scales.current_delay_s + both * self.inverter.carrier_s()
    }

    /// Checks the words, and every value against its range. The scales come first, since the rules of other
    /// settings follow from the sensors' range.
    ///
    /// # Errors
    /// [`SettingsError::Word`], or [`SettingsError::Range`] with the first value outside its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        self.check_words(DemodulatorKind::HAS_ALL)?;
        let scales = SETTINGS.iter().filter(|entry| entry.name.starts_with("scales."));
        scales.chain(SETTINGS).try_for_each(|entry| entry.check(self))?;
        let reads = self.injection.demodulator == DemodulatorKind::Synchronous;
        let serves = reads && self.injection_a() <= self.i_d();
        let why = if reads { BEYOND_I_D } else { SYNCHRONOUS_ALONE };
        let is_q = self.injection.axis == InjectionAxis::Q;
        (is_q || serves).then_some(()).ok_or(SettingsError::Word("injection.axis", "d", why))
    }

    /// Checks that the build contains the demodulation (`has_all`: it contains all, otherwise the synchronous one alone), and
    /// that the sensors can measure in the way that is set.
    pub(crate) fn check_words(&self, has_all: bool) -> Result<(), SettingsError> {
        if self.scales.both_zero_vectors && self.scales.sensors == CurrentSensors::LowSide {
            return Err(SettingsError::Word("scales.both_zero_vectors", true.word(), BLIND));
        }
        if self.sequence.flying_start && Catch::IN_BUILD.is_none() {
            return Err(SettingsError::Word("sequence.flying_start", true.word(), LEFT_OUT));
        }
        if self.limits_power() && Power::IN_BUILD.is_none() {
            return Err(SettingsError::Word(
                "limits.motoring_w",
                "or another limit of dc current and power",
                LEFT_OUT,
            ));
        }
        let carrier = self.inverter.switching_khz;
        if carrier != Carrier::Khz6 && self.scales.sensors == CurrentSensors::LowSide {
            return Err(SettingsError::Word("inverter.switching_khz", carrier.word(), SLOW));
        }
        let kind = self.injection.demodulator;
        let present = has_all || kind == DemodulatorKind::Synchronous;
        let absent = SettingsError::Word("injection.demodulator", kind.word(), ABSENT);
        present.then_some(()).ok_or(absent)
    }

    /// Returns the name of the first setting for whose value results learned with the settings `other` are not valid.
    pub fn learned_with_another(&self, other: &Self) -> Option<&'static str> {
        let differing = SETTINGS.iter().find(|entry| entry.learned && !entry.same(self, other));
        differing.map(|entry| entry.name)
    }
}

/// The reason why settings were refused.
///
/// Exhaustive on purpose, so that code that translates the reasons also has to translate a new one.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A value outside its range.
    #[error(
        "{name} = {value}: allowed is {}{min} to {max}{}{unit}",
        // A NaN limit counts as an empty range.
        if .min <= .max { "" } else { "nothing beside other settings: " },
        if .unit.is_empty() { "" } else { " " }
    )]
    Range {
        /// Name of the setting.
        name: &'static str,
        /// Its unit; empty if there is none.
        unit: &'static str,
        /// The value.
        value: f32,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
    /// Name of a setting, its word, which this build or this board does not allow, and the reason.
    #[error("{0} = {1}: {2}")]
    Word(&'static str, &'static str, &'static str),
    /// The design of the controllers failed.
    #[error("controllers: {0}")]
    Tuning(#[from] TuningError),
}
