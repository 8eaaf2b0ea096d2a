//! Points from PCD.

use super::super::assemble::RawCloud;
use super::super::error::{Fault, Place, Problem};
use super::super::text::{Lines, decoded, number};
use super::header::{Encoding, Header, Scalar};

/// Fields that are kept, in the order of [`RawCloud::push`].
const KEPT: [[&str; 2]; 10] = [
    ["x", "x"],
    ["y", "y"],
    ["z", "z"],
    ["normal_x", "nx"],
    ["normal_y", "ny"],
    ["normal_z", "nz"],
    ["view_x", "view_x"],
    ["view_y", "view_y"],
    ["view_z", "view_z"],
    ["sweep", "sweep"],
];

/// LZF cannot do better: a reference of three bytes copies at most 264.
const MAX_LZF_RATIO: u64 = 88;

/// Field of each kept value, `None` where the file has none.
type Slots = [Option<usize>; 10];

pub(in super::super) fn read(bytes: &[u8]) -> Result<RawCloud, Fault> {
    let header = Header::parse(bytes)?;
    let slots: Slots = KEPT.map(|names| {
        header.fields.iter().position(|field| names.contains(&field.name.as_str()) && field.count > 0)
    });
    let has = |wanted: std::ops::Range<usize>| slots[wanted].iter().all(Option::is_some);
    if !has(0..3) {
        return Err(Problem::Missing("x, y or z among FIELDS").at(Place::File));
    }
    let mut cloud = RawCloud::with(has(3..6), has(6..9), has(9..10));
    cloud.viewpoint = header.viewpoint;
    let body = &bytes[header.body_at..];
    match header.encoding {
        Encoding::Ascii => read_ascii(&header, &slots, body, &mut cloud)?,
        Encoding::Binary => {
            let points = available(&header, body).map_err(|problem| problem.at(Place::File))?;
            let starts = starts(&header, 1);
            let step = header.point_bytes() as usize;
            collect(&header, &slots, body, points, |field| (starts[field], step), &mut cloud);
        }
        Encoding::Compressed => {
            let plain = decompressed(&header, body).map_err(|problem| problem.at(Place::File))?;
            let points = header.points as usize;
            let starts = starts(&header, points);
            let step = |field: usize| header.fields[field].width * header.fields[field].count;
            collect(&header, &slots, &plain, points, |field| (starts[field], step(field)), &mut cloud);
        }
    }
    Ok(cloud)
}

/// The number of points, when their bytes are there.
fn available(header: &Header, body: &[u8]) -> Result<usize, Problem> {
    let (needed, found) = (header.points.saturating_mul(header.point_bytes()), body.len() as u64);
    if needed > found {
        return Err(Problem::CutShort { what: "the points", needed, found });
    }
    Ok(header.points as usize)
}

/// Where the first value of each field stands when the fields before it take `points` values each.
fn starts(header: &Header, points: usize) -> Vec<usize> {
    let sizes = header.fields.iter().map(|field| field.width * field.count * points);
    sizes
        .scan(0, |start, size| {
            let here = *start;
            *start += size;
            Some(here)
        })
        .collect()
}

/// Takes the kept fields out of `data`, which is long enough: value `i` of a field stands at its start + `i` steps.
fn collect(
    header: &Header,
    slots: &Slots,
    data: &[u8],
    points: usize,
    layout: impl Fn(usize) -> (usize, usize),
    cloud: &mut RawCloud,
) {
    for point in 0..points {
        let mut values = [0.0; 10];
        for (value, slot) in values.iter_mut().zip(slots) {
            if let Some(field) = *slot {
                let (start, step) = layout(field);
                *value = decode(header.fields[field].scalar, &data[start + point * step..]);
            }
        }
        cloud.push(&values);
    }
}

fn read_ascii(header: &Header, slots: &Slots, body: &[u8], cloud: &mut RawCloud) -> Result<(), Fault> {
    let text = decoded(body);
    let mut lines = Lines::new(&text, header.lines);
    let columns: Vec<usize> = header
        .fields
        .iter()
        .scan(0, |column, field| {
            let here = *column;
            *column += field.count;
            Some(here)
        })
        .collect();
    let wanted: usize = header.fields.iter().map(|field| field.count).sum();
    for _ in 0..header.points {
        let (line, content) = lines.expect("another point")?;
        let words: Vec<&str> = content.split_whitespace().collect();
        if words.len() != wanted {
            let (found, wanted) = (words.len() as u64, wanted as u64);
            return Err(Problem::ValueCount { what: "a point", found, wanted }.at_line(line));
        }
        let mut values = [0.0; 10];
        for (value, slot) in values.iter_mut().zip(slots) {
            if let Some(field) = *slot {
                *value = number(words[columns[field]]).map_err(|problem| problem.at_line(line))?;
            }
        }
        cloud.push(&values);
    }
    Ok(())
}

/// Two counts, then LZF data that hold the first field of all points, then the second, and so on.
fn decompressed(header: &Header, body: &[u8]) -> Result<Vec<u8>, Problem> {
    let counts = body.split_at_checked(8).and_then(|(counts, rest)| {
        let (packed, plain) = counts.split_at(4);
        let count = |bytes: &[u8]| bytes.first_chunk().map(|bytes| u64::from(u32::from_le_bytes(*bytes)));
        Some((count(packed)?, count(plain)?, rest))
    });
    let Some((packed, plain, rest)) = counts else {
        let found = body.len() as u64;
        return Err(Problem::CutShort { what: "the sizes of the compressed points", needed: 8, found });
    };
    let wanted = header.points.saturating_mul(header.point_bytes());
    if plain != wanted {
        return Err(Problem::ValueCount { what: "the size of the points", found: plain, wanted });
    }
    let short = Problem::CutShort { what: "the compressed points", needed: packed, found: rest.len() as u64 };
    let data = rest.get(..packed as usize).ok_or(short)?;
    if plain == 0 {
        return Ok(Vec::new());
    }
    let most = packed.saturating_mul(MAX_LZF_RATIO);
    if plain > most || plain > super::super::MAX_FILE_BYTES {
        return Err(Problem::ValueCount { what: "the size of the points", found: plain, wanted: most });
    }
    let points = lzf::decompress(data, plain as usize).map_err(Problem::Compression)?;
    if points.len() as u64 != plain {
        return Err(Problem::ValueCount {
            what: "decompressed bytes",
            found: points.len() as u64,
            wanted: plain,
        });
    }
    Ok(points)
}

/// A number from the bytes at the start of `data`, least significant first.
fn decode(scalar: Scalar, data: &[u8]) -> f64 {
    let (Scalar::Signed(width) | Scalar::Unsigned(width) | Scalar::Float(width)) = scalar;
    let mut little = [0; 8];
    little[..width].copy_from_slice(&data[..width]);
    let bits = u64::from_le_bytes(little);
    match scalar {
        Scalar::Unsigned(_) => bits as f64,
        Scalar::Signed(width) => {
            let unused = 64 - 8 * width as u32;
            ((bits << unused) as i64 >> unused) as f64
        }
        Scalar::Float(4) => f64::from(f32::from_bits(bits as u32)),
        Scalar::Float(_) => f64::from_bits(bits),
    }
}
