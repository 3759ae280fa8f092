//! The settings by name: one table.
//!
//! Ranges do not stand here: `Settings::build` knows them, and says them.

use core::fmt;

use drive_core::Settings;
use drive_core::carrier::DemodulatorKind;
use drive_core::identify::learning::Learned;
use drive_core::math::decimal::Shortest;
use drive_core::settings::{AngleSource, CurrentPlant, SettingsError};

use super::grammar::number;

/// FirmwareSettings that can be set at the console.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirmwareSettings {
    /// Of the drive.
    pub drive: Settings,
    /// Of the firmware around it.
    pub command: Commands,
    /// What was learned on the motor with these settings, and accepted; it comes on top of them.
    pub learned: Option<Learned>,
}

/// What the firmware makes of commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Commands {
    /// The drive is stopped when no line was understood for so long, s; 0 for never.
    pub timeout_s: f32,
    /// Whether a start has checked the wiring since the defaults were set.
    pub wiring_checked: bool,
}

/// Longest time-out of commands, s.
const LONGEST_TIMEOUT_S: f32 = 3600.0;

impl FirmwareSettings {
    /// What is set in the image. Not inlined: every number of it is an instruction or two.
    #[inline(never)]
    pub fn of_the_board() -> Self {
        Self { drive: crate::board::settings(), command: Commands::default(), learned: None }
    }

    /// What a learning has found holds from now on, if it was accepted.
    pub fn learn(&mut self, found: &Learned) {
        if found.accepted {
            self.learned = Some(found.on_top_of(self.learned.as_ref()));
        }
    }

    /// Forgets what was learned, if it was learned with other settings than these.
    pub fn forget_unless_as(&mut self, before: &Self) {
        if !self.drive.shares_learning_with(&before.drive) {
            self.learned = None;
        }
    }

    /// Every value against its range; the coefficients if all are inside.
    ///
    /// # Errors
    /// The first value outside, or the rule of design that cannot be met.
    pub fn build(&self) -> Result<drive_core::Coefficients, SettingsError> {
        self.build_for(crate::board::dead_time(self.drive.inverter.dead_time_s).1)
    }

    /// The drive's settings, for a timer that makes this dead time, s.
    fn drive_with(&self, dead_time_s: f32) -> Settings {
        // Copied whole and changed, which is a tenth of the code of fields one by one.
        let mut drive = self.drive;
        drive.inverter.dead_time_s = dead_time_s;
        drive
    }

    /// The same as [`build`](Self::build) for a timer that makes another dead time than is set, because
    /// it takes a new one at a reset only, s.
    ///
    /// # Errors
    /// As there.
    pub fn build_for(&self, dead_time_s: f32) -> Result<drive_core::Coefficients, SettingsError> {
        self.check()?;
        let mut built = self.drive_with(dead_time_s).build();
        if let (Ok(coefficients), Some(learned)) = (&mut built, &self.learned) {
            coefficients.take(learned);
        }
        built
    }

    /// What the firmware asks of settings beside the drive.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let (shortest, longest) = crate::board::DEAD_TIME_RANGE_S;
        for (name, value, min, max) in [
            ("command.timeout_s", self.command.timeout_s, 0.0, LONGEST_TIMEOUT_S),
            ("inverter.dead_time_s", self.drive.inverter.dead_time_s, shortest, longest),
        ] {
            if !(min..=max).contains(&value) {
                return Err(SettingsError::Range { name, value, min, max });
            }
        }
        Ok(())
    }
}

/// A setting.
#[derive(Debug)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// Its unit, empty if it has none.
    pub unit: &'static str,
    access: Access,
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

#[derive(Debug)]
enum Access {
    Number(fn(&mut FirmwareSettings) -> &mut f32),
    /// `checked` says whether a range stands in the settings: 0 is in none of them.
    Whole {
        get: fn(&FirmwareSettings) -> u32,
        set: fn(&mut FirmwareSettings, u32),
        max: u32,
        checked: bool,
    },
    Word {
        words: &'static [&'static str],
        get: fn(&FirmwareSettings) -> u8,
        set: fn(&mut FirmwareSettings, u8),
    },
}

/// A value that suits a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A finite number.
    Number(f32),
    /// A whole number.
    Whole(u32),
    /// One of the setting's words, by its place among them.
    Word {
        /// Its place.
        index: u8,
        /// The word.
        word: &'static str,
    },
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => Shortest(*value).fmt(f),
            Self::Whole(value) => value.fmt(f),
            Self::Word { word, .. } => f.write_str(word),
        }
    }
}

/// Why a text is no value for a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotTaken {
    /// Not a finite number.
    Number,
    /// Not a whole number up to this.
    Whole(u32),
    /// Not one of these words.
    Word(&'static [&'static str]),
}

impl fmt::Display for NotTaken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number => f.write_str("not a number"),
            Self::Whole(max) => write!(f, "not a whole number from 0 to {max}"),
            Self::Word(words) => {
                f.write_str("not one of:")?;
                words.iter().try_for_each(|word| write!(f, " {word}"))
            }
        }
    }
}

macro_rules! number {
    ($name:literal, $unit:literal, $($path:ident).+) => {
        Key { name: $name, unit: $unit, access: Access::Number(|s| &mut s.$($path).+) }
    };
}

macro_rules! whole {
    ($name:literal, $type:ty, checked = $checked:literal, $($path:ident).+) => {
        Key {
            name: $name,
            unit: "",
            access: Access::Whole {
                get: |s| s.$($path).+ as u32,
                // Never above the type's largest: see `parse`.
                set: |s, value| s.$($path).+ = value as $type,
                max: <$type>::MAX as u32,
                checked: $checked,
            },
        }
    };
}

macro_rules! word {
    ($name:literal, |$s:ident| $place:expr, $($word:literal = $value:pat => $make:expr),+) => {{
        const WORDS: &[&str] = &[$($word),+];
        let get: fn(&FirmwareSettings) -> u8 =
            |$s| match $place { $($value => const { place($word, WORDS) },)+ };
        let set: fn(&mut FirmwareSettings, u8) =
            |$s, index| { $(if index == const { place($word, WORDS) } { $place = $make; })+ };
        Key { name: $name, unit: "", access: Access::Word { words: WORDS, get, set } }
    }};
}

macro_rules! yes_or_no {
    ($name:literal, $($path:ident).+) => {
        word!($name, |s| s.$($path).+, "no" = false => false, "yes" = true => true)
    };
}

/// The place of a word among words, when compiling.
const fn place(word: &str, words: &[&str]) -> u8 {
    let (word, mut place) = (word.as_bytes(), 0);
    while place < words.len() {
        let other = words[place].as_bytes();
        let mut same = 0;
        while same < word.len() && same < other.len() && word[same] == other[same] {
            same += 1;
        }
        if same == word.len() && same == other.len() {
            break;
        }
        place += 1;
    }
    place as u8
}

/// All settings, in the order in which they are shown.
pub static KEYS: [Key; 54] = [
    number!("motor.r_s", "ohm", drive.motor.r_s),
    number!("motor.r_r", "ohm", drive.motor.r_r),
    number!("motor.l_ls", "H", drive.motor.l_ls),
    number!("motor.l_lr", "H", drive.motor.l_lr),
    number!("motor.l_m", "H", drive.motor.l_m),
    whole!("motor.pole_pairs", u8, checked = true, drive.motor.pole_pairs),
    number!("motor.inertia", "kg m2", drive.motor.inertia),
    number!("inverter.dead_time_s", "s", drive.inverter.dead_time_s),
    yes_or_no!("inverter.compensate", drive.inverter.compensate),
    number!("inverter.full_compensation_a", "A", drive.inverter.full_compensation_a),
    number!("scales.current_a.gain", "A", drive.scales.current_a.gain),
    number!("scales.current_a.offset", "A", drive.scales.current_a.offset),
    number!("scales.current_b.gain", "A", drive.scales.current_b.gain),
    number!("scales.current_b.offset", "A", drive.scales.current_b.offset),
    number!("scales.dc_link.gain", "V", drive.scales.dc_link.gain),
    number!("scales.dc_link.offset", "V", drive.scales.dc_link.offset),
    whole!("scales.heat_sink_trip", u16, checked = false, drive.scales.heat_sink_trip),
    number!("scales.current_delay_s", "s", drive.scales.current_delay_s),
    whole!("scales.encoder_counts", u32, checked = true, drive.scales.encoder_counts),
    word!("angle_source", |s| s.drive.angle_source,
        "encoder" = AngleSource::Encoder => AngleSource::Encoder,
        "injection" = AngleSource::Injection => AngleSource::Injection),
    word!("current_plant", |s| s.drive.current_plant,
        "identified" = CurrentPlant::Identified { .. } => CurrentPlant::default(),
        "motor" = CurrentPlant::Motor => CurrentPlant::Motor),
    yes_or_no!("ignore_delays", drive.ignore_delays),
    yes_or_no!("track_rotor", drive.track_rotor),
    number!("injection.amplitude_v", "V", drive.injection.amplitude_v),
    word!("injection.demodulator", |s| s.drive.injection.demodulator,
        "literal" = DemodulatorKind::Literal => DemodulatorKind::Literal,
        "rectified" = DemodulatorKind::Rectified => DemodulatorKind::Rectified,
        "synchronous" = DemodulatorKind::Synchronous => DemodulatorKind::Synchronous,
        "rms-impedance" = DemodulatorKind::RmsImpedance => DemodulatorKind::RmsImpedance,
        "envelope" = DemodulatorKind::Envelope => DemodulatorKind::Envelope),
    number!("injection.reference_a", "A", drive.injection.printed.reference_a),
    number!("injection.full_reference_iq_a", "A", drive.injection.printed.full_reference_iq_a),
    number!("injection.k_s", "rad/A", drive.injection.printed.k_s),
    number!("injection.z_s", "", drive.injection.printed.z_s),
    whole!("injection.rms_samples", u8, checked = true, drive.injection.printed.rms_samples),
    number!("injection.bandwidth_hz", "Hz", drive.injection.synchronous.bandwidth_hz),
    number!("injection.flux_saliency", "", drive.injection.synchronous.flux_saliency),
    number!("injection.current_saliency", "1/A", drive.injection.synchronous.current_saliency),
    yes_or_no!("injection.check", drive.injection.synchronous.check),
    yes_or_no!("injection.monitor", drive.injection.synchronous.monitor),
    number!("injection.allowed_loss", "", drive.injection.synchronous.allowed_loss),
    number!("injection.loss_s", "s", drive.injection.synchronous.loss_s),
    number!("injection.tracked_rpm", "rpm", drive.injection.synchronous.tracked_rpm),
    yes_or_no!("injection.beside_encoder", drive.injection.beside_encoder),
    number!("limits.current_a", "A", drive.limits.current_a),
    number!("limits.trip_a", "A", drive.limits.trip_a),
    number!("limits.dc_over_v", "V", drive.limits.dc_over_v),
    number!("limits.dc_under_v", "V", drive.limits.dc_under_v),
    number!("limits.speed_rpm", "rpm", drive.limits.speed_rpm),
    number!("limits.unexplained_v", "V", drive.limits.unexplained_v),
    number!("sequence.magnetise_s", "s", drive.sequence.magnetise_s),
    number!("sequence.i_d", "A", drive.sequence.i_d),
    number!("sequence.stop_a_per_s", "A/s", drive.sequence.stop_a_per_s),
    number!("speed.i_q_limit_a", "A", drive.speed.i_q_limit_a),
    number!("speed.limit_rpm", "rpm", drive.speed.limit_rpm),
    number!("speed.ramp_rpm_per_s", "rpm/s", drive.speed.ramp_rpm_per_s),
    number!("speed.phase_margin_deg", "deg", drive.speed.phase_margin_deg),
    number!("command.timeout_s", "s", command.timeout_s),
    yes_or_no!("wiring_checked", command.wiring_checked),
];

/// The setting with this [number](Key::id).
pub fn find_id(id: u32) -> Option<&'static Key> {
    KEYS.iter().find(|key| key.id() == id)
}

/// FNV-1a: a number for a word.
pub(crate) fn number_of(word: &str) -> u32 {
    word.bytes().fold(0x811c_9dc5, |hash, b| (hash ^ u32::from(b)).wrapping_mul(0x0100_0193))
}

/// The setting of this name.
pub fn find(name: &str) -> Option<&'static Key> {
    KEYS.iter().find(|key| key.name == name)
}

impl Key {
    /// What is set.
    pub fn get(&self, settings: &FirmwareSettings) -> Value {
        match self.access {
            Access::Number(place) => Value::Number(*place(&mut { *settings })),
            Access::Whole { get, .. } => Value::Whole(get(settings)),
            Access::Word { words, get, .. } => {
                let index = get(settings);
                Value::Word { index, word: words.get(usize::from(index)).copied().unwrap_or("") }
            }
        }
    }

    /// The value that a text stands for. Whether it is in range, [`FirmwareSettings::build`] says.
    ///
    /// # Errors
    /// The text is no value for this setting.
    pub fn parse(&self, text: &str) -> Result<Value, NotTaken> {
        match self.access {
            Access::Number(_) => number(text).map(Value::Number).map_err(|_| NotTaken::Number),
            Access::Whole { max, .. } => {
                let value = text.parse().ok().filter(|value| *value <= max);
                value.map(Value::Whole).ok_or(NotTaken::Whole(max))
            }
            Access::Word { words, .. } => {
                let index = words.iter().position(|word| *word == text);
                let found = index.and_then(|i| Some((u8::try_from(i).ok()?, *words.get(i)?)));
                found.map(|(index, word)| Value::Word { index, word }).ok_or(NotTaken::Word(words))
            }
        }
    }

    /// Sets a value that [`parse`](Self::parse) gave.
    pub fn set(&self, settings: &mut FirmwareSettings, value: Value) {
        match (&self.access, value) {
            (Access::Number(place), Value::Number(value)) => *place(settings) = value,
            (Access::Whole { set, .. }, Value::Whole(value)) => set(settings, value),
            (Access::Word { set, .. }, Value::Word { index, .. }) => set(settings, index),
            // Not from this key.
            _ => {}
        }
    }

    /// A number made of its name, by which the flash knows it.
    pub fn id(&self) -> u32 {
        number_of(self.name)
    }

    /// What is set, as it is kept in the flash.
    pub fn to_bits(&self, settings: &FirmwareSettings) -> u32 {
        match self.get(settings) {
            Value::Number(value) => value.to_bits(),
            Value::Whole(value) => value,
            Value::Word { word, .. } => number_of(word),
        }
    }

    /// Sets what [`to_bits`](Self::to_bits) gave; `None` if it is no value of this setting. Whether it
    /// is in range, [`FirmwareSettings::build`] says.
    pub fn set_bits(&self, settings: &mut FirmwareSettings, bits: u32) -> Option<()> {
        let value = match self.access {
            Access::Number(_) => Value::Number(f32::from_bits(bits)),
            Access::Whole { max, .. } => Value::Whole(Some(bits).filter(|bits| *bits <= max)?),
            Access::Word { words, .. } => {
                let index = words.iter().position(|word| number_of(word) == bits)?;
                Value::Word { index: u8::try_from(index).ok()?, word: words.get(index)? }
            }
        };
        self.set(settings, value);
        Some(())
    }

    /// What may be set beside the present settings, where a range says it.
    pub fn range(&self, settings: &FirmwareSettings) -> Option<(f32, f32)> {
        let mut probe = *settings;
        match self.access {
            // In no range.
            Access::Number(place) => *place(&mut probe) = f32::NAN,
            Access::Whole { set, checked: true, .. } => set(&mut probe, 0),
            Access::Whole { .. } | Access::Word { .. } => return None,
        }
        match probe.build() {
            Err(SettingsError::Range { name, min, max, .. }) if self.name.starts_with(name) => {
                Some((min, max))
            }
            _ => None,
        }
    }

    /// The words that may be set, for settings that take words.
    pub fn words(&self) -> &'static [&'static str] {
        match self.access {
            Access::Word { words, .. } => words,
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        for key in &KEYS {
            assert!(core::ptr::eq(find(key.name).unwrap(), key), "{}", key.name);
            assert!(core::ptr::eq(find_id(key.id()).unwrap(), key), "{}", key.name);
        }
        assert!(find("motor").is_none());
    }

    #[test]
    fn every_number_has_a_range_that_holds_what_is_set() {
        let settings = FirmwareSettings::of_the_board();
        for key in &KEYS {
            let value = match key.get(&settings) {
                Value::Number(value) => value,
                Value::Whole(value) => value as f32,
                Value::Word { .. } => continue,
            };
            match key.range(&settings) {
                Some((min, max)) => assert!(min <= value && value <= max, "{}", key.name),
                // Any code of the converter.
                None => assert_eq!(key.name, "scales.heat_sink_trip"),
            }
        }
    }

    #[test]
    fn what_is_set_is_read_back_and_nothing_else_moves() {
        for (i, key) in KEYS.iter().enumerate() {
            let before = FirmwareSettings::of_the_board();
            let mut after = before;
            let value = match key.get(&before) {
                Value::Number(value) => key.parse(&format!("{}", value * 1.5 + 1.0)),
                Value::Whole(value) => key.parse(&format!("{}", value + 1)),
                Value::Word { index, .. } => {
                    let words = key.words();
                    key.parse(words[(usize::from(index) + 1) % words.len()])
                }
            };
            key.set(&mut after, value.unwrap());
            assert_eq!(key.get(&after), value.unwrap(), "{}", key.name);
            for (j, other) in KEYS.iter().enumerate() {
                assert_eq!(i != j, other.get(&after) == other.get(&before), "{}", other.name);
            }
        }
    }

    #[test]
    fn values_out_of_range_are_named() {
        let mut settings = FirmwareSettings::of_the_board();
        for (name, text) in [("limits.trip_a", "5"), ("command.timeout_s", "-1")] {
            let key = find(name).unwrap();
            let mut other = settings;
            key.set(&mut other, key.parse(text).unwrap());
            let error = other.build().unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
        settings.command.timeout_s = f32::NAN;
        assert!(settings.build().is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_a_value_or_refused(text in ".*", i in 0..KEYS.len()) {
            let mut settings = FirmwareSettings::of_the_board();
            if let Ok(value) = KEYS[i].parse(&text) {
                KEYS[i].set(&mut settings, value);
                prop_assert_eq!(KEYS[i].get(&settings), value);
            }
        }

        #[test]
        fn values_survive_the_way_through_text(bits in 0_u32..4_000_000, i in 0..KEYS.len()) {
            let key = &KEYS[i];
            let text = match key.access {
                Access::Number(_) => (bits as f32 * 1e-3).to_string(),
                _ => bits.to_string(),
            };
            if let Ok(value) = key.parse(&text) {
                prop_assert_eq!(key.parse(&value.to_string()), Ok(value));
            }
        }
    }
}
