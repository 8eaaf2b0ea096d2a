//! Lines and numbers of the text formats.

use std::borrow::Cow;

use super::error::{Fault, Problem, clipped};

/// The file as text. Comments in other encodings than UTF-8 are common, so bytes that are not UTF-8 become replacement
/// characters; where they stand in data the number parser refuses them. A byte order mark is dropped.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// Lines that are neither blank nor a comment, numbered from 1 and trimmed.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    first: usize,
}

impl<'a> Lines<'a> {
    /// `before` is the number of lines that precede `text` in its file.
    pub(super) fn new(text: &'a str, before: usize) -> Self {
        Self { lines: text.lines().enumerate(), first: before + 1 }
    }

    /// The next line, or the fault that the file ends where `wanted` was expected.
    pub(super) fn expect(&mut self, wanted: &'static str) -> Result<(usize, &'a str), Fault> {
        self.next().ok_or(Problem::EndOfFile(wanted).at(super::error::Place::File))
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        let first = self.first;
        self.lines
            .by_ref()
            .map(|(index, line)| (first + index, line.split('#').next().unwrap_or("").trim()))
            .find(|(_, line)| !line.is_empty())
    }
}

/// A number, which may be NaN or infinite.
pub(super) fn number(word: &str) -> Result<f64, Problem> {
    word.parse().map_err(|_| Problem::NotANumber(clipped(word)))
}

/// A number that is finite.
pub(super) fn coordinate(word: &str) -> Result<f64, Problem> {
    let value = number(word)?;
    if value.is_finite() { Ok(value) } else { Err(Problem::NotFinite(value)) }
}

/// A whole number.
pub(super) fn whole(word: &str) -> Result<i64, Problem> {
    word.parse().map_err(|_| Problem::NotWhole(clipped(word)))
}

/// A count.
pub(super) fn count(word: &str) -> Result<u64, Problem> {
    word.parse().map_err(|_| Problem::NotWhole(clipped(word)))
}

/// The first three words of a line as a position.
pub(super) fn position<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<[f64; 3], Problem> {
    let mut position = [0.0; 3];
    for (found, value) in position.iter_mut().enumerate() {
        let missing = Problem::ValueCount { what: "a position", found: found as u64, wanted: 3 };
        *value = coordinate(words.next().ok_or(missing)?)?;
    }
    Ok(position)
}
