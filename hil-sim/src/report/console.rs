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

/// Returns a table with aligned columns, with its title above and its note below. If the table is wider than 100 characters, the texts of its
/// widest columns continue on further lines, where only a word longer than a third of that, such as a path, is broken.
pub fn table(table: &Table) -> String {
    let (mut text, count) = (String::new(), table.columns.len());
    let right: Vec<bool> = (0..count).map(|column| table.is_numeric(column)).collect();
    let chars = |cell: &str| cell.chars().count();
    let word = |cell: &str| cell.split(' ').map(chars).max().unwrap_or(0);
    let longest = |column: usize, length: &dyn Fn(&str) -> usize| {
        let cells = table.rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| length(cell.text())).max().unwrap_or(0)
    };
    let cells: Vec<_> = (0..count).map(|column| longest(column, &chars)).collect();
    let with_head = |column: usize, length: &dyn Fn(&str) -> usize| {
        longest(column, length).max(length(&table.columns[column]))
    };
    let mut widths: Vec<_> = (0..count).map(|column| with_head(column, &chars)).collect();
    let least: Vec<_> = (0..count).map(|column| with_head(column, &word).min(WIDTH / 3)).collect();
    let gaps = 2 * count.saturating_sub(1);
    while widths.iter().sum::<usize>() + gaps > WIDTH {
        // Heads first, which are longer than what is below them.
        let shrinks = (0..count).filter(|&column| widths[column] > least[column]);
        let widest = shrinks.max_by_key(|&n| (widths[n] > cells[n], widths[n]));
        let Some(widest) = widest else { break };
        widths[widest] -= 1;
    }
    let row = |cells: Vec<&str>| {
        let parts = cells
            .iter()
            .zip(&widths)
            .map(|(cell, &width)| textwrap::wrap(cell, options(width).break_words(true)));
        let parts: Vec<_> = parts.collect();
        let height = parts.iter().map(Vec::len).max().unwrap_or(0);
        let lines = (0..height).map(|line| {
            let padded = parts.iter().zip(&widths).zip(&right).map(|((part, &width), right)| {
                let part = part.get(line).map_or("", |part| part.trim_end());
                if *right { format!("{part:>width$}") } else { format!("{part:<width$}") }
            });
            padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        });
        lines.collect::<Vec<_>>().join("\n")
    };
    if !table.title.is_empty() {
        let _ = writeln!(text, "{}", table.title);
    }
    let _ = writeln!(text, "{}", row(table.columns.iter().map(String::as_str).collect()));
    let _ = writeln!(text, "{}", "-".repeat(widths.iter().sum::<usize>() + gaps));
    for cells in &table.rows {
        let _ = writeln!(text, "{}", row(cells.iter().map(Cell::text).collect()));
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
    let options = options(WIDTH).initial_indent(first).subsequent_indent(others);
    textwrap::fill(&paragraph.split_whitespace().collect::<Vec<_>>().join(" "), options)
}

/// Returns the options to break lines at `width` characters, between words alone.
fn options(width: usize) -> textwrap::Options<'static> {
    let options = textwrap::Options::new(width).break_words(false);
    options.word_splitter(textwrap::WordSplitter::NoHyphenation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_table_continues_its_texts_on_further_lines() {
        let mut wide = Table::new("", &["machines", "answer of the drive"]);
        wide.row([Cell::fixed(50.0, 0), Cell::from("the shaft turns ".repeat(20).as_str())]);
        let text = table(&wide);
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        assert_eq!(text.split_whitespace().filter(|word| *word == "shaft").count(), 20, "{text}");
        assert_eq!(text.matches("50").count(), 1, "{text}");
        wide.rows[0][1] = Cell::from("the shaft turns");
        assert_eq!(table(&wide).lines().count(), 4, "head, line, row, empty line");
    }

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
