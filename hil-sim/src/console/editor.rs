//! The console of a person: a line editor with history and completion. Lines from the drive are shown above the line
//! that is being typed.

use std::sync::mpsc::channel;

use rustyline::completion::Completer;
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::DefaultHistory;
use rustyline::validate::Validator;
use rustyline::{CompletionType, Config, Context, Editor, ExternalPrinter as _, Helper};

use super::catalogue::Catalogue;
use super::link::Link;
use super::session::{Flow, Session};
use crate::error::Error;

/// The completion for the line editor.
struct Completion(Catalogue);

impl Completer for Completion {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _: &Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        Ok(self.0.complete(&line[..at]))
    }
}

impl Hinter for Completion {
    type Hint = String;
}
impl Highlighter for Completion {}
impl Validator for Completion {}
impl Helper for Completion {}

/// A function that shows an unsolicited line of the drive.
type Show = Box<dyn FnMut(&str) + Send>;

/// Talks to a drive until the person ends the session.
///
/// # Errors
/// [`Error::Internal`] if the terminal fails or the port is closed.
pub fn run(port: &str, connect: impl FnOnce(Show) -> Link) -> Result<(), Error> {
    let terminal = |why: ReadlineError| Error::Internal(format!("terminal: {why}"));
    let config = Config::builder().completion_type(CompletionType::List).auto_add_history(true);
    let mut editor: Editor<Completion, DefaultHistory> =
        Editor::with_config(config.build()).map_err(terminal)?;
    let mut printer = editor.create_external_printer().map_err(terminal)?;
    // The printer may wait for the editor; the sender of a line must not.
    let (send, lines) = channel::<String>();
    std::thread::spawn(move || {
        lines.iter().for_each(|line| drop(printer.print(format!("{line}\n"))));
    });
    let mut session = Session::new(connect(Box::new(move |line| drop(send.send(line.to_owned())))));
    match Catalogue::read(&mut session.link) {
        Ok(catalogue) => {
            let settings = catalogue.settings();
            println!("{port}: {settings} settings; !help lists the commands of this program");
            editor.set_helper(Some(Completion(catalogue)));
        }
        Err(why) => println!("{port}: {why}; Tab completes nothing"),
    }
    loop {
        match editor.readline("> ") {
            Ok(line) => match session.enter(&line, |line| println!("{line}")) {
                Ok(Flow::Next | Flow::Refused(_)) => {}
                Ok(Flow::Quit) => return Ok(()),
                Err(error) => println!("{error}"),
            },
            // Ctrl-C only discards the line.
            Err(ReadlineError::Interrupted) => {}
            Err(ReadlineError::Eof) => return Ok(()),
            Err(error) => return Err(terminal(error)),
        }
    }
}
