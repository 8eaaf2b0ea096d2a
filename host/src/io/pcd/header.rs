//! The header: one keyword per line up to `DATA`.

use nalgebra::Point3;

use super::super::error::{Fault, Place, Problem};
use super::super::text::{coordinate, count};

/// How the points behind the header are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

/// Type of a number: letter and width in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

#[derive(Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Bytes of one value.
    pub(super) width: usize,
    /// Values per point.
    pub(super) count: usize,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    pub(super) points: u64,
    /// Present only when the file says where it was seen from.
    pub(super) viewpoint: Option<Point3<f64>>,
    pub(super) encoding: Encoding,
    /// Where the points begin.
    pub(super) body_at: usize,
    /// Lines of the header.
    pub(super) lines: usize,
}

#[derive(Default)]
struct Draft {
    names: Vec<String>,
    sizes: Vec<u64>,
    types: Vec<String>,
    counts: Vec<u64>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    viewpoint: Option<Point3<f64>>,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, Fault> {
        let mut draft = Draft::default();
        let mut body_at = 0;
        for (index, raw) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
            body_at += raw.len();
            let text = String::from_utf8_lossy(raw);
            let content = text.split('#').next().unwrap_or("");
            let mut words = content.split_whitespace();
            let keyword = words.next().unwrap_or("");
            let at_line = |problem: Problem| problem.at_line(index + 1);
            if keyword == "DATA" {
                let encoding = match words.next().unwrap_or("") {
                    "ascii" => Encoding::Ascii,
                    "binary" => Encoding::Binary,
                    "binary_compressed" => Encoding::Compressed,
                    other => return Err(at_line(Problem::unknown("kind of data", other))),
                };
                let (points, viewpoint) = (draft.point_count().map_err(at_line)?, draft.viewpoint);
                let fields = draft.fields().map_err(at_line)?;
                return Ok(Self { fields, points, viewpoint, encoding, body_at, lines: index + 1 });
            }
            draft.line(keyword, words).map_err(at_line)?;
        }
        Err(Problem::EndOfFile("the line 'DATA'").at(Place::File))
    }

    /// Bytes of one point; at most 2^31, see [`Draft::fields`].
    pub(super) fn point_bytes(&self) -> u64 {
        self.fields.iter().map(|field| (field.width * field.count) as u64).sum()
    }
}

impl Draft {
    fn line<'a>(&mut self, keyword: &str, mut words: impl Iterator<Item = &'a str>) -> Result<(), Problem> {
        let mut one = || count(words.next().ok_or(Problem::Missing("a number"))?);
        match keyword {
            "" | "VERSION" => {}
            "WIDTH" => self.width = Some(one()?),
            "HEIGHT" => self.height = Some(one()?),
            "POINTS" => self.points = Some(one()?),
            "FIELDS" | "COLUMNS" => self.names = words.map(str::to_owned).collect(),
            "TYPE" => self.types = words.map(str::to_owned).collect(),
            "SIZE" => self.sizes = words.map(count).collect::<Result<_, _>>()?,
            "COUNT" => self.counts = words.map(count).collect::<Result<_, _>>()?,
            "VIEWPOINT" => {
                let values = words.map(coordinate).collect::<Result<Vec<_>, _>>()?;
                let wrong = Problem::ValueCount { what: "VIEWPOINT", found: values.len() as u64, wanted: 7 };
                let [x, y, z, ..] = values[..] else { return Err(wrong) };
                self.viewpoint = Some(Point3::new(x, y, z));
            }
            _ => return Err(Problem::expected("a line of the header", keyword)),
        }
        Ok(())
    }

    fn point_count(&self) -> Result<u64, Problem> {
        let area = self.width.map(|width| width.saturating_mul(self.height.unwrap_or(1)));
        match (area, self.points) {
            (Some(wanted), Some(found)) if wanted != found => {
                Err(Problem::ValueCount { what: "POINTS (against WIDTH x HEIGHT)", found, wanted })
            }
            (None, None) => Err(Problem::Missing("the line 'POINTS'")),
            (area, points) => Ok(points.or(area).unwrap_or(0)),
        }
    }

    fn fields(mut self) -> Result<Vec<Field>, Problem> {
        let wanted = self.names.len();
        if self.counts.is_empty() {
            self.counts = vec![1; wanted];
        }
        for (what, found) in
            [("SIZE", self.sizes.len()), ("TYPE", self.types.len()), ("COUNT", self.counts.len())]
        {
            if found != wanted {
                return Err(Problem::ValueCount { what, found: found as u64, wanted: wanted as u64 });
            }
        }
        let mut total = 0u64;
        let mut fields = Vec::with_capacity(wanted);
        for (((name, size), kind), count) in
            self.names.into_iter().zip(self.sizes).zip(self.types).zip(self.counts)
        {
            let scalar = match (kind.as_str(), size) {
                ("I", 1 | 2 | 4 | 8) => Scalar::Signed(size as usize),
                ("U", 1 | 2 | 4 | 8) => Scalar::Unsigned(size as usize),
                ("F", 4 | 8) => Scalar::Float(size as usize),
                _ => return Err(Problem::unknown("type and size", &format!("{kind}{size}"))),
            };
            total = total.saturating_add(size.saturating_mul(count));
            if total > u64::from(u32::MAX >> 1) {
                return Err(Problem::NotWhole(count.to_string()));
            }
            fields.push(Field { name, scalar, width: size as usize, count: count as usize });
        }
        Ok(fields)
    }
}
