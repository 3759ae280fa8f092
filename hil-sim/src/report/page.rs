//! One self-contained page: no script, no network.

use std::fmt::Write as _;

use super::plot;
use super::prose::{escape, number, prose};
use crate::error::Error;
use crate::outcome::{Cell, Metrics, Origin, Outcome, Table};

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

/// The page with these sections, whose outcomes have one origin. It states the program's version, the date,
/// seed and settings.
///
/// # Errors
/// [`Error::Internal`] when a figure cannot be drawn.
pub fn page(title: &str, origin: &Origin, sections: &[Section<'_>]) -> Result<String, Error> {
    let mut body = String::new();
    if sections.len() > 1 {
        body.push_str("<nav><h2>Contents</h2>\n<ol>\n");
        for section in sections {
            let (name, stands_for) = (escape(section.name), prose(section.stands_for));
            let about = prose(section.about);
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
    let title = escape(title);
    let tab = match sections {
        [one] => format!("{} – {title}", escape(one.name)),
        _ => title.clone(),
    };
    let (style, plots) = (include_str!("page.css"), plot::style());
    let (version, seed) = (env!("CARGO_PKG_VERSION"), origin.seed);
    let date = chrono::Utc::now().format("%Y-%m-%d %H:%M");
    let settings = settings(&origin.settings);
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{tab}</title>\n<style>\n{style}{plots}</style>\n</head>\n<body>\n<header>\n\
         <h1>{title}</h1>\n<p>Simulated by hil-sim {version} on {date} UTC with seed {seed}. \
         {settings}</p>\n<p>Figure, table and equation numbers are those of Barroso (2017), unless \
         another source is named.</p>\n</header>\n{body}</body>\n</html>\n"
    ))
}

fn settings(changed: &[(String, String)]) -> String {
    let one = |(name, value): &(String, String)| {
        format!("<code>{} = {}</code>", escape(name), escape(value))
    };
    match changed {
        [] => "All settings have their defaults.".to_owned(),
        some => {
            format!("Changed settings: {}.", some.iter().map(one).collect::<Vec<_>>().join(", "))
        }
    }
}

/// Metrics in a list that is too long to stand before the figures.
const LONG_LIST: usize = 24;

fn write_section(body: &mut String, section: &Section<'_>) -> Result<(), Error> {
    let outcome = section.outcome;
    let (name, about) = (escape(section.name), prose(section.about));
    let (stands_for, command) = (prose(section.stands_for), escape(&section.command));
    let _ = writeln!(
        body,
        "<section id=\"{name}\">\n<h2>{name} <span class=\"source\">{stands_for}</span></h2>\n\
         <p>{about}</p>\n<p class=\"command\"><code>{command}</code></p>"
    );
    if let Some(lost) = outcome.lost() {
        let _ = writeln!(body, "<p class=\"lost\">{}</p>", prose(&lost));
    }
    // Long lists do not stand between the reader and the figures.
    let is_long = outcome.metrics.iter().count() > LONG_LIST;
    if !is_long {
        write_metrics(body, &outcome.metrics);
    }
    if let Some(steps) = &outcome.steps {
        write_table(body, &Table::of_steps(steps));
    }
    for (figure, number) in outcome.figures.iter().zip(1..) {
        let source = if figure.source.is_empty() {
            String::new()
        } else {
            format!(" <span class=\"source\">{}</span>", prose(&figure.source))
        };
        let _ = writeln!(
            body,
            "<figure>\n<div class=\"scroll\">\n{}</div>\n\
             <figcaption><b>{name}, plot {number}.</b> {}.{source}</figcaption>\n</figure>",
            plot::panels(figure)?.concat(),
            prose(figure.title.trim_end_matches('.')),
        );
    }
    for table in &outcome.tables {
        write_table(body, table);
    }
    if is_long {
        write_metrics(body, &outcome.metrics);
    }
    for (title, text) in &outcome.texts {
        let _ = writeln!(body, "<h3>{}</h3>\n<pre>{}</pre>", escape(title), escape(text));
    }
    if !outcome.remarks.is_empty() {
        body.push_str("<h3>Remarks</h3>\n<ul class=\"remarks\">\n");
        for remark in &outcome.remarks {
            let _ = writeln!(body, "<li>{}</li>", prose(remark));
        }
        body.push_str("</ul>\n");
    }
    body.push_str("</section>\n");
    Ok(())
}

/// Names, which end in their unit, and values.
fn write_metrics(body: &mut String, metrics: &Metrics) {
    if metrics.is_empty() {
        return;
    }
    body.push_str("<dl class=\"metrics\">\n");
    for (name, value) in metrics.iter() {
        let (name, value) = (escape(name), shown(&Metrics::cell(name, value)));
        let _ = writeln!(body, "<div><dt><code>{name}</code></dt><dd>{value}</dd></div>");
    }
    body.push_str("</dl>\n");
}

/// A cell as HTML.
fn shown(cell: &Cell) -> String {
    if cell.is_number() { number(cell.text()) } else { prose(cell.text()) }
}

fn write_table(body: &mut String, table: &Table) {
    body.push_str("<div class=\"table\"><table>\n");
    if !table.title.is_empty() {
        let _ = writeln!(body, "<caption>{}</caption>", prose(&table.title));
    }
    let is_number =
        |column: usize| table.rows.iter().any(|row| row.get(column).is_some_and(Cell::is_number));
    let class = |column: usize| {
        if is_number(column) { " class=\"number\"" } else { "" }
    };
    body.push_str("<thead><tr>");
    for (column, head) in table.columns.iter().enumerate() {
        let _ = write!(body, "<th{}>{}</th>", class(column), prose(head));
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        body.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let _ = write!(body, "<td{}>{}</td>", class(column), shown(cell));
        }
        body.push_str("</tr>\n");
    }
    body.push_str("</tbody></table>\n");
    if !table.note.is_empty() {
        let _ = writeln!(body, "<p class=\"note\">{}</p>", prose(&table.note));
    }
    body.push_str("</div>\n");
}
