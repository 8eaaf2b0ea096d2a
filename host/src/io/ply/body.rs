//! The records, read number by number.

use super::super::error::{Place, Problem};
use super::super::text::{Lines, number};
use super::header::{Element, Encoding, Scalar};

/// A cursor over the records. Every PLY type fits a double without loss.
pub(super) enum Body<'a> {
    Text { lines: Lines<'a>, line: usize, words: std::str::SplitWhitespace<'a> },
    Bytes { rest: &'a [u8], big_endian: bool },
}

impl<'a> Body<'a> {
    pub(super) fn text(text: &'a str, lines_before: usize) -> Self {
        Self::Text { lines: Lines::new(text, lines_before), line: 0, words: "".split_whitespace() }
    }

    pub(super) fn bytes(rest: &'a [u8], encoding: Encoding) -> Self {
        Self::Bytes { rest, big_endian: encoding == Encoding::BigEndian }
    }

    /// Holds the count of an element against the bytes that are left. Lines of text need no such check: each record
    /// takes one, and no memory is taken ahead of them.
    pub(super) fn check(&self, element: &Element) -> Result<(), Problem> {
        let Self::Bytes { rest, .. } = self else { return Ok(()) };
        let (needed, found) = (element.count.saturating_mul(element.least_bytes()), rest.len() as u64);
        if needed > found {
            return Err(Problem::CutShort { what: "the records that the header promises", needed, found });
        }
        Ok(())
    }

    /// Goes to the next record, which in text is the next line.
    pub(super) fn begin_record(&mut self) -> Result<(), Problem> {
        if let Self::Text { lines, line, words } = self {
            let (number, content) = lines.next().ok_or(Problem::EndOfFile("another record"))?;
            (*line, *words) = (number, content.split_whitespace());
        }
        Ok(())
    }

    /// Where the current record stands.
    pub(super) fn place(&self, kind: &'static str, index: u64) -> Place {
        match self {
            Self::Text { line, .. } if *line > 0 => Place::Line(*line),
            _ => Place::Element(kind, index as usize),
        }
    }

    pub(super) fn next(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        match self {
            Self::Text { words, .. } => {
                number(words.next().ok_or(Problem::Missing("a value of this record"))?)
            }
            Self::Bytes { rest, big_endian } => {
                let width = scalar.bytes();
                let Some((value, tail)) = rest.split_at_checked(width) else {
                    let (needed, found) = (width as u64, rest.len() as u64);
                    return Err(Problem::CutShort { what: "the next value", needed, found });
                };
                *rest = tail;
                let mut little = [0; 8];
                little[..width].copy_from_slice(value);
                if *big_endian {
                    little[..width].reverse();
                }
                Ok(decoded(scalar, little))
            }
        }
    }

    /// The length of a list, held against the bytes that are left.
    pub(super) fn next_length(&mut self, count: Scalar, item: Scalar) -> Result<u64, Problem> {
        let length = self.next(count)?;
        if length < 0.0 || length.fract() != 0.0 || length > f64::from(u32::MAX) {
            return Err(Problem::NotWhole(length.to_string()));
        }
        let length = length as u64;
        if let Self::Bytes { rest, .. } = self {
            let (needed, found) = (length * item.bytes() as u64, rest.len() as u64);
            if needed > found {
                return Err(Problem::CutShort { what: "the items of a list", needed, found });
            }
        }
        Ok(length)
    }
}

/// A number from its bytes, least significant first.
fn decoded(scalar: Scalar, little: [u8; 8]) -> f64 {
    let bits = u64::from_le_bytes(little);
    match scalar {
        Scalar::I8 => f64::from(bits as i8),
        Scalar::U8 => f64::from(bits as u8),
        Scalar::I16 => f64::from(bits as i16),
        Scalar::U16 => f64::from(bits as u16),
        Scalar::I32 => f64::from(bits as i32),
        Scalar::U32 => f64::from(bits as u32),
        Scalar::F32 => f64::from(f32::from_bits(bits as u32)),
        Scalar::F64 => f64::from_bits(bits),
    }
}
