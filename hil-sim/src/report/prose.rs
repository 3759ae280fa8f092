//! Plain text as HTML: signs, powers and indices as they are set in print.

/// Escapes a text and changes nothing else.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A text with code between backticks, minus signs, indices (`i_q`, `V_dc`) and powers (`L_m^2`).
pub fn prose(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(number, part)| match number % 2 {
        1 => format!("<code>{}</code>", escape(part)),
        _ => typeset(&escape(part)),
    });
    parts.collect()
}

/// A rounded number: minus sign, and a power of ten for an exponent.
pub fn number(text: &str) -> String {
    match text.split_once('e') {
        Some((digits, power)) => format!("{} × 10<sup>{}</sup>", number(digits), number(power)),
        None => text.replace('-', "−"),
    }
}

fn typeset(text: &str) -> String {
    let letters: Vec<char> = text.chars().collect();
    let at = |k: usize| letters.get(k).copied().unwrap_or(' ');
    let before = |k: usize, back: usize| k.checked_sub(back).map_or(' ', at);
    let run =
        |from: usize, of: fn(char) -> bool| letters[from..].iter().take_while(|c| of(**c)).count();
    let mut html = String::new();
    let mut k = 0;
    while k < letters.len() {
        let (letter, next) = (letters[k], at(k + 1));
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        k += 1;
        match letter {
            '-' if next.is_ascii_digit() && !is_word(before(k, 2)) && before(k, 2) != '-' => {
                html.push('−');
            }
            '-' if next == ' ' && before(k, 2) == ' ' => html.push('−'),
            '_' | '^' => {
                let (tag, of): (_, fn(char) -> bool) = match letter {
                    '_' => ("sub", char::is_alphanumeric),
                    _ => ("sup", |c| c.is_ascii_digit()),
                };
                let length = run(k, of);
                let is_index = before(k, 2).is_alphabetic()
                    && (letter == '^' || !is_word(before(k, 3)))
                    && (1..=3).contains(&length)
                    && at(k + length) != '_';
                if is_index {
                    let index: String = letters[k..k + length].iter().collect();
                    html.push_str(&format!("<{tag}>{index}</{tag}>"));
                    k += length;
                } else {
                    html.push(letter);
                }
            }
            other => html.push(other),
        }
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
            ("L_m^2/L_r < 1", "L<sub>m</sub><sup>2</sup>/L<sub>r</sub> &lt; 1"),
            ("angle_error_deg, sigma_l_s", "angle_error_deg, sigma_l_s"),
            ("`--set i_q=-1` adds", "<code>--set i_q=-1</code> adds"),
        ] {
            assert_eq!(prose(text), html);
        }
        assert_eq!(number("-1.23e-7"), "−1.23 × 10<sup>−7</sup>");
    }
}
