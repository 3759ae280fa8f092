//! Printed values of the two sources and their errors: the lists of `hil-sim/lab/source`, and the verdict on a printed
//! value with ours beside it.
//!
//! S1 is Barroso 2017, S0 is Jacobina, Lima and Ribeiro 1996.

pub mod errata;
pub mod evidence;
pub mod formula;

use std::collections::HashMap;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Deserialize;
use sim_bench::outcome::Compared;

use errata::ERRATA;

/// The files, in the order of the page.
const FILES: [&str; 2] =
    [include_str!("../source/barroso-2017.toml"), include_str!("../source/jacobina-1996.toml")];

/// Role of a printed value in its source.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A rating, reading or specification that the source starts from.
    #[default]
    Input,
    /// A value that the source computed, designed, identified or measured.
    Result,
    /// A result that the source read off a graph.
    Graph,
    /// A statement that is true or false; its value is `yes` or `no`.
    Claim,
}

/// A printed value.
#[derive(Debug, Default)]
pub struct Printed {
    /// `S0` or `S1`.
    pub source: String,
    /// Number and name of the chapter or section.
    pub chapter: String,
    /// Short name of the chapter.
    id: String,
    /// Name in the program, if an experiment uses it; otherwise empty.
    name: String,
    /// The printed place: `Eq. 3.20`, `Table 6, 1.5 A`.
    pub place: String,
    /// Symbol or name.
    pub quantity: String,
    /// Unit as printed; may be empty.
    pub unit: String,
    /// The value with its digits.
    pub value: String,
    /// Its role in the source.
    pub kind: Kind,
    /// Formula by which it follows from other printed values.
    pub formula: Option<String>,
    /// Error in print beside the number, for example in its unit.
    slip: Option<String>,
    /// Whether an experiment or a formula has read the value from here.
    taken: AtomicBool,
}

/// A source. The single values of a chapter come before its tables.
#[derive(Deserialize)]
struct File {
    source: String,
    /// Quantities of the formulas, each computed from those before it.
    #[serde(default)]
    names: Vec<[String; 2]>,
    chapter: Vec<Chapter>,
}

#[derive(Deserialize)]
struct Chapter {
    /// Short name on the page.
    id: String,
    name: String,
    /// Place, quantity, unit, value, kind and name; formula, slip.
    #[serde(default)]
    printed: Vec<Vec<String>>,
    #[serde(default)]
    table: Vec<Cells>,
}

/// A printed table; the place of a cell consists of the place of the table and the head of the row.
#[derive(Deserialize)]
struct Cells {
    place: String,
    kind: Kind,
    /// Quantity, unit, and formula if there is one.
    columns: Vec<Vec<String>>,
    /// Head, followed by a value for each column.
    rows: Vec<Vec<String>>,
}

fn files() -> impl Iterator<Item = File> {
    FILES.into_iter().map(|text| toml::from_str(text).expect("the lists are part of the program"))
}

/// All printed values, in the order of the sources.
pub static PRINTED: LazyLock<Vec<Printed>> = LazyLock::new(|| {
    let mut all = Vec::new();
    for File { source, chapter, .. } in files() {
        for Chapter { id, name, printed, table } in chapter {
            let chapter = name;
            let mut add = |texts: [&str; 4], rest: Printed| {
                let [place, quantity, unit, value] = texts.map(str::to_owned);
                let (source, chapter, id) = (source.clone(), chapter.clone(), id.clone());
                all.push(Printed { source, chapter, id, place, quantity, unit, value, ..rest });
            };
            for row in &printed {
                let [place, quantity, unit, value, kind, more @ ..] = &row[..] else {
                    panic!("{chapter}: too few cells in {}", row.join(", "));
                };
                let (kind, name) = kind.split_once(' ').unwrap_or((kind, ""));
                let kind = toml::Value::from(kind).try_into();
                let kind = kind.expect("input, result, graph or claim");
                let [formula, slip] = [0, 1].map(|k| more.get(k).cloned());
                let name = name.to_owned();
                let rest = Printed { kind, name, formula, slip, ..Printed::default() };
                add([place, quantity, unit, value], rest);
            }
            for Cells { place, kind, columns, rows } in &table {
                for row in rows {
                    let place = format!("{place}, {}", row[0]);
                    for (column, value) in columns.iter().zip(&row[1..]) {
                        let formula =
                            column.get(2).map(|text| text.replace("{| ", &format!("{{{place} | ")));
                        let rest = Printed { kind: *kind, formula, ..Printed::default() };
                        add([&place, &column[0], &column[1], value], rest);
                    }
                }
            }
        }
    }
    all
});

/// The quantities of the formulas, by source.
static NAMES: LazyLock<HashMap<String, HashMap<String, f64>>> = LazyLock::new(|| {
    let of = |File { source, names, .. }: File| {
        let mut values = HashMap::new();
        for [name, formula] in names {
            let value = evaluate(&source, &formula, &values);
            values.insert(name, value.expect("the formulas are part of the program"));
        }
        (source, values)
    };
    files().map(of).collect()
});

/// Evaluates a formula of a source, which contains printed values, `{PLACE | QUANTITY}`, and names.
fn evaluate(source: &str, formula: &str, names: &HashMap<String, f64>) -> Option<f64> {
    formula::evaluate(formula, &|name| match name.split_once(" | ") {
        Some((place, quantity)) => PRINTED[place_of(source, place, quantity)?].take(),
        None => names.get(name).copied(),
    })
}

/// Evaluates a formula of a source.
pub fn value_of(source: &str, formula: &str) -> Option<f64> {
    evaluate(source, formula, &NAMES[source])
}

/// Returns the index of a value in [`PRINTED`].
pub fn place_of(source: &str, place: &str, quantity: &str) -> Option<usize> {
    let is_it = |p: &Printed| p.source == source && p.place == place && p.quantity == quantity;
    PRINTED.iter().position(is_it)
}

/// Returns a printed number, for an experiment that uses it.
///
/// # Panics
/// If the list has no such number: the lists are part of the program.
pub fn number(source: &str, place: &str, quantity: &str) -> f64 {
    let found = place_of(source, place, quantity).and_then(|found| PRINTED[found].take());
    found.unwrap_or_else(|| panic!("{source} prints no number at {place}, {quantity}"))
}

/// Returns a printed number of S1.
pub fn printed(place: &str, quantity: &str) -> f64 {
    number("S1", place, quantity)
}

/// Makes an entry for our value beside a printed value of S1.
pub fn beside(place: &str, quantity: &str) -> Compared {
    Compared::with("S1", place, quantity)
}

/// Makes an entry for our value beside the printed value of this name.
///
/// # Panics
/// If the list has no such name: the lists are part of the program.
pub fn named(name: &str) -> Compared {
    let found = PRINTED.iter().find(|printed| printed.name == name);
    let found = found.unwrap_or_else(|| panic!("no printed value is called {name}"));
    Compared::with(&found.source, &*found.place, &*found.quantity)
}

/// Returns the numbers of a column of a table, starting with the first row.
pub fn column(source: &str, table: &str, quantity: &str) -> Vec<f64> {
    let begins = format!("{table}, ");
    let is_in =
        |p: &&Printed| p.source == source && p.quantity == quantity && p.place.starts_with(&begins);
    PRINTED.iter().filter(is_in).filter_map(Printed::take).collect()
}

impl Printed {
    /// Returns the value as a number: 1 and 0 for `yes` and `no`; fractions are divided.
    pub fn number(&self) -> Option<f64> {
        match &*self.value {
            "yes" => Some(1.0),
            "no" => Some(0.0),
            value => value.parse().ok().or_else(|| formula::evaluate(value, &|_| None)),
        }
    }

    fn take(&self) -> Option<f64> {
        self.taken.store(true, Ordering::Relaxed);
        self.number()
    }

    /// Computes our value by its formula.
    fn recomputed(&self) -> Option<f64> {
        value_of(&self.source, self.formula.as_deref()?)
    }

    /// Whether our value equals the printed value within this share of a unit of its last digit.
    fn agrees(&self, ours: f64, units: f64) -> bool {
        let exact = self.kind == Kind::Claim || self.value.contains('/');
        let bound = if exact { 1e-9 } else { units * self.last_digit() };
        self.number().is_some_and(|printed| (ours - printed).abs() <= bound)
    }

    /// Whether the constant of the program equals the printed value: to its last digit, or to single precision if that has fewer digits.
    fn is_used(&self, used: f64) -> bool {
        self.agrees(used, 0.501)
            || self.number().is_some_and(|printed| (used / printed - 1.0).abs() < SINGLE)
    }

    /// Returns one unit of the last printed digit. For a whole number it is 1, regardless of trailing zeros.
    fn last_digit(&self) -> f64 {
        let (digits, exponent) = self.value.split_once('e').unwrap_or((&self.value, "0"));
        let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        10f64.powi(exponent.parse::<i32>().unwrap_or(0) - decimals as i32)
    }
}

/// Comparison of a printed value with ours.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Equal to the last printed digit.
    Equal,
    /// Equal except for this.
    EqualBut(String),
    /// Different; this row of [`ERRATA`] explains it.
    Differs(usize),
    /// Different; the source does not state this quantity.
    Unknown(&'static str),
    /// A mean of random runs: our value divided by the printed one, and its range over seeds.
    Statistics {
        /// Our value divided by the printed one.
        factor: f64,
        /// Smallest and largest value over seeds.
        seeds: [f64; 2],
    },
    /// Nothing is compared, or the difference is not explained.
    None,
}

/// Relative precision of constants and filter sections in `f32`.
const SINGLE: f64 = 1e-5;
/// Relative difference within which a value that was read off a graph counts as equal.
const GRAPH: f64 = 0.02;

/// Returns the verdict on a printed value. An input or a reading that is taken from the list needs no value beside it.
pub fn verdict(place: usize, ours: &Compared) -> Verdict {
    let printed = &PRINTED[place];
    let taken =
        matches!(printed.kind, Kind::Input | Kind::Graph) && printed.taken.load(Ordering::Relaxed);
    let value = match printed.kind {
        Kind::Input => ours.used.or(ours.value()),
        _ => ours.value(),
    };
    let Some(value) = value.filter(|_| ours.used.is_none_or(|used| printed.is_used(used))) else {
        return match (ours.unknown, ours.used) {
            (Some(what), None) => Verdict::Unknown(what),
            (None, None) if taken => Verdict::Equal,
            _ => Verdict::None,
        };
    };
    let ratio = printed.number().map_or(f64::NAN, |printed| value / printed);
    let off = (ratio - 1.0).abs();
    // Our value is rounded as well.
    if printed.agrees(value, 0.501) {
        return printed.slip.clone().map_or(Verdict::Equal, Verdict::EqualBut);
    }
    if let Some((what, _)) = ours.but.filter(|(_, share)| off < *share) {
        return Verdict::EqualBut(what.to_owned());
    }
    if let Some([low, high]) = ours.seeds {
        let printed = value / ratio;
        return Verdict::Statistics { factor: ratio, seeds: [low / printed, high / printed] };
    }
    if let Some(row) = ERRATA.iter().position(|row| row.explains(place)) {
        return Verdict::Differs(row);
    }
    match ours.unknown {
        Some(what) => Verdict::Unknown(what),
        None if printed.kind == Kind::Graph && off <= GRAPH => {
            Verdict::EqualBut(format!("read off a graph, {:.1} %", 100.0 * off))
        }
        None if printed.kind != Kind::Claim && printed.agrees(value, 1.0) => {
            Verdict::EqualBut("rounding".to_owned())
        }
        None => Verdict::None,
    }
}

impl Verdict {
    /// Heads of the counts on the first page.
    pub const NAMES: [&str; 6] = [
        "equal",
        "equal but for unit or rounding",
        "differs, follows from",
        "differs, cannot be known",
        "statistics",
        "none",
    ];

    /// Returns the index in [`Self::NAMES`].
    pub fn number(&self) -> usize {
        match self {
            Self::Equal => 0,
            Self::EqualBut(_) => 1,
            Self::Differs(_) => 2,
            Self::Unknown(_) => 3,
            Self::Statistics { .. } => 4,
            Self::None => 5,
        }
    }

    /// Describes the verdict in words.
    pub fn text(&self) -> String {
        match self {
            Self::Equal | Self::None => Self::NAMES[self.number()].to_owned(),
            Self::EqualBut(what) => format!("equal but for: {what}"),
            Self::Differs(row) => format!("differs, erratum {}", row + 1),
            Self::Unknown(what) => format!("cannot be known: the source does not state {what}"),
            Self::Statistics { factor, seeds: [low, high] } => {
                format!("statistics: {factor:.2} of printed, {low:.2} to {high:.2} over seeds")
            }
        }
    }
}
