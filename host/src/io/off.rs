//! OFF of Geomview as text, with its per-vertex prefixes (`COFF`, `NOFF`, `STOFF`): what follows x y z is left out.

use std::io::{self, Write};

use super::assemble::RawMesh;
use super::error::{Fault, Problem, clipped};
use super::text::{Lines, count, decoded, position, whole};
use crate::surface::Mesh;

/// Length of the format's mark at the beginning of a line. The mark may be followed at once by the counts; the
/// prefixes `4` and `n` are recognised here and refused by [`read`].
pub(super) fn mark_length(line: &str) -> Option<usize> {
    let length = line.find("OFF")? + 3;
    let prefix = line[..length - 3].trim_start_matches("ST").trim_start_matches('C').trim_start_matches('N');
    let ends = line[length..].chars().next().is_none_or(|c| c.is_whitespace() || c.is_ascii_digit());
    (["", "4", "n", "4n"].contains(&prefix) && ends).then_some(length)
}

pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let text = decoded(bytes);
    let mut lines = Lines::new(&text, 0);
    let (mut line, mut content) = lines.expect("'OFF'")?;
    if let Some(length) = mark_length(content) {
        let (mark, rest) = content.split_at(length);
        if mark.contains(['4', 'n']) {
            let problem = Problem::Unsupported("vertices of other than three dimensions (4OFF, nOFF)");
            return Err(problem.at_line(line));
        }
        if rest.trim().starts_with("BINARY") {
            let problem = Problem::Unsupported("binary OFF is not read: save it as text, PLY or STL");
            return Err(problem.at_line(line));
        }
        content = rest.trim();
        if content.is_empty() {
            (line, content) = lines.expect("the counts of vertices and faces")?;
        }
    }
    let mut counts = content.split_whitespace();
    let mut next_count = || match counts.next() {
        Some(word) => count(word),
        None => Err(Problem::expected("'OFF' and the counts of vertices and faces", content)),
    };
    let (vertices, faces) = next_count()
        .and_then(|vertices| Ok((vertices, next_count()?)))
        .map_err(|problem| problem.at_line(line))?;
    // The shortest vertex is "0 0 0" and the shortest face "3 0 1 2", and each ends a line.
    let needed = vertices.saturating_mul(6).saturating_add(faces.saturating_mul(8)).saturating_sub(1);
    if needed > bytes.len() as u64 {
        let problem = Problem::CutShort { what: "vertices and faces", needed, found: bytes.len() as u64 };
        return Err(problem.at_line(line));
    }
    let mut mesh = RawMesh::by_line();
    for _ in 0..vertices {
        let (line, content) = lines.expect("a vertex")?;
        let vertex = position(&mut content.split_whitespace()).map_err(|problem| problem.at_line(line))?;
        mesh.vertices.push(vertex.into());
    }
    for _ in 0..faces {
        let (line, content) = lines.expect("a face")?;
        push_face(&mut mesh, content, line).map_err(|problem| problem.at_line(line))?;
    }
    Ok(mesh)
}

fn push_face(mesh: &mut RawMesh, content: &str, line: usize) -> Result<(), Problem> {
    let mut words = content.split_whitespace();
    let first = words.next().unwrap_or("");
    let corners: usize = first.parse().map_err(|_| Problem::NotWhole(clipped(first)))?;
    let indices: Vec<&str> = words.take(corners).collect();
    if indices.len() < corners {
        let (found, wanted) = (indices.len() as u64, corners as u64);
        return Err(Problem::ValueCount { what: "the corners of a face", found, wanted });
    }
    mesh.push(indices.into_iter().map(whole), line)
}

pub(super) fn write(writer: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    writeln!(writer, "OFF\n# unit: metre\n{} {} 0", mesh.vertices().len(), mesh.faces().len())?;
    for vertex in mesh.vertices() {
        writeln!(writer, "{} {} {}", vertex.x, vertex.y, vertex.z)?;
    }
    for [a, b, c] in mesh.faces() {
        writeln!(writer, "3 {a} {b} {c}")?;
    }
    Ok(())
}
