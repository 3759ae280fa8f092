//! Sessions with the drive, written as text: requests, and below each of them its answer. `tests/sessions/README.md` describes the lines.

/// A request and the answer that is written below it.
#[derive(Clone, Debug)]
pub struct Exchange {
    /// Number of the line of the request.
    pub number: usize,
    /// The request.
    pub request: String,
    /// The lines of its answer.
    pub answer: Vec<String>,
}

/// Returns the exchanges of a session, without its comments.
///
/// # Errors
/// The number of the first line that is neither a request nor directly behind one.
pub fn exchanges(session: &str) -> Result<Vec<Exchange>, String> {
    let mut all: Vec<Exchange> = Vec::new();
    for (number, line) in (1..).zip(session.lines()) {
        if line.starts_with(['>', '[']) || line.starts_with("bus> ") {
            all.push(Exchange { number, request: line.to_owned(), answer: Vec::new() });
        } else if !line.is_empty() && !line.starts_with('#') {
            let last = all.last_mut().filter(|last| last.number + last.answer.len() + 1 == number);
            let last =
                last.ok_or_else(|| format!("line {number}: `{line}`: not behind a request"))?;
            last.answer.push(line.to_owned());
        }
    }
    Ok(all)
}

impl Exchange {
    /// Returns the difference between the written answer and these lines, if there is one.
    pub fn difference(&self, said: &[String]) -> Option<String> {
        let [text, answer] = [said, &self.answer].map(|lines| lines.join("\n"));
        let is_right = is_as_written(&self.answer, said);
        (!is_right).then(|| format!("the answer is\n{text}\nand not\n{answer}"))
    }
}

/// Whether lines are as written: `~ ` before a part of a line, `...` for any number of lines.
fn is_as_written(written: &[String], said: &[String]) -> bool {
    match written.split_first() {
        None => said.is_empty(),
        Some((one, rest)) if one == "..." => {
            (0..=said.len()).any(|n| is_as_written(rest, &said[n..]))
        }
        Some((one, rest)) => said.split_first().is_some_and(|(line, others)| {
            let is_right = match one.strip_prefix("~ ") {
                None => rest_behind(one, line) == Some(""),
                Some(part) => {
                    line.char_indices().any(|(at, _)| rest_behind(part, &line[at..]).is_some())
                }
            };
            is_right && is_as_written(rest, others)
        }),
    }
}

/// Returns the rest of a line that begins as written. `{1.9 to 2.1}` is any number within these bounds.
fn rest_behind<'a>(written: &str, line: &'a str) -> Option<&'a str> {
    let bounds = |inner: &str| {
        let (low, high) = inner.split_once(" to ")?;
        Some(low.parse::<f64>().ok()?..=high.parse().ok()?)
    };
    let pieces = written.split_once('{').and_then(|(before, rest)| {
        let (inner, behind) = rest.split_once('}')?;
        Some((before, bounds(inner)?, behind))
    });
    let Some((before, bounds, behind)) = pieces else { return line.strip_prefix(written) };
    let line = line.strip_prefix(before)?;
    let is_digit = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
    let end = line.find(|c| !is_digit(c)).unwrap_or(line.len());
    let number = line[..end].trim_end_matches('.');
    let is_within = number.parse::<f64>().is_ok_and(|number| bounds.contains(&number));
    if is_within { rest_behind(behind, &line[number.len()..]) } else { None }
}

/// Returns the seconds of a time such as `2 s` or `150 ms`.
pub fn seconds(time: &str) -> Option<f64> {
    let (number, unit) = time.split_once(' ')?;
    let unit = [("s", 1.0), ("ms", 1e-3)].into_iter().find(|(name, _)| *name == unit)?.1;
    number.parse::<f64>().ok().map(|number| number * unit).filter(|seconds| *seconds >= 0.0)
}
