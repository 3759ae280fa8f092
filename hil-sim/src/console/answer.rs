//! The protocol of the console: the meaning of a line while the program awaits the answer to a request.
//!
//! Requests are sent with a tag, `@17 speed 300`, and the last line of an answer repeats it, `@17 ok`. Lines that begin
//! with `* ` are unsolicited and may come at any time. A line of the drive without a tag continues a list, or it is the
//! error of a request that was damaged on its way, so that the drive does not know the tag.

/// The meaning of a line while an answer is awaited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning<'a> {
    /// The echo of the request, or its beginning.
    Echo,
    /// A line of the answer; others follow.
    Answer,
    /// The last line of the answer.
    Last(&'a str),
    /// The last line of the answer to an older request, which is not awaited.
    Older(&'a str),
    /// The last line of the answer to a younger request, which has cut short this one's.
    Younger(&'a str),
    /// Not part of an answer.
    Unasked,
}

/// Whether the drive sends such a line unsolicited.
pub fn is_unasked(line: &str) -> bool {
    line.starts_with("* ")
}

/// Whether a line refuses a request.
pub fn is_error(line: &str) -> bool {
    line.starts_with("error:")
}

/// Returns a request with this tag, as it is sent.
pub fn tagged(tag: u32, request: &str) -> String {
    format!("@{tag:x} {request}")
}

/// Returns the tag of a line and the text after it, if it has one.
pub fn split_tag(line: &str) -> Option<(&str, &str)> {
    line.strip_prefix('@')?.split_once(' ')
}

/// Returns the meaning of a line while the answer to `request`, sent with `tag`, is awaited. Tags count up, and wrap.
pub fn meaning<'a>(tag: u32, request: &str, line: &'a str) -> Meaning<'a> {
    if is_unasked(line) {
        return Meaning::Unasked;
    }
    if line.starts_with('@') && tagged(tag, request).starts_with(line) {
        return Meaning::Echo;
    }
    let known =
        split_tag(line).and_then(|(tag, rest)| Some((u32::from_str_radix(tag, 16).ok()?, rest)));
    match known {
        Some((theirs, rest)) if theirs == tag => Meaning::Last(rest),
        Some((theirs, rest)) if tag.wrapping_sub(theirs) < 1 << 31 => Meaning::Older(rest),
        Some((_, rest)) => Meaning::Younger(rest),
        None if is_error(line) => Meaning::Last(line),
        None => Meaning::Answer,
    }
}

#[cfg(test)]
mod tests {
    use super::Meaning::{Answer, Echo, Last, Older, Unasked, Younger};
    use super::*;

    #[test]
    fn each_line_has_one_meaning() {
        for (line, expected) in [
            ("@1f faults 4", Echo),
            ("@1f faul", Echo),
            ("* fault 4: dc link; likely: the brake; type 'clear'", Unasked),
            ("* induction-drive 0.1; last run: power-on", Unasked),
            ("fault 4: dc link", Answer),
            ("cause 1: the brake", Answer),
            ("ok", Answer),
            ("@1f ok", Last("ok")),
            ("@1f ok: limited to 3.4 A", Last("ok: limited to 3.4 A")),
            ("@1f error: no such command", Last("error: no such command")),
            (
                "error: characters were lost or damaged",
                Last("error: characters were lost or damaged"),
            ),
            ("@1e ok", Older("ok")),
            ("@20 ok", Younger("ok")),
            ("@zz ok", Answer),
        ] {
            assert_eq!(meaning(0x1f, "faults 4", line), expected, "{line}");
        }
        assert_eq!(meaning(0, "stop", "@ffffffff ok"), Older("ok"));
        assert_eq!(meaning(u32::MAX, "stop", "@0 ok"), Younger("ok"));
    }
}
