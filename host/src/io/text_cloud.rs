//! Columns of numbers: XYZ, TXT, CSV.
//!
//! Fields are separated by semicolons, else by commas, else by white space. A line of names may come first, also as a
//! comment (`# x y z nx ny nz`, `//X,Y,Z`). Without names the first three columns are the position and the rest is left
//! out: six columns may as well be colours.

use std::io::{self, Write};

use super::assemble::RawCloud;
use super::cloud_columns;
use super::error::{Fault, Place, Problem};
use super::text::{decoded, number};
use crate::surface::PointCloud;

const NAMES: [&str; 10] = ["x", "y", "z", "nx", "ny", "nz", "view_x", "view_y", "view_z", "sweep"];

pub(super) fn read(bytes: &[u8]) -> Result<RawCloud, Fault> {
    let text = decoded(bytes);
    let mut columns: Option<[Option<usize>; 10]> = None;
    let mut cloud = RawCloud::default();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        let (content, is_comment) = match line.strip_prefix('#').or_else(|| line.strip_prefix("//")) {
            Some(comment) => (comment.trim(), true),
            None => (line.split('#').next().unwrap_or("").trim(), false),
        };
        if content.is_empty() {
            continue;
        }
        let fields = fields(content);
        let at_line = |problem: Problem| problem.at_line(index + 1);
        if columns.is_none() {
            let named = named_columns(&fields);
            let is_names =
                named.is_some() || !is_comment && fields.iter().all(|field| number(field).is_err());
            if is_names {
                let named = named.ok_or_else(|| at_line(Problem::Missing("a column named x, y or z")))?;
                let has = |names: std::ops::Range<usize>| named[names].iter().all(Option::is_some);
                cloud = RawCloud::with(has(3..6), has(6..9), has(9..10));
                columns = Some(named);
                continue;
            }
        }
        if is_comment {
            continue;
        }
        let columns = columns.get_or_insert_with(|| std::array::from_fn(|k| (k < 3).then_some(k)));
        cloud.push(&row(&fields, columns).map_err(at_line)?);
    }
    if cloud.points.is_empty() {
        return Err(Problem::NoPoints.at(Place::File));
    }
    Ok(cloud)
}

fn fields(line: &str) -> Vec<&str> {
    let separator = [';', ','].into_iter().find(|&separator| line.contains(separator));
    match separator {
        Some(separator) => {
            // A separator at the end closes the last field and opens none.
            let line = line.strip_suffix(separator).unwrap_or(line);
            line.split(separator).map(|field| field.trim().trim_matches('"')).collect()
        }
        None => line.split_whitespace().map(|field| field.trim_matches('"')).collect(),
    }
}

/// Where each of [`NAMES`] stands; `None` unless all of x, y, z are there. A unit behind a name (`x [m]`) is cut off.
fn named_columns(fields: &[&str]) -> Option<[Option<usize>; 10]> {
    let names: Vec<String> = fields
        .iter()
        .map(|field| field.split([' ', '[', '(']).next().unwrap_or("").to_lowercase())
        .map(|name| name.replace("normal_", "n"))
        .collect();
    let columns = NAMES.map(|wanted| names.iter().position(|name| name == wanted));
    columns[..3].iter().all(Option::is_some).then_some(columns)
}

fn row(fields: &[&str], columns: &[Option<usize>; 10]) -> Result<[f64; 10], Problem> {
    let mut values = [0.0; 10];
    for (value, column) in values.iter_mut().zip(columns) {
        if let Some(column) = *column {
            let (found, wanted) = (fields.len() as u64, column as u64 + 1);
            let field = fields.get(column).ok_or(Problem::ValueCount { what: "a point", found, wanted })?;
            *value = number(field)?;
        }
    }
    Ok(values)
}

pub(super) fn write(writer: &mut dyn Write, cloud: &PointCloud, separator: char) -> io::Result<()> {
    let separator = separator.to_string();
    let (names, rows) = cloud_columns(cloud, NAMES);
    // XYZ has no line of names; a comment says what the columns are to those who look, and stays out of their way.
    let mark = if separator == "," { "" } else { "# " };
    writeln!(writer, "{mark}{}", names.join(&separator))?;
    for row in rows {
        let row: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(writer, "{}", row.join(&separator))?;
    }
    Ok(())
}
