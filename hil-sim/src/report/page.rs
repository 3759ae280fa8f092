//! One self-contained page: no script, no network.

use std::fmt::Write as _;

use super::plot;
use crate::error::Error;
use crate::outcome::{Cell, Outcome, Table};

/// An experiment and its outcome.
pub struct Section<'a> {
    /// Name of the experiment.
    pub name: &'a str,
    /// The part of the source that it reproduces.
    pub stands_for: &'a str,
    /// Description of the experiment.
    pub about: &'a str,
    /// The command line that repeats it.
    pub command: String,
    /// The outcome.
    pub outcome: &'a Outcome,
}

/// The page with these sections.
///
/// # Errors
/// [`Error::Internal`] when a figure cannot be drawn.
pub fn page(title: &str, sections: &[Section<'_>]) -> Result<String, Error> {
    let mut body = String::new();
    if sections.len() > 1 {
        body.push_str("<nav><h2>Contents</h2>\n<ol>\n");
        for section in sections {
            let (name, stands_for) = (escape(section.name), escape(section.stands_for));
            let about = escape(section.about);
            let _ = writeln!(
                body,
                "<li><a href=\"#{name}\">{name}</a> <span class=\"source\">{stands_for}</span><br>{about}</li>"
            );
        }
        body.push_str("</ol></nav>\n");
    }
    for section in sections {
        write_section(&mut body, section)?;
    }
    let (title, style) = (escape(title), include_str!("page.css"));
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<header>\n\
         <h1>{title}</h1>\n<p>Simulated by hil-sim. Figure, table and equation numbers are those \
         of Barroso (2017), unless another source is named.</p>\n</header>\n{body}</body>\n</html>\n"
    ))
}

fn write_section(body: &mut String, section: &Section<'_>) -> Result<(), Error> {
    let outcome = section.outcome;
    let (name, about) = (escape(section.name), escape(section.about));
    let (stands_for, command) = (escape(section.stands_for), escape(&section.command));
    let _ = writeln!(
        body,
        "<section id=\"{name}\">\n<h2>{name} <span class=\"source\">{stands_for}</span></h2>\n\
         <p>{about}</p>\n<p class=\"command\"><code>{command}</code></p>"
    );
    if let Some(steps) = &outcome.steps {
        write_table(body, &Table::of_steps(steps));
    }
    for (number, figure) in outcome.figures.iter().enumerate() {
        let source = if figure.source.is_empty() {
            String::new()
        } else {
            format!(" <span class=\"source\">{}</span>", escape(&figure.source))
        };
        let _ = writeln!(
            body,
            "<figure>\n{}\n<figcaption><b>{name}, plot {}.</b> {}.{source}</figcaption>\n</figure>",
            plot::svg(figure)?,
            number + 1,
            escape(figure.title.trim_end_matches('.')),
        );
    }
    for table in &outcome.tables {
        write_table(body, table);
    }
    for (title, text) in &outcome.texts {
        let _ = writeln!(body, "<h3>{}</h3>\n<pre>{}</pre>", escape(title), escape(text));
    }
    if !outcome.remarks.is_empty() {
        body.push_str("<h3>Remarks</h3>\n<ul class=\"remarks\">\n");
        for remark in &outcome.remarks {
            let _ = writeln!(body, "<li>{}</li>", escape(remark));
        }
        body.push_str("</ul>\n");
    }
    if !outcome.metrics.is_empty() {
        body.push_str("<details><summary>All metrics</summary>\n");
        let mut table = Table::new("", &["metric", "value"]);
        for (name, value) in outcome.metrics.iter() {
            table.row([Cell::from(name), Cell::significant(value, 6)]);
        }
        write_table(body, &table);
        body.push_str("</details>\n");
    }
    body.push_str("</section>\n");
    Ok(())
}

fn write_table(body: &mut String, table: &Table) {
    body.push_str("<div class=\"table\"><table>\n");
    if !table.title.is_empty() {
        let _ = writeln!(body, "<caption>{}</caption>", escape(&table.title));
    }
    let is_number =
        |column: usize| table.rows.iter().any(|row| row.get(column).is_some_and(Cell::is_number));
    let class = |column: usize| {
        if is_number(column) { " class=\"number\"" } else { "" }
    };
    body.push_str("<thead><tr>");
    for (column, head) in table.columns.iter().enumerate() {
        let _ = write!(body, "<th{}>{}</th>", class(column), escape(head));
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        body.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let text = escape(cell.text());
            let text = if cell.is_number() { text.replace('-', "\u{2212}") } else { text };
            let _ = write!(body, "<td{}>{text}</td>", class(column));
        }
        body.push_str("</tr>\n");
    }
    body.push_str("</tbody></table>\n");
    if !table.note.is_empty() {
        let _ = writeln!(body, "<p class=\"note\">{}</p>", escape(&table.note));
    }
    body.push_str("</div>\n");
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
