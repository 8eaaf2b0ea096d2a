//! Grasps as arrays in a NumPy archive, with the keys of BODex and DexGraspBench (Chen et al., ICRA 2025).
//!
//! Those keep a pickled dictionary in `.npy`; pickles run code when they are read, so this is the `.npz` of the same keys:
//! `dict(numpy.load(file))` is that dictionary.

use std::collections::BTreeMap;
use std::io::{self, Cursor};

use hand_model::HandAngles;
use nalgebra::Isometry3;
use npyz::{DType, WriterBuilder};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::Grasp;
use crate::plan::document::named;

/// Root pose and joints: a position, a quaternion with its real part first, then the joints' angles.
type Qpos = Vec<f32>;
/// Where the hand of a grasp is at one time.
type Posture = fn(&Grasp) -> Qpos;

/// The archive. Metres, radians, base frame; the root is the palm.
///
/// | key | is |
/// |---|---|
/// | `obj_path` | what the object is called, bytes |
/// | `obj_pose` | 7: position and quaternion (w first) of the object |
/// | `obj_scale` | 1 |
/// | `joint_names` | names of the joints, bytes, in the order of the `qpos` |
/// | `approach_qpos` | open hand where the straight way to the grasp begins |
/// | `pregrasp_qpos` | open hand where the fingers close |
/// | `grasp_qpos` | fingertips touching |
/// | `squeeze_qpos` | targets behind the surface, as the grasp has them |
/// | `lift_qpos` | the same after the lift |
/// | `epsilon` | lower bound of each grasp's epsilon, double precision |
///
/// Every `qpos` has 7 numbers and those of the joints, single precision; of a single grasp they are vectors, of several
/// (`is_list`) matrices with a row each.
///
/// # Errors
/// None on the way into memory, but for more than 2^32 bytes.
pub fn archive(
    source: &str,
    base_from_object: &Isometry3<f64>,
    grasps: &[Grasp],
    is_list: bool,
) -> io::Result<Vec<u8>> {
    let mut archive = Archive { zip: ZipWriter::new(Cursor::new(Vec::new())) };
    archive.bytes("obj_path", &[], &[source.to_owned()])?;
    archive.numbers("obj_pose", &[7], &pose(base_from_object))?;
    archive.numbers("obj_scale", &[], &[1.0_f32])?;
    let names: Vec<String> = joints(&HandAngles::default()).into_keys().collect();
    archive.bytes("joint_names", &[names.len() as u64], &names)?;
    let postures: [(&str, Posture); 5] = [
        ("approach_qpos", |grasp| qpos(&grasp.approach_site, &grasp.pregrasp)),
        ("pregrasp_qpos", |grasp| qpos(&grasp.grasp_site, &grasp.pregrasp)),
        ("grasp_qpos", |grasp| qpos(&grasp.grasp_site, &grasp.grasp)),
        ("squeeze_qpos", |grasp| qpos(&grasp.grasp_site, &grasp.squeeze)),
        ("lift_qpos", |grasp| qpos(&grasp.lift_site, &grasp.squeeze)),
    ];
    let rows = grasps.len() as u64;
    let shaped = |width: u64| if is_list { vec![rows, width] } else { vec![width] };
    for (key, posture) in postures {
        let numbers: Vec<f32> = grasps.iter().flat_map(posture).collect();
        archive.numbers(key, &shaped(7 + names.len() as u64), &numbers)?;
    }
    let shape = [rows];
    let epsilons: Vec<f64> = grasps.iter().map(|grasp| grasp.epsilon).collect();
    archive.numbers("epsilon", if is_list { &shape } else { &[] }, &epsilons)?;
    Ok(archive.zip.finish()?.into_inner())
}

fn pose(base_from_it: &Isometry3<f64>) -> Qpos {
    let (p, q) = (base_from_it.translation.vector, base_from_it.rotation);
    [p.x, p.y, p.z, q.w, q.i, q.j, q.k].map(|x| x as f32).into()
}

fn qpos(base_from_palm: &Isometry3<f64>, angles: &HandAngles<f64>) -> Qpos {
    let angles = joints(angles).into_values().map(|angle_rad| angle_rad as f32);
    pose(base_from_palm).into_iter().chain(angles).collect()
}

/// All joints of the description, the coupled ones too: the benches know no coupling.
fn joints(angles: &HandAngles<f64>) -> BTreeMap<String, f64> {
    let mut joints = named(angles);
    let coupled: Vec<(String, f64)> = joints
        .iter()
        .filter_map(|(name, angle_rad)| {
            Some((format!("{}_distal", name.strip_suffix("_middle")?), *angle_rad))
        })
        .collect();
    joints.extend(coupled);
    joints
}

struct Archive {
    zip: ZipWriter<Cursor<Vec<u8>>>,
}

impl Archive {
    fn begin(&mut self, key: &str) -> io::Result<()> {
        // Without a clock, the same plan leaves the same bytes.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        Ok(self.zip.start_file(format!("{key}.npy"), options)?)
    }

    fn numbers<T: npyz::AutoSerialize + Copy>(
        &mut self,
        key: &str,
        shape: &[u64],
        values: &[T],
    ) -> io::Result<()> {
        self.begin(key)?;
        let mut writer =
            npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut self.zip).begin_nd()?;
        writer.extend(values.iter().copied())?;
        writer.finish()
    }

    /// Texts as NumPy's bytes, all as long as the longest.
    fn bytes(&mut self, key: &str, shape: &[u64], texts: &[String]) -> io::Result<()> {
        self.begin(key)?;
        let longest = texts.iter().map(String::len).max().unwrap_or(0).max(1);
        let dtype = format!("|S{longest}").parse().map_err(io::Error::other)?;
        let mut writer = npyz::WriteOptions::<[u8]>::new()
            .dtype(DType::Plain(dtype))
            .shape(shape)
            .writer(&mut self.zip)
            .begin_nd()?;
        for text in texts {
            writer.push(text.as_bytes())?;
        }
        writer.finish()
    }
}
