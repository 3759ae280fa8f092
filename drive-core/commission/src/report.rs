//! Report of a step of the commissioning: values with their units, and the verdict in words.

use core::fmt;

use drive_core::{Fault, Refused, State};
use drive_settings::tuning::TuningError;
use drive_settings::value::Words;
use drive_settings::words;

words! {
    /// The steps of the commissioning, in their order.
    pub enum Step {
        /// The nameplate: its plausibility, and the values that follow from it.
        Nameplate = "nameplate",
        /// Offsets and noise of the current sensors, dc link.
        Sensors = "sensors",
        /// Volt-second pulses: wiring, open phases, rough transient inductance.
        Wiring = "wiring",
        /// DC resistance test with two current levels along phase a, and a third: resistances, rotor time constant, inverter
        /// voltage error.
        Levels = "levels",
        /// Injection along and across a bias: transient inductance, saliency at standstill, gain mismatch.
        Leakage = "leakage",
        /// Magnetising-curve test with currents that rise in steps. Done only if the levels show that the main flux saturates.
        Staircase = "staircase",
        /// The current loop, designed from the values found and checked by a step.
        CurrentLoop = "current-loop",
        /// The plants of the current loop from a pseudo-random voltage, as in section 3.7, with a locked shaft.
        Plant = "plant",
        /// The inertia, with a free shaft, after the saliency self-commissioning. The shaft turns to and fro.
        Inertia = "inertia",
    }
}

impl Step {
    /// Last step at standstill.
    pub const LAST: Self = Self::CurrentLoop;
    /// The words of all steps, for messages.
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
    /// Its standard deviation due to the noise of the measurement; 0 if none is stated.
    pub deviation: f32,
    /// Range that nameplate and noise allow, from and to; infinite if nothing is expected.
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
    /// Reason of its refusal; none if the step has passed.
    pub refusal: Option<Refusal>,
}

/// The reason why a step is refused. The settings stay as they were.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// An entry of the nameplate is implausible beside the others.
    #[error(
        "{} = {} {}: the rest of the nameplate allows {:.1} to {:.1}{}",
        .0.name, .0.value, .0.unit, .0.allowed.0, .0.allowed.1, no_slip(.0)
    )]
    Plate(Quantity),
    /// A measured value that cannot belong to a motor with this nameplate.
    #[error(
        "{} = {:.5} {}: allowed is {:.5} to {:.5}; {}",
        .found.name, .found.value, .found.unit, .found.allowed.0, .found.allowed.1, .meaning.word()
    )]
    Value {
        /// Measured value, with its allowed range.
        found: Quantity,
        /// Meaning of the deviation.
        meaning: Meaning,
    },
    /// The drive is in a state in which it cannot be commissioned: it was stopped by a fault or by a command.
    #[error("the drive is {0}")]
    Drive(State),
    /// Fault that the responses to the pulses show.
    #[error("{0}")]
    Wiring(Fault),
    /// Pulses on this phase, 0 to 2, make no current: the phase is open.
    #[error("phase {} is open", phase(*.0))]
    PhaseOpen(u8),
    /// A current sensor, 0 or 1, shows no current.
    #[error("current sensor {} shows no current", phase(*.0))]
    SensorOpen(u8),
    /// No pulse makes a current.
    #[error("no motor: no pulse makes a current")]
    NoMotor,
    /// The current loop cannot be designed for what was found.
    #[error("{0}")]
    Design(TuningError),
    /// Another step has to be done before.
    #[error("the step {} comes first", .0.word())]
    Needs(Step),
    /// The drive has not taken a command.
    #[error("{0}")]
    Command(Refused),
    /// Samples were missing in the evaluation.
    #[error("samples were lost; repeat it")]
    SamplesLost,
}

/// Advice for a speed at which the slip is missing.
fn no_slip(entry: &Quantity) -> &'static str {
    let is_synchronous = entry.name == "nameplate.speed_rpm" && entry.value > entry.allowed.1;
    if is_synchronous { "; it shows no slip: enter 1 to 5 % less" } else { "" }
}

/// Letter of a phase by its number.
fn phase(number: u8) -> char {
    char::from(b'a'.wrapping_add(number))
}

words! {
    /// Meaning of a value outside its range; its word is the advice.
    pub enum Meaning {
        /// Larger motor than the nameplate says.
        TooLarge = "the motor is larger than its nameplate says, or its windings are shorted",
        /// Smaller motor than the nameplate says.
        TooSmall = "the motor is smaller than its nameplate says, or connected differently",
        /// The sensor's offset.
        Offset = "correct the offset in scales.current_*, and let the motor come to rest",
        /// The sensors' noise.
        Noise = "shield and ground the lines of the sensors",
        /// The dc link.
        BusTooLow = "raise the dc link, or compare scales.dc_link with a voltmeter",
        /// The model of a linear motor does not fit.
        Misfit = "the motor is not linear at these currents, or its shaft has moved",
        /// Gains that differ.
        Mismatch = "compare scales.current_a and scales.current_b with an ammeter",
        /// Resistances that differ.
        Resistances = "look for a bad joint, a cable or a winding: the resistances of phases b and c differ",
        /// Voltages of the inverter legs that differ.
        Legs = "dead time, gate drive or switches of legs b and c differ",
        /// Changing current across the axis of the voltage.
        Turning = "the shaft turns",
        /// Inverter voltage error that depends on the current.
        Inverter = "the inverter voltage error still grows with the current",
        /// Value too uncertain.
        Uncertain = "too much noise for this motor",
        /// The step response of the current loop.
        Loop = "the motor is not as it was measured, or a filter lies before it",
        /// The speed does not follow the torque.
        NotFree = "the shaft must be free to turn; friction, a load or a coupling hides the inertia",
    }
}

/// Meaning of a value below its range, and of a value above it: for a resistance or an inductance, and for a time constant.
pub(super) const SIZE: [Meaning; 2] = [Meaning::TooLarge, Meaning::TooSmall];
pub(super) const TIME: [Meaning; 2] = [Meaning::TooSmall, Meaning::TooLarge];

impl Report {
    /// Creates the report of a step that has passed.
    pub(super) fn new(step: Step, values: &[Quantity]) -> Self {
        let values = core::array::from_fn(|n| values.get(n).copied());
        Self { step, values, refusal: None }
    }
}

impl Quantity {
    /// Creates a value without an expected range.
    pub(super) const fn new(name: &'static str, unit: &'static str, value: f32) -> Self {
        Self { name, unit, value, deviation: 0.0, allowed: (f32::NEG_INFINITY, f32::INFINITY) }
    }

    /// Returns the value with the standard deviation that noise gives it.
    pub(super) const fn within(self, deviation: f32) -> Self {
        Self { deviation, ..self }
    }

    /// Returns the value with its allowed range.
    pub(super) const fn allowing(self, allowed: (f32, f32)) -> Self {
        Self { allowed, ..self }
    }

    /// Whether the value is in its allowed range; false for NaN.
    pub(super) fn is_allowed(&self) -> bool {
        self.value >= self.allowed.0 && self.value <= self.allowed.1
    }

    /// Refuses a value outside this range; `below` and `above` are the meanings.
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
        // Four digits are shown.
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
    /// Writes step and verdict; the values are shown one by one.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.refusal {
            None if self.step == Step::Inertia => {
                let rings = self.values.iter().flatten().any(|value| !value.is_allowed());
                f.write_str("inertia: sound; it began with positive torque: if the shaft turned the wrong way then, exchange two lines of the motor")?;
                if rings {
                    f.write_str("; the shaft rings on an elastic coupling: speed.phase_margin_deg becomes 70, a slower speed loop")?;
                }
                Ok(())
            }
            None => write!(f, "{}: sound", self.step.word()),
            Some(refusal) => write!(f, "{}: refused: {refusal}", self.step.word()),
        }
    }
}
