//! Lines: bytes in, whole lines out; and a buffer for the text that goes out.

use core::fmt;

use heapless::String;
use thiserror::Error;

/// Longest tag of a request, characters.
pub const LONGEST_TAG: usize = 8;
/// Longest request, characters.
const LONGEST_REQUEST: usize = 120;
/// Longest line that is accepted, characters without its end: a request after `@TAG `.
pub const LONGEST: usize = "@ ".len() + LONGEST_TAG + LONGEST_REQUEST;
/// Space for text that goes out, bytes: the longest line, which is that of `status`, or one of `describe` and the typed text so far.
pub const OUTPUT: usize = 504;

/// Tag of a request.
pub type Tag = String<LONGEST_TAG>;

/// Beginning of each unrequested line, and of no other.
pub const UNASKED: &str = "* ";

const CTRL_C: u8 = 0x03;
const BACKSPACE: u8 = 0x08;
const CTRL_U: u8 = 0x15;
const ESCAPE: u8 = 0x1b;
const DELETE: u8 = 0x7f;

/// Reason why a line was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum LineError {
    /// Longer than [`LONGEST`].
    #[error("the line is longer than {LONGEST} characters")]
    TooLong,
    /// Not printable text.
    #[error("the line is not plain text")]
    NotText,
    /// Characters came faster than they were read, or damaged.
    #[error("characters were lost or damaged")]
    Lost,
    /// Its end did not come in time.
    #[error("the line was not finished")]
    Unfinished,
}

/// Place in an escape sequence of a terminal.
#[derive(Clone, Copy, Default, PartialEq)]
enum Sequence {
    #[default]
    Outside,
    /// Behind the escape character.
    Began,
    /// Behind `ESC [` or `ESC O`; ends with a letter or `~`.
    Inside,
}

/// Collects bytes into lines.
#[derive(Default)]
pub struct LineReader {
    text: String<LONGEST>,
    /// First error in the line so far; the line is discarded at its end.
    error: Option<LineError>,
    sequence: Sequence,
    /// Whether the last byte was a carriage return: a line feed after it belongs to the same end.
    returned: bool,
}

impl LineReader {
    /// Takes one byte. Returns the line at its end (carriage return or line feed), unless it is empty. Tab and the
    /// sequences of cursor keys are ignored.
    ///
    /// # Errors
    /// The first error in the line, which is discarded.
    pub fn push(&mut self, byte: u8) -> Result<Option<String<LONGEST>>, LineError> {
        let sequence = core::mem::replace(&mut self.sequence, Sequence::Outside);
        match (sequence, byte) {
            (_, b'\r' | b'\n') => {
                let fresh = Self { returned: byte == b'\r', ..Self::default() };
                let line = core::mem::replace(self, fresh);
                return match line.error {
                    Some(error) => Err(error),
                    None => Ok(Some(line.text).filter(|text| !text.is_empty())),
                };
            }
            (Sequence::Began, b'[' | b'O') | (Sequence::Inside, b' '..=b'?') => {
                self.sequence = Sequence::Inside;
            }
            (Sequence::Inside, b'@'..=b'~') | (Sequence::Outside, b'\t') => {}
            (Sequence::Outside, ESCAPE) => self.sequence = Sequence::Began,
            (Sequence::Outside, CTRL_C | CTRL_U) => self.forget(),
            (Sequence::Outside, BACKSPACE | DELETE) => {
                self.text.pop();
            }
            (Sequence::Outside, b' '..=b'~') => {
                if self.text.push(char::from(byte)).is_err() {
                    self.spoil(LineError::TooLong);
                }
            }
            _ => self.spoil(LineError::NotText),
        }
        self.returned = false;
        Ok(None)
    }

    /// Writes the text that a terminal is to show for the next byte, before it is [pushed](Self::push).
    pub fn echo(&self, byte: u8, to: &mut OutputLine) {
        match byte {
            b'\n' if self.returned => {}
            b'\r' | b'\n' => to.raw("\r\n"),
            CTRL_C => to.raw("^C\r\n"),
            // Erases the line of the terminal.
            CTRL_U => to.raw("\r\x1b[K"),
            BACKSPACE | DELETE if !self.text.is_empty() => to.raw("\x08 \x08"),
            b' '..=b'~' if self.sequence == Sequence::Outside && self.text.len() < LONGEST => {
                to.raw(char::from(byte).encode_utf8(&mut [0; 1]));
            }
            _ => {}
        }
    }

    /// The line so far.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Marks the incoming line as unusable.
    pub fn spoil(&mut self, why: LineError) {
        self.error.get_or_insert(why);
    }

    /// Whether a line has begun.
    pub fn begun(&self) -> bool {
        !self.text.is_empty() || self.error.is_some()
    }

    /// Discards the incoming line.
    pub fn forget(&mut self) {
        *self = Self::default();
    }
}

/// Text that goes out. Text that does not fit is cut off, between characters.
#[derive(Default)]
pub struct OutputLine {
    text: String<OUTPUT>,
    /// Tag of the request whose answer has not ended.
    tag: Option<Tag>,
}

impl OutputLine {
    /// Begins the answer to a request with this tag, if it has one.
    pub fn begin_answer(&mut self, tag: Option<Tag>) {
        self.tag = tag;
    }

    /// Adds the last line of an answer, after the request's tag.
    pub fn answer(&mut self, text: fmt::Arguments<'_>) {
        match self.tag.take() {
            Some(tag) => self.line(format_args!("@{tag} {text}")),
            None => self.line(text),
        }
    }

    /// Adds an unrequested line.
    pub fn news(&mut self, text: fmt::Arguments<'_>) {
        self.line(format_args!("{UNASKED}{text}"));
    }

    /// Adds a line of an answer that other lines follow.
    pub fn line(&mut self, text: fmt::Arguments<'_>) {
        const END: &str = "\r\n";
        // Writing to it never fails.
        let _ = fmt::Write::write_fmt(self, text);
        while self.text.len() + END.len() > OUTPUT {
            self.text.pop();
        }
        let _ = self.text.push_str(END);
    }

    /// Adds text without the end of a line.
    pub fn raw(&mut self, text: &str) {
        let _ = fmt::Write::write_str(self, text);
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Removes the text.
    pub fn clear(&mut self) {
        self.text.clear();
    }
}

impl fmt::Write for OutputLine {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let fits = text.floor_char_boundary(OUTPUT - self.text.len());
        let fits = text.get(..fits).unwrap_or_default();
        self.text.push_str(fits).map_err(|_| fmt::Error)
    }
}

#[cfg(test)]
mod tests;
