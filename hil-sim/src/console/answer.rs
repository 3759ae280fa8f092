//! The lines that answer a command: one, or many that end with `ok`. Lines that the drive says unasked can come at any
//! time.

/// Beginnings of lines that the drive says unasked, those of the firmware's announcements and of its greeting, and of
/// the one that comes before an answer that takes a while.
const UNASKED: [&str; 15] = [
    "induction-drive ",
    "fault ",
    "running: ",
    "off: ",
    "stopped: ",
    "learning: ",
    "learned: ",
    "commissioning: ",
    "homing: ",
    "refused: ",
    "trace: ",
    "link: ",
    "bus: ",
    "applied",
    "designing...",
];
/// Commands that are answered with many lines.
const LISTS: [&str; 7] = ["help", "h", "?", "describe", "backup", "learned", "trace"];

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

/// Whether an answer says that the firmware does not know the command.
pub fn is_unknown_command(error: &str) -> bool {
    error.contains("no such command")
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
    /// Whether its lines so far are those of a list.
    many: bool,
}

impl Awaited {
    /// The answer to a command that has just been sent.
    pub fn new(command: &str) -> Self {
        Self { command: command.trim().to_owned(), begun: false, many: false }
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
        // `faults 4` is answered with `fault 4: ...`, without the advice of the announcement.
        let explained = self.word() == "faults" && !line.contains("; likely: ");
        if is_unasked(line) && !explained {
            return Meaning::Unasked;
        }
        self.begun = true;
        self.many = self.is_list(line);
        if self.many { Meaning::Answer } else { Meaning::Last }
    }

    /// Whether further lines follow this line of the answer.
    fn is_list(&self, line: &str) -> bool {
        match (self.word(), self.command.split_once(char::is_whitespace)) {
            ("get", None) => true,
            // One setting, or all whose names begin so.
            ("get", Some((_, name))) => {
                self.many || {
                    let key = line.split_once(" = ").map(|(key, _)| key);
                    key.is_some_and(|key| key != name.trim() && key.starts_with(name.trim()))
                }
            }
            ("faults", _) => self.many || !line.starts_with("none "),
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
        assert_eq!(
            meanings("get mot", &["motor.r_s = 1", "motor.r_r = 2", "ok"])[1..],
            [Answer, Last]
        );
        assert_eq!(meanings("learned", &["ok: nothing learned"]), [Last]);
        assert_eq!(meanings("describe", &["error: no such command"]), [Last]);
    }

    #[test]
    fn the_echo_and_unasked_lines_are_no_answer() {
        let lines = ["start", "fault 4: dc link above its limit", "ok"];
        assert_eq!(meanings("start", &lines), [Echo, Unasked, Last]);
        let causes = ["latched: fault 4, dc link", "cause 1: the brake", "cure: a resistor", "ok"];
        assert_eq!(meanings("faults", &causes), [Answer, Answer, Answer, Last]);
        assert_eq!(meanings("faults", &["none latched; last run: power"]), [Last]);
        assert_eq!(
            meanings("faults 4", &["fault 4: dc link", "cause 1: x", "ok"])[..2],
            [Answer; 2]
        );
        let news = "fault 4: dc link; likely: the brake; type 'clear'";
        assert_eq!(meanings("faults 4", &[news, "fault 4: dc link"]), [Unasked, Answer]);
        assert_eq!(meanings("apply", &["designing...", "off: stopped", "ok"])[..2], [Unasked; 2]);
        assert_eq!(meanings("version", &["0.1.0 1abee12"]), [Last]);
    }
}
