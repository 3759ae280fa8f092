//! What a step of the commissioning reports: values with their units, and the verdict in words.

use core::fmt;

use crate::drive::{Refused, State};
use crate::fault::Fault;
use crate::settings::value::{Words as _, words};
use crate::tuning::TuningError;

/// A step of the commissioning, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// The nameplate: is it plausible, and what follows from it.
    Nameplate,
    /// Offsets and noise of the current sensors, dc link.
    Sensors,
    /// Volt-second pulses: wiring, open phases, rough transient inductance.
    Wiring,
    /// Two current levels along phase a, and a third: resistances, rotor time constant, voltage of the inverter, gain
    /// mismatch.
    Levels,
    /// The carrier along and across a bias: transient inductance, saliency at standstill.
    Leakage,
    /// A staircase of currents: the magnetising curve. Only where the levels show that the main flux saturates.
    Staircase,
    /// The current loop, designed from the values found and checked by a step.
    CurrentLoop,
    /// The plants of the current loop from a pseudo-random voltage, as in section 3.7, shaft locked.
    Plant,
    /// The inertia, with a free shaft and a drive that has learned: the shaft turns to and fro.
    Inertia,
}

words!(Step {
    Self::Nameplate => Step::Nameplate, "nameplate"; Self::Sensors => Step::Sensors, "sensors";
    Self::Wiring => Step::Wiring, "wiring"; Self::Levels => Step::Levels, "levels";
    Self::Leakage => Step::Leakage, "leakage"; Self::Staircase => Step::Staircase, "staircase";
    Self::CurrentLoop => Step::CurrentLoop, "current-loop"; Self::Plant => Step::Plant, "plant";
    Self::Inertia => Step::Inertia, "inertia";
});

impl Step {
    /// The last one at standstill.
    pub const LAST: Self = Self::CurrentLoop;
    /// The words of all, for messages.
    pub const ALL: &'static str =
        "nameplate sensors wiring levels leakage staircase current-loop plant inertia";
}

/// A value that a step has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// The value.
    pub value: f32,
    /// Its standard deviation by the noise of the measurement; 0 where there is none to state.
    pub deviation: f32,
    /// What nameplate and noise allow, from and to; infinite where nothing is expected.
    pub allowed: (f32, f32),
}

/// Values of a report at most.
pub const VALUES: usize = 8;

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The step.
    pub step: Step,
    /// The values that it has found, in their order.
    pub values: [Option<Quantity>; VALUES],
    /// Why it is refused; none where it is sound.
    pub refusal: Option<Refusal>,
}

/// The reason why a step is refused. The settings stay as they were.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// An entry of the nameplate that cannot belong to the others.
    Plate {
        /// The setting.
        name: &'static str,
        /// Its unit.
        unit: &'static str,
        /// Its value.
        value: f32,
        /// Smallest plausible.
        min: f32,
        /// Largest plausible.
        max: f32,
    },
    /// A measured value that cannot belong to a motor with this nameplate.
    Value {
        /// The value.
        name: &'static str,
        /// Its unit.
        unit: &'static str,
        /// As measured.
        value: f32,
        /// Smallest allowed.
        min: f32,
        /// Largest allowed.
        max: f32,
        /// What that means.
        meaning: Meaning,
    },
    /// The drive is in a state in which it cannot be commissioned: a fault has stopped it, or somebody has.
    Drive(State),
    /// What the answers to the pulses say.
    Wiring(Fault),
    /// The pulses on this phase, 0 to 2, are not answered: it is open.
    PhaseOpen(u8),
    /// A current sensor, 0 or 1, shows no current.
    SensorOpen(u8),
    /// No pulse is answered at all.
    NoMotor,
    /// The current loop cannot be designed for what was found.
    Design(TuningError),
    /// A step that must come before is missing.
    Needs(Step),
    /// The drive has not taken a command.
    Command(Refused),
    /// Samples were lost on the way to the evaluation.
    SamplesLost,
}

/// What a value out of its range means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Larger motor than the nameplate says.
    TooLarge,
    /// Smaller motor than the nameplate says.
    TooSmall,
    /// The sensor's offset.
    Offset,
    /// The sensors' noise.
    Noise,
    /// The dc link.
    BusTooLow,
    /// The model of a linear motor does not fit.
    Misfit,
    /// Gains that differ.
    Mismatch,
    /// Current across the axis of the voltage.
    Turning,
    /// Inverter voltage that depends on the current.
    Inverter,
    /// Value too uncertain.
    Uncertain,
    /// The step response of the current loop.
    Loop,
    /// The speed does not follow the torque.
    NotFree,
}

impl Meaning {
    /// In words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::TooLarge => {
                "the motor is larger than its nameplate says, or its windings are shorted"
            }
            Self::TooSmall => {
                "the motor is smaller than its nameplate says, or connected in another way"
            }
            Self::Offset => {
                "correct the offset in scales.current_*, and let the motor come to rest"
            }
            Self::Noise => "shield and ground the lines of the sensors",
            Self::BusTooLow => "raise the dc link, or compare scales.dc_link with a voltmeter",
            Self::Misfit => "the motor is not linear at these currents, or something has moved",
            Self::Mismatch => {
                "compare scales.current_a and scales.current_b with an ammeter; was the shaft at rest?"
            }
            Self::Turning => "the shaft turns, or the gains of the sensors differ",
            Self::Inverter => "the voltage that the inverter loses still grows with the current",
            Self::Uncertain => "too much noise for this motor",
            Self::NotFree => {
                "the shaft must be free to turn; friction, a load or a coupling hides the inertia"
            }
            Self::Loop => "the motor is not as it was measured",
        }
    }
}

impl Report {
    /// A report of a step that is sound.
    pub(super) fn new<const N: usize>(step: Step, values: [Quantity; N]) -> Self {
        let mut report = Self { step, values: [None; VALUES], refusal: None };
        for (place, value) in report.values.iter_mut().zip(values) {
            *place = Some(value);
        }
        report
    }
}

impl Quantity {
    /// A value of which the nameplate expects nothing.
    pub(super) const fn new(name: &'static str, unit: &'static str, value: f32) -> Self {
        Self { name, unit, value, deviation: 0.0, allowed: (f32::NEG_INFINITY, f32::INFINITY) }
    }

    /// With the deviation that noise gives it.
    pub(super) const fn within(self, deviation: f32) -> Self {
        Self { deviation, ..self }
    }

    /// With the range that the nameplate lets expect.
    pub(super) const fn of(self, allowed: (f32, f32)) -> Self {
        Self { allowed, ..self }
    }

    /// Refuses a value outside what is expected, or one that is not finite.
    pub(super) fn check(self, below: Meaning, above: Meaning) -> Result<Self, Refusal> {
        let (min, max) = self.allowed;
        if self.value >= min && self.value <= max {
            return Ok(self);
        }
        let meaning = if self.value < min { below } else { above };
        let Self { name, unit, value, .. } = self;
        Err(Refusal::Value { name, unit, value, min, max, meaning })
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Four digits.
        let places = match self.value.abs() {
            x if x >= 1000.0 => 0,
            x if x >= 100.0 => 1,
            x if x >= 10.0 => 2,
            x if x >= 1.0 => 3,
            x if x >= 0.1 => 4,
            _ => 5,
        };
        write!(f, "{} {:.places$}", self.name, self.value)?;
        if self.deviation > 0.0 {
            write!(f, " +-{:.places$}", self.deviation)?;
        }
        f.write_str(if self.unit.is_empty() { "" } else { " " })?;
        f.write_str(self.unit)?;
        let (min, max) = self.allowed;
        match (min.is_finite(), max.is_finite()) {
            (true, true) => write!(f, " (allowed: {min:.places$} to {max:.places$})"),
            (true, false) => write!(f, " (allowed: from {min:.places$})"),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Report {
    /// Step and verdict; the values are shown one by one.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.refusal {
            None if self.step == Step::Inertia => f.write_str(
                "inertia: sound; it began with positive torque: if the shaft turned the wrong way then, exchange two lines of the motor",
            ),
            None => write!(f, "{}: sound", self.step.word()),
            Some(refusal) => write!(f, "{}: refused: {refusal}", self.step.word()),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Plate { name, unit, value, min, max } => {
                write!(
                    f,
                    "{name} = {value} {unit}: with the rest of the nameplate {min:.4} to {max:.4} is plausible"
                )
            }
            Self::Value { name, unit, value, min, max, meaning } => {
                write!(
                    f,
                    "{name} = {value:.5} {unit}: allowed is {min:.5} to {max:.5}; {}",
                    meaning.text()
                )
            }
            Self::Drive(state) => write!(f, "the drive is {state}"),
            Self::Design(error) => write!(f, "{error}"),
            Self::Wiring(fault) => write!(f, "{fault}"),
            Self::PhaseOpen(n) => write!(f, "phase {} is open", phase(n)),
            Self::SensorOpen(n) => write!(f, "current sensor {} shows no current", phase(n)),
            Self::NoMotor => f.write_str("no motor: no pulse is answered"),
            Self::Command(why) => write!(f, "{why}"),
            Self::Needs(step) => write!(f, "the step {} comes first", step.word()),
            Self::SamplesLost => f.write_str("samples were lost; repeat it"),
        }
    }
}

fn phase(number: u8) -> &'static str {
    ["a", "b", "c"].get(usize::from(number)).copied().unwrap_or("?")
}
