//! Which format a file has, and which one it gets.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use super::error::IoError;

/// Families of formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Polygon file format, meshes and clouds.
    Ply,
    /// Stereolithography, ascii and binary.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// Object file format of Geomview.
    Off,
    /// Open Inventor 2.x, VRML 1 and VRML 2.
    Inventor,
    /// Point cloud data of the Point Cloud Library.
    Pcd,
    /// Columns of numbers: XYZ, TXT, CSV.
    Columns,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Obj => "OBJ",
            Self::Off => "OFF",
            Self::Inventor => "Inventor/VRML",
            Self::Pcd => "PCD",
            Self::Columns => "point columns",
        })
    }
}

impl Format {
    /// The format by content, and where that has no mark of its own by the extension of `name`.
    pub(super) fn detect(bytes: &[u8], name: &Path) -> Option<Self> {
        let head = &bytes[..bytes.len().min(4096)];
        let text = String::from_utf8_lossy(head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head));
        Self::by_mark(head, &text)
            .or_else(|| super::stl::is_binary_by_length(bytes).then_some(Self::Stl))
            .or_else(|| Self::by_extension(name))
            .or_else(|| Self::by_first_line(&text))
    }

    fn by_mark(head: &[u8], text: &str) -> Option<Self> {
        let first_line = text.lines().next().unwrap_or("").trim_end();
        if first_line == "ply" {
            Some(Self::Ply)
        } else if head.starts_with(b"\x1f\x8b") || text.starts_with("#Inventor") || text.starts_with("#VRML")
        {
            Some(Self::Inventor)
        } else if text.starts_with("# .PCD") || is_pcd(text) {
            Some(Self::Pcd)
        } else if super::off::mark_length(first_line).is_some() {
            Some(Self::Off)
        } else {
            None
        }
    }

    fn by_extension(name: &Path) -> Option<Self> {
        match lower_extension(name).as_str() {
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            "off" => Some(Self::Off),
            "iv" | "wrl" | "vrml" | "wrz" => Some(Self::Inventor),
            "pcd" => Some(Self::Pcd),
            "xyz" | "txt" | "csv" | "asc" | "xyzn" => Some(Self::Columns),
            _ => None,
        }
    }

    fn by_first_line(text: &str) -> Option<Self> {
        let line = super::text::Lines::new(text, 0).next()?.1;
        let first = line.split_whitespace().next()?;
        if first.eq_ignore_ascii_case("solid") {
            return Some(Self::Stl);
        }
        if ["v", "vn", "vt", "o", "g", "mtllib", "usemtl"].contains(&first) {
            return Some(Self::Obj);
        }
        let words: Vec<&str> = line.split([',', ';', ' ', '\t']).filter(|w| !w.is_empty()).collect();
        (words.len() >= 3 && words.iter().all(|word| word.parse::<f64>().is_ok())).then_some(Self::Columns)
    }
}

/// Formats that meshes are written in. Lengths are metres in all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// PLY, little endian, doubles (`.ply`).
    Ply,
    /// PLY as text.
    PlyAscii,
    /// Binary STL, single precision (`.stl`).
    Stl,
    /// STL as text.
    StlAscii,
    /// Wavefront OBJ (`.obj`).
    Obj,
    /// OFF as text (`.off`).
    Off,
    /// Open Inventor V2.1 ascii (`.iv`).
    Inventor,
}

impl MeshFormat {
    /// The format that the extension of a path asks for.
    pub fn from_path(path: &Path) -> Result<Self, IoError> {
        match lower_extension(path).as_str() {
            "ply" => Ok(Self::Ply),
            "stl" => Ok(Self::Stl),
            "obj" => Ok(Self::Obj),
            "off" => Ok(Self::Off),
            "iv" => Ok(Self::Inventor),
            _ => Err(IoError::UnknownExtension {
                path: path.to_owned(),
                kind: "meshes",
                known: ".ply .stl .obj .off .iv",
            }),
        }
    }
}

/// Formats that clouds are written in. Lengths are metres in all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudFormat {
    /// PLY, little endian, doubles (`.ply`).
    Ply,
    /// PLY as text.
    PlyAscii,
    /// PCD, binary, single precision (`.pcd`).
    Pcd,
    /// PCD as text.
    PcdAscii,
    /// PCD, LZF-compressed, single precision.
    PcdCompressed,
    /// Columns separated by spaces (`.xyz`, `.txt`).
    Xyz,
    /// Columns separated by commas under a line of names (`.csv`).
    Csv,
}

impl CloudFormat {
    /// The format that the extension of a path asks for.
    pub fn from_path(path: &Path) -> Result<Self, IoError> {
        match lower_extension(path).as_str() {
            "ply" => Ok(Self::Ply),
            "pcd" => Ok(Self::Pcd),
            "xyz" | "txt" => Ok(Self::Xyz),
            "csv" => Ok(Self::Csv),
            _ => Err(IoError::UnknownExtension {
                path: path.to_owned(),
                kind: "clouds",
                known: ".ply .pcd .xyz .txt .csv",
            }),
        }
    }
}

/// A word that names no format or unit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{word}' is none of {known}")]
pub struct UnknownName {
    /// The word.
    pub word: String,
    /// The names that would do.
    pub known: &'static str,
}

impl FromStr for MeshFormat {
    type Err = UnknownName;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        Ok(match word {
            "ply" => Self::Ply,
            "ply-ascii" => Self::PlyAscii,
            "stl" => Self::Stl,
            "stl-ascii" => Self::StlAscii,
            "obj" => Self::Obj,
            "off" => Self::Off,
            "iv" => Self::Inventor,
            _ => {
                return Err(UnknownName {
                    word: word.to_owned(),
                    known: "ply, ply-ascii, stl, stl-ascii, obj, off, iv",
                });
            }
        })
    }
}

impl FromStr for CloudFormat {
    type Err = UnknownName;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        Ok(match word {
            "ply" => Self::Ply,
            "ply-ascii" => Self::PlyAscii,
            "pcd" => Self::Pcd,
            "pcd-ascii" => Self::PcdAscii,
            "pcd-compressed" => Self::PcdCompressed,
            "xyz" => Self::Xyz,
            "csv" => Self::Csv,
            _ => {
                return Err(UnknownName {
                    word: word.to_owned(),
                    known: "ply, ply-ascii, pcd, pcd-ascii, pcd-compressed, xyz, csv",
                });
            }
        })
    }
}

/// Unit of the coordinates in a file; the formats do not carry one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Unit {
    /// One unit in the file is a metre.
    #[default]
    Metre,
    /// One unit in the file is a millimetre.
    Millimetre,
}

impl Unit {
    /// A length in the file, in metres. Dividing by 1000 rounds correctly where multiplying by 0.001 would not.
    #[must_use]
    pub fn to_metres(self, length: f64) -> f64 {
        match self {
            Self::Metre => length,
            Self::Millimetre => length / 1000.0,
        }
    }
}

impl FromStr for Unit {
    type Err = UnknownName;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        match word {
            "m" => Ok(Self::Metre),
            "mm" => Ok(Self::Millimetre),
            _ => Err(UnknownName { word: word.to_owned(), known: "m, mm" }),
        }
    }
}

fn is_pcd(text: &str) -> bool {
    let first = super::text::Lines::new(text, 0).next().and_then(|(_, line)| line.split_whitespace().next());
    matches!(first, Some("VERSION" | "FIELDS"))
}

fn lower_extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}
