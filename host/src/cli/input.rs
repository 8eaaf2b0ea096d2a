//! What several commands read: objects by name or file, lengths, files to write.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::colour;
use crate::io::{Unit, read_mesh, read_text};
use crate::object::{BuiltIn, Object};
use crate::plan::arm::Arm;
use crate::scan::hand_eye::MountFile;
use crate::surface::{Mesh, Pick};

/// Height of the virtual cell's table in the base frame, metres.
pub(super) const TABLE_HEIGHT_M: f64 = 0.0;

/// Where objects stand in the virtual cell: in the middle of the annulus in which the arm reaches straight down in
/// every yaw (0.35 to 0.50 m).
pub(super) const SPOT_M: [f64; 2] = [0.40, 0.0];

/// Mass that is assumed for an object of unknown mass, kg, unless that is more than it would weigh in steel.
const ASSUMED_MASS_KG: f64 = 0.1;

/// Density of steel, kg/m^3.
const STEEL_KG_PER_M3: f64 = 7850.0;

/// Reads `--unit`.
pub(super) fn unit(text: &str) -> Result<Unit, String> {
    text.parse().map_err(|error: crate::io::UnknownName| error.to_string())
}

/// A number above zero, for arguments.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a number above 0".to_owned()),
    }
}

/// A number of zero or more, for arguments.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("give a number of 0 or more".to_owned()),
    }
}

/// Three numbers separated by commas.
pub(super) fn triple(text: &str) -> Result<[f64; 3], String> {
    numbers(text).ok_or_else(|| "give three numbers separated by commas".to_owned())
}

/// Six numbers separated by commas.
pub(super) fn six(text: &str) -> Result<[f64; 6], String> {
    numbers(text).ok_or_else(|| "give six numbers separated by commas".to_owned())
}

/// Reads `--pick`: what one of several objects is called.
pub(super) fn pick(text: &str) -> Result<Pick, String> {
    match (text, text.parse::<usize>(), numbers(text)) {
        ("whole", ..) => Ok(Pick::Whole),
        ("largest", ..) => Ok(Pick::Largest),
        ("nearest", ..) => Ok(Pick::Nearest),
        (_, Ok(number), _) if number > 0 => Ok(Pick::Number(number - 1)),
        (_, _, Some(at)) => Ok(Pick::At(Point3::from(at))),
        _ => Err("give a number from 1, largest, nearest, whole, or a point X,Y,Z".to_owned()),
    }
}

/// `N` finite numbers separated by commas.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.iter().all(|n| n.is_finite()).then_some(())?;
    numbers.try_into().ok()
}

/// Largest description of an arm that is read, bytes.
const MAX_ARM_BYTES: u64 = 1 << 20;

/// The arm that a TOML file describes.
pub(super) fn arm(path: &Path) -> anyhow::Result<Arm> {
    let name = || path.display().to_string();
    let metadata = std::fs::metadata(path).with_context(name)?;
    ensure!(metadata.is_file(), "{}: not a file", path.display());
    ensure!(
        metadata.len() <= MAX_ARM_BYTES,
        "{}: {} bytes are more than an arm has",
        path.display(),
        metadata.len()
    );
    let text = std::fs::read_to_string(path).with_context(name)?;
    Arm::from_toml(&text).with_context(name)
}

/// Largest mount that is read, bytes.
const MAX_MOUNT_BYTES: u64 = 1 << 20;

/// Where the scanner sits on the palm, as a TOML file of `prehend calibrate-mount` says.
pub(super) fn mount(path: &Path) -> anyhow::Result<Isometry3<f64>> {
    let name = || path.display().to_string();
    let text = read_text(path, MAX_MOUNT_BYTES).with_context(name)?;
    MountFile::palm_from_scanner(&text).with_context(name)
}

/// A built-in object by its name, or a mesh file, with its warnings printed to stderr.
pub(super) fn object(name: &str, unit: Unit, mass_kg: Option<f64>, friction: f64) -> anyhow::Result<Object> {
    if let Some(built_in) = BuiltIn::ALL.into_iter().find(|b| b.name() == name) {
        let mut object = built_in.object(1.0)?;
        object.friction = friction;
        object.mass_kg = mass_kg.unwrap_or(object.mass_kg);
        return Ok(object);
    }
    let path = Path::new(name);
    if !path.exists() && path.extension().is_none() {
        // A word without an extension is more likely a name than a path.
        bail!("{}", crate::object::ObjectError::UnknownName(name.to_owned()));
    }
    let loaded = read_mesh(path, unit)?;
    warn(name, &loaded.warnings);
    let mass_kg = mass_kg.unwrap_or_else(|| assumed_mass_kg(&loaded.value));
    Ok(Object::new(name, loaded.value, mass_kg, friction))
}

/// The mass of an object when nobody gives it.
pub(super) fn assumed_mass_kg(mesh: &Mesh) -> f64 {
    let in_steel_kg = mesh.bulk().volume_m3 * STEEL_KG_PER_M3;
    if in_steel_kg > 0.0 { ASSUMED_MASS_KG.min(in_steel_kg) } else { ASSUMED_MASS_KG }
}

/// Prints warnings about a file to stderr, a line each.
pub(super) fn warn(file: impl std::fmt::Display, warnings: &[String]) {
    for warning in warnings {
        // Nobody is left to tell when stderr is gone.
        let _ = writeln!(
            anstream::stderr(),
            "{} {file}: {warning}",
            colour::styled("warning:", colour::DOUBTFUL)
        );
    }
}

/// The pose that stands a mesh, upright in its own z, at the cell's spot on a table of the given height.
pub(super) fn standing_at_spot(mesh: &Mesh, table_height_m: f64) -> Isometry3<f64> {
    let (low, high) = mesh.bounding_box();
    let middle = nalgebra::center(&low, &high);
    Isometry3::from(Translation3::new(SPOT_M[0] - middle.x, SPOT_M[1] - middle.y, table_height_m - low.z))
}

/// Whether a mesh already stands on a table of the given height within the arm's reach, as scans in the base frame do.
pub(super) fn stands_in_cell(mesh: &Mesh, table_height_m: f64) -> bool {
    let (low, high) = mesh.bounding_box();
    let middle: Point3<f64> = nalgebra::center(&low, &high);
    let distance_m = Vector3::new(middle.x, middle.y, 0.0).norm();
    (low.z - table_height_m).abs() < 0.005 && (0.2..0.7).contains(&distance_m)
}

/// Makes a folder for results, with its parents.
pub(super) fn make_folder(path: &Path) -> anyhow::Result<()> {
    ensure!(path.is_dir() || !path.exists(), "{}: is a file, not a folder: name another", path.display());
    std::fs::create_dir_all(path).with_context(|| format!("making folder {}", path.display()))
}
