//! Open Inventor 2.x ascii, VRML 1 and VRML 2: scene files whose surfaces are read as one mesh.
//!
//! | file | does |
//! |---|---|
//! | `lexer.rs` | words, strings, brackets |
//! | `parser.rs` | nodes, fields, `DEF` and `USE` |
//! | `field.rs` | fields as numbers, vectors, rotations |
//! | `transform.rs` | what the transformation nodes do |
//! | `scene.rs` | walks the nodes with the state that they pass on |
//! | `shapes.rs` | faces and strips over coordinates |
//! | `primitives.rs` | cube, sphere, cylinder, cone |
//! | `write.rs` | Inventor V2.1 |
//!
//! The three dialects share one syntax and differ in two things that matter here: in VRML 2 a `Transform` groups the
//! nodes that it moves, before it moves what follows; and VRML 2 shapes name their coordinates, before they are
//! inherited. The first line decides, never the extension.

mod field;
mod lexer;
mod parser;
mod primitives;
mod scene;
mod shapes;
mod transform;
mod write;

#[cfg(test)]
mod tests;

use super::assemble::RawMesh;
use super::error::{Fault, Place, Problem};
use super::text::decoded;

pub(super) use write::write;

/// Which rules a file follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dialect {
    /// Open Inventor 2.x and VRML 1: nodes change a state that later nodes inherit.
    Inventor,
    /// VRML 2 (VRML97).
    Vrml2,
}

pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, Fault> {
    if bytes.starts_with(b"\x1f\x8b") {
        let problem = Problem::Unsupported("the file is compressed with gzip: unpack it first (gunzip)");
        return Err(problem.at(Place::File));
    }
    let text = decoded(bytes);
    let dialect = dialect(text.lines().next().unwrap_or("")).map_err(|problem| problem.at_line(1))?;
    scene::flatten(&parser::parse(&text)?, dialect, bytes.len())
}

fn dialect(first_line: &str) -> Result<Dialect, Problem> {
    let words: Vec<&str> = first_line.split_whitespace().collect();
    match words[..] {
        ["#Inventor", version, .., "ascii"] if version.starts_with("V2.") => Ok(Dialect::Inventor),
        ["#VRML", "V1.0", "ascii", ..] => Ok(Dialect::Inventor),
        ["#VRML", "V2.0", "utf8", ..] => Ok(Dialect::Vrml2),
        ["#Inventor", _, .., "binary"] => Err(Problem::Unsupported(
            "binary Inventor is not read: save it as ascii (ivcat, ivview), or as PLY, STL or OBJ",
        )),
        _ => Err(Problem::expected(
            "'#Inventor V2.x ascii', '#VRML V1.0 ascii' or '#VRML V2.0 utf8'",
            first_line,
        )),
    }
}
