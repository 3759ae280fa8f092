//! The configuration of an experiment: plain numbers under dotted names.

mod keys;
mod value;

use std::path::Path;

use drive_core::tuning;

pub use keys::*;
pub use value::{Allowed, Value};

use crate::error::{Error, nearest};

impl Key {
    /// The key with this name.
    ///
    /// # Errors
    /// [`Error::UnknownKey`] with the most similar name.
    pub fn find(name: &str) -> Result<&'static Self, Error> {
        KEYS.iter().find(|key| key.name == name).ok_or_else(|| Error::UnknownKey {
            key: name.to_owned(),
            nearest: nearest(name, KEYS.iter().map(|key| key.name)),
        })
    }

    /// The values it can have, in words, with the unit.
    pub fn allowed_text(&self) -> String {
        self.allowed.describe(self.unit)
    }
}

impl MotorConfig {
    /// The T-equivalent circuit, ohm and H.
    pub fn circuit(&self) -> tuning::EquivalentCircuit {
        let Self { rs: r_s, rr: r_r, lm: l_m, lls: l_ls, llr: l_lr, .. } = *self;
        tuning::EquivalentCircuit { r_s, r_r, l_m, l_ls, l_lr }
    }
}

impl Config {
    /// The defaults, changed first by the file and then by the assignments `KEY=VALUE`, in order.
    ///
    /// # Errors
    /// [`Error::ConfigFile`] when the file cannot be read or is not TOML, [`Error::Assignment`] for an
    /// assignment without an equals sign, and as [`Config::set`].
    pub fn load(file: Option<&Path>, assignments: &[String]) -> Result<Self, Error> {
        let mut config = Self::default();
        if let Some(path) = file {
            let failed = |problem: String| Error::ConfigFile { path: path.to_owned(), problem };
            let text = std::fs::read_to_string(path).map_err(|e| failed(e.to_string()))?;
            let table: toml::Table =
                text.parse().map_err(|e: toml::de::Error| failed(e.to_string()))?;
            config.set_table("", &table)?;
        }
        for assignment in assignments {
            let (key, value) =
                assignment.split_once('=').ok_or_else(|| Error::Assignment(assignment.clone()))?;
            config.set(key.trim(), &Value::from_text(value))?;
        }
        Ok(config)
    }

    /// Sets one key; on an error nothing changes.
    ///
    /// # Errors
    /// [`Error::UnknownKey`]; [`Error::Value`] with the key, the value and the allowed values.
    pub fn set(&mut self, name: &str, value: &Value) -> Result<(), Error> {
        let key = Key::find(name)?;
        (key.set)(self, value).map_err(|problem| Error::Value {
            key: name.to_owned(),
            value: value.to_string(),
            problem,
            allowed: key.allowed_text(),
        })
    }

    fn set_table(&mut self, prefix: &str, table: &toml::Table) -> Result<(), Error> {
        for (name, value) in table {
            let name = format!("{prefix}{name}");
            match value {
                toml::Value::Table(inner) => self.set_table(&format!("{name}."), inner)?,
                value => self.set(&name, &Value::from_toml(value))?,
            }
        }
        Ok(())
    }

    /// The keys whose value is not the default, as `KEY=VALUE` for `--set`.
    pub fn changes(&self) -> Vec<String> {
        let default = Self::default();
        KEYS.iter()
            .filter(|key| (key.get)(self) != (key.get)(&default))
            .map(|key| format!("{}={}", key.name, (key.get)(self)))
            .collect()
    }

    /// The motor parameters that the drive is set to.
    pub fn believed_motor(&self) -> MotorConfig {
        let (motor, believed) = (&self.motor, &self.drive_motor);
        MotorConfig {
            rs: believed.rs.unwrap_or(motor.rs),
            rr: believed.rr.unwrap_or(motor.rr),
            lls: believed.lls.unwrap_or(motor.lls),
            llr: believed.llr.unwrap_or(motor.llr),
            lm: believed.lm.unwrap_or(motor.lm),
            ..motor.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(assignment: &str) -> Result<Config, Error> {
        Config::load(None, &[assignment.to_owned()])
    }

    #[test]
    fn every_default_is_allowed_and_every_key_round_trips() {
        for key in KEYS {
            let mut config = Config::default();
            let value = (key.get)(&config);
            assert_eq!((key.set)(&mut config, &value), Ok(()), "{}", key.name);
            assert_eq!(config, Config::default(), "{}", key.name);
            assert!(!key.doc.trim().is_empty(), "{}", key.name);
            // Through text, as --set has it, with a value that is not the default.
            let text = match key.allowed {
                Allowed::Range { min, .. } => min.to_string(),
                Allowed::Words(words) => words[0].to_owned(),
                Allowed::Switch => "true".to_owned(),
            };
            let config = set(&format!("{}={text}", key.name)).expect(key.name);
            assert_eq!((key.get)(&config).to_string(), text, "{}", key.name);
        }
    }

    #[test]
    fn names_are_unique() {
        for (i, key) in KEYS.iter().enumerate() {
            assert!(KEYS[..i].iter().all(|other| other.name != key.name), "{}", key.name);
        }
    }

    #[test]
    fn just_outside_the_range_is_refused() {
        for key in KEYS {
            if let Allowed::Range { min, max } = key.allowed {
                for value in [min - 1.0, max + 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    assert!(set(&format!("{}={value}", key.name)).is_err(), "{} {value}", key.name);
                }
            }
        }
    }

    #[test]
    fn errors_name_the_key_the_value_and_the_range() {
        let text = |assignment: &str| set(assignment).unwrap_err().to_string();
        assert_eq!(text("motor.rs=-1"), "motor.rs = -1: out of range; allowed: 0.01 to 1000 ohm");
        assert_eq!(
            text("motor.rs=nan"),
            "motor.rs = NaN: not a finite number; allowed: 0.01 to 1000 ohm"
        );
        assert_eq!(
            text("motor.rs=a lot"),
            "motor.rs = a lot: not a number; allowed: 0.01 to 1000 ohm"
        );
        assert_eq!(
            text("motor.pole_pairs=1.5"),
            "motor.pole_pairs = 1.5: not a whole number; allowed: 1 to 50"
        );
        assert_eq!(
            text("angle.source=resolver"),
            "angle.source = resolver: not one of the words; allowed: encoder, injection"
        );
        assert_eq!(
            text("motor.r_s=5"),
            "there is no key `motor.r_s`; did you mean `motor.rs`?; `keys` shows all of them"
        );
        assert_eq!(text("motor.rs"), "`motor.rs`: write KEY=VALUE, for example --set motor.rs=5.4");
    }

    #[test]
    fn toml_and_assignments_say_the_same() {
        let mut from_toml = Config::default();
        let table = "runs = 3\nload.mode = \"speed\"\n[motor]\nrs = 6\n[drive.motor]\nrr = 1.3\n";
        from_toml.set_table("", &table.parse().unwrap()).unwrap();
        let changes = from_toml.changes();
        assert_eq!(changes, ["motor.rs=6", "load.mode=speed", "drive.motor.rr=1.3", "runs=3"]);
        assert_eq!(Config::load(None, &changes).unwrap(), from_toml);
        assert_eq!(from_toml.believed_motor().rr, 1.3);
        assert_eq!(from_toml.believed_motor().rs, 6.0);
    }

    #[test]
    fn toml_of_the_wrong_type_or_name_is_refused() {
        for bad in ["motor.rs = \"5.4\"", "motor.rs = [1]", "motor = 3", "moter.rs = 1"] {
            let table = bad.parse().unwrap();
            assert!(Config::default().set_table("", &table).is_err(), "{bad}");
        }
    }
}
