//! Wavefront OBJ: positions and faces. Normals, texture, colours, materials, groups and smoothing are left out.

use std::io::{self, Write};

use super::assemble::RawMesh;
use super::error::{Fault, Place, Problem};
use super::text::{Lines, decoded, position, whole};
use crate::surface::Mesh;

/// Statements that say nothing about the shape of a polygon mesh.
const SILENT: [&str; 14] =
    ["vn", "vt", "vp", "g", "o", "s", "mg", "usemtl", "mtllib", "usemap", "maplib", "l", "p", "lod"];

pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let text = decoded(bytes);
    let mut mesh = RawMesh::by_line();
    let mut unknown: Option<(usize, usize)> = None;
    let mut lines = Lines::new(&text, 0);
    while let Some((line, content)) = lines.next() {
        let mut joined;
        let mut statement = content;
        // A backslash at the end continues a statement on the next line.
        if content.ends_with('\\') {
            joined = String::new();
            let mut part = Some(content);
            while let Some(open) = part.and_then(|part| part.strip_suffix('\\')) {
                joined.push_str(open);
                part = lines.next().map(|(_, next)| next);
                joined.push_str(part.map_or("", |part| part.strip_suffix('\\').unwrap_or(part)));
            }
            statement = &joined;
        }
        let mut words = statement.split_whitespace();
        let known = match words.next() {
            Some("v") => position(&mut words).map(|position| {
                mesh.vertices.push(position.into());
                true
            }),
            Some("f" | "fo") => {
                let vertices = mesh.vertices.len();
                mesh.push(words.map(|corner| vertex_index(corner, vertices)), line).map(|()| true)
            }
            Some(word) => Ok(SILENT.contains(&word)),
            None => Ok(true),
        }
        .map_err(|problem| problem.at_line(line))?;
        if !known {
            unknown = Some(unknown.map_or((1, line), |(count, first)| (count + 1, first)));
        }
    }
    if mesh.vertices.is_empty() {
        return Err(Problem::Missing("a vertex ('v x y z')").at(Place::File));
    }
    if let Some((count, first)) = unknown {
        mesh.warnings.push(format!("{count} statements were not understood, the first in line {first}"));
    }
    Ok(mesh)
}

/// The position's index from 0 out of `7`, `7/1`, `7//3`, `7/1/3`, or `-1` for the last one so far.
fn vertex_index(corner: &str, vertices: usize) -> Result<i64, Problem> {
    let index = whole(corner.split('/').next().unwrap_or(corner))?;
    let from_zero = if index > 0 { index - 1 } else { index.saturating_add(vertices as i64) };
    if index == 0 || from_zero < 0 {
        Err(Problem::IndexOutOfRange { index, vertices })
    } else {
        Ok(from_zero)
    }
}

pub(super) fn write(writer: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    writeln!(writer, "# unit: metre")?;
    for vertex in mesh.vertices() {
        writeln!(writer, "v {} {} {}", vertex.x, vertex.y, vertex.z)?;
    }
    for face in mesh.faces() {
        let [a, b, c] = face.map(|index| u64::from(index) + 1);
        writeln!(writer, "f {a} {b} {c}")?;
    }
    Ok(())
}
