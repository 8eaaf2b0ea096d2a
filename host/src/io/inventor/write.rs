//! A mesh as Open Inventor V2.1 ascii, the format of the 2005 system and of GraspIt.

use std::io::{self, Write};

use crate::surface::Mesh;

pub(in super::super) fn write(writer: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let shape_type = if mesh.is_watertight() { "SOLID" } else { "UNKNOWN_SHAPE_TYPE" };
    writeln!(writer, "#Inventor V2.1 ascii\n\n# unit: metre\nSeparator {{")?;
    writeln!(
        writer,
        "  ShapeHints {{\n    vertexOrdering COUNTERCLOCKWISE\n    shapeType {shape_type}\n  }}"
    )?;
    writeln!(writer, "  Coordinate3 {{\n    point [")?;
    for vertex in mesh.vertices() {
        writeln!(writer, "      {} {} {},", vertex.x, vertex.y, vertex.z)?;
    }
    writeln!(writer, "    ]\n  }}\n  IndexedFaceSet {{\n    coordIndex [")?;
    for [a, b, c] in mesh.faces() {
        writeln!(writer, "      {a}, {b}, {c}, -1,")?;
    }
    writeln!(writer, "    ]\n  }}\n}}")
}
