//! The configuration of an experiment: numbers under dotted names, the names that the console of the drive uses.
//!
//! A key belongs to the bench ([`BENCH`]: the simulated motor, inverter, sensors and load) or to the drive
//! ([`drive_settings::SETTINGS`]). If both tables have a name, an assignment to it sets both keys, so that the drive
//! knows its bench. `drive.NAME` sets the key of the drive alone, whose value then differs from the bench. Assignments
//! take effect in their order; in a file, those to `drive.` keys come last. `after.NAME` is a key of the plant whose
//! value changes after the saliency self-commissioning.

mod alias;
pub mod file;
mod key;
mod keys;
pub mod motors;
pub mod passport;
mod plant;
pub mod plate;
mod words;

use std::f32::consts::TAU;
use std::fmt::Display;
use std::path::Path;

use drive_core::{Coefficients, Line, PERIOD_S};
use drive_settings::rules::CARRIER_HZ;
use drive_settings::{Settings, SettingsError, find, value};

use file::FileAssignment;
pub use key::{BenchKey, Key, check_model, double};
pub use keys::*;
pub use plant::{current_lines, flux_level_a, open_phase, plant_settings};

use crate::error::{Error, cut};
use motors::Motor;

/// A value of a key.
pub type Value = value::Value<f64>;

/// Prefix of the keys that set the drive alone.
const DRIVE: &str = "drive.";

/// Returns the settings of the dissertation's drive, which knows the inertia of its simulated motor.
fn dissertation() -> Settings {
    Settings { inertia: Some(MotorConfig::default().inertia as f32), ..Settings::default() }
}

impl Config {
    /// Returns the defaults, changed first by the motor, then by the file, and then by the assignments `KEY=VALUE`, in order.
    ///
    /// # Errors
    /// As [`Config::of_motor`], [`file::read`] and [`Config::set`]. [`Error::Data`] for an assignment of the file that
    /// [`Config::set`] refuses; [`Error::Refused`] for an assignment without an equals sign. The ranges of the drive's
    /// settings depend on each other, so they are checked when the drive is built.
    pub fn load(
        motor: Option<&str>,
        file: Option<&Path>,
        assignments: &[impl AsRef<str>],
    ) -> Result<Self, Error> {
        let mut config = Self::of_motor(motor)?;
        if let Some(path) = file {
            for FileAssignment { name, value, line } in file::read(path)? {
                let failed = |e: Error| Error::data(path, Some(line), e.to_string());
                config.set(&name, &value).map_err(failed)?;
            }
        }
        for assignment in assignments {
            let (name, value) = assigned(assignment.as_ref())?;
            config.set(name, value)?;
        }
        Ok(config)
    }

    /// Returns the defaults with a motor; see [`Motor::find`].
    ///
    /// # Errors
    /// As [`Motor::find`] and [`Motor::apply`].
    pub fn of_motor(name: Option<&str>) -> Result<Self, Error> {
        let mut config = Self::default();
        if let Some(name) = name {
            Motor::find(name)?.apply(&mut config)?;
        }
        Ok(config)
    }

    /// Sets one key to a value, which may be a number, a word, a value of TOML or the text of one of them. If it returns an error, nothing
    /// has changed.
    ///
    /// # Errors
    /// [`Error::Unknown`]; [`Error::Value`] with the key, the value and the allowed values.
    pub fn set(&mut self, name: &str, value: impl Display) -> Result<(), Error> {
        let (name, value) = alias::today(name, &value.to_string());
        let mut changed = self.clone();
        for key in Key::named(&name)? {
            key.set(&mut changed, &value).map_err(|problem| Error::Value {
                key: name.clone(),
                value: value.clone(),
                problem,
                allowed: key.allowed_text(),
            })?;
        }
        if name.starts_with("measurement.") || name == "inverter.dc_link_v" {
            changed.calibrate();
        }
        *self = changed;
        Ok(())
    }

    /// The q-axis current of experiments that do not bring their own, A peak.
    pub fn iq_a(&self) -> f64 {
        self.reference.iq_a.unwrap_or_else(|| self.amperes(1.0))
    }

    /// Describes the simulated motor in words.
    pub fn motor_text(&self) -> String {
        let m = &self.motor;
        if *m == MotorConfig::default() {
            return "Table 5".to_owned();
        }
        let MotorConfig { r_s, r_r, l_ls, l_lr, l_m, pole_pairs, .. } = m;
        let inductances = format!("l_ls {l_ls} H, l_lr {l_lr} H, l_m {l_m} H");
        format!("r_s {r_s} ohm, r_r {r_r} ohm, {inductances}, {pole_pairs} pole pairs")
    }

    /// Scales a current in proportion to the rated current; `on_reference`, A, is its value on the dissertation's motor.
    pub fn amperes(&self, on_reference: f64) -> f64 {
        on_reference * self.relative(Settings::rated_a)
    }

    /// Scales the range of the current sensors. It holds the rated current, the injection current at the dissertation's share of the dc link,
    /// 50 of 311 V, and the ripple of the PWM.
    pub fn sensed(&self, on_reference: f64) -> f64 {
        let peak = |s: &Settings| {
            let injection = s.share_of_dc_link(50.0) / (TAU * CARRIER_HZ);
            let ripple = s.inverter.dc_link_v * PERIOD_S / 8.0;
            s.rated_a() + (injection + ripple) / s.motor.sigma_l_s()
        };
        on_reference * self.relative(peak)
    }

    /// Scales a load torque; `on_reference`, Nm, is its value on the dissertation's motor. A load step of the result
    /// causes the same electrical acceleration as on that motor, because the angle tracking follows only a limited
    /// acceleration. The result is not a larger share of the torque at the current limit either.
    pub fn newton_metres(&self, on_reference: f64) -> f64 {
        let torque = self.relative(|s| s.motor.torque_per_ampere(s.i_d()) * s.current_limit_a());
        let inertia = self.relative(|s| s.inertia() / f32::from(s.motor.pole_pairs));
        on_reference * torque.min(inertia)
    }

    /// Rated torque, Nm: power over speed of the nameplate.
    pub fn rated_nm(&self) -> f64 {
        self.drive.nameplate.torque_nm().into()
    }

    /// A quantity of the drive's settings, divided by its value in the dissertation's drive.
    fn relative(&self, of: fn(&Settings) -> f32) -> f64 {
        f64::from(of(&self.drive)) / f64::from(of(&dissertation()))
    }

    /// The mechanical speed, rpm, that has the same electrical frequency as `on_reference`, rpm, on four poles.
    pub fn rpm(&self, on_reference: f64) -> f64 {
        on_reference * (2.0 / f64::from(self.motor.pole_pairs))
    }

    /// Sets the scales of the drive to those of the sensors, without the sensors' errors. Call it after code has
    /// changed `measurement` or the dc link directly.
    pub fn calibrate(&mut self) {
        let sensors = plant_settings(self).measurement;
        let scales = &mut self.drive.scales;
        [scales.current_a, scales.current_b] = current_lines(&sensors);
        scales.full_scale = sensors.calibration()[0].full_scale;
        scales.dc_link = Line { gain: sensors.dc_link_v as f32, offset: 0.0 };
        let filter_hz = self.measurement.filter_hz;
        scales.current_delay_s =
            if filter_hz > 0.0 { (1.0 / (std::f64::consts::TAU * filter_hz)) as f32 } else { 0.0 };
        scales.both_zero_vectors = self.measurement.both_zero_vectors;
    }

    /// Returns the keys whose value is not the default, as `KEY=VALUE` for `--set`.
    pub fn changes(&self) -> Vec<String> {
        self.changes_from(&Self::default())
    }

    /// Returns the assignments that change `base` into this configuration.
    pub fn changes_from(&self, base: &Self) -> Vec<String> {
        let (mut rebuilt, mut changes) = (base.clone(), Vec::new());
        for key in Key::all().chain(Key::after()) {
            let value = key.get(self);
            if value != key.get(&rebuilt) {
                let change = (key.assigned_name(), value);
                // Every value in the configuration is an allowed one.
                let _ = rebuilt.set(&change.0, change.1);
                changes.push(format!("{}={}", change.0, change.1));
            }
        }
        changes
    }
}

/// Computes the coefficients of a drive with these settings.
///
/// # Errors
/// [`Error::Refused`] with the setting. If nobody set it, the message adds what its rule depends on.
pub fn built(settings: &Settings) -> Result<Coefficients, Error> {
    settings.build().map_err(|error| {
        let is_auto = |name| find(name).is_some_and(|it| it.get(settings) == value::Value::Auto);
        let by_rule = matches!(error, SettingsError::Range { name, .. } if is_auto(name));
        let rule = "; it was not set: its rule follows from nameplate, motor, measurement.range_a and inverter.dc_link_v";
        Error::Refused(format!("{error}{}", if by_rule { rule } else { "" }))
    })
}

/// Splits an assignment `KEY=VALUE` into name and value.
///
/// # Errors
/// [`Error::Refused`] if there is no equals sign.
pub fn assigned(assignment: &str) -> Result<(&str, &str), Error> {
    let refused = |given| format!("`{given}`: write KEY=VALUE, for example --set motor.r_s=5.4");
    let pair = assignment.split_once('=').ok_or_else(|| Error::Refused(refused(cut(assignment))));
    pair.map(|(name, value)| (name.trim(), value))
}

/// Returns the keys that an assignment to `name` sets; the name may be an old one.
///
/// # Errors
/// As [`Key::named`].
pub fn keys_of(name: &str) -> Result<Vec<Key>, Error> {
    Key::named(&alias::today(name, "").0)
}

/// Returns the assignments of a table; those for the drive alone come last.
pub fn flattened(table: &toml::Table) -> Vec<(String, toml::Value)> {
    let mut assignments = Vec::new();
    flatten("", table, &mut assignments);
    assignments.sort_by_key(|(name, _)| name.starts_with(DRIVE));
    assignments
}

fn flatten(prefix: &str, table: &toml::Table, into: &mut Vec<(String, toml::Value)>) {
    for (name, value) in table {
        let name = format!("{prefix}{name}");
        match value {
            toml::Value::Table(inner) => flatten(&format!("{name}."), inner, into),
            value => into.push((name, value.clone())),
        }
    }
}
