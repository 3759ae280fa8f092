//! The settings of the terminal strip: functions of its wires. All are off by default.

use drive_core::Stop;
use drive_settings::value::Words;
use drive_settings::{SettingsError, words};

use crate::boards::{Board, EXTRA_LOW_V};
use crate::terminals::{TERMINALS, Wires};

words! {
    /// Whether ENABLE must be closed, and how opening it stops the drive, for every commander.
    #[derive(Default)]
    pub enum Enable {
        /// ENABLE need not be closed.
        #[default]
        No = "no",
        /// Opening it takes the torque to zero, then switches off.
        Yes = "yes",
        /// Opening it switches off at once.
        Now = "now",
    }
}

words! {
    /// Function of START.
    #[derive(Default)]
    pub enum Start {
        /// START does nothing.
        #[default]
        Off = "off",
        /// A switch: closing starts, opening stops.
        Switch = "switch",
        /// Two buttons: closing START starts, opening STOP stops.
        Buttons = "buttons",
    }
}

words! {
    /// The signal of the analog reference.
    #[derive(Default)]
    pub enum Reference {
        /// No analog reference.
        #[default]
        Off = "off",
        /// A current loop.
        Current = "4-20ma",
        /// A voltage, which has no live zero.
        Voltage = "0-10v",
    }
}

/// Settings of the terminal strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Whether ENABLE must be closed, for every commander.
    pub enable: Enable,
    /// Function of START and STOP.
    pub start: Start,
    /// Whether REVERSE is used.
    pub reverse: bool,
    /// Whether RESET is used.
    pub reset: bool,
    /// Whether PRESET1 and PRESET2 are used.
    pub presets: bool,
    /// The analog reference.
    pub reference: Reference,
    /// Whether the outputs run and fault are used.
    pub outputs: bool,
    /// Whether the output for the brake is used.
    pub brake: bool,
    /// Time that the brake needs to close, s.
    pub brake_s: f32,
    /// First preset speed, rpm.
    pub preset_1_rpm: u16,
    /// Second preset speed, rpm.
    pub preset_2_rpm: u16,
    /// Third preset speed, rpm.
    pub preset_3_rpm: u16,
    /// Speed at the full reference, rpm.
    pub reference_rpm: u16,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            enable: Enable::No,
            start: Start::Off,
            reverse: false,
            reset: false,
            presets: false,
            reference: Reference::Off,
            outputs: false,
            brake: false,
            // Most spring-applied brakes close within this time.
            brake_s: 0.2,
            preset_1_rpm: 0,
            preset_2_rpm: 0,
            preset_3_rpm: 0,
            reference_rpm: 0,
        }
    }
}

/// If a switch is closed at power-up, only an ENABLE that is open then distinguishes it from a switch that is being closed.
const NEEDS_ENABLE: &str = "needs strip.enable yes, so that a switch that is already closed at power-up does not start the drive";
const NO_PIN: &str = "this board has no pin for it";
const NO_LIVE_ZERO: &str =
    "it has no live zero: above 60 V the board needs a second input that agrees; 4-20ma has one";

impl Settings {
    /// The stop that keeps the drive from running with these wires closed; `None` if the drive may run.
    pub fn interlock(&self, closed: Wires) -> Option<Stop> {
        match self.enable {
            Enable::Yes if !closed.has(Wires::ENABLE) => return Some(Stop::Coast),
            Enable::Now if !closed.has(Wires::ENABLE) => return Some(Stop::Now),
            _ => {}
        }
        (self.start == Start::Buttons && !closed.has(Wires::STOP)).then_some(Stop::Ramp)
    }

    /// Checks that the board has the pins of the functions in use, and that the functions are safe there.
    ///
    /// # Errors
    /// The first function that fails the check.
    pub fn check(&self, board: &Board) -> Result<(), SettingsError> {
        let pins = TERMINALS.iter().zip(board.strip.pins);
        let has = |name| pins.clone().any(|(terminal, pin)| *terminal == name && pin.is_some());
        let extra_low = board.dc_link_limits.operation.value <= EXTRA_LOW_V;
        let (start, reference) = (self.start, self.reference);
        let live = reference != Reference::Voltage || extra_low || has("REFERENCE2");
        let buttons = start == Start::Buttons;
        needs("strip.enable", self.enable, has("ENABLE"), NO_PIN)?;
        needs("strip.start", start, has("START") && (!buttons || has("STOP")), NO_PIN)?;
        let enable = self.enable != Enable::No;
        needs("strip.start", start, buttons || enable, NEEDS_ENABLE)?;
        needs("strip.reverse", self.reverse, has("REVERSE"), NO_PIN)?;
        needs("strip.reset", self.reset, has("RESET"), NO_PIN)?;
        needs("strip.presets", self.presets, has("PRESET1") && has("PRESET2"), NO_PIN)?;
        needs("strip.reference", reference, has("REFERENCE"), NO_PIN)?;
        needs("strip.reference", reference, live, NO_LIVE_ZERO)?;
        needs("strip.outputs", self.outputs, has("RUN") || has("FAULT"), NO_PIN)?;
        needs("strip.brake", self.brake, has("BRAKE"), NO_PIN)
    }
}

/// Refuses a function that its setting switches on, unless `met`.
fn needs<T: Words>(
    name: &'static str,
    value: T,
    met: bool,
    why: &'static str,
) -> Result<(), SettingsError> {
    // The first word of each function is off.
    if met || value.place() == 0 {
        Ok(())
    } else {
        Err(SettingsError::Word(name, value.word(), why))
    }
}
