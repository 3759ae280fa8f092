//! Plain text as HTML, with signs, powers and indices as in print.

/// Escapes a text and changes nothing else.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Formats a text with code between backticks, minus signs, indices (`i_q`, `V_dc`) and powers (`L_m^2`).
pub fn prose(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(number, part)| match number % 2 {
        1 => format!("<code>{}</code>", escape(part)),
        _ => typeset(&escape(part)),
    });
    parts.collect()
}

/// Formats a rounded number: minus sign, and a power of ten for an exponent.
pub fn number(text: &str) -> String {
    match text.split_once('e') {
        Some((digits, power)) if power.parse::<i32>().is_ok() => {
            format!("{} × 10<sup>{}</sup>", signs(digits), signs(power))
        }
        _ => signs(text),
    }
}

/// Replaces names of parameters that stand alone with their symbols.
fn symbols(text: &str) -> String {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let words = text.split_inclusive(|c| !is_word(c)).map(|piece| {
        let word = piece.trim_end_matches(|c| !is_word(c));
        let symbol = match word {
            "tau_r" => "τ_r",
            "sigma_l_s" => "σ l_s",
            "omega_m" => "ω_m",
            other => other,
        };
        format!("{symbol}{}", &piece[word.len()..])
    });
    words.collect()
}

/// Replaces hyphens that stand for a minus: before a digit and not after a word, or between two spaces.
pub fn signs(text: &str) -> String {
    let letters: Vec<char> = text.chars().collect();
    let signed = letters.iter().enumerate().map(|(k, &letter)| {
        let before = k.checked_sub(1).map_or(' ', |k| letters[k]);
        let next = letters.get(k + 1).copied().unwrap_or(' ');
        let is_sign = next.is_ascii_digit() && !before.is_alphanumeric() && !"-_".contains(before);
        let is_between = before == ' ' && next == ' ' && 0 < k && k + 1 < letters.len();
        if letter == '-' && (is_sign || is_between) { '−' } else { letter }
    });
    signed.collect()
}

/// Formats signs, indices and powers of an escaped text.
fn typeset(text: &str) -> String {
    let letters: Vec<char> = signs(&symbols(text)).chars().collect();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let before = |k: usize, back: usize| k.checked_sub(back).map_or(' ', |k| letters[k]);
    let mut html = String::new();
    let mut k = 0;
    while let Some(&letter) = letters.get(k) {
        let rest = &letters[k + 1..];
        let (tag, of): (_, fn(&&char) -> bool) = match letter {
            '_' => ("sub", |c| c.is_alphabetic() || c.is_ascii_digit()),
            _ => ("sup", |c| c.is_ascii_digit()),
        };
        let index: String = rest.iter().take_while(of).collect();
        let length = index.chars().count();
        let is_index = matches!(letter, '_' | '^')
            && before(k, 1).is_alphabetic()
            // Only after a single letter: other words with an underscore are names.
            && (letter == '^' || !is_word(before(k, 2)))
            && (1..=3).contains(&length)
            && rest.get(length) != Some(&'_');
        if is_index {
            html.push_str(&format!("<{tag}>{index}</{tag}>"));
            k += length;
        } else {
            html.push(letter);
        }
        k += 1;
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_indices_and_powers_are_set() {
        for (text, html) in [
            ("-3.5 % and a-b, (-2)", "−3.5 % and a-b, (−2)"),
            ("Table 1-2, z - 1", "Table 1-2, z − 1"),
            ("i_q, V_dc t_d / T", "i<sub>q</sub>, V<sub>dc</sub> t<sub>d</sub> / T"),
            ("x^2 < L_m/L_r", "x<sup>2</sup> &lt; L<sub>m</sub>/L<sub>r</sub>"),
            ("angle_error_deg, tau_r_error", "angle_error_deg, tau_r_error"),
            ("sigma_l_s/tau_r, L_m²", "σ l<sub>s</sub>/τ<sub>r</sub>, L<sub>m</sub>²"),
            ("`--set i_q=-1` adds", "<code>--set i_q=-1</code> adds"),
        ] {
            assert_eq!(prose(text), html);
        }
        assert_eq!(number("none"), "none");
        assert_eq!(number("-1.23e-7"), "−1.23 × 10<sup>−7</sup>");
    }
}
