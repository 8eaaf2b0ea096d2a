//! Meshes and clouds as PLY, in doubles: the file gives back the same numbers.

use std::io::{self, Write};

use super::super::cloud_columns;
use super::header::Encoding;
use crate::surface::{Mesh, PointCloud, Provenance};

const NAMES: [&str; 10] = ["x", "y", "z", "nx", "ny", "nz", "view_x", "view_y", "view_z", "sweep"];

/// A mesh, with the provenance of its faces where it is known. `encoding` is ascii or little endian; big endian is only read.
pub(in super::super) fn write_mesh(
    writer: &mut dyn Write,
    mesh: &Mesh,
    encoding: Encoding,
) -> io::Result<()> {
    write_header(writer, encoding)?;
    write_vertex_element(writer, mesh.vertices().len(), &NAMES[..3])?;
    writeln!(writer, "element face {}", mesh.faces().len())?;
    writeln!(writer, "property list uchar uint vertex_indices")?;
    let provenance = mesh.provenance();
    if provenance.is_some() {
        let names: Vec<String> =
            Provenance::ALL.iter().map(|each| format!("{} {each}", each.number())).collect();
        writeln!(writer, "property uchar provenance\ncomment provenance: {}", names.join(", "))?;
    }
    writeln!(writer, "end_header")?;
    for vertex in mesh.vertices() {
        write_row(writer, encoding, vertex.coords.as_slice())?;
    }
    for (number, face) in mesh.faces().iter().enumerate() {
        let provenance = provenance.and_then(|all| all.get(number)).map(|each| each.number());
        if encoding == Encoding::Ascii {
            let provenance = provenance.map_or_else(String::new, |number| format!(" {number}"));
            writeln!(writer, "3 {} {} {}{provenance}", face[0], face[1], face[2])?;
        } else {
            writer.write_all(&[3])?;
            face.iter().try_for_each(|index| writer.write_all(&index.to_le_bytes()))?;
            writer.write_all(provenance.as_slice())?;
        }
    }
    Ok(())
}

/// A cloud with the attributes that it has. `encoding` as in [`write_mesh`].
pub(in super::super) fn write_cloud(
    writer: &mut dyn Write,
    cloud: &PointCloud,
    encoding: Encoding,
) -> io::Result<()> {
    let (names, rows) = cloud_columns(cloud, NAMES);
    write_header(writer, encoding)?;
    write_vertex_element(writer, cloud.len(), &names)?;
    writeln!(writer, "end_header")?;
    for row in rows {
        write_row(writer, encoding, &row)?;
    }
    Ok(())
}

fn write_header(writer: &mut dyn Write, encoding: Encoding) -> io::Result<()> {
    let format = if encoding == Encoding::Ascii { "ascii" } else { "binary_little_endian" };
    writeln!(writer, "ply\nformat {format} 1.0\ncomment unit: metre")
}

fn write_vertex_element(writer: &mut dyn Write, count: usize, names: &[&str]) -> io::Result<()> {
    writeln!(writer, "element vertex {count}")?;
    names.iter().try_for_each(|name| writeln!(writer, "property double {name}"))
}

fn write_row(writer: &mut dyn Write, encoding: Encoding, row: &[f64]) -> io::Result<()> {
    if encoding == Encoding::Ascii {
        let row: Vec<String> = row.iter().map(f64::to_string).collect();
        return writeln!(writer, "{}", row.join(" "));
    }
    row.iter().try_for_each(|value| writer.write_all(&value.to_le_bytes()))
}
