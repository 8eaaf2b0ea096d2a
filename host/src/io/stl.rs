//! STL: loose triangles, as text or as 50 bytes each.
//!
//! A binary file may begin with "solid" like a text file does, so its length decides: 84 bytes and 50 per triangle.
//! Normals in the file are ignored, the corners' order tells them.

use std::io::{self, Write};

use nalgebra::Point3;

use super::assemble::RawMesh;
use super::error::{Fault, Place, Problem};
use super::narrowed;
use super::text::{Lines, decoded, position};
use crate::surface::Mesh;

/// 80 bytes of anything and the number of triangles.
const HEADER_BYTES: usize = 84;
/// Normal and corners in single precision, and two bytes of attributes.
const TRIANGLE_BYTES: usize = 50;
/// Where the corners begin in a triangle.
const CORNERS_AT: usize = 12;

/// Whether a file is as long as its count of triangles says.
pub(super) fn is_binary_by_length(bytes: &[u8]) -> bool {
    promised(bytes).is_some_and(|count| {
        count > 0 && (HEADER_BYTES + TRIANGLE_BYTES * count) as u64 == bytes.len() as u64
    })
}

fn promised(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?.first_chunk()?;
    Some(u32::from_le_bytes(*count) as usize)
}

pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let head = &bytes[..bytes.len().min(512)];
    let is_text = head.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && !head.contains(&0);
    if is_text && !is_binary_by_length(bytes) { read_ascii(bytes) } else { read_binary(bytes) }
}

fn read_binary(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let whole_file = |problem: Problem| problem.at(Place::File);
    let count = promised(bytes).ok_or_else(|| {
        let found = bytes.len() as u64;
        whole_file(Problem::CutShort {
            what: "header and count of triangles",
            needed: HEADER_BYTES as u64,
            found,
        })
    })?;
    let body = &bytes[HEADER_BYTES..];
    let needed = count as u64 * TRIANGLE_BYTES as u64;
    if needed > body.len() as u64 {
        return Err(whole_file(Problem::CutShort {
            what: "the triangles",
            needed,
            found: body.len() as u64,
        }));
    }
    let mut mesh = RawMesh::by_face();
    mesh.vertices.reserve_exact(3 * count);
    for (face, triangle) in body.chunks_exact(TRIANGLE_BYTES).take(count).enumerate() {
        let (values, _) = triangle[CORNERS_AT..CORNERS_AT + 36].as_chunks::<4>();
        let first = mesh.vertices.len() as i64;
        for corner in values.chunks_exact(3) {
            mesh.vertices.push(Point3::from_slice(
                corner.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect::<Vec<_>>().as_slice(),
            ));
        }
        let face_place = Place::Element("face", face);
        if let Some(&value) =
            mesh.vertices[first as usize..].iter().flat_map(|p| p.iter()).find(|c| !c.is_finite())
        {
            return Err(Problem::NotFinite(value).at(face_place));
        }
        mesh.push((first..first + 3).map(Ok), face).map_err(|problem| problem.at(face_place))?;
    }
    let rest = body.len() as u64 - needed;
    if rest > 0 {
        mesh.warnings.push(format!("{rest} bytes behind the last triangle were ignored"));
    }
    Ok(mesh)
}

fn read_ascii(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let text = decoded(bytes);
    let mut mesh = RawMesh::by_line();
    let mut facet: Option<(usize, i64)> = None;
    let mut closed = false;
    for (line, content) in Lines::new(&text, 0) {
        let mut words = content.split_whitespace();
        let keyword = words.next().unwrap_or("").to_ascii_lowercase();
        let at_line = |problem: Problem| problem.at_line(line);
        let next_vertex = mesh.vertices.len() as i64;
        match (keyword.as_str(), facet) {
            ("solid", None) => closed = false,
            ("endsolid", None) => closed = true,
            ("facet", None) => facet = Some((line, next_vertex)),
            ("outer" | "endloop", Some(_)) => {}
            ("vertex", Some(_)) => {
                mesh.vertices.push(position(&mut words).map_err(at_line)?.into());
            }
            ("endfacet", Some((start, first))) => {
                mesh.push((first..next_vertex).map(Ok), start).map_err(at_line)?;
                facet = None;
            }
            _ => return Err(at_line(Problem::expected("the next part of a facet or solid", content))),
        }
    }
    if closed { Ok(mesh) } else { Err(Problem::EndOfFile("'endsolid'").at(Place::File)) }
}

pub(super) fn write_binary(writer: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let mut header = [b' '; 80];
    let title = b"Binary STL, unit: metre";
    header[..title.len()].copy_from_slice(title);
    writer.write_all(&header)?;
    let count = u32::try_from(mesh.faces().len())
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "too many triangles for STL"))?;
    writer.write_all(&count.to_le_bytes())?;
    for face in 0..mesh.faces().len() {
        let normal = mesh.face_normal(face);
        let corners = mesh.corners(face);
        for value in normal.iter().chain(corners.iter().flat_map(|corner| corner.iter())) {
            writer.write_all(&narrowed(*value)?.to_le_bytes())?;
        }
        writer.write_all(&[0; 2])?;
    }
    Ok(())
}

pub(super) fn write_ascii(writer: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    writeln!(writer, "solid metre")?;
    for face in 0..mesh.faces().len() {
        let normal = mesh.face_normal(face);
        writeln!(writer, "facet normal {} {} {}\n outer loop", normal.x, normal.y, normal.z)?;
        for corner in mesh.corners(face) {
            writeln!(writer, "  vertex {} {} {}", corner.x, corner.y, corner.z)?;
        }
        writeln!(writer, " endloop\nendfacet")?;
    }
    writeln!(writer, "endsolid metre")
}
