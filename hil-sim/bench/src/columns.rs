//! CSV files that a user brings: a header with the names of the columns, then numbers.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::bounded;
use crate::error::{Error, cut, unknown};

/// Likely cause if the first row after the header cannot be read.
const PREAMBLE: &str = "; if the instrument wrote lines before the names of the columns, remove them or begin them with #";

/// Named columns of equal length.
#[derive(Debug)]
pub struct Columns {
    path: PathBuf,
    names: Vec<String>,
    /// The rows, each with its line number.
    rows: Vec<(u64, Vec<f64>)>,
}

impl Columns {
    /// Reads a file. Spaces around names and numbers do not count; lines that begin with `#` are comments.
    ///
    /// # Errors
    /// [`Error::Data`] with the line of a cell that is not a finite number, or of a row with another width than the header.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let failed = |line, problem: String| Error::data(path, line, problem);
        let of_csv = |error: csv::Error, hint: &str| {
            let line = error.position().map(csv::Position::line);
            let problem = match error.kind() {
                csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                    format!("{len} cells; the header has {expected_len}{hint}")
                }
                _ => "no UTF-8 text".to_owned(),
            };
            failed(line, problem)
        };
        let mut builder = csv::ReaderBuilder::new();
        let builder = builder.trim(csv::Trim::All).comment(Some(b'#'));
        let bytes = bounded::bytes(path, bounded::TABLE_MIB);
        let bytes = bytes.map_err(|why| failed(None, why.to_string()))?;
        if [[0xff, 0xfe], [0xfe, 0xff]].iter().any(|mark| bytes.starts_with(mark)) {
            return Err(failed(None, "UTF-16 text; save the file as CSV in UTF-8".to_owned()));
        }
        let mut reader = builder.from_reader(&bytes[..]);
        let header = reader.headers().map_err(|error| of_csv(error, ""))?;
        let names: Vec<String> = header.iter().map(str::to_owned).collect();
        let line = cut(&names.join(", "));
        if names.len() == 1 && line.contains([';', '\t']) {
            return Err(failed(Some(1), format!("`{line}`: the separator must be a comma")));
        } else if names.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(failed(Some(1), format!("`{line}`: the first line must name the columns")));
        }
        let mut before = BTreeSet::new();
        if let Some(name) = names.iter().find(|name| !before.insert(*name)) {
            return Err(failed(Some(1), format!("two columns are called `{}`", cut(name))));
        }
        let mut rows = Vec::new();
        for record in reader.records() {
            let hint = if rows.is_empty() { PREAMBLE } else { "" };
            let record = record.map_err(|error| of_csv(error, hint))?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |(cell, name): (&str, &String)| {
                let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
                let [name, cell] = [name, cell].map(cut);
                let problem = || format!("{name} = `{cell}` is not a finite number{hint}");
                number.ok_or_else(|| failed(Some(line), problem()))
            };
            rows.push((line, record.iter().zip(&names).map(number).collect::<Result<_, _>>()?));
        }
        Ok(Self { path: path.to_owned(), names, rows })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns the place of a column in the file, counted from 0, if there is one of this name.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// Returns the column of this name, if there is one.
    pub fn get(&self, name: &str) -> Option<Vec<f64>> {
        let place = self.place(name)?;
        Some(self.rows.iter().map(|(_, row)| row[place]).collect())
    }

    /// Returns a column that the caller requires.
    ///
    /// # Errors
    /// [`Error::Data`] with the names of the columns of the file.
    pub fn need(&self, name: &str) -> Result<Vec<f64>, Error> {
        self.get(name).ok_or_else(|| self.missing(name))
    }

    /// Returns the error of a missing column, with the names of the columns of the file.
    pub fn missing(&self, name: &str) -> Error {
        let (name, names) = (cut(name), cut(&self.names.join(", ")));
        self.error(format!("there is no column `{name}`; the file has: {names}"))
    }

    /// Checks that every column has one of these names.
    ///
    /// # Errors
    /// [`Error::Data`] with the name of the column that is not allowed, and the allowed names.
    pub fn only(&self, allowed: &[&str]) -> Result<(), Error> {
        let other = self.names.iter().find(|name| !allowed.contains(&name.as_str()));
        let Some(other) = other else { return Ok(()) };
        Err(self.at(0, unknown("column", other, allowed)))
    }

    /// Returns an error of the file as a whole.
    pub fn error(&self, problem: String) -> Error {
        Error::data(&self.path, None, problem)
    }

    /// Returns an error of a row, counted from 1; 0 is the header.
    pub fn at(&self, row: usize, problem: String) -> Error {
        let line = match row {
            0 => Some(1),
            row => self.rows.get(row - 1).map(|(line, _)| *line),
        };
        Error::data(&self.path, line, problem)
    }
}
