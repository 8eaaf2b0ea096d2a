//! Mesh and cloud files.
//!
//! Reading takes the unit of the file, which none of the formats carries, and gives metres; writing is always in
//! metres. What is read is decided by content before extension. No reader trusts a count: it is held against the bytes
//! that are there before memory is taken for it, so a damaged or hostile file costs an error and not the machine.
//!
//! | format | meshes | clouds |
//! |---|---|---|
//! | PLY (ascii, binary of both endians) | read, write | read, write |
//! | STL (ascii, binary), OBJ, OFF | read, write | |
//! | Open Inventor 2.x ascii, VRML 1 and 2 | read; Inventor V2.1 written | |
//! | PCD (ascii, binary, binary_compressed) | | read, write |
//! | columns (XYZ, TXT, CSV) | | read, write |
//!
//! The readers are written here and not taken from crates, because an error must name the line and a count must not be
//! believed: `tobj` and `stl_io` name no line and round to single precision, `stl_io` takes every file that begins with
//! "solid " for text, and `ply-rs-bw` makes a map per vertex. LZF is the crate `lzf`'s.

mod assemble;
mod atomic;
mod error;
mod format;
mod inventor;
mod obj;
mod off;
mod pcd;
mod ply;
mod polygon;
mod repair;
mod stl;
mod text;
mod text_cloud;

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use thiserror::Error;

pub use atomic::write_atomically;
pub use error::{IoError, Place, Problem};
pub use format::{CloudFormat, Format, MeshFormat, Unit, UnknownName};

use crate::surface::{Mesh, PointCloud};
use assemble::Raw;
use error::Fault;

/// Larger files are refused: they do not fit the memory of the machines that this runs on.
pub const MAX_FILE_BYTES: u64 = 2 << 30;

/// What a file held, and what a person should know about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded<T> {
    /// The mesh or cloud, metres.
    pub value: T,
    /// One line each, to follow the name of the file: dropped points, a doubtful unit, nodes that were skipped.
    pub warnings: Vec<String>,
}

/// Either kind of thing that a file may hold.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// Points.
    Cloud(PointCloud),
}

/// Reads a mesh. Errors for a file of points; see [`IoError`].
pub fn read_mesh(path: &Path, unit: Unit) -> Result<Loaded<Mesh>, IoError> {
    read_mesh_bytes(&read_bytes(path)?, path, unit)
}

/// Reads a cloud. Errors for a file of faces; see [`IoError`].
pub fn read_cloud(path: &Path, unit: Unit) -> Result<Loaded<PointCloud>, IoError> {
    read_cloud_bytes(&read_bytes(path)?, path, unit)
}

/// Reads whichever the file holds: a PLY file without faces is a cloud.
pub fn read_geometry(path: &Path, unit: Unit) -> Result<Loaded<Geometry>, IoError> {
    read_geometry_bytes(&read_bytes(path)?, path, unit)
}

/// [`read_mesh`] from memory; `name` stands in errors, and its extension decides where the content does not.
pub fn read_mesh_bytes(bytes: &[u8], name: &Path, unit: Unit) -> Result<Loaded<Mesh>, IoError> {
    match parse(bytes, name)? {
        (format, Raw::Mesh(mesh)) => mesh.finish(unit).map_err(|fault| malformed(name, format, fault)),
        (format, Raw::Cloud(_)) => Err(IoError::WrongKind {
            path: name.to_owned(),
            format,
            found: "points without faces",
            wanted: "a mesh",
        }),
    }
}

/// [`read_cloud`] from memory; `name` as in [`read_mesh_bytes`].
pub fn read_cloud_bytes(bytes: &[u8], name: &Path, unit: Unit) -> Result<Loaded<PointCloud>, IoError> {
    match parse(bytes, name)? {
        (format, Raw::Cloud(cloud)) => cloud.finish(unit).map_err(|fault| malformed(name, format, fault)),
        (format, Raw::Mesh(_)) => Err(IoError::WrongKind {
            path: name.to_owned(),
            format,
            found: "a mesh",
            wanted: "a point cloud",
        }),
    }
}

/// [`read_geometry`] from memory; `name` as in [`read_mesh_bytes`].
pub fn read_geometry_bytes(bytes: &[u8], name: &Path, unit: Unit) -> Result<Loaded<Geometry>, IoError> {
    let (format, raw) = parse(bytes, name)?;
    match raw {
        Raw::Mesh(mesh) => mesh
            .finish(unit)
            .map(|Loaded { value, warnings }| Loaded { value: Geometry::Mesh(value), warnings }),
        Raw::Cloud(cloud) => cloud
            .finish(unit)
            .map(|Loaded { value, warnings }| Loaded { value: Geometry::Cloud(value), warnings }),
    }
    .map_err(|fault| malformed(name, format, fault))
}

/// Writes a mesh, in metres, in the format of the path's extension; the file appears whole or not at all.
pub fn write_mesh(path: &Path, mesh: &Mesh) -> Result<(), IoError> {
    let format = MeshFormat::from_path(path)?;
    write_atomically(path, |writer| write_mesh_to(format, writer, mesh))
}

/// Writes a cloud, in metres, in the format of the path's extension; the file appears whole or not at all.
pub fn write_cloud(path: &Path, cloud: &PointCloud) -> Result<(), IoError> {
    let format = CloudFormat::from_path(path)?;
    write_atomically(path, |writer| write_cloud_to(format, writer, cloud))
}

/// Writes a mesh, in metres, to a stream. The caller buffers.
pub fn write_mesh_to(format: MeshFormat, writer: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    match format {
        MeshFormat::Ply => ply::write_mesh(writer, mesh, ply::Encoding::LittleEndian),
        MeshFormat::PlyAscii => ply::write_mesh(writer, mesh, ply::Encoding::Ascii),
        MeshFormat::Stl => stl::write_binary(writer, mesh),
        MeshFormat::StlAscii => stl::write_ascii(writer, mesh),
        MeshFormat::Obj => obj::write(writer, mesh),
        MeshFormat::Off => off::write(writer, mesh),
        MeshFormat::Inventor => inventor::write(writer, mesh),
    }
}

/// Writes a cloud with the normals and lines of sight that it has, in metres, to a stream. The caller buffers.
pub fn write_cloud_to(format: CloudFormat, writer: &mut dyn Write, cloud: &PointCloud) -> io::Result<()> {
    match format {
        CloudFormat::Ply => ply::write_cloud(writer, cloud, ply::Encoding::LittleEndian),
        CloudFormat::PlyAscii => ply::write_cloud(writer, cloud, ply::Encoding::Ascii),
        CloudFormat::Pcd => pcd::write(writer, cloud, pcd::Encoding::Binary),
        CloudFormat::PcdAscii => pcd::write(writer, cloud, pcd::Encoding::Ascii),
        CloudFormat::PcdCompressed => pcd::write(writer, cloud, pcd::Encoding::Compressed),
        CloudFormat::Xyz => text_cloud::write(writer, cloud, ' '),
        CloudFormat::Csv => text_cloud::write(writer, cloud, ','),
    }
}

/// Why a file gives no text, in one line; the caller names the file.
#[derive(Debug, Error)]
pub enum TextError {
    /// The operating system refused.
    #[error("{0}")]
    System(io::Error),
    /// Larger than what was asked for can be.
    #[error("larger than {} MB", .limit_bytes >> 20)]
    TooLarge {
        /// Largest size that is read.
        limit_bytes: u64,
    },
    /// Not UTF-8.
    #[error("line {line}: not UTF-8 text")]
    Encoding {
        /// Where, counted from 1.
        line: usize,
    },
}

/// Reads a file of text of `limit_bytes` or less.
pub fn read_text(path: &Path, limit_bytes: u64) -> Result<String, TextError> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(TextError::System)?;
    file.take(limit_bytes + 1).read_to_end(&mut bytes).map_err(TextError::System)?;
    if bytes.len() as u64 > limit_bytes {
        return Err(TextError::TooLarge { limit_bytes });
    }
    String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        TextError::Encoding { line: good.iter().filter(|&&byte| byte == b'\n').count() + 1 }
    })
}

/// The bytes of a file of [`MAX_FILE_BYTES`] or less. Errors as those of [`read_geometry`], also when there are none.
pub fn read_file(path: &Path) -> Result<Vec<u8>, IoError> {
    let bytes = read_bytes(path)?;
    if bytes.is_empty() { Err(IoError::Empty { path: path.to_owned() }) } else { Ok(bytes) }
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, IoError> {
    let system = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound => IoError::NotFound { path: path.to_owned() },
        _ => IoError::System { path: path.to_owned(), source },
    };
    let file = File::open(path).map_err(system)?;
    let metadata = file.metadata().map_err(system)?;
    if metadata.is_dir() {
        return Err(IoError::Directory { path: path.to_owned() });
    }
    let too_large = || IoError::TooLarge { path: path.to_owned(), limit_bytes: MAX_FILE_BYTES };
    if metadata.len() > MAX_FILE_BYTES {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    // Pipes and devices have no length of their own.
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(system)?;
    if bytes.len() as u64 > MAX_FILE_BYTES { Err(too_large()) } else { Ok(bytes) }
}

fn parse(bytes: &[u8], name: &Path) -> Result<(Format, Raw), IoError> {
    if bytes.is_empty() {
        return Err(IoError::Empty { path: name.to_owned() });
    }
    let format =
        Format::detect(bytes, name).ok_or_else(|| IoError::Unrecognised { path: name.to_owned() })?;
    let raw = match format {
        Format::Ply => ply::read(bytes),
        Format::Stl => stl::read(bytes).map(Raw::Mesh),
        Format::Obj => obj::read(bytes).map(Raw::Mesh),
        Format::Off => off::read(bytes).map(Raw::Mesh),
        Format::Inventor => inventor::read(bytes).map(Raw::Mesh),
        Format::Pcd => pcd::read(bytes).map(Raw::Cloud),
        Format::Columns => text_cloud::read(bytes).map(Raw::Cloud),
    };
    raw.map(|raw| (format, raw)).map_err(|fault| malformed(name, format, fault))
}

fn malformed(name: &Path, format: Format, Fault { place, problem }: Fault) -> IoError {
    IoError::Malformed { path: name.to_owned(), format, place, problem }
}

/// Single precision, as STL and PCD have it; an error instead of an infinity.
fn narrowed(value: f64) -> io::Result<f32> {
    let narrow = value as f32;
    if narrow.is_finite() {
        Ok(narrow)
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidData, format!("{value} does not fit single precision")))
    }
}

/// The columns that a cloud has, by name, and one row per point.
fn cloud_columns(
    cloud: &PointCloud,
    names: [&'static str; 10],
) -> (Vec<&'static str>, impl Iterator<Item = Vec<f64>>) {
    let has = [true, cloud.normals.is_some(), cloud.views.is_some(), cloud.sweeps.is_some()];
    let columns =
        names.chunks(3).zip(has).filter(|(_, has)| *has).flat_map(|(names, _)| names.iter().copied());
    let rows = cloud.points.iter().enumerate().map(|(i, point)| {
        let attributes = [&cloud.normals, &cloud.views].into_iter().flatten().filter_map(move |a| a.get(i));
        let sweep = cloud.sweeps.as_ref().and_then(|sweeps| sweeps.get(i)).map(|&sweep| f64::from(sweep));
        point.iter().copied().chain(attributes.flat_map(|v| v.iter().copied())).chain(sweep).collect()
    });
    (columns.collect(), rows)
}

#[cfg(test)]
mod tests;
