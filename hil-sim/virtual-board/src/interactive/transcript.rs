//! Lines typed, answered and logged, with their times.

use std::fmt;

use drive_stream::client::split_tag;
use induction_drive::console::line::UNASKED;

/// Origin of a line, in the order of the marks before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Typed to the console.
    Typed,
    /// Printed by the console.
    Said,
    /// Logged.
    Log,
    /// From the board itself: resets, its end.
    Board,
}

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Simulated time since power-on, s.
    pub time: f64,
    /// Its origin.
    pub source: Source,
    /// Its text.
    pub text: String,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = ['>', '<', ' ', '#'][self.source as usize];
        write!(f, "{:9.3} {mark} {}", self.time, self.text)
    }
}

/// Commands that change the behaviour of the drive; those with a reference can be numerous in a session.
const CHANGES: [&str; 5] = ["start", "stop", "learn", "clear", "reboot"];
const REFERENCES: [&str; 3] = ["torque", "speed", "position"];
/// Largest number of events that keep a figure readable.
const MOST_EVENTS: usize = 24;

impl Line {
    /// Returns the text of a line that changes the behaviour of the drive, or reports a fault or a reset.
    fn event(&self, references: bool) -> Option<&str> {
        let text = self.text.trim();
        let text = split_tag(text).map_or(text, |(_, request)| request);
        let first = text.split_whitespace().next()?;
        match self.source {
            Source::Typed if CHANGES.contains(&first) => Some(text),
            Source::Typed if references && REFERENCES.contains(&first) => Some(text),
            Source::Board if text.starts_with("reset") => Some(text),
            Source::Log => text.strip_prefix("ERROR ").filter(|text| is_fault(text)),
            Source::Said => fault(text),
            _ => None,
        }
    }
}

/// Returns the report of a fault in a line that the console says unrequested.
pub fn fault(line: &str) -> Option<&str> {
    line.strip_prefix(UNASKED).filter(|text| is_fault(text))
}

/// Whether a text is the report of a fault: `fault NUMBER: MEANING`.
fn is_fault(text: &str) -> bool {
    let number = text.strip_prefix("fault ").and_then(|rest| rest.split_once(':'));
    number.is_some_and(|(number, _)| number.parse::<u8>().is_ok())
}

/// Returns the events of a session: commands that change the behaviour of the drive, faults and resets, each with its
/// time, s. A repeated fault counts once until something else happens. If there are too many events, references are
/// left out.
pub fn events(lines: &[Line]) -> Vec<(f64, String)> {
    let all = |references: bool| {
        let mut events: Vec<(f64, String)> = Vec::new();
        for line in lines {
            if let Some(text) = line.event(references)
                && !(is_fault(text) && events.last().is_some_and(|last| last.1 == text))
            {
                events.push((line.time, text.to_owned()));
            }
        }
        events
    };
    Some(all(true)).filter(|events| events.len() <= MOST_EVENTS).unwrap_or_else(|| all(false))
}

/// Returns the texts of the faults that console or log have reported, each once.
pub fn faults(lines: &[Line]) -> Vec<String> {
    let mut faults: Vec<String> = Vec::new();
    for text in lines.iter().filter_map(|line| line.event(false)).filter(|text| is_fault(text)) {
        if !faults.iter().any(|known| known == text) {
            faults.push(text.to_owned());
        }
    }
    faults
}

/// The bytes of one direction, which are assembled to lines.
#[derive(Debug, Default)]
pub struct Assembler {
    bytes: Vec<u8>,
}

/// Longest line that is assembled.
const LONGEST: usize = 4096;

impl Assembler {
    /// Adds bytes; returns the completed lines.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<String> {
        let mut lines = Vec::new();
        for byte in bytes {
            let ends = matches!(byte, b'\r' | b'\n');
            if !ends {
                self.bytes.push(*byte);
            }
            if (ends || self.bytes.len() >= LONGEST) && !self.bytes.is_empty() {
                lines.push(readable(&std::mem::take(&mut self.bytes)));
            }
        }
        lines
    }

    /// Returns the incomplete line, if there is one.
    pub fn rest(&mut self) -> Option<String> {
        (!self.bytes.is_empty()).then(|| readable(&std::mem::take(&mut self.bytes)))
    }
}

/// Converts bytes to text; bytes that cannot be shown are escaped.
fn readable(bytes: &[u8]) -> String {
    let shown = |byte: &u8| match byte {
        b' '..=b'~' => char::from(*byte).to_string(),
        other => format!("\\x{other:02x}"),
    };
    bytes.iter().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_faults_and_resets_are_events_and_a_fault_counts_once() {
        let line = |time, source, text: &str| Line { time, source, text: text.to_owned() };
        let mut lines = vec![
            line(1.0, Source::Typed, "status"),
            line(2.0, Source::Typed, "start"),
            line(2.5, Source::Log, "INFO magnetising"),
            line(3.0, Source::Log, "ERROR fault 4: dc link above its limit"),
            line(3.1, Source::Log, "ERROR fault 4: dc link above its limit"),
            line(4.0, Source::Board, "reset: watchdog"),
            line(5.0, Source::Typed, "torque 1"),
        ];
        let texts = |lines: &[Line]| events(lines).into_iter().map(|e| e.1).collect::<Vec<_>>();
        let fault = "fault 4: dc link above its limit";
        assert_eq!(texts(&lines), ["start", fault, "reset: watchdog", "torque 1"]);
        assert_eq!(faults(&lines), [fault]);
        lines.extend((0..40).map(|k| line(6.0 + f64::from(k), Source::Typed, "torque 2")));
        assert_eq!(texts(&lines), ["start", fault, "reset: watchdog"]);
    }
}
