//! What a step of the commissioning reports: values with their units, and the verdict in words.

use core::fmt;

use drive_core::{Fault, Refused, State};
use drive_settings::tuning::TuningError;
use drive_settings::value::Words;
use drive_settings::words;

words! {
    /// A step of the commissioning, in their order.
    pub enum Step {
        /// The nameplate: is it plausible, and what follows from it.
        Nameplate = "nameplate",
        /// Offsets and noise of the current sensors, dc link.
        Sensors = "sensors",
        /// Volt-second pulses: wiring, open phases, rough transient inductance.
        Wiring = "wiring",
        /// Two current levels along phase a, and a third: resistances, rotor time constant, voltage of the inverter.
        Levels = "levels",
        /// The carrier along and across a bias: transient inductance, saliency at standstill, gain mismatch.
        Leakage = "leakage",
        /// A staircase of currents: the magnetising curve. Only where the levels show that the main flux saturates.
        Staircase = "staircase",
        /// The current loop, designed from the values found and checked by a step.
        CurrentLoop = "current-loop",
        /// The plants of the current loop from a pseudo-random voltage, as in section 3.7, shaft locked.
        Plant = "plant",
        /// The inertia, with a free shaft and a drive that has learned: the shaft turns to and fro.
        Inertia = "inertia",
    }
}

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

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The step.
    pub step: Step,
    /// The values that it has found, in their order.
    pub values: [Option<Quantity>; 8],
    /// Why it is refused; none where it is sound.
    pub refusal: Option<Refusal>,
}

/// The reason why a step is refused. The settings stay as they were.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// An entry of the nameplate, with what is plausible beside the others.
    #[error(
        "{} = {} {}: with the rest of the nameplate {:.4} to {:.4} is plausible",
        .0.name, .0.value, .0.unit, .0.allowed.0, .0.allowed.1
    )]
    Plate(Quantity),
    /// A measured value that cannot belong to a motor with this nameplate.
    #[error(
        "{} = {:.5} {}: allowed is {:.5} to {:.5}; {}",
        .found.name, .found.value, .found.unit, .found.allowed.0, .found.allowed.1, .meaning.word()
    )]
    Value {
        /// As measured, with what is allowed.
        found: Quantity,
        /// What that means.
        meaning: Meaning,
    },
    /// The drive is in a state in which it cannot be commissioned: a fault has stopped it, or somebody has.
    #[error("the drive is {0}")]
    Drive(State),
    /// What the answers to the pulses say.
    #[error("{0}")]
    Wiring(Fault),
    /// The pulses on this phase, 0 to 2, are not answered: it is open.
    #[error("phase {} is open", phase(*.0))]
    PhaseOpen(u8),
    /// A current sensor, 0 or 1, shows no current.
    #[error("current sensor {} shows no current", phase(*.0))]
    SensorOpen(u8),
    /// No pulse is answered at all.
    #[error("no motor: no pulse is answered")]
    NoMotor,
    /// The current loop cannot be designed for what was found.
    #[error("{0}")]
    Design(TuningError),
    /// A step that must come before is missing.
    #[error("the step {} comes first", .0.word())]
    Needs(Step),
    /// The drive has not taken a command.
    #[error("{0}")]
    Command(Refused),
    /// Samples were lost on the way to the evaluation.
    #[error("samples were lost; repeat it")]
    SamplesLost,
}

/// Letter of a phase by its number.
fn phase(number: u8) -> char {
    char::from(b'a'.wrapping_add(number))
}

words! {
    /// Meaning of a value out of its range; its word is the advice.
    pub enum Meaning {
        /// Larger motor than the nameplate says.
        TooLarge = "the motor is larger than its nameplate says, or its windings are shorted",
        /// Smaller motor than the nameplate says.
        TooSmall = "the motor is smaller than its nameplate says, or connected in another way",
        /// The sensor's offset.
        Offset = "correct the offset in scales.current_*, and let the motor come to rest",
        /// The sensors' noise.
        Noise = "shield and ground the lines of the sensors",
        /// The dc link.
        BusTooLow = "raise the dc link, or compare scales.dc_link with a voltmeter",
        /// The model of a linear motor does not fit.
        Misfit = "the motor is not linear at these currents, or something has moved",
        /// Gains that differ.
        Mismatch = "compare scales.current_a and scales.current_b with an ammeter",
        /// Resistances that differ.
        Resistances = "look for a bad joint, a cable or a winding: the resistances of phases b and c differ",
        /// Voltages of the legs that differ.
        Legs = "dead time, drive or switches of the legs b and c differ",
        /// Current across the axis of the voltage that changes.
        Turning = "the shaft turns",
        /// Inverter voltage that depends on the current.
        Inverter = "the voltage that the inverter loses still grows with the current",
        /// Value too uncertain.
        Uncertain = "too much noise for this motor",
        /// The step response of the current loop.
        Loop = "the motor is not as it was measured, or a filter lies before it",
        /// The speed does not follow the torque.
        NotFree = "the shaft must be free to turn; friction, a load or a coupling hides the inertia",
    }
}

/// What a value below its range means, and one above: of a resistance or an inductance, and of a time constant.
pub(super) const SIZE: [Meaning; 2] = [Meaning::TooLarge, Meaning::TooSmall];
pub(super) const TIME: [Meaning; 2] = [Meaning::TooSmall, Meaning::TooLarge];

impl Report {
    /// A report of a step that is sound.
    pub(super) fn new(step: Step, values: &[Quantity]) -> Self {
        let values = core::array::from_fn(|n| values.get(n).copied());
        Self { step, values, refusal: None }
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

    /// With the range that is allowed.
    pub(super) const fn allowing(self, allowed: (f32, f32)) -> Self {
        Self { allowed, ..self }
    }

    /// Whether it is in that range; not if it is not a number.
    pub(super) fn is_allowed(&self) -> bool {
        self.value >= self.allowed.0 && self.value <= self.allowed.1
    }

    /// Refuses a value outside this range; `below` and `above` say what that means.
    pub(super) fn checked(
        self,
        allowed: (f32, f32),
        [below, above]: [Meaning; 2],
    ) -> Result<Self, Refusal> {
        let found = self.allowing(allowed);
        let meaning = if found.value < allowed.0 { below } else { above };
        if found.is_allowed() { Ok(found) } else { Err(Refusal::Value { found, meaning }) }
    }

    /// Refuses a value beyond plus or minus `most`.
    pub(super) fn up_to(self, most: f32, meaning: Meaning) -> Result<Self, Refusal> {
        self.checked((-most, most), [meaning; 2])
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Four digits.
        let size = self.value.abs();
        let places = [1000.0, 100.0, 10.0, 1.0, 0.1].iter().position(|least| size >= *least);
        let places = places.unwrap_or(5);
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
