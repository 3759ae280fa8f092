//! The errata: claims and numbers of the sources that are wrong, each with the numbers that show it and the run that
//! computes them.

use std::sync::LazyLock;

use serde::Deserialize;

use super::{PRINTED, Printed, place_of};

/// An erratum.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// Heading of its table.
    pub group: String,
    /// `S0` or `S1`.
    pub source: String,
    /// The printed place, for the reader.
    pub place: String,
    /// The printed statement.
    pub printed: String,
    /// The correct statement, with `{}` for each of `numbers`.
    pub(super) holds: String,
    /// The printed values that differ because of this erratum: place, and quantity.
    #[serde(default)]
    pub(super) of: Vec<[String; 2]>,
    /// Beginnings of the places of printed means over random runs that differ because of this erratum, unless they lie within the
    /// spread over seeds.
    #[serde(default)]
    pub(super) means: Vec<String>,
    /// Basis of the finding: our value of `PLACE | QUANTITY`, `EXPERIMENT/METRIC`, or a formula of this source; and the
    /// number with the digits that are shown.
    #[serde(default)]
    pub(super) numbers: Vec<[String; 2]>,
    /// Tests that show it, if no number does: files of the repository.
    #[serde(default)]
    pub tests: Vec<String>,
}

/// Origin of the numbers of an erratum that needs no run.
pub const OWN: &str = "its own numbers";

#[derive(Deserialize)]
struct File {
    errata: Vec<Erratum>,
}

/// All errata, in the order of the page.
pub static ERRATA: LazyLock<Vec<Erratum>> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("../../source/errata.toml"))
        .expect("the errata are part of the program");
    file.errata
});

impl Erratum {
    /// Whether this printed value differs because of this erratum. A quantity `*` stands for all quantities of a place;
    /// a place that ends in `*` stands for all places that begin so.
    pub fn explains(&self, place: usize) -> bool {
        let printed = &PRINTED[place];
        let is_mean = |begin: &String| printed.place.starts_with(begin);
        self.of.iter().any(|of| self.names(of, printed))
            || self.source == printed.source && self.means.iter().any(is_mean)
    }

    /// Whether a row of `of` names this printed value.
    pub(super) fn names(&self, [place, quantity]: &[String; 2], printed: &Printed) -> bool {
        let here = match place.strip_suffix('*') {
            Some(begin) => printed.place.starts_with(begin),
            None => printed.place == *place,
        };
        here && self.source == printed.source && (quantity == "*" || *quantity == printed.quantity)
    }

    /// Returns the correct statement, with its numbers.
    pub fn holds(&self) -> String {
        let mut parts = self.holds.split("{}");
        let first = parts.next().unwrap_or_default().to_owned();
        parts.zip(&self.numbers).fold(first, |text, (part, [_, number])| text + number + part)
    }

    /// Returns the place of a number that is our value of a printed one.
    pub(super) fn place_of(&self, name: &str) -> Option<usize> {
        let (place, quantity) = name.split_once(" | ")?;
        place_of(&self.source, place, quantity)
    }
}

/// Formats a number with as many decimals as another one.
pub(super) fn rounded(value: f64, like: &str) -> String {
    let digits = like.split('e').next().unwrap_or(like);
    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let text = if like.contains('e') {
        format!("{value:.decimals$e}")
    } else {
        format!("{value:.decimals$}")
    };
    // A rounded zero has no sign.
    if text.chars().all(|c| "-0.".contains(c)) { text.replace('-', "") } else { text }
}
