//! The header: which elements follow, how many, with which properties.

use super::super::error::{Fault, Place, Problem};
use super::super::text::count;

/// How the numbers behind the header are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Result<Self, Problem> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err(Problem::unknown("type", name)),
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

#[derive(Debug)]
pub(super) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes that one record takes in a binary file.
    pub(super) fn least_bytes(&self) -> u64 {
        let least = |property: &Property| match property.kind {
            Kind::One(scalar) => scalar.bytes(),
            Kind::List { count, .. } => count.bytes(),
        };
        self.properties.iter().map(|property| least(property) as u64).sum()
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Where the records begin.
    pub(super) body_at: usize,
    /// Lines of the header.
    pub(super) lines: usize,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, Fault> {
        let mut encoding = None;
        let mut elements = Vec::new();
        let mut body_at = 0;
        for (index, raw) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
            body_at += raw.len();
            let text = String::from_utf8_lossy(raw);
            let mut words = text.split_whitespace();
            let keyword = words.next().unwrap_or("");
            if keyword == "end_header" {
                let encoding = encoding.ok_or(Problem::Missing("the line 'format'").at(Place::File))?;
                return Ok(Self { encoding, elements, body_at, lines: index + 1 });
            }
            match keyword {
                "ply" if index == 0 => Ok(()),
                "comment" | "obj_info" | "" => Ok(()),
                "format" => format(words).map(|found| encoding = Some(found)),
                "element" => element(words).map(|element| elements.push(element)),
                "property" => property(words, &mut elements),
                _ if index == 0 => Err(Problem::expected("'ply'", keyword)),
                _ => Err(Problem::expected("a line of the header", keyword)),
            }
            .map_err(|problem| problem.at_line(index + 1))?;
        }
        Err(Problem::EndOfFile("'end_header'").at(Place::File))
    }
}

fn format<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Encoding, Problem> {
    let encoding = match words.next().unwrap_or("") {
        "ascii" => Encoding::Ascii,
        "binary_little_endian" => Encoding::LittleEndian,
        "binary_big_endian" => Encoding::BigEndian,
        other => return Err(Problem::unknown("format", other)),
    };
    match words.next() {
        Some("1.0") => Ok(encoding),
        other => Err(Problem::unknown("version", other.unwrap_or(""))),
    }
}

fn element<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Element, Problem> {
    let name = words.next().ok_or(Problem::Missing("the name of the element"))?.to_owned();
    let count = count(words.next().ok_or(Problem::Missing("the count of the element"))?)?;
    Ok(Element { name, count, properties: Vec::new() })
}

fn property<'a>(mut words: impl Iterator<Item = &'a str>, elements: &mut [Element]) -> Result<(), Problem> {
    let element = elements.last_mut().ok_or(Problem::Missing("the element of this property"))?;
    let mut word = || words.next().ok_or(Problem::Missing("a part of the property"));
    let kind = match word()? {
        "list" => {
            let (count, item) = (word()?, word()?);
            let counts = Scalar::from_name(count)?;
            if !counts.is_whole() {
                return Err(Problem::expected("a whole number's type for the length of a list", count));
            }
            Kind::List { count: counts, item: Scalar::from_name(item)? }
        }
        scalar => Kind::One(Scalar::from_name(scalar)?),
    };
    let name = word()?.to_owned();
    element.properties.push(Property { name, kind });
    Ok(())
}
