//! The settings by name: those of the drive, and the firmware's own.

use core::fmt;

use drive_settings::entry::{Change, Entry, Guard};
use drive_settings::renamed::old_name;
use drive_settings::value::{Value, ValueError};
use drive_settings::{SETTINGS, Settings, SettingsError};

pub use super::own::BOARD;
use super::own::TIMEOUT;
use super::{BUS_SILENT_S, FirmwareSettings};
use crate::boards::Board;
use crate::{ModuleState, OWN, hash};

/// Bits of `auto` in the flash: NaN, which no value of a setting is.
const AUTO_BITS: u32 = 0x7fc0_0000;

/// Number of settings.
pub const COUNT: usize = SETTINGS.len() + OWN[0].len() + OWN[1].len() + OWN[2].len() + OWN[3].len();

/// A setting of the firmware. Two are equal if they have the same name.
#[derive(Clone, Copy)]
pub enum Key {
    /// One of the drive's.
    Drive(&'static Entry<Settings>),
    /// One of the firmware's own.
    Own(&'static Entry<FirmwareSettings>),
}

/// All settings, in the order in which they are shown.
pub fn all() -> impl Iterator<Item = Key> {
    (0..).map_while(at)
}

/// The setting at a place in this order.
fn at(place: usize) -> Option<Key> {
    let own = || OWN.iter().copied().flatten().nth(place - SETTINGS.len()).map(Key::Own);
    SETTINGS.get(place).map(Key::Drive).or_else(own)
}

/// The setting with this name, or with this old name.
pub fn find(name: &str) -> Option<Key> {
    all().find(|key| [key.name(), old_name(key.name())].contains(&name))
}

/// The setting with this [permanent number](Key::id).
pub fn find_id(id: u16) -> Option<Key> {
    of_id(all(), id)
}

/// The setting with this number among these: neither order nor names matter.
pub fn of_id(mut keys: impl Iterator<Item = Key>, id: u16) -> Option<Key> {
    keys.find(|key| key.id() == id)
}

/// Evaluates the same expression for either kind of entry, with the settings that it belongs to.
macro_rules! with {
    ($key:expr, |$entry:ident| $result:expr) => {
        match $key {
            Key::Drive($entry) => $result,
            Key::Own($entry) => $result,
        }
    };
    ($key:expr, $settings:expr, |$entry:ident, $s:ident| $result:expr) => {
        match ($key, $settings) {
            (Key::Drive($entry), FirmwareSettings { drive: $s, .. }) => $result,
            (Key::Own($entry), $s) => $result,
        }
    };
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Functions that return a property, the same for both kinds of entry: `NAME: TYPE = |entry| VALUE;`.
macro_rules! properties {
    ($($(#[$about:meta])+ $name:ident: $type:ty = |$entry:ident| $value:expr;)+) => {
        $($(#[$about])+ pub fn $name(self) -> $type { with!(self, |$entry| $value) })+
    };
}

impl Key {
    properties! {
        /// Name at the console.
        name: &'static str = |entry| entry.name;
        /// Unit; empty if there is none.
        unit: &'static str = |entry| entry.unit;
        /// Meaning, one sentence without its full stop.
        help: &'static str = |entry| entry.help;
        /// Who may change it, and when.
        change: Change = |entry| entry.change;
        /// Whether learned values are valid for this value only.
        learned: bool = |entry| entry.learned;
        /// Whether the setting affects the safety of the power stage: it can be set only at the console, and must be confirmed.
        hardware: bool = |entry| entry.hardware;
        /// Whether the setting is protective: other sources than the console can only tighten it.
        guards: bool = |entry| entry.guard != Guard::None;
        /// The words that may be set; empty for a number.
        words: &'static [&'static str] = |entry| entry.words();
        /// Whether the setting follows a rule unless it is set.
        has_rule: bool = |entry| entry.has_rule();
        /// Permanent number of the setting: in the flash, and for its registers on the bus.
        id: u16 = |entry| entry.id;
    }

    /// The number in effect; for a word its place in the list. A time-out of 0 is the bus's own time-out.
    pub fn level(self, settings: &FirmwareSettings) -> f32 {
        let level = with!(self, settings, |entry, s| entry.level(s));
        if self.name() == TIMEOUT && level == 0.0 { BUS_SILENT_S } else { level }
    }

    /// Whether these settings protect at least as well as settings in which this setting has the level `bound`.
    pub fn holds(self, settings: &FirmwareSettings, bound: f32) -> bool {
        let level = self.level(settings);
        with!(self, |entry| entry.guard.holds(level, bound))
    }

    /// Whether the setting protects less in these settings than in others.
    pub fn is_looser(self, settings: &FirmwareSettings, than: &FirmwareSettings) -> bool {
        let says_what_is_there = with!(self, |entry| entry.guard == Guard::Keep);
        !says_what_is_there && !self.holds(settings, self.level(than))
    }

    /// The value.
    pub fn get(self, settings: &FirmwareSettings) -> Value {
        with!(self, settings, |entry, s| entry.get(s))
    }

    /// The number in effect; `None` for a word.
    pub fn number(self, settings: &FirmwareSettings) -> Option<f32> {
        with!(self, settings, |entry, s| entry.number(s))
    }

    /// The range with the present settings; `None` for a word.
    pub fn range(self, settings: &FirmwareSettings) -> Option<(f32, f32)> {
        let range = with!(self, settings, |entry, s| entry.range(s));
        let Board { dead_time_s, dead_time_max_s, .. } = settings.board;
        // The lower limit of the board protects its switches, and the timer generates no dead time above the upper limit.
        if self.name() == DEAD_TIME { Some((dead_time_s.value, *dead_time_max_s)) } else { range }
    }

    /// Checks the value in effect against its range.
    ///
    /// # Errors
    /// [`SettingsError::Range`].
    pub fn check(self, settings: &FirmwareSettings) -> Result<(), SettingsError> {
        let range = self.range(settings);
        with!(self, settings, |entry, s| entry.check_in(range, s))?;
        // The words of a module depend on the board and on each other.
        if matches!(self, Self::Own(_)) { ModuleState::check(settings) } else { Ok(()) }
    }

    /// The value that a text stands for. [`check`](Self::check) checks its range.
    ///
    /// # Errors
    /// The text is not a value of this setting.
    pub fn parse(self, text: &str) -> Result<Value, ValueError> {
        with!(self, |entry| entry.parse(text))
    }

    /// Sets a value from this key's [`parse`](Self::parse); a value of another type changes nothing.
    pub fn set(self, settings: &mut FirmwareSettings, value: Value) {
        with!(self, settings, |entry, s| entry.set(s, value))
    }

    /// The value as 32 bits for the flash: the bits of a number, the hash of a word.
    pub fn to_bits(self, settings: &FirmwareSettings) -> u32 {
        match self.get(settings) {
            Value::Number(value) => value.to_bits(),
            Value::Auto => AUTO_BITS,
            Value::Whole(value) => value,
            Value::Word(word) => hash::of(word.bytes()),
        }
    }

    /// Sets a value from [`to_bits`](Self::to_bits); `None` if the bits are not a value of this setting. [`check`](Self::check) checks
    /// its range.
    pub fn set_bits(self, settings: &mut FirmwareSettings, bits: u32) -> Option<()> {
        let value = match self.get(settings) {
            Value::Number(_) | Value::Auto if bits == AUTO_BITS => Value::Auto,
            Value::Number(_) | Value::Auto => Value::Number(f32::from_bits(bits)),
            Value::Whole(_) => Value::Whole(bits),
            Value::Word(_) => {
                Value::Word(self.words().iter().find(|word| hash::of(word.bytes()) == bits)?)
            }
        };
        self.set(settings, value);
        // A value that the setting cannot take has changed nothing.
        (self.get(settings) == value).then_some(())
    }
}

/// The setting whose range is the board's.
const DEAD_TIME: &str = "inverter.dead_time_s";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_unique_and_found() {
        assert_eq!(all().count(), COUNT);
        for key in all() {
            assert_eq!(find(key.name()).unwrap().name(), key.name());
            assert_eq!(find_id(key.id()).unwrap().name(), key.name());
        }
        assert!(find("motor").is_none() && find_id(u16::MAX).is_none());
    }

    #[test]
    fn the_board_is_in_range() {
        let settings = FirmwareSettings::of_the_board();
        for key in all() {
            assert_eq!(key.check(&settings), Ok(()));
            assert_eq!(key.words().is_empty(), key.range(&settings).is_some(), "{}", key.name());
        }
    }

    #[test]
    fn values_survive_the_way_through_the_flash() {
        for key in all() {
            let before = FirmwareSettings::of_the_board();
            let values = match (key.get(&before), key.range(&before)) {
                (Value::Word(_), _) => key.words().iter().map(|word| Value::Word(word)).collect(),
                (Value::Whole(value), _) => vec![Value::Whole(value + 1)],
                (_, Some((_, max))) => vec![Value::Number(max), key.get(&before)],
                (_, None) => unreachable!(),
            };
            for value in values {
                let mut other = before;
                key.set(&mut other, value);
                assert_eq!(key.get(&other), value, "{}", key.name());
                let (bits, mut read) = (key.to_bits(&other), before);
                assert_eq!(key.set_bits(&mut read, bits), Some(()), "{}", key.name());
                assert_eq!(read, other, "{}", key.name());
            }
        }
    }

    #[test]
    fn bits_that_are_no_value_are_refused() {
        let mut settings = FirmwareSettings::of_the_board();
        for (name, bits) in [
            ("motor.r_s", AUTO_BITS),
            ("motor.pole_pairs", 1 << 20),
            ("angle_source", 7),
            ("wiring_checked", 1),
        ] {
            assert_eq!(find(name).unwrap().set_bits(&mut settings, bits), None, "{name}");
        }
    }

    #[test]
    fn values_out_of_range_are_named() {
        let mut settings = FirmwareSettings::of_the_board();
        for (name, text) in
            [("limits.trip_a", "5"), ("command.timeout_s", "-1"), ("inverter.dead_time_s", "0")]
        {
            let key = find(name).unwrap();
            let mut other = settings;
            key.set(&mut other, key.parse(text).unwrap());
            let error = other.build().unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
        settings.command.timeout_s = f32::NAN;
        assert!(settings.build().is_err());
    }
}
