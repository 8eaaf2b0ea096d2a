//! Points to PCD, in single precision because the Point Cloud Library's own point types know no other.
//!
//! Lines of sight go into fields `view_x view_y view_z`, one per point, and the header has no `VIEWPOINT`: that could
//! only hold one place for all.

use std::io::{self, Write};

use super::super::{cloud_columns, narrowed};
use super::header::Encoding;
use crate::surface::PointCloud;

const NAMES: [&str; 10] =
    ["x", "y", "z", "normal_x", "normal_y", "normal_z", "view_x", "view_y", "view_z", "sweep"];

pub(in super::super) fn write(
    writer: &mut dyn Write,
    cloud: &PointCloud,
    encoding: Encoding,
) -> io::Result<()> {
    let (names, rows) = cloud_columns(cloud, NAMES);
    let per_field = |value: &str| vec![value; names.len()].join(" ");
    let data = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::Binary => "binary",
        Encoding::Compressed => "binary_compressed",
    };
    writeln!(writer, "# .PCD v0.7 - Point Cloud Data file format\n# unit: metre\nVERSION 0.7")?;
    writeln!(writer, "FIELDS {}\nSIZE {}", names.join(" "), per_field("4"))?;
    writeln!(writer, "TYPE {}\nCOUNT {}", per_field("F"), per_field("1"))?;
    writeln!(writer, "WIDTH {0}\nHEIGHT 1\nPOINTS {0}\nDATA {data}", cloud.len())?;
    match encoding {
        Encoding::Ascii => rows.into_iter().try_for_each(|row| {
            let row: Vec<String> =
                row.iter().map(|v| narrowed(*v).map(|v| v.to_string())).collect::<Result<_, _>>()?;
            writeln!(writer, "{}", row.join(" "))
        }),
        Encoding::Binary => rows.into_iter().try_for_each(|row| {
            row.iter().try_for_each(|value| writer.write_all(&narrowed(*value)?.to_le_bytes()))
        }),
        Encoding::Compressed => {
            let rows: Vec<Vec<f64>> = rows.collect();
            let mut plain = Vec::with_capacity(rows.len() * names.len() * 4);
            for column in 0..names.len() {
                for row in &rows {
                    plain.extend(narrowed(row[column])?.to_le_bytes());
                }
            }
            let packed = lzf::compress(&plain).unwrap_or_else(|_| stored(&plain));
            for size in [packed.len(), plain.len()] {
                let size = u32::try_from(size)
                    .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "too many points for PCD"))?;
                writer.write_all(&size.to_le_bytes())?;
            }
            writer.write_all(&packed)
        }
    }
}

/// LZF data without a single reference, for points that do not get smaller.
fn stored(plain: &[u8]) -> Vec<u8> {
    plain.chunks(32).flat_map(|run| std::iter::once(run.len() as u8 - 1).chain(run.iter().copied())).collect()
}
