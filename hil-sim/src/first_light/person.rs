//! The person at the bench.

use rustyline::DefaultEditor;

use crate::error::Error;

/// A person who acts, looks and measures. `None` ends the session: the person has left, or has pressed Ctrl-C or Ctrl-D.
pub trait Person {
    /// Shows a text.
    fn tell(&mut self, text: &str);
    /// Asks the person to do something.
    fn hand(&mut self, what: &str) -> Option<()>;
    /// Asks whether something is so.
    fn see(&mut self, what: &str) -> Option<bool>;
    /// Asks for a measured value, or for a value of a nameplate.
    fn measure(&mut self, what: &str, unit: &str) -> Option<f64>;
}

/// A person at a terminal, or the lines of standard input.
pub struct Terminal(DefaultEditor);

impl Terminal {
    /// Opens the terminal of this process.
    ///
    /// # Errors
    /// [`Error::Internal`].
    pub fn new() -> Result<Self, Error> {
        let editor = DefaultEditor::new();
        editor.map(Self).map_err(|why| Error::Internal(format!("terminal: {why}")))
    }

    /// Asks until an answer is understood.
    fn ask<T>(&mut self, prompt: &str, understand: impl Fn(&str) -> Option<T>) -> Option<T> {
        loop {
            let line = self.0.readline(prompt).ok()?;
            match understand(line.trim()) {
                None => println!("not understood: {line}"),
                answer => return answer,
            }
        }
    }
}

impl Person for Terminal {
    fn tell(&mut self, text: &str) {
        println!("{text}");
    }

    fn hand(&mut self, what: &str) -> Option<()> {
        self.ask(&format!("DO: {what}. Enter when done: "), |_| Some(()))
    }

    fn see(&mut self, what: &str) -> Option<bool> {
        self.ask(&format!("SEE: {what}. y or n (in doubt n): "), |line| match line {
            "y" | "yes" => Some(true),
            "n" | "no" => Some(false),
            _ => None,
        })
    }

    fn measure(&mut self, what: &str, unit: &str) -> Option<f64> {
        let finite = |line: &str| line.parse().ok().filter(|number: &f64| number.is_finite());
        self.ask(&format!("MEASURE: {what}, {unit}: "), finite)
    }
}
