//! Results as text with aligned columns.

use std::fmt::Write as _;

use crate::outcome::{Cell, Metrics, Outcome, Table};

/// Returns the current levels, tables, metrics and remarks of an outcome, and whether the run failed.
pub fn text(outcome: &Outcome) -> String {
    let mut text = String::new();
    if let Some(steps) = &outcome.steps {
        text.push_str(&table(&Table::of_steps(steps)));
    }
    outcome.tables.iter().for_each(|one| text.push_str(&table(one)));
    if let Some(lost) = outcome.lost() {
        let _ = writeln!(text, "{}\n", wrap(&lost, "", ""));
    }
    write_metrics(&mut text, &outcome.metrics);
    for remark in &outcome.remarks {
        let _ = writeln!(text, "{}", wrap(remark, "* ", "  "));
    }
    text
}

/// Writes names, which end in their unit, and values, in as many columns as fit.
fn write_metrics(text: &mut String, metrics: &Metrics) {
    let cells: Vec<_> =
        metrics.iter().map(|(name, value)| (name, Metrics::cell(name, value))).collect();
    let longest = |length: fn(&(&str, Cell)) -> usize| cells.iter().map(length).max().unwrap_or(0);
    let name_width = longest(|(name, _)| name.chars().count());
    let value_width = longest(|(_, cell)| cell.text().chars().count());
    let columns = ((WIDTH + 4) / (name_width + value_width + 6)).max(1);
    let rows = cells.len().div_ceil(columns);
    if rows == 0 {
        return;
    }
    text.push_str("Metrics\n");
    for row in 0..rows {
        let line =
            cells.iter().skip(row).step_by(rows).map(|(name, value)| {
                format!("{name:<name_width$}  {:>value_width$}", value.text())
            });
        let _ = writeln!(text, "{}", line.collect::<Vec<_>>().join("    "));
    }
    text.push('\n');
}

/// Returns a table with aligned columns, with its title above and its note below.
pub fn table(table: &Table) -> String {
    let (mut text, count) = (String::new(), table.columns.len());
    let width = |column: usize| {
        let cells = table.rows.iter().filter_map(|row| row.get(column)).map(Cell::text);
        let head = table.columns[column].as_str();
        cells.chain([head]).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..count).map(width).collect();
    let right: Vec<bool> = (0..count).map(|column| table.is_numeric(column)).collect();
    let line = |cells: Vec<&str>| {
        let padded = cells.iter().enumerate().map(|(column, cell)| {
            let width = widths.get(column).copied().unwrap_or(0);
            match right.get(column) {
                Some(true) => format!("{cell:>width$}"),
                _ => format!("{cell:<width$}"),
            }
        });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    if !table.title.is_empty() {
        let _ = writeln!(text, "{}", table.title);
    }
    let _ = writeln!(text, "{}", line(table.columns.iter().map(String::as_str).collect()));
    let whole = widths.iter().sum::<usize>() + 2 * count.saturating_sub(1);
    let _ = writeln!(text, "{}", "-".repeat(whole));
    for row in &table.rows {
        let _ = writeln!(text, "{}", line(row.iter().map(Cell::text).collect()));
    }
    if !table.note.is_empty() {
        let _ = writeln!(text, "{}", wrap(&table.note, "", ""));
    }
    text.push('\n');
    text
}

/// Longest line of a paragraph, characters.
const WIDTH: usize = 100;

/// Returns a paragraph in lines of at most 100 characters, indented by `indent` columns.
pub fn paragraph(text: &str, indent: usize) -> String {
    let indent = " ".repeat(indent);
    wrap(text, &indent, &indent)
}

/// Breaks a paragraph into lines of at most 100 characters, each after one of the two indents.
fn wrap(paragraph: &str, first: &str, others: &str) -> String {
    let options = textwrap::Options::new(WIDTH).initial_indent(first).subsequent_indent(others);
    let options = options.word_splitter(textwrap::WordSplitter::NoHyphenation).break_words(false);
    textwrap::fill(&paragraph.split_whitespace().collect::<Vec<_>>().join(" "), options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_are_printed_beside_tables_and_without_any_nan() {
        let mut outcome = Outcome::default();
        let mut table = Table::new("Levels", &["error (°)"]);
        table.row([Cell::fixed(f64::NAN, 1)]);
        outcome.tables.push(table);
        outcome.metrics.set("angle_error_rms_deg", 1.63447);
        outcome.metrics.set("largest_loss", f64::NAN);
        outcome.metrics.set("lost", 1.0);
        let text = text(&outcome);
        let words: Vec<_> = text.split_whitespace().collect();
        assert!(words.windows(2).any(|pair| pair == ["angle_error_rms_deg", "1.634"]), "{text}");
        assert!(words.windows(2).any(|pair| pair == ["largest_loss", "none"]), "{text}");
        assert!(text.contains("Lost: ") && !text.contains("NaN"), "{text}");
    }
}
