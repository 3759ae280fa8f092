//! Lines: bytes in, whole lines out; and a buffer for the line that goes out.

use core::fmt;
use core::str;

/// Longest line that is taken, without its end.
pub const LONGEST: usize = 80;

/// Why a line was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Garbled {
    /// Longer than [`LONGEST`].
    TooLong,
    /// Not printable text.
    NotText,
    /// Characters came faster than they were read, or damaged.
    Lost,
    /// Its end did not come in time.
    Unfinished,
}

impl fmt::Display for Garbled {
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
pub struct Lines {
    bytes: [u8; LONGEST],
    length: usize,
    /// What is wrong with the line so far: it is thrown away at its end.
    garbled: Option<Garbled>,
}

impl Lines {
    /// Nothing read yet.
    pub const fn new() -> Self {
        Self { bytes: [0; LONGEST], length: 0, garbled: None }
    }

    /// Takes one byte. At the end of a line (carriage return or line feed) gives it; of an empty
    /// line, nothing.
    pub fn push(&mut self, byte: u8) -> Option<Result<&str, Garbled>> {
        match byte {
            b'\r' | b'\n' => return self.end(),
            // Backspace and delete, for people.
            0x08 | 0x7f => self.length = self.length.saturating_sub(1),
            b'\t' | b' '..=b'~' => match self.bytes.get_mut(self.length) {
                Some(place) => {
                    *place = byte;
                    self.length += 1;
                }
                None => self.spoil(Garbled::TooLong),
            },
            _ => self.spoil(Garbled::NotText),
        }
        None
    }

    /// The line that is coming in is no good any more.
    pub fn spoil(&mut self, why: Garbled) {
        self.garbled.get_or_insert(why);
    }

    /// Whether a line has begun.
    pub fn begun(&self) -> bool {
        self.length > 0 || self.garbled.is_some()
    }

    /// Throws away what has come of a line.
    pub fn forget(&mut self) {
        *self = Self::new();
    }

    fn end(&mut self) -> Option<Result<&str, Garbled>> {
        let length = core::mem::take(&mut self.length);
        if let Some(why) = self.garbled.take() {
            return Some(Err(why));
        }
        let line = self.bytes.get(..length)?;
        (length > 0).then(|| str::from_utf8(line).map_err(|_| Garbled::NotText))
    }
}

/// A line on its way out. What does not fit is cut off.
#[derive(Clone, Copy)]
pub struct Text<const N: usize = 240> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Text<N> {
    /// Empty.
    pub const fn new() -> Self {
        Self { bytes: [0; N], length: 0 }
    }

    /// Ends the line, over its last characters if it is full.
    pub fn end_line(&mut self) {
        const END: &[u8] = b"\r\n";
        let mut at = self.length.min(N.saturating_sub(END.len()));
        while !self.as_str().is_char_boundary(at) {
            at -= 1;
        }
        if let Some(place) = self.bytes.get_mut(at..at + END.len()) {
            place.copy_from_slice(END);
            self.length = at + END.len();
        }
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        // Whole characters only were written.
        self.bytes.get(..self.length).and_then(|b| str::from_utf8(b).ok()).unwrap_or("")
    }
}

impl<const N: usize> fmt::Write for Text<N> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let (bytes, room) = (text.as_bytes(), N.saturating_sub(self.length));
        // Whole characters only.
        let fits = text.floor_char_boundary(room);
        for (place, byte) in self.bytes.iter_mut().skip(self.length).zip(bytes.iter().take(fits)) {
            *place = *byte;
        }
        self.length += fits;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use core::fmt::Write;

    use proptest::prelude::*;

    use super::*;

    fn read(bytes: &[u8]) -> Vec<Result<String, Garbled>> {
        let mut lines = Lines::new();
        bytes.iter().filter_map(|b| Some(lines.push(*b)?.map(str::to_owned))).collect()
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
        assert_eq!(read(&long), [Err(Garbled::TooLong), Ok("ok".to_owned())]);
        assert_eq!(read(b"st\xffop\nok\n"), [Err(Garbled::NotText), Ok("ok".to_owned())]);
        assert_eq!(read(b"st\0op\nok\n"), [Err(Garbled::NotText), Ok("ok".to_owned())]);
        // A backspace does not heal.
        assert_eq!(read(b"\xff\x08stop\n"), [Err(Garbled::NotText)]);
    }

    #[test]
    fn a_lost_character_spoils_its_line_only() {
        let mut lines = Lines::new();
        for byte in *b"tor" {
            assert!(lines.push(byte).is_none());
        }
        lines.spoil(Garbled::Lost);
        assert!(lines.begun());
        for byte in *b"e 3" {
            assert!(lines.push(byte).is_none());
        }
        assert_eq!(lines.push(b'\n'), Some(Err(Garbled::Lost)));
        assert!(!lines.begun());
    }

    #[test]
    fn text_is_cut_between_characters() {
        let mut text = Text::<5>::new();
        write!(text, "ab°°").unwrap();
        assert_eq!(text.as_str(), "ab°");
        text.end_line();
        assert_eq!(text.as_str(), "ab\r\n");
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
