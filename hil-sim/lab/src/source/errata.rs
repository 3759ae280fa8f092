//! The errata: claims and numbers of the sources that do not hold, each with the numbers that show it and the run that
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
    /// Where it stands, for the reader.
    pub place: String,
    /// What is printed.
    pub printed: String,
    /// What holds, with `{}` for each of `numbers`.
    pub(super) holds: String,
    /// The printed values that differ by it: place, and quantity.
    #[serde(default)]
    pub(super) of: Vec<[String; 2]>,
    /// What the finding rests on: ours of `PLACE | QUANTITY`, `EXPERIMENT/METRIC`, or a
    /// formula of this source; and the number with the
    /// digits that are shown.
    #[serde(default)]
    pub(super) numbers: Vec<[String; 2]>,
    /// Tests that show it, where no number does: files of the repository.
    #[serde(default)]
    pub tests: Vec<String>,
}

/// What gives the numbers of an erratum that needs no run.
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
    /// Whether this printed value differs by it. A quantity `*` stands for all of a place, a place that ends in `*` for all that
    /// begin so.
    pub fn explains(&self, place: usize) -> bool {
        self.of.iter().any(|of| self.names(of, &PRINTED[place]))
    }

    /// Whether a row of `of` names this printed value.
    pub(super) fn names(&self, [place, quantity]: &[String; 2], printed: &Printed) -> bool {
        let here = match place.strip_suffix('*') {
            Some(begin) => printed.place.starts_with(begin),
            None => printed.place == *place,
        };
        here && self.source == printed.source && (quantity == "*" || *quantity == printed.quantity)
    }

    /// What holds, with its numbers.
    pub fn holds(&self) -> String {
        let mut parts = self.holds.split("{}");
        let first = parts.next().unwrap_or_default().to_owned();
        parts.zip(&self.numbers).fold(first, |text, (part, [_, number])| text + number + part)
    }

    /// The place of a number that is ours of a printed value.
    pub(super) fn place_of(&self, name: &str) -> Option<usize> {
        let (place, quantity) = name.split_once(" | ")?;
        place_of(&self.source, place, quantity)
    }
}

/// A number with as many decimals as another is shown with; yes and no for what is shown so.
pub(super) fn rounded(value: f64, like: &str) -> String {
    if like == "yes" || like == "no" {
        return if value == 0.0 { "no" } else { "yes" }.to_owned();
    }
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
