//! One self-contained page, from the template `page.html`: no script, no network.

use std::process::Command;

use minijinja::syntax::SyntaxConfig;
use minijinja::{Environment, UndefinedBehavior, Value, context};

use super::plot;
use super::prose::{escape, number, prose};
use crate::error::Error;
use crate::outcome::{Cell, Figure, Metrics, Origin, Outcome, Table, name};
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

/// Number of metrics before the figures; the rest is folded.
const FIRST_METRICS: usize = 5;

/// Makes the page with these sections, whose outcomes have a common origin. It states the program's version, the date,
/// seed and settings.
///
/// # Errors
/// [`Error::Internal`] if a figure cannot be drawn.
pub fn page(title: &str, origin: &Origin, sections: &[Section<'_>]) -> Result<String, Error> {
    let sections: Vec<_> = sections.iter().map(Section::contents).collect::<Result<_, _>>()?;
    let contents = context! {
        title, sections,
        style => [include_str!("page.css"), plot::STYLE].concat(),
        version => env!("CARGO_PKG_VERSION"),
        sources => env!("HIL_SIM_SOURCES"),
        commit => commit(),
        date => chrono::Utc::now().format("%Y-%m-%d %H:%M").to_string(),
        seed => origin.seed,
        settings => origin.settings.clone(),
        first_metrics => FIRST_METRICS,
    };
    rendered(contents).map_err(|why| Error::Internal(format!("page.html: {why:#}")))
}

/// Fills the template.
fn rendered(contents: Value) -> Result<String, minijinja::Error> {
    let syntax = SyntaxConfig::builder().trim_blocks(true).keep_trailing_newline(true).build()?;
    let mut environment = Environment::new();
    environment.set_syntax(syntax);
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.add_filter("escape", |text: &str| escape(text));
    environment.add_filter("prose", |text: &str| prose(text));
    environment.render_str(include_str!("page.html"), contents)
}

/// Returns the commit of the repository of this program, if it runs there.
fn commit() -> String {
    let describe = ["describe", "--always", "--dirty", "--abbrev=10"];
    let git = |root| Command::new("git").args(describe).current_dir(root).output().ok();
    let found = repository::root().and_then(git).filter(|output| output.status.success());
    let commit = found.map_or_else(|| b"unknown".to_vec(), |output| output.stdout);
    String::from_utf8_lossy(&commit).trim().to_owned()
}

impl Section<'_> {
    /// Returns what the template shows of the section.
    fn contents(&self) -> Result<Value, Error> {
        let Self { name, stands_for, about, open, outcome, .. } = *self;
        let metric = |(name, value)| {
            let (words, value) = (escape(&name::words(name)), shown(&Metrics::cell(name, value)));
            context! { name, words, value }
        };
        let figure = |figure: &Figure| {
            let title = figure.title.trim_end_matches('.');
            let panels = plot::panels(figure)?.concat();
            Ok(context! { title, source => &*figure.source, panels })
        };
        Ok(context! {
            name, stands_for, about, open,
            command => &self.command,
            lost => outcome.lost(),
            lost_runs => outcome.metrics.lost(),
            main => outcome.metrics.main().map_or(context! { words => "", value => "" }, metric),
            metrics => outcome.metrics.iter().map(metric).collect::<Vec<_>>(),
            steps => outcome.steps.as_ref().map(|steps| contents(&Table::of_steps(steps))),
            figures => outcome.figures.iter().map(figure).collect::<Result<Vec<_>, Error>>()?,
            tables => outcome.tables.iter().map(contents).collect::<Vec<_>>(),
            texts => outcome.texts.clone(),
            remarks => outcome.remarks.clone(),
        })
    }
}

/// Returns a cell as HTML.
fn shown(cell: &Cell) -> String {
    if cell.is_number() { number(cell.text()) } else { prose(cell.text()) }
}

/// Returns what the template shows of a table.
fn contents(table: &Table) -> Value {
    let column = |(place, head)| {
        let class = if table.is_numeric(place) { " class=\"number\"" } else { "" };
        context! { head, class }
    };
    let columns: Vec<_> = table.columns.iter().enumerate().map(column).collect();
    let row = |row: &Vec<Cell>| row.iter().map(shown).collect::<Vec<_>>();
    let rows: Vec<_> = table.rows.iter().map(row).collect();
    context! { title => &*table.title, columns, rows, note => &*table.note }
}
