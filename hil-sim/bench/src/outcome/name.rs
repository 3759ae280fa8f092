//! Names for programs, derived from labels for people.
//!
//! This is our own code: crates that change the case of identifiers split `mA` and `dB`, and know no units.

/// Converts a label to `snake_case`: `turn of the axis (°)` becomes `turn_of_the_axis_deg`. A unit in brackets at the
/// end stays at the end; signs and Greek letters are spelled out.
pub fn snake(label: &str) -> String {
    let (quantity, unit) = split(label);
    joined(&[quantity, unit])
}

/// Returns the name of a curve: the name of its panel, then its own, and the unit of the panel at the end.
pub fn of_curve(panel: &str, series: &str) -> String {
    let (quantity, unit) = split(panel);
    joined(&[quantity, series, unit])
}

#[rustfmt::skip] // one a line would fill a page
const UNITS: [(&str, &str); 19] = [
    ("_deg", "°"), ("_pct", "%"), ("_nm", "Nm"), ("_ma", "mA"), ("_ua", "µA"), ("_a", "A"), ("_v", "V"), ("_ms", "ms"),
    ("_us", "µs"), ("_s", "s"), ("_rpm", "rpm"), ("_hz", "Hz"), ("_wb", "Wb"), ("_ohm", "Ω"), ("_milli", "10⁻³"),
    ("_db", "dB"), ("_w", "W"), ("_h", "H"), ("_c", "°C"),
];

/// Splits the unit from the end of a name and returns it as it is shown; none if the name ends in no unit.
pub fn split_unit(name: &str) -> Option<(&str, &'static str)> {
    UNITS.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit)))
}

/// Converts a name to words: `angle_error_rms_deg` becomes `angle error rms (°)`.
pub fn words(name: &str) -> String {
    match split_unit(name).filter(|(of, _)| !of.ends_with("_per") && !of.ends_with(".r")) {
        Some((quantity, unit)) => format!("{} ({unit})", quantity.replace('_', " ")),
        None => name.replace('_', " "),
    }
}

/// Returns a name that `taken` does not have yet, with a number at the end if needed.
pub fn unique(name: String, taken: &mut Vec<String>) -> String {
    let numbered = (2..).map(|number| format!("{name}_{number}"));
    let mut candidates = std::iter::once(name.clone()).chain(numbered);
    let free = candidates.find(|name| !taken.contains(name)).unwrap_or(name);
    taken.push(free.clone());
    free
}

/// Splits a label into quantity and unit.
fn split(label: &str) -> (&str, &str) {
    let inside = label.strip_suffix(')').and_then(|label| label.rsplit_once(" ("));
    inside.unwrap_or((label, ""))
}

fn joined(parts: &[&str]) -> String {
    let words: Vec<_> =
        parts.iter().map(|part| plain(part)).filter(|part| !part.is_empty()).collect();
    words.join("_")
}

fn plain(text: &str) -> String {
    // As in the names of metrics, the kind of an angle stands before its unit.
    let text = match text.strip_prefix("° ") {
        Some(kind) => format!("{kind} °"),
        None => text.replace("10⁻³", "milli"),
    };
    let mut name = String::new();
    let mut before = ' ';
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let is_sign = matches!(letter, '-' | '−')
            && !before.is_alphanumeric()
            && letters.peek().is_some_and(char::is_ascii_digit);
        before = letter;
        match spelled(letter) {
            _ if is_sign => name.push_str(" minus "),
            Some(word) => name.push_str(&format!(" {word} ")),
            None if letter == 'µ' => name.push('u'),
            None if letter.is_ascii_alphanumeric() => name.push(letter.to_ascii_lowercase()),
            None if letter == '\u{302}' => {}
            None => name.push(' '),
        }
    }
    name.split_whitespace().collect::<Vec<_>>().join("_")
}

fn spelled(letter: char) -> Option<&'static str> {
    #[rustfmt::skip] // as above
    const WORDS: [(char, &str); 16] = [
        ('°', "deg"), ('%', "pct"), ('Ω', "ohm"), ('Δ', "delta"), ('γ', "gamma"), ('θ', "theta"), ('λ', "lambda"), ('σ', "sigma"),
        ('τ', "tau"), ('φ', "phi"), ('ψ', "psi"), ('ω', "omega"), ('±', "plus_minus"), ('₁', "1"), ('₂', "2"), ('²', "2"),
    ];
    WORDS.iter().find(|(known, _)| *known == letter).map(|(_, word)| *word)
}
