//! The motors that come with the program: one file a motor in the folder `motors`, every number with its source.
//!
//! A file holds settings under the names of the keys ([`super`]), a title, a text, and sources. See the page
//! "Motors" of the documentation.

use std::path::Path;

use include_dir::{Dir, File, include_dir};
use serde::{Deserialize, Serialize};

use super::passport::Passport;
use super::{Config, Key, alias, flattened, plate};
use crate::bounded;
use crate::error::{Error, cut, parser_text};

/// The folder `motors`, which `build.rs` finds.
static FILES: Dir<'static> = include_dir!("$MOTORS");

/// Keys that a user's motor file must set, because no rule gives them and no value of another motor may replace them.
/// A file that states only the nameplate is completed by [`plate`].
pub const NEEDED: &str = "nameplate.power_w nameplate.voltage_v nameplate.current_a nameplate.frequency_hz nameplate.speed_rpm \
    motor.r_s motor.r_r motor.l_ls motor.l_lr motor.l_m motor.pole_pairs inverter.dc_link_v";

/// Units of a nameplate, with the keys of the group `nameplate` and the factors.
const UNITS: [(&str, &str, f64); 6] = [
    ("W", "power_w", 1.0),
    ("kW", "power_w", 1e3),
    ("V", "voltage_v", 1.0),
    ("A", "current_a", 1.0),
    ("Hz", "frequency_hz", 1.0),
    ("rpm", "speed_rpm", 1.0),
];

/// Returns the text of a file of `motors/measured`: values that others have measured on a motor.
///
/// # Errors
/// [`Error::Internal`] if there is no such file.
pub fn measured(name: &str) -> Result<&'static str, Error> {
    let file = FILES.get_file(Path::new("measured").join(name));
    let text = file.and_then(|file| file.contents_utf8());
    text.ok_or_else(|| Error::Internal(format!("motors/measured/{name} is missing")))
}

/// Where numbers of a motor come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Keys whose values come from this source.
    pub keys: Vec<String>,
    /// Publication, file and line, and the conversion of the values.
    pub from: String,
    /// Whether the values are quoted from memory: nobody has looked them up.
    #[serde(default)]
    pub unverified: bool,
}

/// A motor with the inverter and the sensors that suit it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motor {
    /// Name on the command line. For a motor that comes with the program it is the name of the file; for a user's file
    /// it ends in `.toml`, for a passport in `.json`.
    #[serde(skip)]
    pub name: String,
    /// Rated data in one line.
    #[serde(default)]
    pub title: String,
    /// Description of the motor and its peculiarities.
    #[serde(default)]
    pub about: String,
    /// Sources of the numbers; a user's file need not state them.
    #[serde(default)]
    pub source: Vec<Source>,
    /// The settings, in groups.
    #[serde(flatten)]
    settings: toml::Table,
}

impl Motor {
    /// Returns all motors that come with the program, by name.
    pub fn all() -> Vec<Self> {
        // A test parses every file.
        let parsed =
            |file: &File<'_>| parse(file.path().file_stem()?.to_str()?, file.contents_utf8()?).ok();
        let mut all: Vec<Self> = FILES.files().filter_map(parsed).collect();
        all.sort_by(|a, b| a.name.cmp(&b.name));
        all
    }

    /// Returns the motor of this name. A name that ends in `.toml` is a motor file, one that ends in `.json` a passport.
    ///
    /// # Errors
    /// [`Error::Unknown`] with the most similar name; [`Error::Data`].
    pub fn find(name: &str) -> Result<Self, Error> {
        if is_file(name) {
            let path = Path::new(name);
            let failed = |problem: String| Error::data(path, None, problem);
            let text = bounded::text(path).map_err(|e| failed(e.to_string()))?;
            return match name.ends_with(".json") {
                true => Passport::parse(&text).map(|it| of_passport(name, it)).map_err(failed),
                false => parse(name, &text).map_err(|e| failed(parser_text(e)))?.completed(),
            };
        }
        let all = Self::all();
        let names = || all.iter().map(|motor| motor.name.as_str());
        let found = all.iter().find(|motor| motor.name == name);
        found.cloned().ok_or_else(|| Error::unknown("motor", name, names()))
    }

    /// Parses a motor from the text of a motor file.
    ///
    /// # Errors
    /// [`Error::Refused`] if the text is not a motor file, or as [`plate::circuit`].
    pub fn from_text(name: &str, text: &str) -> Result<Self, Error> {
        parse(name, text).map_err(|e| Error::Refused(parser_text(e)))?.completed()
    }

    /// Adds circuit and dc link, estimated, to a user's file that states only the nameplate.
    fn completed(mut self) -> Result<Self, Error> {
        if !self.is_own() || !NEEDED.split(' ').all(|key| self.says(key) == of_plate(key)) {
            return Ok(self);
        }
        let mut config = Config::default();
        let of_plate = self.settings().into_iter().filter(|(key, _)| of_plate(key));
        of_plate.into_iter().try_for_each(|(key, value)| config.set(&key, value))?;
        let estimated = plate::circuit(&config.drive.nameplate)?;
        let keys = estimated.each_ref().map(|(key, _)| (*key).to_owned()).to_vec();
        for (key, value) in estimated {
            let (group, name) = key.split_once('.').unwrap_or_default();
            let group = self.settings.entry(group).or_insert_with(|| toml::Table::new().into());
            group.as_table_mut().map(|group| group.insert(name.to_owned(), value.into()));
        }
        self.source.push(Source { keys, from: plate::ESTIMATED.to_owned(), unverified: true });
        Ok(self)
    }

    /// Returns what a reader of the results has to know: that circuit and dc link are estimated.
    pub fn remark(&self) -> Option<String> {
        let is_estimated = self.source.iter().any(|source| source.from == plate::ESTIMATED);
        is_estimated
            .then(|| format!("{}: circuit and dc link are {}.", self.name, plate::ESTIMATED))
    }

    /// Returns the keys that the file sets, with their values.
    pub fn settings(&self) -> Vec<(String, toml::Value)> {
        flattened(&self.settings)
    }

    /// Returns the source of a key.
    pub fn source_of(&self, key: &str) -> Option<&Source> {
        self.source.iter().find(|source| source.keys.iter().any(|known| known == key))
    }

    /// Whether it is a user's file; the other motors come with the program.
    fn is_own(&self) -> bool {
        is_file(&self.name)
    }

    /// Sets the keys of the file, and the keys that follow by [`implied`](Self::implied).
    ///
    /// # Errors
    /// As [`Config::set`]. [`Error::Refused`] if a number of a motor that comes with the program has no source or two
    /// sources, or if a user's file does not set all [`NEEDED`] keys.
    pub fn apply(&self, config: &mut Config) -> Result<(), Error> {
        let name = &self.name;
        for (key, value) in self.settings() {
            let sources = self.source.iter().flat_map(|source| &source.keys);
            let count = sources.filter(|known| **known == key).count();
            if count > 1 || count == 0 && !self.is_own() {
                let why = format!("{} has {count} sources; one [[source]] must name it", cut(&key));
                return Err(Error::Refused(format!("motor {name}: {why}")));
            }
            config.set(&key, value)?;
        }
        let missing: Vec<_> =
            NEEDED.split(' ').filter(|key| self.is_own() && !self.says(key)).collect();
        if !missing.is_empty() {
            let missing = missing.join(", ");
            return Err(Error::Refused(format!("motor {name}: these are missing: {missing}")));
        }
        if self.is_own() {
            plate::check(config)?;
        }
        self.implied(config).into_iter().try_for_each(|(key, value, _)| config.set(key, value))
    }

    /// Whether the file sets a key.
    fn says(&self, key: &str) -> bool {
        self.settings().iter().any(|(name, _)| alias::today(name, "").0 == key)
    }

    /// Returns the keys that the file does not set and that follow from others, with the reason. For a motor that comes
    /// with the program these are only the keys that a commissioned drive has.
    pub fn implied(&self, config: &Config) -> Vec<(&'static str, String, &'static str)> {
        let base = Config::default();
        let four_digits = |value: f64| format!("{value:.3e}").parse().unwrap_or(value).to_string();
        let range_a = four_digits(config.sensed(base.measurement.range_a));
        let inertia = four_digits(base.motor.inertia * config.rated_nm() / base.rated_nm());
        let flux = if self.says("sequence.i_d") { "sequence.i_d" } else { "sequence.flux" };
        let commissioned = "by rule: as a commissioned drive has it";
        let sensors = "by rule: rated current, injection and ripple, and 12 %";
        let all = [
            ("current_plant", "motor".to_owned(), commissioned),
            (flux, "high".to_owned(), commissioned),
            ("measurement.range_a", range_a, sensors),
            ("motor.inertia", inertia, "assumed: in proportion to the rated torque"),
            ("prepare.learn", "yes".to_owned(), "by rule: the drive has not learned this motor"),
        ];
        let of_all = |reason| self.is_own() || reason == commissioned;
        all.into_iter().filter(|(key, _, reason)| of_all(*reason) && !self.says(key)).collect()
    }

    /// Returns the lines that set the drive to this motor at the console.
    pub fn console_lines(&self) -> Vec<String> {
        let mut config = Config::default();
        if self.apply(&mut config).is_err() {
            return Vec::new();
        }
        let default = Config::default();
        // The scales belong to the board, not to the motor.
        Key::all()
            .filter(|key| matches!(key, Key::Drive(entry) if !entry.name.starts_with("scales.")))
            .filter(|key| key.get(&config) != key.get(&default))
            .map(|key| format!("set {} {}", key.name(), key.get(&config)))
            .collect()
    }
}

/// Returns the motor file of a nameplate such as `750 W, 400 V, 1.86 A, 50 Hz, 1400 rpm`. A source marks the numbers that are estimated.
///
/// # Errors
/// [`Error::Refused`] with the part that is no number with one of the units, that is missing, or that occurs twice; as [`plate::circuit`].
pub fn motor_file(text: &str) -> Result<String, Error> {
    let refused = |why: String| {
        let example = "for example: 750 W, 400 V, 1.86 A, 50 Hz, 1400 rpm";
        Err(Error::Refused(format!("nameplate: {why}; {example}")))
    };
    let mut file = format!("title = {}\n[nameplate]\n", toml::Value::from(text));
    let mut missing = UNITS.map(|(_, key, _)| key).to_vec();
    for part in text.split(", ").map(str::trim) {
        let end = part.find(|c: char| !c.is_ascii_digit() && !".,".contains(c));
        let (number, unit) = part.split_at(end.unwrap_or(part.len()));
        let number = number.replace(',', ".").parse::<f64>();
        let known = UNITS.iter().find(|(name, ..)| name.eq_ignore_ascii_case(unit.trim()));
        let (Ok(number), Some((_, key, factor))) = (number, known) else {
            return refused(format!("`{}` is no number in W, kW, V, A, Hz or rpm", cut(part)));
        };
        if !missing.contains(key) {
            return refused(format!("`{}` is a second {key}", cut(part)));
        }
        missing.retain(|other| other != key);
        file += &format!("{key} = {}\n", number * factor);
    }
    if !missing.is_empty() {
        return refused(format!("{} missing", missing.join(", ")));
    }
    let motor = Motor::from_text("nameplate.toml", &file)?;
    let mut config = Config::default();
    motor.apply(&mut config)?;
    config.drive.build().map_err(Error::refused)?;
    toml::to_string(&motor).map_err(|e| Error::Internal(e.to_string()))
}

/// Whether a key belongs to the nameplate.
fn of_plate(key: &str) -> bool {
    key.starts_with("nameplate.")
}

/// Whether a motor of this name is a user's file.
fn is_file(name: &str) -> bool {
    [".toml", ".json"].iter().any(|end| name.ends_with(end))
}

fn of_passport(name: &str, Passport { image, twin, .. }: Passport) -> Motor {
    let (name, about, source) = (name.to_owned(), String::new(), Vec::new());
    Motor { name, title: format!("passport, {image}"), about, source, settings: twin }
}

fn parse(name: &str, text: &str) -> Result<Motor, toml::de::Error> {
    Ok(Motor { name: name.to_owned(), ..toml::from_str(text)? })
}
