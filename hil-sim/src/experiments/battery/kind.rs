//! The kinds of runs, each with what the drive is asked for over time.

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// A kind of run. Currents, speeds and torques are those of the dissertation's motor; on others they are in proportion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// Constant torque current while a dynamometer holds this speed, rpm.
    Constant(i16),
    /// A torque current drawn anew every half second, shaft locked.
    Steps,
    /// Torque current of 3 A, reversed every second, shaft locked.
    Reversals,
    /// Torque current from -3 A to 3 A, or back, in three seconds, shaft locked.
    Ramp,
    /// Speed regulated, this reference, rpm, and then its opposite; free shaft.
    Speed(i16),
    /// Speed regulated, a step of 0.4 Nm on a free shaft.
    Load,
    /// Torque current near its largest for six seconds, shaft locked. Not one of the battery: there it would need a
    /// motor whose flux collapses.
    Hold,
}

/// The kinds in the order of the runs.
pub const KINDS: [Kind; 12] = [
    Kind::Constant(0),
    Kind::Constant(30),
    Kind::Constant(150),
    Kind::Constant(-150),
    Kind::Constant(300),
    Kind::Constant(-300),
    Kind::Steps,
    Kind::Reversals,
    Kind::Ramp,
    Kind::Speed(150),
    Kind::Speed(-150),
    Kind::Load,
];

/// Largest torque current, A, and the least of a constant one.
const MOST_A: f64 = 3.0;
const LEAST_A: f64 = 0.5;
/// Load, Nm, and the speeds at which it comes, rpm.
const LOAD_NM: f64 = 0.4;
const LOAD_RPM: [f64; 4] = [0.0, 30.0, 150.0, -150.0];
/// Time between two changes of a torque current, s.
const LEVEL_S: f64 = 0.5;

/// A part of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Torque current, A, or speed, rpm, at the beginning and at the end; straight between them.
    pub reference: (f64, f64),
    /// Torque of the load, Nm, where the shaft is free.
    pub load_nm: f64,
    /// Length, s.
    pub seconds: f64,
}

impl Part {
    fn constant(reference: f64, seconds: f64) -> Self {
        Self { reference: (reference, reference), load_nm: 0.0, seconds }
    }
}

/// The shaft in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shaft {
    /// Locked.
    Locked,
    /// A dynamometer holds a speed, rpm.
    Held(f64),
    /// Free; the drive regulates its speed.
    Free,
}

impl Kind {
    /// In words.
    pub fn name(self) -> String {
        match self {
            Self::Constant(rpm) => format!("constant torque, {rpm} rpm"),
            Self::Steps => "torque steps".to_owned(),
            Self::Reversals => "reversals of 3 A".to_owned(),
            Self::Ramp => "torque ramp".to_owned(),
            Self::Speed(rpm) => format!("speed {rpm} rpm"),
            Self::Load => "load of 0.4 Nm".to_owned(),
            Self::Hold => "2.25 to 3 A at rest".to_owned(),
        }
    }

    /// The shaft.
    pub fn shaft(self) -> Shaft {
        match self {
            Self::Constant(0) | Self::Steps | Self::Reversals | Self::Ramp | Self::Hold => {
                Shaft::Locked
            }
            Self::Constant(rpm) => Shaft::Held(rpm.into()),
            Self::Speed(_) | Self::Load => Shaft::Free,
        }
    }

    /// The parts of a run, drawn at random.
    pub fn parts(self, random: &mut impl Rng) -> Vec<Part> {
        let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
        match self {
            Self::Constant(_) => {
                vec![Part::constant(sign * random.random_range(LEAST_A..=MOST_A), 3.0)]
            }
            Self::Hold => {
                vec![Part::constant(sign * random.random_range(0.75..=1.0) * MOST_A, 6.0)]
            }
            Self::Steps => std::iter::repeat_with(|| {
                Part::constant(random.random_range(-MOST_A..=MOST_A), LEVEL_S)
            })
            .take(6)
            .collect(),
            Self::Reversals => (0..4)
                .map(|n| Part::constant(if n % 2 == 0 { sign } else { -sign } * MOST_A, 1.0))
                .collect(),
            Self::Ramp => {
                let ramp = (-sign * MOST_A, sign * MOST_A);
                let begin = Part::constant(ramp.0, LEVEL_S);
                vec![begin, Part { reference: ramp, load_nm: 0.0, seconds: 3.0 }]
            }
            Self::Speed(rpm) => {
                vec![Part::constant(rpm.into(), 2.0), Part::constant(-f64::from(rpm), 2.0)]
            }
            Self::Load => {
                let rpm = LOAD_RPM[random.random_range(0..LOAD_RPM.len())];
                let before = Part::constant(rpm, 1.5);
                let loaded = Part { load_nm: sign * LOAD_NM, ..Part::constant(rpm, 2.0) };
                vec![before, loaded, Part::constant(rpm, 1.0)]
            }
        }
    }
}
