//! The lines that answer a command: one, or many that end with `ok`. Lines that the drive says unasked can come at any
//! time.

/// Beginnings of lines that the drive says unasked: after a reset, about faults, learning and silence.
const UNASKED: [&str; 8] = [
    "induction-drive ",
    "fault ",
    "learned:",
    "learning",
    "refused:",
    "progress",
    "stopped:",
    "not stopped:",
];
/// Commands that are answered with many lines.
const LISTS: [&str; 5] = ["help", "describe", "backup", "learned", "trace"];

/// The meaning of a line while an answer is awaited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// The command itself, sent back.
    Echo,
    /// A line of the answer; others follow.
    Answer,
    /// The last line of the answer.
    Last,
    /// Not of the answer.
    Unasked,
}

/// Whether the drive says such a line without being asked.
pub fn is_unasked(line: &str) -> bool {
    UNASKED.iter().any(|beginning| line.starts_with(beginning))
}

/// Whether a line refuses a command.
pub fn is_error(line: &str) -> bool {
    line.starts_with("error:")
}

/// An answer that is awaited.
#[derive(Clone, Debug)]
pub struct Awaited {
    command: String,
    begun: bool,
}

impl Awaited {
    /// The answer to a command that has just been sent.
    pub fn new(command: &str) -> Self {
        Self { command: command.trim().to_owned(), begun: false }
    }

    /// Whether the answer can take minutes: a trace is first recorded.
    pub fn is_slow(&self) -> bool {
        self.word() == "trace"
    }

    fn word(&self) -> &str {
        self.command.split_whitespace().next().unwrap_or_default()
    }

    /// The meaning of the next line.
    pub fn take(&mut self, line: &str) -> Meaning {
        if !self.begun && line.trim() == self.command {
            return Meaning::Echo;
        }
        let ends = line == "ok" || line.starts_with("ok:") || line.starts_with("ok ");
        if ends || is_error(line) {
            return Meaning::Last;
        }
        if is_unasked(line) {
            return Meaning::Unasked;
        }
        self.begun = true;
        if self.is_list(line) { Meaning::Answer } else { Meaning::Last }
    }

    /// Whether further lines follow this line of the answer.
    fn is_list(&self, line: &str) -> bool {
        match (self.word(), self.command.split_once(char::is_whitespace)) {
            ("get", None) => true,
            // One setting, or all whose names begin so.
            ("get", Some((_, name))) => {
                line.split_once(" = ").is_some_and(|(key, _)| key.starts_with(&format!("{name}.")))
            }
            (word, _) => LISTS.contains(&word),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Meaning::{Answer, Echo, Last, Unasked};
    use super::*;

    fn meanings(command: &str, lines: &[&str]) -> Vec<Meaning> {
        let mut awaited = Awaited::new(command);
        lines.iter().map(|line| awaited.take(line)).collect()
    }

    #[test]
    fn a_line_is_answered_with_a_line() {
        assert_eq!(meanings("status", &["off; i_d 0.00 A"]), [Last]);
        assert_eq!(meanings("stop", &["ok"]), [Last]);
        assert_eq!(meanings("torque 9", &["ok: limited to 3.4 A"]), [Last]);
        assert_eq!(meanings("torqe", &["error: no such command"]), [Last]);
        assert_eq!(meanings("get motor.r_s", &["motor.r_s = 5.4 ohm (0.1 to 9)"]), [Last]);
    }

    #[test]
    fn a_list_ends_with_ok_or_at_once_with_an_error() {
        assert_eq!(meanings("help", &["help", "start [MODE]  begins", "ok"])[1..], [Answer, Last]);
        assert_eq!(meanings("get", &["a = 1", "b = 2", "ok"]), [Answer, Answer, Last]);
        assert_eq!(meanings("get motor", &["motor.r_s = 1", "ok"]), [Answer, Last]);
        assert_eq!(meanings("learned", &["ok: nothing learned"]), [Last]);
        assert_eq!(meanings("describe", &["error: no such command"]), [Last]);
    }

    #[test]
    fn the_echo_and_unasked_lines_are_no_answer() {
        let lines = ["start", "fault 4: dc link above its limit", "ok"];
        assert_eq!(meanings("start", &lines), [Echo, Unasked, Last]);
        assert_eq!(meanings("faults", &["latched: fault 4, dc link"]), [Last]);
        assert_eq!(meanings("version", &["0.1.0 1abee12"]), [Last]);
    }
}
