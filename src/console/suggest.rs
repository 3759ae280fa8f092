//! Suggestions for misspelt words.
//!
//! Own code replaces `strsim`, which needs an allocator.

/// Longest word that is compared.
const LONGEST: usize = 32;
/// Most changes of a letter between a word and its suggestion.
const MOST_CHANGES: usize = 2;

/// The candidate whose spelling is nearest to `word`, if it differs in at most half of the letters and at most two.
pub fn nearest(word: &str, candidates: impl Iterator<Item = &'static str>) -> Option<&'static str> {
    let most = MOST_CHANGES.min(word.len() / 2);
    let near =
        candidates.filter_map(|candidate| Some((changes(word, candidate, most)?, candidate)));
    near.min_by_key(|(changes, _)| *changes).map(|(_, candidate)| candidate)
}

/// Letters to insert, remove or replace to turn one word into the other (Levenshtein); `None` if there are more than
/// `most`.
fn changes(one: &str, other: &str, most: usize) -> Option<usize> {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    if one.len() > LONGEST || other.len() > LONGEST || one.len().abs_diff(other.len()) > most {
        return None;
    }
    // Changes from the part of `one` read so far to each beginning of `other`.
    let mut row = [0_u8; LONGEST + 1];
    (0..).zip(&mut row).for_each(|(n, place)| *place = n);
    for (n, letter) in (1..).zip(one) {
        let mut diagonal = core::mem::replace(&mut row[0], n);
        let mut fewest = n;
        for (i, with) in other.iter().enumerate() {
            let replaced = diagonal + u8::from(letter != with);
            diagonal = row[i + 1];
            row[i + 1] = replaced.min(diagonal + 1).min(row[i] + 1);
            fewest = fewest.min(row[i + 1]);
        }
        if usize::from(fewest) > most {
            return None;
        }
    }
    let changes = usize::from(row[other.len()]);
    (changes <= most).then_some(changes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_words_get_the_one_that_was_meant() {
        let words = ["start", "status", "stop", "torque", "motor.r_s", "motor.r_r", "get"];
        for (word, meant) in [
            ("stopp", Some("stop")),
            ("stpo", Some("stop")),
            ("torqe", Some("torque")),
            ("tourqe", Some("torque")),
            ("statsu", Some("status")),
            ("motor.rs", Some("motor.r_s")),
            ("motor_r_r", Some("motor.r_r")),
            ("rubbish", None),
            ("xx", None),
            ("", None),
            ("a word that is far too long to be any of the words here", None),
        ] {
            assert_eq!(nearest(word, words.into_iter()), meant, "{word}");
        }
    }

    /// Compared with the usual definition, letter by letter.
    #[test]
    fn changes_are_counted_as_defined() {
        fn defined(a: &[u8], b: &[u8]) -> usize {
            match (a, b) {
                ([], rest) | (rest, []) => rest.len(),
                ([x, a_rest @ ..], [y, b_rest @ ..]) => (defined(a_rest, b_rest)
                    + usize::from(x != y))
                .min(defined(a_rest, b) + 1)
                .min(defined(a, b_rest) + 1),
            }
        }
        let words = ["", "a", "ab", "ba", "abc", "acb", "bca", "abab", "kitten", "mitten", "sitin"];
        for a in words {
            for b in words {
                let expected = defined(a.as_bytes(), b.as_bytes());
                assert_eq!(changes(a, b, 9), Some(expected), "{a} {b}");
                assert_eq!(changes(a, b, 2), Some(expected).filter(|n| *n <= 2), "{a} {b}");
            }
        }
    }
}
