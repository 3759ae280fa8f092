//! Figures and tables as CSV.

use std::collections::HashMap;
use std::iter::once;

use crate::outcome::name::{snake, unique};
use sim_bench::prelude::*;

/// Returns the files of an outcome, each with its name without folder and without the experiment's name: one per
/// figure, `levels.csv`, and one per table, `table-1.csv` and so on.
///
/// # Errors
/// [`Error::Internal`] if a file cannot be made.
pub fn csv(outcome: &Outcome) -> Result<Vec<(String, String)>, Error> {
    let mut files = Vec::new();
    for figure in &outcome.figures {
        files.push((format!("{}.csv", figure.name), of_figure(figure)?));
    }
    if let Some(steps) = &outcome.steps {
        files.push(("levels.csv".to_owned(), written(steps)?));
    }
    if !outcome.compared.is_empty() {
        files.push(("compared.csv".to_owned(), written(&outcome.compared)?));
    }
    for (table, number) in outcome.tables.iter().zip(1..) {
        files.push((format!("table-{number}.csv"), of_table(table)?));
    }
    Ok(files)
}

/// Writes columns of equal length. Curves with the same x follow one column of x. Curves with other x have their own x
/// columns (`time_s_2`). Shorter columns are filled with empty cells.
fn of_figure(figure: &Figure) -> Result<String, Error> {
    let mut groups: HashMap<Vec<u64>, usize> = HashMap::new();
    let mut columns: Vec<Vec<(String, Vec<f64>)>> = Vec::new();
    for curve in figure.curves() {
        let (x, y): (Vec<f64>, Vec<f64>) = curve.series.points.iter().copied().unzip();
        let bits = x.iter().map(|x| x.to_bits()).collect();
        let group = *groups.entry(bits).or_insert(columns.len());
        if group == columns.len() {
            columns.push(vec![(snake(&curve.panel.x_label), x)]);
        }
        columns[group].push((curve.name, y));
    }
    let columns: Vec<_> = columns.into_iter().flatten().collect();
    let mut taken = Vec::new();
    let heads: Vec<_> = columns.iter().map(|(name, _)| unique(name.clone(), &mut taken)).collect();
    let length = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let cell = |values: &[f64], k| values.get(k).map_or_else(String::new, |v| number(*v));
    let row = |k| columns.iter().map(|(_, values)| cell(values, k)).collect();
    written(once(heads).chain((0..length).map(row)))
}

/// Writes a table.
///
/// # Errors
/// As [`csv()`].
fn of_table(table: &Table) -> Result<String, Error> {
    let mut taken = Vec::new();
    let mut head = |label: &String| match snake(label) {
        none if none.is_empty() => unique("item".to_owned(), &mut taken),
        name => unique(name, &mut taken),
    };
    let text = |cell: &Cell| match cell {
        Cell::Text(text) => text.clone(),
        Cell::Number { value, .. } => number(*value),
    };
    let heads: Vec<_> = table.columns.iter().map(&mut head).collect();
    written(once(heads).chain(table.rows.iter().map(|row| row.iter().map(text).collect())))
}

/// Returns a number with all its digits; an empty text if it is not finite.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// Writes records whose fields are the columns, or lists of cells.
fn written(records: impl IntoIterator<Item: Serialize>) -> Result<String, Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for record in records {
        writer.serialize(record).map_err(internal)?;
    }
    String::from_utf8(writer.into_inner().map_err(internal)?).map_err(internal)
}

fn internal(error: impl std::fmt::Display) -> Error {
    Error::Internal(format!("CSV: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::{Panel, Series};

    #[test]
    fn columns_have_units_and_one_length() {
        let two = |y: f64| vec![(0.0, y), (0.5, f64::NAN)];
        let current = Panel::new("time (s)", "current (A)")
            .with(Series::line("measured", two(1.0)))
            .with(Series::reference("reference", vec![(0.0, 2.0)]));
        let torque = Panel::new("time (s)", "torque (Nm)").with(Series::line("", two(3.0)));
        let figure = Figure::new("step", "", "").panel(current).panel(torque);
        let expected = "time_s,current_measured_a,torque_nm,time_s_2,current_reference_a\n\
                        0,1,3,0,2\n0.5,,,,\n";
        assert_eq!(of_figure(&figure).unwrap(), expected);
    }

    #[test]
    fn tables_keep_all_digits_and_quote_commas() {
        let mut table = Table::new("", &["", "error (°)"]);
        table.row([Cell::from("a, b"), Cell::fixed(1.23456, 1)]);
        let outcome = Outcome { tables: vec![table], ..Outcome::default() };
        let files = csv(&outcome).unwrap();
        assert_eq!(files[0].0, "table-1.csv");
        assert_eq!(files[0].1, "item,error_deg\n\"a, b\",1.23456\n");
    }
}
