//! Mesh files that a description names: found, read, scaled.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

use super::error::Problem;
use crate::io::{IoError, Loaded, Unit, read_mesh};
use crate::surface::{Mesh, MeshError};

/// Meshes of a hand wider or narrower than this are probably in another unit than metres.
const LARGEST_M: f64 = 2.0;
const SMALLEST_M: f64 = 1e-3;

/// Where files are looked for.
#[derive(Debug, Clone)]
pub(super) struct Files<'a> {
    /// Folder of the description.
    pub(super) base: &'a Path,
    /// Folders that hold packages, or are packages.
    pub(super) package_paths: &'a [PathBuf],
}

/// Formats that descriptions use and that are not read here.
const UNREAD: [(&str, &str); 6] = [
    ("dae", "COLLADA"),
    ("glb", "glTF"),
    ("gltf", "glTF"),
    ("fbx", "FBX"),
    ("step", "STEP"),
    ("stp", "STEP"),
];

impl Files<'_> {
    /// The mesh at a URI, in metres, scaled. What its reader says of it, and a doubt about its size, go to `warnings`.
    pub(super) fn mesh(
        &self,
        link: &str,
        uri: &str,
        scale: &Vector3<f64>,
        warnings: &mut Vec<String>,
    ) -> Result<Mesh, Problem> {
        let extension = uri.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
        if let Some((_, format)) = UNREAD.iter().find(|(unread, _)| *unread == extension) {
            let (link, uri) = (link.to_owned(), uri.to_owned());
            return Err(Problem::MeshFormat { link, uri, format: (*format).to_owned() });
        }
        let path = self.find(link, uri)?;
        let of_file = |source: IoError| Problem::Mesh { link: link.to_owned(), source: Box::new(source) };
        let Loaded { value, warnings: said } = read_mesh(&path, Unit::Metre).map_err(of_file)?;
        let mesh = scaled(value, link, uri, scale)?;
        // The reader's doubt about the size is of the mesh before it is scaled, and names an option that is not for it.
        let said = said.into_iter().filter(|line| !(line.starts_with("is ") && line.contains(" across: ")));
        for line in said.chain(size_doubt(&mesh, scale)) {
            warnings.push(format!("link '{link}': {uri}: {line}"));
        }
        Ok(mesh)
    }

    fn find(&self, link: &str, uri: &str) -> Result<PathBuf, Problem> {
        let places = self.places(uri);
        places.iter().find(|place| place.is_file()).cloned().ok_or_else(|| {
            let looked: Vec<String> = places.iter().take(6).map(|p| p.display().to_string()).collect();
            Problem::NoMesh { link: link.to_owned(), uri: uri.to_owned(), looked: looked.join(", ") }
        })
    }

    /// Paths that a URI may mean, likeliest first.
    fn places(&self, uri: &str) -> Vec<PathBuf> {
        if let Some(path) = uri.strip_prefix("file://") {
            // file:///a/b is absolute; file://a/b is seen too, and means a file beside the description.
            return vec![self.base.join(path)];
        }
        let Some(rest) = uri.strip_prefix("package://").or_else(|| uri.strip_prefix("model://")) else {
            return vec![self.base.join(uri)];
        };
        let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
        let mut places = Vec::new();
        for folder in self.package_paths {
            places.push(folder.join(package).join(inside));
            if is_package(folder, package) {
                places.push(folder.join(inside));
            }
        }
        // The description mostly lies inside the package or beside it: upwards, a folder of that name, or one whose
        // package.xml says so.
        let base = self.base.canonicalize().unwrap_or_else(|_| self.base.to_owned());
        for folder in base.ancestors() {
            if is_package(folder, package) {
                places.push(folder.join(inside));
            }
            places.push(folder.join(package).join(inside));
        }
        places
    }
}

/// A mesh with each coordinate times its scale.
fn scaled(mesh: Mesh, link: &str, uri: &str, scale: &Vector3<f64>) -> Result<Mesh, Problem> {
    if *scale == Vector3::repeat(1.0) {
        return Ok(mesh);
    }
    let vertices = mesh.vertices().iter().map(|p| Point3::from(p.coords.component_mul(scale))).collect();
    let scaled = Mesh::new(vertices, mesh.faces().to_vec()).map_err(|source| match source {
        MeshError::Empty => Problem::FlatShape { link: link.to_owned(), shape: "mesh" },
        source => Problem::Scaled { link: link.to_owned(), uri: uri.to_owned(), source },
    })?;
    // A mirrored mesh shows its inside.
    Ok(if scale.product() < 0.0 { scaled.flipped() } else { scaled })
}

/// What to say of a scaled mesh that is too large or too small for a part of a hand.
fn size_doubt(mesh: &Mesh, scale: &Vector3<f64>) -> Option<String> {
    let (low, high) = mesh.bounding_box();
    let size_m = (high - low).amax();
    let shown = if size_m > LARGEST_M {
        format!("{size_m:.1} m")
    } else if size_m < SMALLEST_M {
        format!("{:.3} mm", 1e3 * size_m)
    } else {
        return None;
    };
    Some(format!(
        "is {shown} across with scale=\"{} {} {}\": meshes are in metres, those in millimetres need a scale of 0.001",
        scale.x, scale.y, scale.z
    ))
}

/// Whether a folder is that package: by its own name, or by what its package.xml says.
fn is_package(folder: &Path, package: &str) -> bool {
    if folder.file_name().is_some_and(|name| name == package) {
        return true;
    }
    let Ok(text) = std::fs::read_to_string(folder.join("package.xml")) else { return false };
    let Ok(document) = roxmltree::Document::parse(&text) else { return false };
    let name = document.root_element().children().find(|node| node.has_tag_name("name"));
    name.and_then(|node| node.text()).is_some_and(|name| name.trim() == package)
}
