//! The sensors.

use super::value::{Words, words};

/// Sensors of the phase currents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentSensors {
    /// Two, in the lines a and b.
    InLine,
    /// Three shunts below the low sides.
    LowSide,
}

words!(CurrentSensors { Self::InLine => CurrentSensors::InLine, "in-line"; Self::LowSide => CurrentSensors::LowSide, "low-side"; });
