//! Lines: bytes in, whole lines out; and a buffer for the line that goes out.

use core::fmt;

use heapless::String;

/// Longest line that is taken, characters without its end.
pub const LONGEST: usize = 80;

/// Reason why a line was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// Longer than [`LONGEST`].
    TooLong,
    /// Not printable text.
    NotText,
    /// Characters came faster than they were read, or damaged.
    Lost,
    /// Its end did not come in time.
    Unfinished,
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong => write!(f, "the line is longer than {LONGEST} characters"),
            Self::NotText => f.write_str("the line is not plain text"),
            Self::Lost => f.write_str("characters were lost or damaged"),
            Self::Unfinished => f.write_str("the line was not finished"),
        }
    }
}

/// Collects bytes to lines.
pub struct LineReader {
    text: String<LONGEST>,
    /// First error in the line so far; the line is discarded at its end.
    error: Option<LineError>,
}

impl LineReader {
    /// A reader without input so far.
    pub const fn new() -> Self {
        Self { text: String::new(), error: None }
    }

    /// Takes one byte. Returns the line at its end (carriage return or line feed), unless it is empty.
    ///
    /// # Errors
    /// The first error in the line, which is discarded.
    pub fn push(&mut self, byte: u8) -> Result<Option<String<LONGEST>>, LineError> {
        match byte {
            b'\r' | b'\n' => {
                let line = core::mem::replace(self, Self::new());
                return match line.error {
                    Some(error) => Err(error),
                    None => Ok(Some(line.text).filter(|text| !text.is_empty())),
                };
            }
            // Backspace and delete, for people.
            0x08 | 0x7f => {
                self.text.pop();
            }
            b'\t' | b' '..=b'~' => {
                if self.text.push(char::from(byte)).is_err() {
                    self.spoil(LineError::TooLong);
                }
            }
            _ => self.spoil(LineError::NotText),
        }
        Ok(None)
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
        *self = Self::new();
    }
}

/// Room for a line that goes out, bytes. Text that does not fit is cut off, between characters.
pub struct OutputLine<const N: usize = 240>(String<N>);

impl<const N: usize> OutputLine<N> {
    /// The line of this text.
    pub fn new(text: fmt::Arguments<'_>) -> Self {
        const END: &str = "\r\n";
        let mut line = Self(String::new());
        // Writing to it never fails.
        let _ = fmt::Write::write_fmt(&mut line, text);
        while line.0.len() + END.len() > N {
            line.0.pop();
        }
        let _ = line.0.push_str(END);
        line
    }

    /// The line with its end.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl<const N: usize> fmt::Write for OutputLine<N> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let fits = text.floor_char_boundary(N - self.0.len());
        let fits = text.get(..fits).unwrap_or_default();
        self.0.push_str(fits).map_err(|()| fmt::Error)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    type Line = Result<std::string::String, LineError>;

    fn push(reader: &mut LineReader, byte: u8) -> Option<Line> {
        reader.push(byte).map(|line| line.map(|text| text.to_string())).transpose()
    }

    fn read(bytes: &[u8]) -> Vec<Line> {
        let mut reader = LineReader::new();
        bytes.iter().filter_map(|byte| push(&mut reader, *byte)).collect()
    }

    #[test]
    fn lines_end_with_either_character_or_both() {
        let text = |t: &str| Ok(t.to_owned());
        assert_eq!(read(b"a\nbb\r\n\n\rcc\rd"), [text("a"), text("bb"), text("cc")]);
        assert_eq!(read(b"abx\x08c\n"), [text("abc")]);
    }

    #[test]
    fn what_is_no_line_is_one_error_and_the_next_line_is_whole() {
        let mut long = vec![b'x'; 1000];
        long.extend(b"\nok\n");
        assert_eq!(read(&long), [Err(LineError::TooLong), Ok("ok".to_owned())]);
        assert_eq!(read(b"st\xffop\nok\n"), [Err(LineError::NotText), Ok("ok".to_owned())]);
        assert_eq!(read(b"st\0op\nok\n"), [Err(LineError::NotText), Ok("ok".to_owned())]);
        // A backspace does not heal.
        assert_eq!(read(b"\xff\x08stop\n"), [Err(LineError::NotText)]);
    }

    #[test]
    fn a_lost_character_spoils_its_line_only() {
        let mut reader = LineReader::new();
        for byte in *b"tor" {
            assert_eq!(push(&mut reader, byte), None);
        }
        reader.spoil(LineError::Lost);
        assert!(reader.begun());
        for byte in *b"e 3" {
            assert_eq!(push(&mut reader, byte), None);
        }
        assert_eq!(push(&mut reader, b'\n'), Some(Err(LineError::Lost)));
        assert!(!reader.begun());
    }

    #[test]
    fn text_is_cut_between_characters() {
        for (text, line) in
            [("ab", "ab\r\n"), ("ab°", "ab\r\n"), ("ab°°", "ab\r\n"), ("a°cd", "a°\r\n")]
        {
            assert_eq!(OutputLine::<5>::new(format_args!("{text}")).as_str(), line);
        }
    }

    proptest! {
        #[test]
        fn whatever_comes_in_a_line_is_taken_as_it_is(line in "[ -~]{1,80}") {
            prop_assert_eq!(read(format!("{line}\n").as_bytes()), [Ok(line)]);
        }

        #[test]
        fn after_any_bytes_a_line_is_read_again(bytes: Vec<u8>) {
            let mut all = bytes;
            all.extend(b"\nstop\n");
            let lines = read(&all);
            prop_assert_eq!(lines.last(), Some(&Ok("stop".to_owned())));
        }
    }
}
