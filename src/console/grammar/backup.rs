//! The lines of `backup`, as they are read back.

use heapless::Vec;

use super::{ParseError, Request, WORDS_IN_LINE, Words, whole};

/// The words of a learned result in a line of `backup`.
pub fn restore<'a>(index: &'a str, words: &mut Words<'a>) -> Result<Request, ParseError<'a>> {
    let largest = crate::store::learned::WORDS as u16 - 1;
    let index = whole("the index", index, 0, largest)?;
    let mut all = Vec::new();
    while let Some(word) = words.optional() {
        all.push(hexadecimal(word)?)
            .map_err(|_| ParseError::TooMany(WORDS_IN_LINE, "words in a line"))?;
    }
    if all.is_empty() {
        return Err(ParseError::Missing("a word"));
    }
    Ok(Request::Restore(index.into(), all))
}

/// A word of eight digits.
pub fn hexadecimal(word: &str) -> Result<u32, ParseError<'_>> {
    let digits = word.len() == 8 && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    let value = u32::from_str_radix(word, 16).ok().filter(|_| digits);
    value.ok_or(ParseError::Hexadecimal(word))
}
