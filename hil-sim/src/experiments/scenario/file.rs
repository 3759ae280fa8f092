//! Scenarios in files: a TOML file, or the rows of a CSV file.

use toml::Spanned;

use super::quantity::Named;
use super::{Part, REFERENCES, Reference, Scenario, Shaft};
use crate::columns::Columns;
use crate::config::flattened;
use crate::error::{cut, parser_text, unknown};
use crate::experiments::course::Ramp;
use crate::prelude::*;

impl Ramp {
    /// Reads a number, or two in a list.
    fn of(value: &toml::Value) -> Option<Self> {
        let number = |value: &toml::Value| {
            let whole = value.as_integer().map(|whole| whole as f64);
            value.as_float().or(whole).filter(|number| number.is_finite())
        };
        match value {
            toml::Value::Array(two) if two.len() == 2 => {
                Some(Self(number(&two[0])?, number(&two[1])?))
            }
            one => number(one).map(|value| Self(value, value)),
        }
    }
}

/// The columns of a part: references of the drive, and the shaft. A CSV file has the first five.
#[rustfmt::skip] // one a line
static COLUMNS: [(&str, Result<&Reference, Shaft>); 7] = [
    ("torque_current_a", Ok(&REFERENCES[0])),
    ("speed_rpm", Ok(&REFERENCES[1])),
    ("position_turns", Ok(&REFERENCES[2])),
    ("load_nm", Err(Shaft::Free)),
    ("load_rpm", Err(Shaft::Held)),
    ("torque_current", Ok(&REFERENCES[0])),
    ("load", Err(Shaft::Free)),
];
const IN_ROWS: usize = 5;

/// The number that a metric computes from the values of a quantity.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Statistic {
    /// Root of the mean square.
    #[default]
    Rms,
    /// Mean.
    Mean,
    /// Largest magnitude.
    Largest,
    /// Largest value.
    Highest,
    /// Last value.
    Last,
    /// Excess of the highest value over the last reference, %.
    Overshoot,
    /// Last time at which the magnitude was beyond `within`, s.
    Settling,
    /// Largest amplitude at the injection frequency in half a second.
    AtInjection,
}

/// The samples that count.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Over {
    /// All of them.
    #[default]
    All,
    /// From half a second after the first reference, or a tenth of the run if it is shorter than five seconds.
    AfterStart,
    /// The last half second of each part.
    Settled,
}

/// A number that is computed from the values of a quantity.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metric {
    /// Name for programs; a bound has none.
    #[serde(default)]
    pub name: String,
    /// The quantity.
    pub of: Named,
    /// The number.
    #[serde(default)]
    pub statistic: Statistic,
    /// The samples that count.
    #[serde(default)]
    pub over: Over,
    /// The band for [`Statistic::Settling`]; for a bound, the largest magnitude.
    #[serde(default)]
    pub within: f64,
}

/// A line of a panel.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// The quantity.
    pub of: Named,
    /// Name in the legend.
    #[serde(default)]
    pub name: String,
    /// Whether it is drawn as a reference.
    #[serde(default)]
    pub dashed: bool,
}

/// Axes.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanelText {
    /// Label; if it is not given, the label of the first line.
    pub label: Option<String>,
    /// Whether the panel is shown only with the synchronous demodulation, or only with others.
    pub synchronous: Option<bool>,
    /// The lines.
    pub lines: Vec<Line>,
}

/// A file.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Text {
    part: Vec<BTreeMap<Spanned<String>, Spanned<toml::Value>>>,
    settings: BTreeMap<String, Spanned<toml::Value>>,
    /// Whether the values are for the dissertation's motor and scale in proportion on others.
    pub in_proportion: bool,
    /// Load whose multiples the parts state, unless `load.torque_nm` is set; Nm.
    pub load_nm: f64,
    /// Whether means over the second half of each constant part are listed.
    pub levels: bool,
    /// Numbers for programs.
    pub metrics: Option<Vec<Metric>>,
    /// Bounds; a run that exceeds one is lost.
    pub judge: Option<Vec<Metric>>,
    /// Name of the figure for programs, its title, and the part of the source that it reproduces.
    pub figure: String,
    /// See `figure`.
    pub title: String,
    /// See `figure`.
    pub source: String,
    /// Its panels, and quantities that have their own panel.
    pub panel: Vec<PanelText>,
    /// See `panel`.
    pub columns: Vec<Named>,
    /// Number of samples whose mean is a point; 0 for the samples of an injection period.
    pub samples: usize,
    /// Remarks for the reader; `{KEY}` is the value of a key, `{load_nm}` the load.
    pub remarks: Vec<String>,
}

impl Text {
    /// Fills keys that the file does not give from `usual.toml`, for a reference of this name.
    fn completed(mut self, column: &str) -> Result<Self, Error> {
        let (quantity, unit) = column.rsplit_once('_').unwrap_or((column, ""));
        let usual = include_str!("../../../scenarios/usual.toml").replace("{column}", column);
        let usual = usual.replace("{error}", &format!("{quantity}_error_rms_{unit}"));
        let usual: Self = toml::from_str(&usual).map_err(|e| Error::Internal(e.to_string()))?;
        self.metrics = self.metrics.or(usual.metrics);
        self.judge = self.judge.or(usual.judge);
        if self.figure.is_empty() {
            (self.figure, self.title) = (usual.figure, usual.title);
        }
        if self.panel.is_empty() && self.columns.is_empty() {
            (self.panel, self.columns) = (usual.panel, usual.columns);
            self.columns.retain(|of| of.0.name != column);
        }
        Ok(self)
    }
}

impl Scenario {
    /// Reads a TOML file; the configuration determines the scale of its values.
    ///
    /// # Errors
    /// [`Error::Data`] with the line.
    pub fn read(path: &Path, config: &Config) -> Result<Self, Error> {
        let failed = |e: std::io::Error| Error::data(path, None, e.to_string());
        Self::of_toml(path, &bounded::text(path).map_err(failed)?, config)
    }

    /// Reads the text of a TOML file.
    ///
    /// # Errors
    /// [`Error::Data`] with the line.
    pub fn of_toml(path: &Path, text: &str, config: &Config) -> Result<Self, Error> {
        let at = |offset: usize, problem: String| {
            Error::data(path, Some(1 + text[..offset].matches('\n').count() as u64), problem)
        };
        let mut text: Text = toml::from_str(text)
            .map_err(|e| at(e.span().unwrap_or_default().start, parser_text(e.message())))?;
        let (parts, settings) =
            (std::mem::take(&mut text.part), std::mem::take(&mut text.settings));
        let mut scenario = Self { text, ..Self::default() };
        for text in parts {
            let mut part = scenario.next();
            for (key, value) in &text {
                let problem = |problem| at(key.span().start, problem);
                scenario.set(&mut part, config, key.get_ref(), value.get_ref()).map_err(problem)?;
            }
            let place = text.keys().next().map_or(0, |key| key.span().start);
            let has = |name: &&str| text.keys().any(|key| key.get_ref() == *name);
            for two in [["torque_current_a", "torque_current"], ["load_nm", "load"]] {
                if two.iter().all(has) {
                    return Err(at(place, format!("{} exclude each other", two.join(" and "))));
                }
            }
            if part.seconds == 0.0 {
                return Err(at(place, "a part without `seconds`".into()));
            }
            scenario.parts.push(part);
        }
        for (name, value) in settings {
            let place = value.span().start;
            for (name, value) in flattened(&toml::Table::from_iter([(name, value.into_inner())])) {
                Config::default().set(&name, &value).map_err(|e| at(place, e.to_string()))?;
                scenario.settings.push((name, value));
            }
        }
        let reference = scenario.reference.ok_or_else(|| {
            Error::data(path, None, format!("no [[part]] gives a reference: {}", references()))
        })?;
        let last = scenario.next().begin;
        check_time(last).map_err(|problem| Error::data(path, None, problem))?;
        Ok(Self { text: scenario.text.completed(reference.column)?, ..scenario })
    }

    /// Reads the rows of a CSV file. The values follow straight lines between the rows; two rows of the same time are a step.
    ///
    /// # Errors
    /// [`Error::Data`] with the line.
    pub fn of_csv(path: &Path, config: &Config) -> Result<Self, Error> {
        let columns = Columns::read(path)?;
        let names = &COLUMNS.each_ref().map(|column| column.0)[..IN_ROWS];
        columns.only(&[&["time_s"], names].concat())?;
        let time = columns.need("time_s")?;
        let given: Vec<_> =
            names.iter().filter_map(|name| Some((*name, columns.get(name)?))).collect();
        let is_reference = |name: &str| REFERENCES.iter().any(|known| known.column == name);
        if given.iter().filter(|(name, _)| is_reference(name)).count() != 1 {
            let names = references();
            return Err(
                columns.error(format!("one of the columns {names} must be there, and only one"))
            );
        }
        if columns.len() < 2 {
            return Err(columns.error(format!("{} rows; a profile has two or more", columns.len())));
        }
        if time[0] != 0.0 {
            return Err(columns.at(1, format!("time_s = {}; the first row is at 0", time[0])));
        }
        if time[time.len() - 1] == 0.0 {
            return Err(columns.error("all rows are at the time 0".into()));
        }
        check_time(time[time.len() - 1])
            .map_err(|problem| columns.at(time.len(), format!("column time_s: {problem}")))?;
        let mut scenario = Self { from_rows: true, ..Self::default() };
        for row in 1..time.len() {
            let (this, before) = (time[row], time[row - 1]);
            if this < before {
                return Err(columns
                    .at(row + 1, format!("time_s = {this} after {before}: it must not decrease")));
            }
            let mut part = Part { begin: before, seconds: this - before, ..scenario.next() };
            for (name, values) in &given {
                let ramp = Ramp(values[row - 1], values[row]);
                let ramp = scenario.in_units(config, name, ramp);
                scenario.put(&mut part, name, ramp).map_err(|e| columns.error(e))?;
            }
            scenario.parts.push(part);
        }
        let text = Text::default().completed(scenario.reference().column)?;
        Ok(Self { text, ..scenario })
    }

    /// Makes a part after the others, with their last values.
    fn next(&self) -> Part {
        let Some(last) = self.parts.last() else { return Part::default() };
        let stays = |Ramp(_, value)| Ramp(value, value);
        let (reference, load) = (stays(last.reference), stays(last.load));
        Part { begin: last.begin + last.seconds, reference, load, ..Part::default() }
    }

    /// Reads a key of a part.
    fn set(
        &mut self,
        part: &mut Part,
        config: &Config,
        name: &str,
        value: &toml::Value,
    ) -> Result<(), String> {
        let (text, ramp) = (value.as_str(), Ramp::of(value));
        let wrong =
            |allowed: &str| format!("{name} = {}; allowed: {allowed}", cut(&value.to_string()));
        match (name, text) {
            ("seconds", _) => {
                let seconds = ramp.filter(|ramp| ramp.0 > 0.0 && ramp.1 == ramp.0);
                part.seconds = seconds.ok_or_else(|| wrong("a time of more than 0 s"))?.0;
            }
            ("start", _) => part.start = value.as_bool().ok_or_else(|| wrong("true, false"))?,
            ("stop", Some("coast")) => part.stop = Some(Stop::Coast),
            ("stop", Some("ramp")) => part.stop = Some(Stop::Ramp),
            ("stop", Some("quick")) => part.stop = Some(Stop::Quick),
            ("stop", Some("now")) => part.stop = Some(Stop::Now),
            ("stop", _) => return Err(wrong("coast, ramp, quick, now")),
            _ => {
                let known = COLUMNS.iter().map(|column| column.0);
                if !known.clone().any(|known| known == name) {
                    let known: Vec<_> = known.chain(["seconds", "start", "stop"]).collect();
                    return Err(unknown("column", name, &known));
                }
                let ramp = ramp.ok_or_else(|| wrong("a finite number, or two of them: [FROM, TO]"));
                self.put(part, name, self.in_units(config, name, ramp?))?;
            }
        }
        Ok(())
    }

    fn in_units(&self, config: &Config, column: &str, Ramp(from, to): Ramp) -> Ramp {
        Ramp(self.scaled(config, column, from), self.scaled(config, column, to))
    }

    /// Puts the value of a column into a part. All parts regulate the same quantity, and have the same kind of shaft.
    fn put(&mut self, part: &mut Part, name: &str, value: Ramp) -> Result<(), String> {
        match COLUMNS.iter().find(|column| column.0 == name).map(|column| column.1) {
            Some(Ok(reference)) => {
                let before = self.reference.get_or_insert(reference).column;
                if before != reference.column {
                    return Err(format!("{before} and {name} exclude each other"));
                }
                part.reference = value;
            }
            Some(Err(shaft)) => {
                if ![Shaft::AsSet, shaft].contains(&self.shaft) {
                    return Err("load_nm and load_rpm exclude each other: a shaft turns freely against a torque, or its speed is held".into());
                }
                (self.shaft, part.load) = (shaft, value);
            }
            None => {}
        }
        Ok(())
    }
}

/// Lists the names of the references.
fn references() -> String {
    REFERENCES.each_ref().map(|reference| reference.column).join(", ")
}

/// Checks the total time of a run, of which every sample is stored, against the range of the key `seconds`.
fn check_time(seconds: f64) -> Result<(), String> {
    match Config::default().set("seconds", seconds) {
        Err(Error::Value { value, problem, allowed, .. }) => Err(format!(
            "the whole time = {value} s: {problem}; allowed: {allowed}. Are the times in milliseconds?"
        )),
        _ => Ok(()),
    }
}
