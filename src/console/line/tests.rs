use proptest::prelude::*;

use super::*;

type Line = Result<std::string::String, LineError>;

fn push(reader: &mut LineReader, byte: u8) -> Option<Line> {
    reader.push(byte).map(|line| line.map(|text| text.to_string())).transpose()
}

fn read(bytes: &[u8]) -> Vec<Line> {
    let mut reader = LineReader::default();
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
    // A backspace does not undo the error.
    assert_eq!(read(b"\xff\x08stop\n"), [Err(LineError::NotText)]);
}

#[test]
fn keys_that_write_nothing_are_ignored() {
    let text = |t: &str| Ok(t.to_owned());
    // Cursor keys, delete forward, function keys, and Tab.
    assert_eq!(read(b"st\x1b[A\x1b[1;5Co\x1b[3~p\x1bOP\t\n"), [text("stop")]);
    // A line ends inside a sequence, too.
    assert_eq!(read(b"stop\x1b[\nok\n"), [text("stop"), text("ok")]);
    assert_eq!(read(b"st\x1bop\nok\n"), [Err(LineError::NotText), text("ok")]);
}

#[test]
fn the_line_is_killed_by_control_characters() {
    let text = |t: &str| Ok(t.to_owned());
    assert_eq!(read(b"torque 3\x15stop\n"), [text("stop")]);
    assert_eq!(read(b"\xfftorque 3\x03stop\n"), [text("stop")]);
    assert_eq!(read(b"torque 3\x03\n"), []);
}

/// One line of a terminal's screen: the text that the echo leaves there is the text that is taken.
#[test]
fn the_echo_shows_the_line_as_it_is_taken() {
    for typed in ["stop", "storq\x08\x7fp", "torque 3\x15stop", "\x08st\x1b[Aop\t", "st\x03stop"] {
        let mut reader = LineReader::default();
        let mut out = OutputLine::default();
        for byte in typed.bytes() {
            reader.echo(byte, &mut out);
            push(&mut reader, byte);
        }
        let mut screen = std::string::String::new();
        let mut shown =
            out.as_str().replace("\r\x1b[K", "\r").chars().collect::<Vec<_>>().into_iter();
        while let Some(c) = shown.next() {
            match c {
                '\r' | '\n' => screen.clear(),
                '\x08' => {
                    screen.pop();
                    // A blank over the character, and back again.
                    assert_eq!((shown.next(), shown.next()), (Some(' '), Some('\x08')));
                }
                c => screen.push(c),
            }
        }
        assert_eq!((screen.as_str(), reader.text()), ("stop", "stop"), "{typed:?}");
    }
    let mut reader = LineReader::default();
    let mut out = OutputLine::default();
    for byte in *b"a\r\n\n" {
        reader.echo(byte, &mut out);
        push(&mut reader, byte);
    }
    assert_eq!(out.as_str(), "a\r\n\r\n");
}

#[test]
fn a_lost_character_spoils_its_line_only() {
    let mut reader = LineReader::default();
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
        let (mut out, before) = (OutputLine::default(), "x".repeat(OUTPUT - 5));
        out.line(format_args!("{before}{text}"));
        assert_eq!(out.as_str(), before + line);
    }
}

proptest! {
    #[test]
    fn whatever_comes_in_a_line_is_taken_as_it_is(line in "[ -~]{1,120}") {
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
