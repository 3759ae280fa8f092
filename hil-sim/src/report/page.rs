//! One self-contained page: no script, no network.

use std::fmt::Write as _;
use std::process::Command;

use super::plot;
use super::prose::{escape, number, prose};
use crate::error::Error;
use crate::outcome::{Cell, Metrics, Origin, Outcome, Table, name};
use crate::repository;

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
    /// Whether the section is open on a page of several sections.
    pub open: bool,
    /// The outcome.
    pub outcome: &'a Outcome,
}

/// Makes the page with these sections, whose outcomes have a common origin. It states the program's version, the date,
/// seed and settings.
///
/// # Errors
/// [`Error::Internal`] if a figure cannot be drawn.
pub fn page(title: &str, origin: &Origin, sections: &[Section<'_>]) -> Result<String, Error> {
    let mut body = String::new();
    let folded = sections.len() > 1;
    if folded {
        write_results(&mut body, sections);
    }
    for section in sections {
        write_section(&mut body, section, folded)?;
    }
    let title = escape(title);
    let tab = match sections {
        [one] => format!("{} – {title}", escape(one.name)),
        _ => title.clone(),
    };
    let (style, plots) = (include_str!("page.css"), plot::STYLE);
    let (version, seed, commit) = (env!("CARGO_PKG_VERSION"), origin.seed, commit());
    let date = chrono::Utc::now().format("%Y-%m-%d %H:%M");
    let settings = settings(&origin.settings);
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{tab}</title>\n<style>\n{style}{plots}</style>\n</head>\n<body>\n<header>\n\
         <h1>{title}</h1>\n<p>Simulated by hil-sim {version}{commit} on {date} UTC with seed {seed}. \
         {settings}</p>\n<p>Figure, table and equation numbers are those of Barroso (2017), unless \
         another source is named.</p>\n</header>\n{body}</body>\n</html>\n"
    ))
}

/// Returns the number of the sources of this program, and the commit of its repository if it runs there.
fn commit() -> String {
    let describe = ["describe", "--always", "--dirty", "--abbrev=10"];
    let git = |root| Command::new("git").args(describe).current_dir(root).output().ok();
    let found = repository::root().and_then(git).filter(|output| output.status.success());
    let commit = found.map_or_else(|| b"unknown".to_vec(), |output| output.stdout);
    let commit = escape(String::from_utf8_lossy(&commit).trim());
    format!(" (sources {}, commit {commit})", env!("HIL_SIM_SOURCES"))
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

/// Writes a row for each experiment, failed ones first.
fn write_results(body: &mut String, sections: &[Section<'_>]) {
    body.push_str(
        "<nav><h2>Results</h2>\n<table>\n<thead><tr><th>experiment</th><th>what it shows</th>\
         <th>main number</th><th class=\"number\"></th><th>lost</th></tr></thead>\n<tbody>\n",
    );
    let failed = |section: &&Section<'_>| section.outcome.lost().is_some();
    let rest = sections.iter().filter(|section| !failed(section));
    for section in sections.iter().filter(failed).chain(rest) {
        let (name, metrics) = (escape(section.name), &section.outcome.metrics);
        let (what, value) = metrics.main().map_or_else(Default::default, |(name, value)| {
            (escape(&name::words(name)), shown(&Metrics::cell(name, value)))
        });
        let lost = match section.outcome.lost() {
            Some(_) => "<span class=\"lost\">failed</span>".to_owned(),
            None => metrics.lost(),
        };
        let (about, source) = (prose(section.about), prose(section.stands_for));
        let _ = writeln!(
            body,
            "<tr><td><a href=\"#{name}\">{name}</a></td>\
             <td>{about} <span class=\"source\">{source}</span></td>\
             <td>{what}</td><td class=\"number\">{value}</td><td>{lost}</td></tr>"
        );
    }
    body.push_str("</tbody></table></nav>\n");
}

/// Number of metrics before the figures; the rest is folded.
const FIRST_METRICS: usize = 5;

/// Writes a section; with `folded` everything but its head opens on request.
fn write_section(body: &mut String, section: &Section<'_>, folded: bool) -> Result<(), Error> {
    let outcome = section.outcome;
    let (name, about) = (escape(section.name), prose(section.about));
    let (stands_for, command) = (prose(section.stands_for), escape(&section.command));
    let _ = writeln!(
        body,
        "<section id=\"{name}\">\n<h2>{name} <span class=\"source\">{stands_for}</span></h2>\n\
         <p>{about}</p>"
    );
    for command in command.lines() {
        let _ = writeln!(body, "<p class=\"command\"><code>{command}</code></p>");
    }
    if let Some(lost) = outcome.lost() {
        let _ = writeln!(body, "<p class=\"lost\">{}</p>", prose(&lost));
    }
    if folded {
        let (plots, tables) = (outcome.figures.len(), outcome.tables.len());
        let open = if section.open { " open" } else { "" };
        let _ = writeln!(body, "<details{open}><summary>{plots} plots, {tables} tables</summary>");
    }
    write_metrics(body, &outcome.metrics);
    if let Some(steps) = &outcome.steps {
        write_table(body, &Table::of_steps(steps));
    }
    for (figure, number) in outcome.figures.iter().zip(1..) {
        let source = match figure.source.as_str() {
            "" => String::new(),
            source => format!(" <span class=\"source\">{}</span>", prose(source)),
        };
        let title = prose(figure.title.trim_end_matches('.'));
        let panels = plot::panels(figure)?.concat();
        let _ = writeln!(
            body,
            "<figure>\n<div class=\"scroll\">\n{panels}</div>\n\
             <figcaption><b>{name}, plot {number}.</b> {title}.{source}</figcaption>\n</figure>"
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
            let _ = writeln!(body, "<li>{}</li>", prose(remark));
        }
        body.push_str("</ul>\n");
    }
    body.push_str(if folded { "</details>\n</section>\n" } else { "</section>\n" });
    Ok(())
}

/// Writes names in words, and values.
fn write_metrics(body: &mut String, metrics: &Metrics) {
    let all = metrics.iter().count();
    if all == 0 {
        return;
    }
    body.push_str("<dl class=\"metrics\">\n");
    for (number, (name, value)) in metrics.iter().enumerate() {
        if number == FIRST_METRICS {
            let more = format!("{} more numbers", all - number);
            let _ =
                writeln!(body, "</dl>\n<details><summary>{more}</summary>\n<dl class=\"metrics\">");
        }
        let (words, value) = (escape(&name::words(name)), shown(&Metrics::cell(name, value)));
        let name = escape(name);
        let _ = writeln!(body, "<div><dt title=\"{name}\">{words}</dt><dd>{value}</dd></div>");
    }
    body.push_str(if all > FIRST_METRICS { "</dl>\n</details>\n" } else { "</dl>\n" });
}

/// Returns a cell as HTML.
fn shown(cell: &Cell) -> String {
    if cell.is_number() { number(cell.text()) } else { prose(cell.text()) }
}

fn write_table(body: &mut String, table: &Table) {
    body.push_str("<div class=\"table\"><table>\n");
    if !table.title.is_empty() {
        let _ = writeln!(body, "<caption>{}</caption>", prose(&table.title));
    }
    let class = |column: usize| {
        if table.is_numeric(column) { " class=\"number\"" } else { "" }
    };
    body.push_str("<thead><tr>");
    for (column, head) in table.columns.iter().enumerate() {
        let _ = write!(body, "<th{}>{}</th>", class(column), prose(head));
    }
    body.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        body.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            // On a narrow page the cells of a row lie below each other, each with its head.
            let head = escape(table.columns.get(column).map_or("", String::as_str));
            let (class, mut cell) = (class(column), shown(cell));
            if head == "section" {
                cell = format!("<a href=\"#{cell}\">{cell}</a>");
            }
            let _ = write!(body, "<td{class} data-head=\"{head}\">{cell}</td>");
        }
        body.push_str("</tr>\n");
    }
    body.push_str("</tbody></table>\n");
    if !table.note.is_empty() {
        let _ = writeln!(body, "<p class=\"note\">{}</p>", prose(&table.note));
    }
    body.push_str("</div>\n");
}
