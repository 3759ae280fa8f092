//! Tables and their cells.

use serde::ser::{Serialize, Serializer};

use super::Step;
use crate::columns;

/// A table.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Table {
    /// Title.
    pub title: String,
    /// Heads of the columns, with units.
    pub columns: Vec<String>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
    /// Source, conditions and help for reading; may be empty.
    pub note: String,
}

impl Table {
    /// Makes a table without rows.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|&column| column.to_owned()).collect();
        Self { title: title.into(), columns, ..Self::default() }
    }

    /// Adds a row for each of these lists of cells, as [`Self::record`] does.
    pub fn records<H: Into<String>, R: IntoIterator<Item = (H, Cell)>>(
        mut self,
        rows: impl IntoIterator<Item = R>,
    ) -> Self {
        rows.into_iter().for_each(|row| self.record(row));
        self
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Adds a row of cells, each with the head of its column; the first row sets the heads.
    pub fn record<H: Into<String>>(&mut self, row: impl IntoIterator<Item = (H, Cell)>) {
        let (heads, cells): (Vec<_>, Vec<_>) = row.into_iter().unzip();
        if self.rows.is_empty() {
            self.columns = heads.into_iter().map(Into::into).collect();
        }
        self.rows.push(cells);
    }

    /// Makes a table with a row for each record; the columns get the record and its number.
    pub fn of<'a, R: 'a>(
        table: impl Into<Self>,
        columns: &[Column<'_, R>],
        records: impl IntoIterator<Item = (usize, &'a R)>,
    ) -> Self {
        let row = |(number, record): (usize, &R)| {
            columns.iter().map(|column| (column.cell)(number, record)).collect()
        };
        let heads = columns.iter().map(|column| column.head.to_owned()).collect();
        let rows = records.into_iter().map(row).collect();
        Self { columns: heads, rows, ..table.into() }
    }

    /// Sets the note below the table.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Whether a column contains numbers.
    pub fn is_numeric(&self, column: usize) -> bool {
        self.rows.iter().any(|row| row.get(column).is_some_and(Cell::is_number))
    }

    /// Makes the standard table of the current levels of a torque experiment.
    pub fn of_steps(steps: &[Step]) -> Self {
        let columns = columns![|_, step: &Step|
            "iq reference (A)" => Cell::fixed(step.iq_ref_a, 3);
            "iq (A)" => of_level(step.iq_a, 3);
            "torque (Nm)" => of_level(step.torque_nm, 3);
            "mean angle error (°)" => of_level(step.angle_error_mean_deg, 2);
        ];
        Self::of("Levels", &columns, steps.iter().enumerate())
    }
}

/// A title makes a table without rows.
impl<T: Into<String>> From<T> for Table {
    fn from(title: T) -> Self {
        Self { title: title.into(), ..Self::default() }
    }
}

/// A column of records: one description for the printed table, the page, JSON and CSV.
pub struct Column<'a, R> {
    /// Head, with the unit; the name in CSV is derived from it.
    pub head: &'a str,
    /// Computes the cell of a record and its number.
    pub cell: OfRecord<'a, R>,
}

/// A function from the number of a record and the record to a cell.
pub type OfRecord<'a, R> = Box<dyn Fn(usize, &R) -> Cell + 'a>;

/// Makes columns from heads and expressions of number and record.
#[macro_export]
macro_rules! columns {
    (|$number:tt, $record:tt: $type:ty| $($head:expr => $cell:expr;)+) => {
        vec![$($crate::outcome::Column {
            head: $head,
            #[allow(unused_variables)]
            cell: Box::new(move |$number: usize, $record: $type| $cell),
        }),+]
    };
}

/// Cell of the mean over a current level; `lost` if the run ended before that level.
fn of_level(value: f64, decimals: usize) -> Cell {
    if value.is_nan() { Cell::from("lost") } else { Cell::fixed(value, decimals) }
}

/// One cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number and how it is shown.
    Number {
        /// The number.
        value: f64,
        /// How it is shown.
        text: String,
    },
}

impl Cell {
    /// Returns the cell, or a dash if there is none.
    pub fn or_dash(cell: Option<Self>) -> Self {
        cell.unwrap_or_else(|| "-".into())
    }

    /// Returns a number with this many decimals, or a dash if there is none, or if it is not finite.
    pub fn fixed_or_dash(value: impl Into<Option<f64>>, decimals: usize) -> Self {
        let finite = value.into().filter(|value| value.is_finite());
        Self::or_dash(finite.map(|value| Self::fixed(value, decimals)))
    }

    /// Returns a number with this many decimals.
    pub fn fixed(value: f64, decimals: usize) -> Self {
        Self::number(value, format!("{value:.decimals$}"))
    }

    /// Returns a number with this many significant digits, with powers of ten for very small and very large numbers.
    pub fn significant(value: f64, digits: usize) -> Self {
        let exponent = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
        let text = if (-4..6).contains(&exponent) {
            let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
            format!("{value:.decimals$}")
        } else {
            format!("{value:.*e}", digits.saturating_sub(1))
        };
        Self::number(value, text)
    }

    /// Returns a number with its rounded text, or words if it is not finite.
    fn number(value: f64, rounded: String) -> Self {
        let text = match value {
            nan if nan.is_nan() => "none".to_owned(),
            f64::INFINITY => "∞".to_owned(),
            f64::NEG_INFINITY => "-∞".to_owned(),
            _ => plain_minus(rounded),
        };
        Self::Number { value, text }
    }

    /// Returns the shown text.
    pub fn text(&self) -> &str {
        match self {
            Self::Text(text) | Self::Number { text, .. } => text,
        }
    }

    /// Whether the cell is a number.
    pub fn is_number(&self) -> bool {
        matches!(self, Self::Number { .. })
    }
}

/// Removes the sign of a rounded zero.
fn plain_minus(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::Text(text.into())
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Number { value, .. } => serializer.serialize_f64(*value),
        }
    }
}
