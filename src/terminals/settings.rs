//! The settings of the terminals: functions of their contacts and outputs. All are off by default.

use drive_core::Stop;
use drive_settings::value::Words;
use drive_settings::{SettingsError, words};

use crate::boards::{Board, EXTRA_LOW_V, TERMINALS};
use crate::settings::own::settings;
use crate::terminals::contacts::Contacts;

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

settings! { [modules.terminals]
    110: word(), "strip.enable", enable: Enable = Enable::No, "whether ENABLE must be closed; opening it takes the torque to zero, then switches off; now: off at once".guarded(Guard::Raise);
    111: word(), "strip.start", start: Start = Start::Off, "a switch at START starts and stops, or a button at START starts and one at STOP stops";
    112: word(), "strip.reverse", reverse: bool = false, "whether REVERSE, closed at a start, turns the other way";
    113: word(), "strip.reset", reset: bool = false, "whether closing RESET clears a latched fault";
    114: word(), "strip.presets", presets: bool = false, "whether PRESET1 and PRESET2 select a preset speed";
    115: whole(), "strip.preset_1_rpm", preset_1_rpm: u16 = 0, "speed with PRESET1 closed".from_to(0.0, 24_000.0);
    116: whole(), "strip.preset_2_rpm", preset_2_rpm: u16 = 0, "speed with PRESET2 closed".from_to(0.0, 24_000.0);
    117: whole(), "strip.preset_3_rpm", preset_3_rpm: u16 = 0, "speed with both closed".from_to(0.0, 24_000.0);
    118: word(), "strip.reference", reference: Reference = Reference::Off, "source of the speed while no preset is selected";
    119: whole(), "strip.reference_rpm", reference_rpm: u16 = 0, "speed at 20 mA or 10 V".from_to(0.0, 24_000.0);
    120: word(), "strip.outputs", outputs: bool = false, "whether the outputs RUN and FAULT are used";
    121: word(), "strip.brake", brake: bool = false, "whether BRAKE opens a brake while the drive has torque, which each start proves".guarded(Guard::Keep);
    // Most spring-applied brakes close within this time.
    133: number("s"), "strip.brake_s", brake_s: f32 = 0.2, "closing time of the brake, for which a stop keeps the torque".from_to(0.01, 5.0).guarded(Guard::Keep);
}

/// If a switch is closed at power-up, only an ENABLE that is open then distinguishes it from a switch that is being closed.
const NEEDS_ENABLE: &str = "needs strip.enable yes, so that a switch that is already closed at power-up does not start the drive";
const NO_PIN: &str = "this board has no pin for it";
const NO_LIVE_ZERO: &str =
    "it has no live zero: above 60 V the board needs a second input that agrees; 4-20ma has one";

impl Settings {
    /// The stop that keeps the drive from running with these contacts closed; `None` if the drive may run.
    pub fn interlock(&self, closed: Contacts) -> Option<Stop> {
        match self.enable {
            Enable::Yes if !closed.has(Contacts::ENABLE) => return Some(Stop::Coast),
            Enable::Now if !closed.has(Contacts::ENABLE) => return Some(Stop::Now),
            _ => {}
        }
        (self.start == Start::Buttons && !closed.has(Contacts::STOP)).then_some(Stop::Ramp)
    }

    /// Checks that the board has the pins of the functions in use, and that the functions are safe there.
    ///
    /// # Errors
    /// The first function that fails the check.
    pub fn check(&self, board: &Board) -> Result<(), SettingsError> {
        let pins = TERMINALS.iter().zip(board.terminals.pins);
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
