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

/// Returns a table with aligned columns, with its title above and its note below. If it is wider than 100 characters, the texts of its widest
/// columns continue on further lines.
pub fn table(table: &Table) -> String {
    let (mut text, widths) = (String::new(), widths(table));
    let row = |cells: Vec<&str>| {
        let parts = cells.iter().zip(&widths).map(|(cell, &n)| textwrap::wrap(cell, options(n)));
        let parts: Vec<_> = parts.collect();
        let height = parts.iter().map(Vec::len).max().unwrap_or(0);
        let lines = (0..height).map(|line| {
            let padded = parts.iter().zip(&widths).enumerate().map(|(column, (part, &width))| {
                let part = part.get(line).map_or("", |part| part.trim_end());
                let right = table.is_numeric(column);
                if right { format!("{part:>width$}") } else { format!("{part:<width$}") }
            });
            padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        });
        lines.collect::<Vec<_>>().join("\n")
    };
    if !table.title.is_empty() {
        let _ = writeln!(text, "{}", table.title);
    }
    let _ = writeln!(text, "{}", row(table.columns.iter().map(String::as_str).collect()));
    text += &widths.iter().map(|&width| "-".repeat(width)).collect::<Vec<_>>().join("--");
    text.push('\n');
    for cells in &table.rows {
        let _ = writeln!(text, "{}", row(cells.iter().map(Cell::text).collect()));
    }
    if !table.note.is_empty() {
        let _ = writeln!(text, "{}", wrap(&table.note, "", ""));
    }
    text.push('\n');
    text
}

/// Returns the widths of the columns. To fit 100 characters, heads that are wider than what is below them shrink first, and nothing below
/// its longest word, of which a third of the line counts.
fn widths(table: &Table) -> Vec<usize> {
    let chars = |cell: &str| cell.chars().count();
    let word = |cell: &str| cell.split(' ').map(chars).max().unwrap_or(0);
    let column = |(column, head): (usize, &String)| {
        let cells = table.rows.iter().filter_map(|row| row.get(column)).map(Cell::text);
        let least = cells.clone().map(word).fold(word(head), usize::max).min(WIDTH / 3);
        let below = cells.map(chars).max().unwrap_or(0);
        [below.max(chars(head)), below, least]
    };
    let mut columns: Vec<_> = table.columns.iter().enumerate().map(column).collect();
    while columns.iter().map(|[width, ..]| width + 2).sum::<usize>() > WIDTH + 2 {
        let shrinks = columns.iter_mut().filter(|[width, _, least]| width > least);
        let Some(widest) = shrinks.max_by_key(|[n, below, _]| (n > below, *n)) else { break };
        widest[0] -= 1;
    }
    columns.iter().map(|[width, ..]| *width).collect()
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
    let options = options(WIDTH).break_words(false);
    let options = options.initial_indent(first).subsequent_indent(others);
    textwrap::fill(&paragraph.split_whitespace().collect::<Vec<_>>().join(" "), options)
}

/// Returns the options to break lines at `width` characters without hyphens.
fn options(width: usize) -> textwrap::Options<'static> {
    textwrap::Options::new(width).word_splitter(textwrap::WordSplitter::NoHyphenation)
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
