//! Lines typed, answered and logged, with their times.

use std::fmt;

/// Where a line came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Typed to the console.
    Typed,
    /// Said by the console.
    Said,
    /// Logged.
    Log,
    /// The board itself: resets, its end.
    Board,
}

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Simulated time since power-on, s.
    pub time: f64,
    /// Where it came from.
    pub source: Source,
    /// Its text.
    pub text: String,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = match self.source {
            Source::Typed => '>',
            Source::Said => '<',
            Source::Log => ' ',
            Source::Board => '#',
        };
        write!(f, "{:9.3} {mark} {}", self.time, self.text)
    }
}

/// Bytes of one direction, as they become lines.
#[derive(Debug, Default)]
pub struct Assembler {
    bytes: Vec<u8>,
}

/// Longest line that is put together.
const LONGEST: usize = 4096;

impl Assembler {
    /// Takes bytes; gives the lines that have ended.
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

    /// The line that has begun, if one has.
    pub fn rest(&mut self) -> Option<String> {
        (!self.bytes.is_empty()).then(|| readable(&std::mem::take(&mut self.bytes)))
    }
}

/// Text of bytes; those that cannot be shown are escaped.
fn readable(bytes: &[u8]) -> String {
    let shown = |byte: &u8| match byte {
        b' '..=b'~' => char::from(*byte).to_string(),
        other => format!("\\x{other:02x}"),
    };
    bytes.iter().map(shown).collect()
}
