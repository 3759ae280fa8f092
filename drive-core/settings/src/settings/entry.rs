//! Rows of a table of settings.

use super::SettingsError;
use super::value::{AUTO, Real, Value, ValueError, number as parsed};

/// When a changed setting takes effect, and who may change it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Anybody may change it while the outputs are off, and it takes effect at once.
    WhileOff,
    /// Anybody may change it while the outputs are off. It takes effect at the next reset, if it was saved, because the hardware
    /// locks it until then.
    FromReset,
    /// Only the code of the board sets it, since it is a property of its hardware.
    Board,
}

/// Changes that a bus master may make to a setting that protects the drive or people. The console may set any value in its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// Any change, since the setting protects nothing.
    None,
    /// A smaller value or an earlier word only, since larger values are looser.
    Lower,
    /// A larger value or a later word only, since smaller values are looser.
    Raise,
    /// No change, since the setting describes the hardware that is there.
    Keep,
}

impl Guard {
    /// Whether `level` protects at least as well as `bound`. NaN never does.
    pub fn holds(self, level: f32, bound: f32) -> bool {
        match self {
            Self::None => true,
            Self::Lower => level <= bound,
            Self::Raise => level >= bound,
            Self::Keep => level == bound,
        }
    }
}

/// A setting of the structure `S`, with numbers of type `N`: number, name, unit, help, range, and access to its value.
pub struct Entry<S: 'static, N: 'static = f32> {
    /// Number of the setting in the flash and of its registers on the bus. It never changes, and no other setting ever gets it.
    pub id: u16,
    /// Name at the console and in files.
    pub name: &'static str,
    /// Unit; empty if there is none.
    pub unit: &'static str,
    /// Meaning, one sentence without its full stop.
    pub help: &'static str,
    /// Who may change it, and when.
    pub change: Change,
    /// Whether learned values are valid for this value only.
    pub learned: bool,
    /// Whether the power stage is at stake: a protection or the scale of its sensor.
    pub hardware: bool,
    /// Whether the setting protects, and which changes are allowed from elsewhere than the console.
    pub guard: Guard,
    access: Access<S, N>,
    range: Range<S, N>,
}

/// Access to a value: the function that reads it, and the function that writes it.
pub enum Access<S, N = f32> {
    /// A number.
    Number(fn(&S) -> N, fn(&mut S, N)),
    /// A number that follows a rule while it is `None`. The third function reads the number in effect.
    Auto(fn(&S) -> Option<N>, fn(&mut S, Option<N>), fn(&S) -> N),
    /// A whole number, which is limited to the largest value of the range when it is written.
    Whole(fn(&S) -> u32, fn(&mut S, u32)),
    /// A whole number that follows a rule while it is `None`.
    AutoWhole(fn(&S) -> Option<u32>, fn(&mut S, Option<u32>)),
    /// One of these words, as its position among them; see [`Words`](super::value::Words).
    Word(fn(&S) -> usize, fn(&mut S, usize), &'static [&'static str]),
}

enum Range<S, N> {
    /// For a word.
    None,
    Fixed(N, N),
    /// The range depends on other settings.
    Beside(fn(&S) -> (N, N)),
}

impl<S, N: Real> Entry<S, N> {
    /// Creates a setting that anybody may change while the outputs are off. A number also needs its range.
    pub const fn new(
        id: u16,
        name: &'static str,
        unit: &'static str,
        access: Access<S, N>,
        help: &'static str,
    ) -> Self {
        let (range, change) = (Range::None, Change::WhileOff);
        let (learned, hardware, guard) = (false, false, Guard::None);
        Self { id, name, unit, help, change, learned, hardware, guard, access, range }
    }

    /// Accepts values from `min` to `max`, both included.
    pub const fn from_to(mut self, min: N, max: N) -> Self {
        self.range = Range::Fixed(min, max);
        self
    }

    /// Accepts values in a range that depends on other settings.
    pub const fn beside(mut self, range: fn(&S) -> (N, N)) -> Self {
        self.range = Range::Beside(range);
        self
    }

    /// Declares that learned values are valid for this value only.
    pub const fn learned(mut self) -> Self {
        self.learned = true;
        self
    }

    /// Declares that a wrong value may damage the power stage.
    pub const fn hardware(mut self) -> Self {
        self.hardware = true;
        self
    }

    /// Declares that the setting protects: from elsewhere than the console it can only be tightened.
    pub const fn guarded(mut self, guard: Guard) -> Self {
        self.guard = guard;
        self
    }

    /// Declares who may change the setting, or when.
    pub const fn changed(mut self, change: Change) -> Self {
        self.change = change;
        self
    }

    /// Returns the value.
    pub fn get(&self, settings: &S) -> Value<N> {
        match self.access {
            Access::Number(get, _) => Value::Number(get(settings)),
            Access::Auto(get, ..) => get(settings).map_or(Value::Auto, Value::Number),
            Access::Whole(get, _) => Value::Whole(get(settings)),
            Access::AutoWhole(get, _) => get(settings).map_or(Value::Auto, Value::Whole),
            Access::Word(get, _, words) => {
                Value::Word(words.get(get(settings)).copied().unwrap_or_default())
            }
        }
    }

    /// Returns the number in effect, which is the number of the rule for `auto`; `None` for a word.
    pub fn number(&self, settings: &S) -> Option<N> {
        match self.access {
            Access::Number(get, _) => Some(get(settings)),
            Access::Auto(.., effective) => Some(effective(settings)),
            Access::Whole(get, _) => Some(N::of_whole(get(settings))),
            Access::AutoWhole(get, _) => get(settings).map(N::of_whole),
            Access::Word(..) => None,
        }
    }

    /// Sets a value of this setting's type; a value of another type changes nothing. The range is checked by
    /// [`check`](Self::check), since it may depend on other settings that are still to be set.
    pub fn set(&self, settings: &mut S, value: Value<N>) {
        match (&self.access, value) {
            (Access::Number(_, set), Value::Number(value)) => set(settings, value),
            (Access::Auto(_, set, _), Value::Number(value)) => set(settings, Some(value)),
            (Access::Auto(_, set, _), Value::Auto) => set(settings, None),
            (Access::Whole(_, set), Value::Whole(value)) => set(settings, value),
            (Access::AutoWhole(_, set), Value::Whole(value)) => set(settings, Some(value)),
            (Access::AutoWhole(_, set), Value::Auto) => set(settings, None),
            (Access::Word(_, set, words), Value::Word(word)) => {
                if let Some(place) = words.iter().position(|known| *known == word) {
                    set(settings, place);
                }
            }
            _ => {}
        }
    }

    /// Returns the value that a text stands for.
    ///
    /// # Errors
    /// The text is not a value of this setting.
    pub fn parse(&self, text: &str) -> Result<Value<N>, ValueError> {
        match self.access {
            Access::Number(..) => parsed(text).map(Value::Number).ok_or(ValueError::Number),
            Access::Auto(..) | Access::AutoWhole(..) if text == AUTO => Ok(Value::Auto),
            Access::Auto(..) => parsed(text).map(Value::Number).ok_or(ValueError::NumberOrAuto),
            Access::Whole(..) | Access::AutoWhole(..) => {
                // Larger numbers may not fit the type of the setting.
                let Range::Fixed(_, max) = self.range else { return Err(ValueError::Whole(0)) };
                let max = max.to_whole();
                let value = text.parse().ok().filter(|value| *value <= max);
                value.map(Value::Whole).ok_or(ValueError::Whole(max))
            }
            Access::Word(.., words) => {
                let word = words.iter().find(|word| **word == text);
                word.map(|word| Value::Word(word)).ok_or(ValueError::Word(words))
            }
        }
    }

    /// Returns the range with the present settings, `(min, max)`; `None` for a word.
    pub fn range(&self, settings: &S) -> Option<(N, N)> {
        match &self.range {
            Range::None => None,
            Range::Fixed(min, max) => Some((*min, *max)),
            Range::Beside(range) => Some(range(settings)),
        }
    }

    /// Returns the words that may be set; none for a number.
    pub fn words(&self) -> &'static [&'static str] {
        if let Access::Word(.., words) = self.access { words } else { &[] }
    }

    /// Whether the setting follows a rule unless it is set.
    pub fn has_rule(&self) -> bool {
        matches!(self.access, Access::Auto(..) | Access::AutoWhole(..))
    }
}

impl<S> Entry<S> {
    /// Returns the number in effect, or the position of a word.
    pub fn level(&self, settings: &S) -> f32 {
        match self.access {
            Access::Word(get, ..) => get(settings) as f32,
            _ => self.number(settings).unwrap_or(f32::NAN),
        }
    }

    /// Checks the value in effect against its range.
    ///
    /// # Errors
    /// [`SettingsError::Range`].
    pub fn check(&self, settings: &S) -> Result<(), SettingsError> {
        self.check_in(self.range(settings), settings)
    }

    /// Checks the value in effect against another range, `(min, max)`; the range of a board may be narrower.
    ///
    /// # Errors
    /// [`SettingsError::Range`].
    pub fn check_in(&self, range: Option<(f32, f32)>, settings: &S) -> Result<(), SettingsError> {
        let (Some(value), Some((min, max))) = (self.number(settings), range) else {
            return Ok(());
        };
        // NaN fails the comparison.
        let holds = value >= min && value <= max;
        let outside = SettingsError::Range { name: self.name, unit: self.unit, value, min, max };
        holds.then_some(()).ok_or(outside)
    }

    /// Whether two sets of settings have the same value in effect. NaN is never the same.
    pub fn same(&self, one: &S, other: &S) -> bool {
        let in_effect = |settings| self.number(settings).map_or(self.get(settings), Value::Number);
        in_effect(one) == in_effect(other)
    }
}

/// Declares a row of a table: permanent number, kind with unit, name, path to the structure, field in it with its type, and help.
/// `Settings` is the type with this name in the module of the table.
#[doc(hidden)]
#[macro_export]
macro_rules! entry {
    ($id:literal: number($($unit:expr)?), $name:expr, [$($path:ident).*] $field:ident: $type:ty, $help:expr) => {
        Entry::new($id, $name, concat!($($unit)?), Access::Number(
            |s: &Settings| s.$($path.)*$field, |s, value| s.$($path.)*$field = value
        ), $help)
    };
    ($id:literal: auto($unit:expr, $effective:expr), $name:expr, [$($path:ident).*] $field:ident: $type:ty, $help:expr) => {
        Entry::new($id, $name, $unit, Access::Auto(
            |s: &Settings| s.$($path.)*$field, |s, value| s.$($path.)*$field = value, $effective
        ), $help)
    };
    ($id:literal: whole(), $name:expr, [$($path:ident).*] $field:ident: $type:ty, $help:expr) => {
        // The range is within the range of the type, see `parse`.
        Entry::new($id, $name, "", Access::Whole(
            |s: &Settings| s.$($path.)*$field as u32, |s, value| s.$($path.)*$field = value as $type
        ), $help)
    };
    ($id:literal: auto_whole(), $name:expr, [$($path:ident).*] $field:ident: $type:ty, $help:expr) => {
        Entry::new($id, $name, "", Access::AutoWhole(
            |s: &Settings| s.$($path.)*$field, |s, value| s.$($path.)*$field = value
        ), $help)
    };
    ($id:literal: word($($unit:expr)?), $name:expr, [$($path:ident).*] $field:ident: $type:ty, $help:expr) => {
        Entry::new($id, $name, concat!($($unit)?), Access::Word(
            |s: &Settings| s.$($path.)*$field.place(), |s, place| s.$($path.)*$field = <$type as Words>::at(place),
            <$type as Words>::WORDS
        ), $help)
    };
}

pub(super) use crate::entry;
