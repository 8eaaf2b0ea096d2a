//! What can be wrong with a file, and where in it.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

use super::format::Format;
use crate::surface::{CloudError, MeshError};

/// Why a file could not be read or written. Every message is one line that names the file.
#[derive(Debug, Error)]
pub enum IoError {
    /// There is no such file.
    #[error("{}: no such file", .path.display())]
    NotFound {
        /// The file asked for.
        path: PathBuf,
    },
    /// The name is a directory's.
    #[error("{}: is a directory, not a file", .path.display())]
    Directory {
        /// The directory.
        path: PathBuf,
    },
    /// The directory that a file shall be written into does not exist.
    #[error("{}: there is no directory {}", .path.display(), .folder.display())]
    NoFolder {
        /// The file to be written.
        path: PathBuf,
        /// The missing directory.
        folder: PathBuf,
    },
    /// The file has no byte.
    #[error("{}: the file is empty", .path.display())]
    Empty {
        /// The empty file.
        path: PathBuf,
    },
    /// The file is larger than [`super::MAX_FILE_BYTES`].
    #[error("{}: the file is larger than {} MiB", .path.display(), .limit_bytes >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Largest size that is read.
        limit_bytes: u64,
    },
    /// The operating system refused.
    #[error("{}: {source}", .path.display())]
    System {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither the content nor the extension tells the format.
    #[error(
        "{}: neither content nor extension is of a known format (PLY, STL, OBJ, OFF, Inventor, VRML, PCD, XYZ, CSV)",
        .path.display()
    )]
    Unrecognised {
        /// The file.
        path: PathBuf,
    },
    /// The extension of an output file names no format that can be written.
    #[error("{}: unknown extension: {kind} are written as {known}", .path.display())]
    UnknownExtension {
        /// The file.
        path: PathBuf,
        /// "meshes" or "clouds".
        kind: &'static str,
        /// The extensions that would do.
        known: &'static str,
    },
    /// A mesh was wanted and the file holds points, or the other way round.
    #[error("{}: {format} file holds {found}, but {wanted} is wanted", .path.display())]
    WrongKind {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// What is in it.
        found: &'static str,
        /// What was asked for.
        wanted: &'static str,
    },
    /// The content breaks the rules of its format.
    #[error("{}: {format}{place}: {problem}", .path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// Where in the file.
        place: Place,
        /// What is wrong there.
        problem: Problem,
    },
}

/// Where in a file something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line, counted from 1.
    Line(usize),
    /// An element of a kind ("vertex", "face", "point"), counted from 0.
    Element(&'static str, usize),
    /// A face, counted from 0, of the node that begins in a line.
    NodeFace {
        /// The node's line, counted from 1.
        line: usize,
        /// The face within the node.
        face: usize,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Element(kind, index) => write!(f, ", {kind} {index}"),
            Self::NodeFace { line, face } => write!(f, ", face {face} of the node in line {line}"),
        }
    }
}

/// What is wrong at a place in a file.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Problem {
    /// A word stands where a number belongs.
    #[error("'{0}' is not a number")]
    NotANumber(String),
    /// A number with a fraction, or out of the range of indices, stands where a whole number belongs.
    #[error("'{0}' is not a whole number in range")]
    NotWhole(String),
    /// NaN or infinite where geometry needs a number.
    #[error("{0} is not a finite coordinate")]
    NotFinite(f64),
    /// A face names a vertex that does not exist.
    #[error("index {index} is out of range: there are {vertices} vertices")]
    IndexOutOfRange {
        /// The index as written in the file.
        index: i64,
        /// Number of vertices.
        vertices: usize,
    },
    /// A face with fewer than three corners.
    #[error("a face needs 3 corners or more, this one has {0}")]
    TooFewCorners(usize),
    /// A face with more corners than are cut into triangles.
    #[error("a face of {corners} corners that is not convex; at most {limit} can be cut into triangles")]
    TooManyCorners {
        /// Its corners.
        corners: usize,
        /// The most that are handled.
        limit: usize,
    },
    /// A header promises more than the file holds.
    #[error("the file is cut short: {what} need {needed} bytes, {found} are left")]
    CutShort {
        /// What was promised.
        what: &'static str,
        /// Bytes that it takes at least.
        needed: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// The file ends in the middle of something.
    #[error("the file ends where {0} was expected")]
    EndOfFile(&'static str),
    /// Something else than expected.
    #[error("expected {wanted}, found '{found}'")]
    Expected {
        /// What belongs here.
        wanted: &'static str,
        /// What is here.
        found: String,
    },
    /// A required part is not there.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// A name that the format does not know.
    #[error("unknown {what} '{name}'")]
    Unknown {
        /// What kind of name.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Another number of values than there must be.
    #[error("{found} values for {what}, {wanted} wanted")]
    ValueCount {
        /// The values of what.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// How many there must be.
        wanted: u64,
    },
    /// A size that must be positive.
    #[error("{what} must be positive, not {value}")]
    NotPositive {
        /// Which size.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Nodes within nodes beyond the limit.
    #[error("nodes are nested deeper than {0} levels")]
    TooDeep(usize),
    /// References that multiply beyond the limit.
    #[error("repeated references expand to more than {0} nodes or vertices")]
    Expands(usize),
    /// A variant of the format that is not read.
    #[error("{0}")]
    Unsupported(&'static str),
    /// Compressed data that do not decompress.
    #[error("the compressed points do not decompress: {0}")]
    Compression(lzf::LzfError),
    /// A cloud without a single usable point.
    #[error("holds no point with finite coordinates")]
    NoPoints,
    /// A mesh without a face.
    #[error("holds no face")]
    NoFaces,
    /// The arrays do not make a mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The arrays do not make a cloud.
    #[error(transparent)]
    Cloud(#[from] CloudError),
}

impl Problem {
    pub(super) fn at(self, place: Place) -> Fault {
        Fault { place, problem: self }
    }

    pub(super) fn at_line(self, line: usize) -> Fault {
        self.at(Place::Line(line))
    }

    pub(super) fn expected(wanted: &'static str, found: &str) -> Self {
        Self::Expected { wanted, found: clipped(found) }
    }

    pub(super) fn unknown(what: &'static str, name: &str) -> Self {
        Self::Unknown { what, name: clipped(name) }
    }
}

/// A problem with its place, before the name of the file is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub(super) place: Place,
    pub(super) problem: Problem,
}

/// The beginning of a word from a file, fit for a one-line message.
pub(super) fn clipped(word: &str) -> String {
    const LONGEST: usize = 32;
    let printable = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut short: String = word.chars().take(LONGEST).map(printable).collect();
    if word.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    short
}
