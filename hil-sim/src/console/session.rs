//! Entering of a line: commands of this program are executed, all others go to the drive.

use super::link::{Link, LinkError};
use super::own::{HELP, Own};
use super::transfer;
use crate::prelude::*;

/// Time between two progress lines of a restore.
const PROGRESS: Duration = Duration::from_secs(5);

/// Action after a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Continue with the next line.
    Next,
    /// Continue with the next line; the drive has refused this one.
    Refused(String),
    /// End.
    Quit,
}

/// A conversation with a drive.
pub struct Session {
    /// The connection.
    pub link: Link,
}

impl Session {
    /// Begins a conversation.
    pub fn new(mut link: Link) -> Self {
        link.begin();
        Self { link }
    }

    /// Enters lines up to the first that fails; the answers go to standard output.
    ///
    /// # Errors
    /// [`Error::Internal`] if the drive refuses a line or does not answer; the errors of [`Session::enter`].
    pub fn play(&mut self, lines: impl Iterator<Item = String>) -> Result<(), Error> {
        for line in lines {
            match self.enter(&line, |line| println!("{line}"))? {
                Flow::Next => {}
                Flow::Refused(why) => {
                    let line = cut(line.trim());
                    return Err(Error::Internal(format!("the drive refuses `{line}`: {why}")));
                }
                Flow::Quit => break,
            }
        }
        Ok(())
    }

    /// Enters a line; `say` gets the lines of the answer.
    ///
    /// # Errors
    /// [`Error::Refused`] for a line that is no command of this program, a file that cannot be read, or a plot without
    /// a trace; [`Error::Write`]; [`Error::Internal`] if the drive does not answer or refuses a line of a file.
    pub fn enter(&mut self, line: &str, mut say: impl FnMut(&str)) -> Result<Flow, Error> {
        let line = line.trim();
        match Own::parse(line).map_err(Error::Refused)? {
            None if line.is_empty() => {}
            None => {
                let answer = self.link.ask(line, say).map_err(failed)?;
                if let Some(error) = answer.error() {
                    let why = error.trim_start_matches("error:").trim();
                    return Ok(Flow::Refused(why.to_owned()));
                }
            }
            Some(Own::Quit) => return Ok(Flow::Quit),
            Some(Own::Help) => {
                HELP.iter().for_each(|(usage, meaning)| say(&format!("{usage:<18}{meaning}")));
            }
            Some(Own::Backup(file)) => {
                let answer = self.link.ask("backup", |_| ()).map_err(failed)?;
                if let Some(why) = answer.error() {
                    return Err(Error::Internal(format!("no backup: {why}")));
                }
                let lines = answer.contents();
                report::write_whole(&file, &(lines.join("\n") + "\n"))?;
                say(&format!("{} lines in {}", lines.len(), file.display()));
            }
            Some(Own::Restore(file)) => self.restore(&file, say)?,
            Some(Own::Plot(file)) => {
                let trace = self.link.last_trace().ok_or_else(|| {
                    Error::Refused("!plot: no trace yet; `trace 500` records one".to_owned())
                })?;
                report::write_whole(&file, &report::svg(&trace.figure())?)?;
                say(&format!("{} records in {}", trace.records(), file.display()));
            }
        }
        Ok(Flow::Next)
    }

    fn restore(&mut self, file: &Path, mut say: impl FnMut(&str)) -> Result<(), Error> {
        let name = file.display();
        let text =
            bounded::text(file).map_err(|why| Error::Refused(format!("!restore {name}: {why}")))?;
        let mut said = Instant::now();
        let done = transfer::restore(&mut self.link, &text, |done, all| {
            if said.elapsed() > PROGRESS {
                said = Instant::now();
                say(&format!("{done} of {all} lines"));
            }
        });
        let lines = done.map_err(|why| Error::Internal(format!("!restore {name}, {why}")))?;
        say(&format!(
            "{lines} lines of {name} restored; `apply` puts them in force if no line did, `save` keeps them over a reset"
        ));
        Ok(())
    }
}

fn failed(why: LinkError) -> Error {
    Error::Internal(why.to_string())
}
