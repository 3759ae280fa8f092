//! Results as text with aligned columns.

use std::fmt::Write as _;

use crate::outcome::{Cell, Outcome, Table};

/// The levels, tables and remarks of an outcome; the metrics where there is no table.
pub fn text(outcome: &Outcome) -> String {
    let mut text = String::new();
    if let Some(steps) = &outcome.steps {
        write_table(&mut text, &Table::of_steps(steps));
    }
    for table in &outcome.tables {
        write_table(&mut text, table);
    }
    if outcome.tables.is_empty() || outcome.steps.is_some() {
        let mut metrics = Table::new("Metrics", &["name", "value"]);
        for (name, value) in outcome.metrics.iter() {
            metrics.row([Cell::from(name), Cell::significant(value, 5)]);
        }
        write_table(&mut text, &metrics);
    }
    for remark in &outcome.remarks {
        let _ = writeln!(text, "{}", wrap(remark, "* ", "  "));
    }
    text
}

/// A table with aligned columns.
pub fn table(table: &Table) -> String {
    let mut text = String::new();
    write_table(&mut text, table);
    text
}

/// A table with its title above and its note below.
fn write_table(text: &mut String, table: &Table) {
    let width = |column: usize| {
        let cells = table.rows.iter().filter_map(|row| row.get(column)).map(Cell::text);
        let head = table.columns[column].as_str();
        cells.chain([head]).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..table.columns.len()).map(width).collect();
    let numeric =
        |column: usize| table.rows.iter().any(|row| row.get(column).is_some_and(Cell::is_number));
    let right: Vec<bool> = (0..table.columns.len()).map(numeric).collect();
    let line = |cells: Vec<&str>| {
        let padded = cells.iter().enumerate().map(|(column, cell)| {
            let width = widths.get(column).copied().unwrap_or(0);
            if right.get(column) == Some(&true) {
                format!("{cell:>width$}")
            } else {
                format!("{cell:<width$}")
            }
        });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    if !table.title.is_empty() {
        let _ = writeln!(text, "{}", table.title);
    }
    let _ = writeln!(text, "{}", line(table.columns.iter().map(String::as_str).collect()));
    let _ = writeln!(
        text,
        "{}",
        "-".repeat(widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1))
    );
    for row in &table.rows {
        let _ = writeln!(text, "{}", line(row.iter().map(Cell::text).collect()));
    }
    if !table.note.is_empty() {
        let _ = writeln!(text, "{}", wrap(&table.note, "", ""));
    }
    text.push('\n');
}

/// A paragraph in lines of at most 100 characters, indented by `indent` columns.
pub fn paragraph(text: &str, indent: usize) -> String {
    let indent = " ".repeat(indent);
    wrap(text, &indent, &indent)
}

/// Breaks a paragraph into lines of at most 100 characters, each behind one of the two indents.
fn wrap(paragraph: &str, first: &str, others: &str) -> String {
    let mut text = first.to_owned();
    let mut used = first.chars().count();
    let mut fresh = true;
    for word in paragraph.split_whitespace() {
        let width = word.chars().count();
        if !fresh && used + 1 + width > 100 {
            text.push('\n');
            text.push_str(others);
            used = others.chars().count();
            fresh = true;
        }
        if !fresh {
            text.push(' ');
            used += 1;
        }
        text.push_str(word);
        used += width;
        fresh = false;
    }
    text
}
