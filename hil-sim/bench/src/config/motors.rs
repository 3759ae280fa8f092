//! The motors that come with the program: one file a motor in the folder `motors`, every number with its source.
//!
//! A file holds settings under the names of the keys ([`super`]), a title, a text, and sources. See the page
//! "Motors" of the documentation.

use std::path::Path;

use include_dir::{Dir, include_dir};
use serde::{Deserialize, Serialize};

use super::passport::Passport;
use super::{Config, Key, Value, alias, flattened};
use crate::bounded;
use crate::error::{Error, cut, parser_text};

/// The folder `motors`, which `build.rs` finds.
static FILES: Dir<'static> = include_dir!("$MOTORS");

/// What a file of one's own must say, because no rule gives it and nothing of another motor may stand in for it.
pub const NEEDED: &str = "nameplate.power_w nameplate.voltage_v nameplate.current_a nameplate.frequency_hz nameplate.speed_rpm \
    motor.r_s motor.r_r motor.l_ls motor.l_lr motor.l_m motor.pole_pairs inverter.dc_link_v";

/// The text of a file of `motors/measured`: what others have measured on a motor.
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
    /// The keys whose values come from here.
    pub keys: Vec<String>,
    /// Publication, file and line, and how the values were converted.
    pub from: String,
    /// The values are recalled: nobody has looked them up.
    #[serde(default)]
    pub unverified: bool,
}

/// A motor with the inverter and the sensors that suit it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Motor {
    /// Name on the command line: that of the file; with `.toml` for a file of one's own, with `.json` for a passport.
    #[serde(skip)]
    pub name: String,
    /// Rated data in a line.
    #[serde(default)]
    pub title: String,
    /// The motor, and what is special about it.
    #[serde(default)]
    pub about: String,
    /// Where the numbers come from; a file of one's own need not say it.
    #[serde(default)]
    pub source: Vec<Source>,
    /// The settings, in groups.
    #[serde(flatten)]
    settings: toml::Table,
}

impl Motor {
    /// All motors that come with the program, by name.
    pub fn all() -> Vec<Self> {
        let mut all: Vec<Self> = FILES.files().filter_map(|file| embedded(file.path())).collect();
        all.sort_by(|a, b| a.name.cmp(&b.name));
        all
    }

    /// The motor with this name, or of this file when the name ends in `.toml`, or, a passport, in `.json`.
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
                false => parse(name, &text).map_err(|e| failed(parser_text(e))),
            };
        }
        let all = Self::all();
        let names = || all.iter().map(|motor| motor.name.as_str());
        let found = all.iter().find(|motor| motor.name == name);
        found.cloned().ok_or_else(|| Error::unknown("motor", name, names()))
    }

    /// The motor of a text in the form of the files.
    ///
    /// # Errors
    /// [`Error::Refused`] when it is not of that form.
    pub fn from_text(name: &str, text: &str) -> Result<Self, Error> {
        parse(name, text).map_err(|e| Error::Refused(parser_text(e)))
    }

    /// The keys that the file sets, with their values.
    pub fn settings(&self) -> Vec<(String, Value)> {
        flattened(&self.settings)
    }

    /// The source of a key.
    pub fn source_of(&self, key: &str) -> Option<&Source> {
        self.source.iter().find(|source| source.keys.iter().any(|known| known == key))
    }

    /// Whether it is a file of one's own; the others come with the program.
    fn is_own(&self) -> bool {
        is_file(&self.name)
    }

    /// Sets the keys of the file, and those that it leaves to [`implied`](Self::implied).
    ///
    /// # Errors
    /// As [`Config::set`]; [`Error::Refused`] when a number that comes with the program has no source, when one has two,
    /// and with all that a file of one's own must say and does not.
    pub fn apply(&self, config: &mut Config) -> Result<(), Error> {
        let (settings, name) = (self.settings(), &self.name);
        let missing: Vec<_> =
            NEEDED.split(' ').filter(|key| self.is_own() && !self.says(key)).collect();
        if !missing.is_empty() {
            let missing = missing.join(", ");
            return Err(Error::Refused(format!("motor {name}: these are missing: {missing}")));
        }
        for (key, value) in settings {
            let sources = self.source.iter().flat_map(|source| &source.keys);
            let count = sources.filter(|known| **known == key).count();
            if count > 1 || count == 0 && !self.is_own() {
                let why = format!("{} has {count} sources; one [[source]] must name it", cut(&key));
                return Err(Error::Refused(format!("motor {name}: {why}")));
            }
            config.set(&key, &value)?;
        }
        self.implied(config).into_iter().try_for_each(|(key, value, _)| config.set(key, &value))
    }

    /// Whether the file sets a key.
    fn says(&self, key: &str) -> bool {
        self.settings().iter().any(|(name, value)| alias::today(name, value).0 == key)
    }

    /// The keys that the file does not set and that follow, with the reason; of one that comes with the program those alone that a
    /// commissioned drive has.
    pub fn implied(&self, config: &Config) -> Vec<(&'static str, Value, &'static str)> {
        let (base, four_digits) = (Config::default(), |value: f64| {
            Value::Number(format!("{value:.3e}").parse().unwrap_or(value))
        });
        let range_a = four_digits(config.amperes(base.measurement.range_a));
        let inertia = four_digits(base.motor.inertia * config.rated_nm() / base.rated_nm());
        let flux = if self.says("sequence.i_d") { "sequence.i_d" } else { "sequence.flux" };
        let word = |word: &str| Value::Word(word.to_owned());
        let commissioned = "by rule: as a commissioned drive has it";
        let all = [
            ("current_plant", word("motor"), commissioned),
            (flux, word("high"), commissioned),
            ("measurement.range_a", range_a, "by rule: 1.24 times the rated current, peak"),
            ("motor.inertia", inertia, "assumed: in proportion to the rated torque"),
            ("prepare.learn", Value::Switch(true), "by rule: the drive has not learned this motor"),
        ];
        let of_all = |reason| self.is_own() || reason == commissioned;
        all.into_iter().filter(|(key, _, reason)| of_all(*reason) && !self.says(key)).collect()
    }

    /// The lines that set the drive to this motor at the console.
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

/// Whether a motor of this name is a file of one's own.
fn is_file(name: &str) -> bool {
    [".toml", ".json"].iter().any(|end| name.ends_with(end))
}

fn of_passport(name: &str, Passport { image, twin, .. }: Passport) -> Motor {
    let (name, about, source) = (name.to_owned(), String::new(), Vec::new());
    Motor { name, title: format!("passport, {image}"), about, source, settings: twin }
}

fn embedded(path: &Path) -> Option<Motor> {
    let name = path.file_stem()?.to_str()?;
    // Every file is parsed by a test.
    parse(name, FILES.get_file(path)?.contents_utf8()?).ok()
}

fn parse(name: &str, text: &str) -> Result<Motor, toml::de::Error> {
    Ok(Motor { name: name.to_owned(), ..toml::from_str(text)? })
}
