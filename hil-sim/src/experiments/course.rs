//! A run over time: the shaft, the parts one after the other, and what changes in them. The bench of the stress test runs it.

mod bench;
mod kind;
mod limits;
mod trial;

pub use bench::Bench;
pub use kind::{KINDS, Kind, chosen};
pub use limits::{allowed_a, nominal_limit_a, share_of_limit, torque_limit_a, torque_nm};
pub use trial::{CLASSES_PER_DEG, Refused, Trial, UNNOTICED_S};

use super::disturbed::Asymmetry;

/// A value at the beginning and at the end of a part, with a straight line between them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp(pub f64, pub f64);

impl Ramp {
    /// Returns the value after this many of all steps.
    pub fn after(self, n: f64, steps: f64) -> f64 {
        self.0 + (self.1 - self.0) * n / steps
    }
}

/// Change or event in a part, beside the reference and the load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Change {
    /// Nothing.
    #[default]
    Nothing,
    /// The rotor flux is suddenly rotated at the beginning, by this many electrical degrees.
    Flux(f64),
    /// The mains have this peak voltage from the beginning, V.
    Mains(f64),
    /// Speed of the dynamometer, rpm.
    Shaft(Ramp),
    /// Voltage of a stiff dc link, relative to the nominal one.
    DcLink(Ramp),
    /// The resistances of stator and rotor rise by these shares.
    Warming(f64, f64),
    /// The drive starts at rest, and a dynamometer brings a held shaft up to its speed without torque.
    Start,
    /// The drive starts on a shaft that a dynamometer turns at this speed, rpm, and searches for the flux.
    FlyingStart(f64),
    /// The drive is stopped, and its outputs stay off for this time, s.
    Coast(f64),
    /// The drive brakes a free shaft to rest.
    Brake,
    /// The angle error counts after this time, s.
    Count(f64),
    /// The asymmetry arises.
    Asymmetry(Asymmetry),
}

/// A part of a run. Currents and speeds are for the dissertation's motor; on others they are in proportion, q-axis
/// currents to the [nominal limit](nominal_limit_a).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// q-axis current, A, or speed, rpm. None: unchanged.
    pub reference: Option<Ramp>,
    /// Torque of the load on the motor of the run, Nm, if the shaft is free.
    pub load_nm: f64,
    /// The change, if there is one.
    pub change: Change,
    /// Duration, s.
    pub seconds: f64,
}

impl Part {
    /// Makes a part with a constant reference.
    pub fn constant(reference: f64, seconds: f64) -> Self {
        let reference = Some(Ramp(reference, reference));
        Self { reference, ..Self::unchanged(Change::Nothing, seconds) }
    }

    /// Makes a part in which the reference stays as it is.
    pub fn unchanged(change: Change, seconds: f64) -> Self {
        Self { reference: None, load_nm: 0.0, change, seconds }
    }

    /// Makes a part that consists of an event.
    pub fn event(change: Change) -> Self {
        Self::unchanged(change, 0.0)
    }

    /// Returns the number of steps in which its values change.
    pub fn steps(&self) -> u32 {
        let pace_s = match self.change {
            Change::Shaft(_) => 0.01,
            Change::DcLink(_) => 0.01 / 60.0,
            Change::Warming(..) => 0.03,
            _ if self.reference.is_some_and(|ramp| ramp.0 != ramp.1) => 0.01,
            _ => return 1,
        };
        (self.seconds / pace_s).round() as u32
    }
}

/// A run over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// The shaft.
    pub shaft: Shaft,
    /// The parts, one after the other.
    pub parts: Vec<Part>,
}

impl Course {
    /// Makes a course that starts at rest and runs up; the angle error counts from this time after the run-up, s.
    pub fn from_rest(shaft: Shaft, run_up: &[Part], settling_s: f64, parts: &[Part]) -> Self {
        let (start, count) = (Part::event(Change::Start), Part::event(Change::Count(settling_s)));
        Self { shaft, parts: [&[start], run_up, &[count], parts].concat() }
    }
}

/// The shaft in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shaft {
    /// The shaft is locked.
    Locked,
    /// A dynamometer holds a speed, rpm.
    Held(f64),
    /// The shaft is free; the drive regulates its speed.
    Free,
}

impl Shaft {
    /// Returns the shaft at a constant speed, rpm.
    pub fn at(rpm: i16) -> Self {
        if rpm == 0 { Self::Locked } else { Self::Held(rpm.into()) }
    }
}
