//! The evidence: a TOML file that says which board did what, step by step. It is written whole before and after every step.

use crate::prelude::*;

/// Version of the file.
pub const SCHEMA: u32 = 1;

/// Evidence of a first light.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// Version of the file.
    pub schema: u32,
    /// Who and what: instruments, supply, motor; an emulated board says so.
    pub bench: String,
    /// The board that the image was built for.
    pub board: String,
    /// Build of the image.
    pub build: String,
    /// Every attempt at a step, in order.
    #[serde(default, rename = "step")]
    pub steps: Vec<Record>,
}

/// An attempt at a step.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Name of the step.
    pub name: String,
    /// When it began, UTC.
    pub began: String,
    /// How it ended.
    pub verdict: Verdict,
    /// Why it was not passed.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
    /// What was asked, read or calculated, with answer and limits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub found: Vec<String>,
    /// The lines of the console: those that were sent behind `> `, a trace among them.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub console: String,
}

/// The end of an attempt.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// All was as it should be.
    Passed,
    /// It was not, or there was doubt.
    Stopped,
    /// It was left out on purpose.
    Skipped,
    /// The program ended before the step did.
    Interrupted,
}

impl Record {
    /// An attempt that begins now.
    pub fn new(name: &str, verdict: Verdict) -> Self {
        let began = chrono::Utc::now().format("%Y-%m-%d %H:%M:%S").to_string();
        let (why, found, console) = Default::default();
        Self { name: name.to_owned(), began, verdict, why, found, console }
    }
}

impl Evidence {
    /// The last verdict on a step.
    pub fn verdict(&self, step: &str) -> Option<Verdict> {
        self.steps.iter().rev().find(|record| record.name == step).map(|record| record.verdict)
    }

    /// Whether it is of this board and build.
    ///
    /// # Errors
    /// The text for the person.
    pub fn is_of(&self, found: &str) -> Result<(), String> {
        let own = format!("board {}, build {}", self.board, self.build);
        let other = "another image begins with a new evidence file";
        let refused = || Err(format!("{found}: allowed is {}; {other}", cut(&own)));
        if found == own { Ok(()) } else { refused() }
    }

    /// The last attempt.
    ///
    /// # Panics
    /// Before the first one.
    pub fn record(&mut self) -> &mut Record {
        let last = self.steps.len() - 1;
        &mut self.steps[last]
    }

    /// Reads a file; none if it does not exist.
    ///
    /// # Errors
    /// [`Error::Refused`] when it cannot be read, or is none of this version.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        if !path.exists() {
            return Ok(None);
        }
        let refused = |why: String| Error::Refused(format!("{}: {why}", path.display()));
        let text = bounded::text(path).map_err(|why| refused(why.to_string()))?;
        let evidence: Self = toml::from_str(&text).map_err(|why| refused(parser_text(why)))?;
        match evidence.schema {
            SCHEMA => Ok(Some(evidence)),
            other => Err(refused(format!("schema = {other}; allowed: {SCHEMA}"))),
        }
    }

    /// Writes it.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let text = toml::to_string(self).map_err(|why| Error::Internal(why.to_string()))?;
        report::write_whole(path, &text)
    }
}
