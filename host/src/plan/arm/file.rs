//! Arms from TOML files: any six-axis arm with an ortho-parallel basis and a spherical wrist.
//!
//! `docs/arms.md` tells every key. Angles may be given in degrees (`_deg`) or radians (`_rad`).

mod reader;
#[cfg(test)]
mod tests;

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

use super::params::{JERK_RISE_S, REST_THETA, RUN_UP_S, adapter_plate, default_capsules};
use super::{Arm, ArmError, ArmParams, JointLimits, LinkCapsule, LoadRating, OpwGeometry};
use reader::Reader;

/// Greatest speed in space where a file gives none: that of the RX60, m/s.
const CARTESIAN_SPEED_M_PER_S: f64 = 1.8;

/// Stands for a rating that the maker does not give: more than any load.
const UNRATED: f64 = 1e9;

/// Why a text describes no arm. Each message names the key, and the value where there is one.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArmFileError {
    /// No TOML.
    #[error("line {line}: {message}")]
    Syntax {
        /// Counted from 1.
        line: usize,
        /// The parser's, in one line.
        message: String,
    },
    /// A key that every arm needs is not there.
    #[error("{key} is missing")]
    Missing {
        /// Its path.
        key: String,
    },
    /// A key that means nothing.
    #[error("{key} is not a key that an arm has")]
    Unknown {
        /// Its path.
        key: String,
    },
    /// A value of another type than wanted.
    #[error("{key} is {value}, not {wanted}")]
    Type {
        /// Its path.
        key: String,
        /// As written.
        value: String,
        /// What it should be.
        wanted: &'static str,
    },
    /// A list of the wrong length.
    #[error("{key} has {found} value(s), not {wanted}")]
    Length {
        /// Its path.
        key: String,
        /// How many there are.
        found: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// NaN or infinity.
    #[error("{key} holds {value}, not a finite number")]
    NotFinite {
        /// Its path.
        key: String,
        /// The value.
        value: f64,
    },
    /// The same angles in degrees and in radians.
    #[error("{first} and {second} are both there: give one of them")]
    Twice {
        /// Path of the one in degrees.
        first: String,
        /// Path of the other.
        second: String,
    },
    /// A number outside its range.
    #[error("{key} is {value}, but has to be {wanted}")]
    Range {
        /// Its path.
        key: String,
        /// The value.
        value: f64,
        /// What it should be.
        wanted: &'static str,
    },
    /// The numbers are readable but describe no arm.
    #[error(transparent)]
    Arm(#[from] ArmError),
}

impl Arm {
    /// Reads an arm from the text of a TOML file.
    ///
    /// # Errors
    /// [`ArmFileError`]: the first thing that is wrong.
    pub fn from_toml(text: &str) -> Result<Self, ArmFileError> {
        let mut file = Reader::parse(text)?;
        let name = file.text("name")?;
        let geometry = geometry(&mut file)?;
        let mut axes = file.table("axes")?;
        let [lower_rad, upper_rad] = ["lower", "upper"].map(|key| axes.angles(key, "", None));
        let limits = JointLimits { lower_rad: lower_rad?, upper_rad: upper_rad? };
        for i in 0..6 {
            if limits.lower_rad[i] >= limits.upper_rad[i] {
                let [lower_rad, upper_rad] = [limits.lower_rad[i], limits.upper_rad[i]];
                return Err(ArmError::Limits { axis: i + 1, lower_rad, upper_rad }.into());
            }
        }
        let speed_rad_per_s = axes.angles("speed", "_per_s", None)?;
        let acceleration = speed_rad_per_s.map(|speed| speed / RUN_UP_S);
        let acceleration_rad_per_s2 = axes.angles("acceleration", "_per_s2", Some(acceleration))?;
        let jerk = acceleration_rad_per_s2.map(|acceleration| acceleration / JERK_RISE_S);
        let jerk_rad_per_s3 = axes.angles("jerk", "_per_s3", Some(jerk))?;
        let cartesian_speed_m_per_s =
            axes.number("cartesian_speed_m_per_s")?.unwrap_or(CARTESIAN_SPEED_M_PER_S);
        let rest = geometry.joints_from_theta(&REST_THETA);
        let inside = std::array::from_fn(|i| rest[i].clamp(limits.lower_rad[i], limits.upper_rad[i]));
        let rest_rad = axes.angles("rest", "", Some(inside))?;
        axes.done()?;
        let load = load(&mut file)?;
        let flange_from_palm = flange_from_palm(&mut file)?;
        let capsules = match capsules(&mut file)? {
            Some(capsules) => capsules,
            None => default_capsules(&geometry),
        };
        file.done()?;
        let params = ArmParams {
            name,
            geometry,
            limits,
            speed_rad_per_s,
            acceleration_rad_per_s2,
            jerk_rad_per_s3,
            cartesian_speed_m_per_s,
            load,
            rest_rad,
            capsules,
        };
        Ok(Self::new(params)?.with_flange_from_palm(flange_from_palm))
    }
}

fn geometry(file: &mut Reader) -> Result<OpwGeometry, ArmFileError> {
    let mut table = file.table("geometry")?;
    let mut lengths = [0.0; 7];
    for (length, key) in lengths.iter_mut().zip(["a1_m", "a2_m", "b_m", "c1_m", "c2_m", "c3_m", "c4_m"]) {
        *length = table.needed(key)?;
    }
    let [a1_m, a2_m, b_m, c1_m, c2_m, c3_m, c4_m] = lengths;
    let offset_rad = table.angles("offset", "", Some([0.0; 6]))?;
    let sign = table.numbers::<6>("sign")?.unwrap_or([1.0; 6]);
    table.done()?;
    Ok(OpwGeometry { a1_m, a2_m, b_m, c1_m, c2_m, c3_m, c4_m, offset_rad, sign })
}

fn load(file: &mut Reader) -> Result<LoadRating, ArmFileError> {
    let mut table = file.table("load")?;
    let mass_kg = table.needed_numbers::<2>("mass_kg")?;
    let axis5_inertia_kg_m2 = table.numbers::<2>("axis5_inertia_kg_m2")?.unwrap_or([UNRATED; 2]);
    let axis6_inertia_kg_m2 = table.numbers::<2>("axis6_inertia_kg_m2")?.unwrap_or([UNRATED; 2]);
    for (key, [nominal, most]) in [
        ("mass_kg", mass_kg),
        ("axis5_inertia_kg_m2", axis5_inertia_kg_m2),
        ("axis6_inertia_kg_m2", axis6_inertia_kg_m2),
    ] {
        table.in_range(key, nominal, nominal > 0.0, "greater than zero")?;
        table.in_range(key, most, most >= nominal, "at least the nominal value before it")?;
    }
    let axis5_torque_nm = table.number("axis5_torque_nm")?.unwrap_or(UNRATED);
    let axis5_torque_with_axis6_nm = table.number("axis5_torque_with_axis6_nm")?.unwrap_or(axis5_torque_nm);
    let axis6_torque_nm = table.number("axis6_torque_nm")?.unwrap_or(UNRATED);
    for (key, value) in [
        ("axis5_torque_nm", axis5_torque_nm),
        ("axis5_torque_with_axis6_nm", axis5_torque_with_axis6_nm),
        ("axis6_torque_nm", axis6_torque_nm),
    ] {
        table.in_range(key, value, value > 0.0, "greater than zero")?;
    }
    let mut shares = [1.0; 2];
    for (share, key) in shares.iter_mut().zip(["reduced_speed", "reduced_acceleration"]) {
        *share = table.number(key)?.unwrap_or(1.0);
        table.in_range(key, *share, *share > 0.0 && *share <= 1.0, "above 0 and at most 1")?;
    }
    table.done()?;
    let [reduced_speed, reduced_acceleration] = shares;
    Ok(LoadRating {
        mass_kg,
        axis5_inertia_kg_m2,
        axis6_inertia_kg_m2,
        axis5_torque_nm,
        axis5_torque_with_axis6_nm,
        axis6_torque_nm,
        reduced_speed,
        reduced_acceleration,
    })
}

fn flange_from_palm(file: &mut Reader) -> Result<Isometry3<f64>, ArmFileError> {
    let Some(mut table) = file.optional_table("flange_from_palm")? else { return Ok(adapter_plate()) };
    let position = table.numbers::<3>("position_m")?.unwrap_or([0.0; 3]);
    let [w, x, y, z] = table.numbers::<4>("orientation_wxyz")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    table.in_range("orientation_wxyz", norm, (norm - 1.0).abs() < 1e-3, "of length 1")?;
    table.done()?;
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    Ok(Isometry3::from_parts(Translation3::from(Vector3::from(position)), rotation))
}

fn capsules(file: &mut Reader) -> Result<Option<Vec<LinkCapsule>>, ArmFileError> {
    let Some(tables) = file.tables("capsule")? else { return Ok(None) };
    let read = |mut table: Reader| {
        let link = table.needed("link")?;
        table.in_range(
            "link",
            link,
            (0.0..=6.0).contains(&link) && link.fract() == 0.0,
            "0 (the base) to 6",
        )?;
        let [from, to] = ["from_m", "to_m"].map(|key| table.needed_numbers::<3>(key).map(Point3::from));
        let radius_m = table.needed("radius_m")?;
        table.in_range("radius_m", radius_m, radius_m > 0.0, "greater than zero")?;
        table.done()?;
        Ok(LinkCapsule { link: link as usize, from: from?, to: to?, radius_m })
    };
    let mut capsules: Vec<LinkCapsule> = tables.into_iter().map(read).collect::<Result<_, ArmFileError>>()?;
    capsules.sort_by_key(|capsule| capsule.link);
    Ok(Some(capsules))
}
