//! Mesh files that a description names: found, read, scaled.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

use super::error::Problem;
use crate::io::{IoError, Unit, read_mesh};
use crate::surface::Mesh;

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
    /// The mesh at a URI, in metres, scaled.
    pub(super) fn mesh(&self, link: &str, uri: &str, scale: &Vector3<f64>) -> Result<Mesh, Problem> {
        let extension = uri.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
        if let Some((_, format)) = UNREAD.iter().find(|(unread, _)| *unread == extension) {
            let (link, uri) = (link.to_owned(), uri.to_owned());
            return Err(Problem::MeshFormat { link, uri, format: (*format).to_owned() });
        }
        let path = self.find(link, uri)?;
        let of_file = |source: IoError| Problem::Mesh { link: link.to_owned(), source: Box::new(source) };
        let mesh = read_mesh(&path, Unit::Metre).map_err(of_file)?.value;
        if *scale == Vector3::repeat(1.0) {
            return Ok(mesh);
        }
        let vertices = mesh.vertices().iter().map(|p| Point3::from(p.coords.component_mul(scale))).collect();
        let flat = |_| Problem::FlatShape { link: link.to_owned(), shape: "mesh" };
        let scaled = Mesh::new(vertices, mesh.faces().to_vec()).map_err(flat)?;
        // A mirrored mesh shows its inside.
        Ok(if scale.product() < 0.0 { scaled.flipped() } else { scaled })
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
            if folder.file_name().is_some_and(|name| name == package) {
                places.push(folder.join(inside));
            }
        }
        // The description mostly lies inside the package or beside it: upwards, a folder of that name, or one whose
        // package.xml says so.
        let base = self.base.canonicalize().unwrap_or_else(|_| self.base.to_owned());
        for folder in base.ancestors() {
            if folder.file_name().is_some_and(|name| name == package) || is_package(folder, package) {
                places.push(folder.join(inside));
            }
            places.push(folder.join(package).join(inside));
        }
        places
    }
}

/// Whether a folder's package.xml has that name.
fn is_package(folder: &Path, package: &str) -> bool {
    let Ok(text) = std::fs::read_to_string(folder.join("package.xml")) else { return false };
    let Ok(document) = roxmltree::Document::parse(&text) else { return false };
    let name = document.root_element().children().find(|node| node.has_tag_name("name"));
    name.and_then(|node| node.text()).is_some_and(|name| name.trim() == package)
}
