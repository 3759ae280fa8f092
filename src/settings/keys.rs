//! The settings by name: one table.
//!
//! Ranges do not stand here: `FirmwareSettings::build` knows them, and its error states them.

use drive_core::carrier::DemodulatorKind;
use drive_core::settings::{AngleSource, CurrentPlant, SettingsError};

use super::FirmwareSettings;
use super::value::{Value, ValueError, number};
use crate::hash;

/// A setting of the table [`KEYS`].
#[derive(Debug)]
pub struct Key {
    /// Name at the console and, hashed, in the flash.
    pub name: &'static str,
    /// Unit; empty if there is none.
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
    /// `checked`: the value has a range, and 0 is outside it.
    Whole {
        get: fn(&FirmwareSettings) -> u32,
        set: fn(&mut FirmwareSettings, u32),
        max: u32,
        checked: bool,
    },
    Word {
        words: &'static [&'static str],
        get: fn(&FirmwareSettings) -> &'static str,
        set: fn(&mut FirmwareSettings, &str),
    },
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
                // At most `max`: see `parse`.
                set: |s, value| s.$($path).+ = value as $type,
                max: <$type>::MAX as u32,
                checked: $checked,
            },
        }
    };
}

macro_rules! word {
    ($name:literal, |$s:ident| $place:expr, $($word:literal = $value:pat => $make:expr),+) => {
        Key {
            name: $name,
            unit: "",
            access: Access::Word {
                words: &[$($word),+],
                get: |$s| match $place { $($value => $word),+ },
                set: |$s, word| match word {
                    $($word => $place = $make,)+
                    // Not one of `words`: see `parse`.
                    _ => {}
                },
            },
        }
    };
}

macro_rules! yes_or_no {
    ($name:literal, $($path:ident).+) => {
        word!($name, |s| s.$($path).+, "no" = false => false, "yes" = true => true)
    };
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

/// The setting with this name.
pub fn find(name: &str) -> Option<&'static Key> {
    KEYS.iter().find(|key| key.name == name)
}

/// The setting with this [id](Key::id).
pub fn find_id(id: u32) -> Option<&'static Key> {
    KEYS.iter().find(|key| key.id() == id)
}

impl Key {
    /// The key's current value.
    pub fn get(&self, settings: &FirmwareSettings) -> Value {
        match self.access {
            Access::Number(place) => Value::Number(*place(&mut { *settings })),
            Access::Whole { get, .. } => Value::Whole(get(settings)),
            Access::Word { get, .. } => Value::Word(get(settings)),
        }
    }

    /// The value that a text stands for. Its range is checked by [`FirmwareSettings::build`].
    ///
    /// # Errors
    /// The text is not a value of this setting.
    pub fn parse(&self, text: &str) -> Result<Value, ValueError> {
        match self.access {
            Access::Number(_) => number(text).map(Value::Number).ok_or(ValueError::Number),
            Access::Whole { max, .. } => {
                let value = text.parse().ok().filter(|value| *value <= max);
                value.map(Value::Whole).ok_or(ValueError::Whole(max))
            }
            Access::Word { words, .. } => {
                let word = words.iter().find(|word| **word == text);
                word.map(|word| Value::Word(word)).ok_or(ValueError::Word(words))
            }
        }
    }

    /// Sets a value from this key's [`parse`](Self::parse); a value of another type changes nothing.
    pub fn set(&self, settings: &mut FirmwareSettings, value: Value) {
        match (&self.access, value) {
            (Access::Number(place), Value::Number(value)) => *place(settings) = value,
            (Access::Whole { set, .. }, Value::Whole(value)) => set(settings, value),
            (Access::Word { set, .. }, Value::Word(word)) => set(settings, word),
            _ => {}
        }
    }

    /// The id of the setting in the flash: the hash of its name.
    pub fn id(&self) -> u32 {
        hash::of(self.name.bytes())
    }

    /// The key's current value as 32 bits for the flash: the bits of a number, the hash of a word.
    pub fn to_bits(&self, settings: &FirmwareSettings) -> u32 {
        match self.get(settings) {
            Value::Number(value) => value.to_bits(),
            Value::Whole(value) => value,
            Value::Word(word) => hash::of(word.bytes()),
        }
    }

    /// Sets a value from [`to_bits`](Self::to_bits); `None` if the bits are not a value of this setting. Its range
    /// is checked by [`FirmwareSettings::build`].
    pub fn set_bits(&self, settings: &mut FirmwareSettings, bits: u32) -> Option<()> {
        let value = match self.access {
            Access::Number(_) => Value::Number(f32::from_bits(bits)),
            Access::Whole { max, .. } => Value::Whole(Some(bits).filter(|bits| *bits <= max)?),
            Access::Word { words, .. } => {
                Value::Word(words.iter().find(|word| hash::of(word.bytes()) == bits)?)
            }
        };
        self.set(settings, value);
        Some(())
    }

    /// The values allowed beside the present settings, `(min, max)`, where the setting has a range.
    pub fn range(&self, settings: &FirmwareSettings) -> Option<(f32, f32)> {
        let mut probe = *settings;
        match self.access {
            // Outside every range.
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
                Value::Word(_) => continue,
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
                Value::Word(word) => {
                    let words = key.words();
                    let index = words.iter().position(|other| *other == word).unwrap();
                    key.parse(words[(index + 1) % words.len()])
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
