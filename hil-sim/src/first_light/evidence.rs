//! The test record (evidence): a TOML file with the results of a board, step by step. The whole file is written before
//! and after every step.

use crate::prelude::*;

/// Version of the file.
pub const SCHEMA: u32 = 1;

/// Test record of a first power-up.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// Version of the file.
    pub schema: u32,
    /// Bench: instruments, supply, motor; for an emulated board it says so.
    pub bench: String,
    /// The board for which the image was built.
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
    /// Time of its beginning, UTC.
    pub began: String,
    /// Its result.
    pub verdict: Verdict,
    /// Reason why it was not passed.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
    /// Questions, readings and calculated values, with answers and limits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub found: Vec<String>,
    /// The lines of the console, including a trace; lines that were sent begin with `> `.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub console: String,
}

/// The end of an attempt.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Everything was as it should be.
    Passed,
    /// Something was wrong, or there was doubt.
    Stopped,
    /// It was left out on purpose.
    Skipped,
    /// The program ended before the step did.
    Interrupted,
}

impl Record {
    /// Makes an attempt that begins now.
    pub fn new(name: &str, verdict: Verdict) -> Self {
        let began = chrono::Utc::now().format("%Y-%m-%d %H:%M:%S").to_string();
        let (why, found, console) = Default::default();
        Self { name: name.to_owned(), began, verdict, why, found, console }
    }
}

impl Evidence {
    /// Returns the last verdict on a step.
    pub fn verdict(&self, step: &str) -> Option<Verdict> {
        self.steps.iter().rev().find(|record| record.name == step).map(|record| record.verdict)
    }

    /// Checks that the record belongs to this board and build.
    ///
    /// # Errors
    /// The text for the person.
    pub fn is_of(&self, found: &str) -> Result<(), String> {
        let own = format!("board {}, build {}", self.board, self.build);
        let other = "for another image, begin a new test record";
        let refused = || Err(format!("{found}: allowed is {}; {other}", cut(&own)));
        if found == own { Ok(()) } else { refused() }
    }

    /// Returns the last attempt.
    ///
    /// # Panics
    /// Before the first attempt.
    pub fn record(&mut self) -> &mut Record {
        let last = self.steps.len() - 1;
        &mut self.steps[last]
    }

    /// Reads a file; none if it does not exist.
    ///
    /// # Errors
    /// [`Error::Refused`] if it cannot be read, or is not of this version.
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

    /// Writes the file.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let text = toml::to_string(self).map_err(|why| Error::Internal(why.to_string()))?;
        report::write_whole(path, &text)
    }
}
