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
    /// A fact about the equipment, from which no other value follows.
    Bench,
}

/// A printed value.
#[derive(Debug, Default)]
pub struct Printed {
    /// `S0` or `S1`.
    pub source: &'static str,
    /// Number and name of the chapter or section.
    pub chapter: &'static str,
    /// Short name of the chapter.
    id: &'static str,
    /// Conditions of our values in this chapter; may be empty.
    ours: &'static str,
    /// Name in the program, if an experiment uses it; otherwise empty.
    name: &'static str,
    /// The printed place: `Eq. 3.20`, `Table 6, 1.5 A`.
    pub place: String,
    /// Symbol or name.
    pub quantity: &'static str,
    /// Unit as printed; may be empty.
    pub unit: &'static str,
    /// The value with its digits.
    pub value: String,
    /// Its role in the source.
    pub kind: Kind,
    /// Formula by which it follows from other printed values.
    pub formula: Option<String>,
    /// Error in print beside the number, for example in its unit.
    slip: Option<&'static str>,
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
    /// Short name of the chapter of each figure, by number.
    figures: HashMap<String, String>,
    chapter: Vec<Chapter>,
}

#[derive(Deserialize)]
struct Chapter {
    /// Short name on the page.
    id: String,
    name: String,
    /// Conditions of our values, for the head of the table.
    #[serde(default)]
    ours: String,
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

static SOURCES: LazyLock<[File; 2]> = LazyLock::new(|| {
    FILES.map(|text| toml::from_str(text).expect("the lists are part of the program"))
});

/// All printed values, in the order of the sources.
pub static PRINTED: LazyLock<Vec<Printed>> = LazyLock::new(|| {
    let mut all = Vec::new();
    for File { source, chapter, .. } in &*SOURCES {
        for Chapter { id, name: chapter, ours, printed, table } in chapter {
            let here = || Printed { source, chapter, id, ours, ..Printed::default() };
            for row in printed {
                let [place, quantity, unit, value, kind, more @ ..] = &row[..] else {
                    panic!("{chapter}: too few cells in {}", row.join(", "));
                };
                let (place, value) = (place.clone(), value.clone());
                let (kind, name) = kind.split_once(' ').unwrap_or((kind, ""));
                let kind = toml::Value::from(kind).try_into();
                let kind = kind.expect("input, result, graph, claim or bench");
                let [formula, slip] = [0, 1].map(|k| more.get(k));
                let (formula, slip) = (formula.cloned(), slip.map(String::as_str));
                let row =
                    Printed { place, quantity, unit, value, kind, name, formula, slip, ..here() };
                all.push(row);
            }
            for &Cells { ref place, kind, ref columns, ref rows } in table {
                for row in rows {
                    let head = format!("{place}, {}", row[0]);
                    for (column, value) in columns.iter().zip(&row[1..]) {
                        let (quantity, unit) = (&column[0], &column[1]);
                        let (place, value) = (head.clone(), value.clone());
                        let of_row = |text: &String| text.replace("{| ", &format!("{{{head} | "));
                        let formula = column.get(2).map(of_row);
                        all.push(Printed { place, quantity, unit, value, kind, formula, ..here() });
                    }
                }
            }
        }
    }
    all
});

/// The chapter of each figure, by source and number.
pub(crate) static FIGURES: LazyLock<HashMap<String, &str>> = LazyLock::new(|| {
    let of = |File { source, figures, .. }: &'static File| {
        figures.iter().map(move |(number, id)| (format!("{source} {number}"), &**id))
    };
    SOURCES.iter().flat_map(of).collect()
});

/// The quantities of the formulas, by source.
static NAMES: LazyLock<HashMap<&str, HashMap<&str, f64>>> = LazyLock::new(|| {
    let of = |File { source, names, .. }: &'static File| {
        let mut values = HashMap::new();
        for [name, formula] in names {
            let value = evaluate(source, formula, &values);
            values.insert(&**name, value.expect("the formulas are part of the program"));
        }
        (&**source, values)
    };
    SOURCES.iter().map(of).collect()
});

/// Evaluates a formula of a source, which contains printed values, `{PLACE | QUANTITY}`, and names.
fn evaluate(source: &str, formula: &str, names: &HashMap<&str, f64>) -> Option<f64> {
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
    Compared::with(found.source, &*found.place, found.quantity)
}

/// Makes entries for the constants that the program uses for printed values: place, quantity, constant.
pub fn used<const N: usize>(source: &'static str, all: [(&str, &str, f64); N]) -> [Compared; N] {
    all.map(|(place, quantity, used)| Compared::with(source, place, quantity).used(used))
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

    /// Returns the head of the table of its chapter, with the conditions of our values.
    fn head(&self) -> String {
        format!("Printed values and ours{}", self.ours)
    }

    fn take(&self) -> Option<f64> {
        self.taken.store(true, Ordering::Relaxed);
        self.number()
    }

    /// Computes our value by its formula.
    fn recomputed(&self) -> Option<f64> {
        value_of(self.source, self.formula.as_deref()?)
    }

    /// Whether our value equals the printed value within this share of a unit of its last digit.
    fn agrees(&self, ours: f64, units: f64) -> bool {
        let exact = self.kind == Kind::Claim || self.value.contains('/');
        let bound = if exact { 1e-9 } else { units * self.last_digit() };
        self.number().is_some_and(|printed| (ours - printed).abs() <= bound)
    }

    /// Whether the constant of the program equals the printed value to single precision.
    fn is_used(&self, used: f64) -> bool {
        let bound = |printed: f64| if printed == 0.0 { SINGLE } else { SINGLE * printed.abs() };
        self.number().is_some_and(|printed| (used - printed).abs() < bound(printed))
    }

    /// Returns one unit of the last printed digit. For a whole number it is 1, regardless of trailing zeros.
    fn last_digit(&self) -> f64 {
        let (digits, exponent) = self.value.split_once('e').unwrap_or((&self.value, "0"));
        let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        10f64.powi(exponent.parse::<i32>().unwrap_or(0) - decimals as i32)
    }
}

/// Class of a comparison of a printed value with ours, from the best to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// Equal to the last printed digit.
    Equal,
    /// Equal except for what the text says.
    EqualBut,
    /// An input of a formula or of a run, with nothing beside it.
    Input,
    /// Different; an erratum explains it.
    Differs,
    /// Different, but the source does not state a quantity on which the value depends.
    Unknown,
    /// A mean of random runs that lies within the spread of ours over seeds.
    WithinSpread,
    /// Nothing is compared, or the difference is not explained.
    None,
}

impl Class {
    /// Heads of the counts on the first page.
    pub const NAMES: [&str; 7] = [
        "equal",
        "equal but for unit or last digits",
        "input",
        "differs, follows from",
        "differs, cannot be known",
        "within the spread over seeds",
        "none",
    ];

    fn named(self) -> Verdict {
        (self, Self::NAMES[self as usize].to_owned())
    }
}

/// Class of a comparison, and the comparison in words.
pub type Verdict = (Class, String);

/// Relative precision of constants and filter sections in `f32`.
const SINGLE: f64 = 1e-5;
/// Relative difference within which a value that was read off a graph counts as equal.
const GRAPH: f64 = 0.02;

/// Returns the verdict on a printed value: the worse one if it was both recomputed and simulated. An input or a reading that is
/// taken from the list needs no value beside it.
pub fn verdict(place: usize, ours: &Compared) -> Verdict {
    let printed = &PRINTED[place];
    let is_input = matches!(printed.kind, Kind::Input | Kind::Graph);
    let judged = [ours.recomputed, ours.simulated].into_iter().flatten();
    let worst = judged.map(|value| judge(place, ours, value)).max();
    match (worst, ours.used, ours.unknown) {
        (_, Some(used), _) if !printed.is_used(used) => Class::None.named(),
        (Some(worst), ..) => worst,
        (None, Some(_), _) => Class::Equal.named(),
        (None, None, Some(what)) => unknown(what),
        _ if printed.kind == Kind::Bench => (Class::Input, "equipment".to_owned()),
        _ if is_input && printed.taken.load(Ordering::Relaxed) => Class::Input.named(),
        _ => Class::None.named(),
    }
}

fn unknown(what: &str) -> Verdict {
    (Class::Unknown, format!("cannot be known: the source does not state {what}"))
}

/// Returns the verdict on a printed value by one value of ours.
fn judge(place: usize, ours: &Compared, value: f64) -> Verdict {
    let printed = &PRINTED[place];
    let number = printed.number().unwrap_or(f64::NAN);
    let off = (value / number - 1.0).abs();
    let equal_but = |what: &str| (Class::EqualBut, format!("equal but for: {what}"));
    // Our value is rounded as well.
    if printed.agrees(value, 0.501) {
        return printed.slip.map_or(Class::Equal.named(), equal_but);
    }
    if let Some((what, _)) = ours.but.filter(|(_, share)| off < *share) {
        return equal_but(what);
    }
    if let Some([low, high]) = ours.seeds.filter(|[low, high]| (*low..=*high).contains(&number)) {
        let spread = format!("{:.2} to {:.2} of printed", low / number, high / number);
        return (Class::WithinSpread, format!("within the spread over seeds: {spread}"));
    }
    if let Some(row) = ERRATA.iter().position(|row| row.explains(place)) {
        return (Class::Differs, format!("differs, erratum {}", row + 1));
    }
    match ours.unknown {
        Some(what) => unknown(what),
        None if printed.kind == Kind::Graph && off <= GRAPH => {
            equal_but(&format!("read off a graph, {:.1} %", 100.0 * off))
        }
        None => Class::None.named(),
    }
}
