//! Thinning: one averaged point for each occupied voxel.

use nalgebra::{Point3, Unit, Vector3};
use rayon::prelude::*;

use super::cloud::PointCloud;

/// A thinned cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Thinned {
    /// One point for each occupied voxel.
    pub cloud: PointCloud,
    /// For each point of the dense cloud the index of its voxel's point.
    pub voxel_of: Vec<u32>,
    /// For each voxel's point how many it is the mean of. Where the border between two voxels passes through the noise of a
    /// surface, few far points make a mean as well as many near ones do; only their numbers tell them apart.
    pub counts: Vec<f64>,
}

/// Averages positions, normals and lines of sight over voxels of side `voxel_m` (> 0), or a millionth of the cloud's side if
/// that is more. Sweeps mix, and their numbers go.
///
/// Overlapping sweeps sample a surface far more densely than their noise lets them resolve it, and neighbourhoods of a
/// few points then describe the noise. The mean of a voxel is both fewer points and better ones.
#[must_use]
pub fn thin(cloud: &PointCloud, voxel_m: f64) -> Thinned {
    let Some((low, high)) = cloud.bounding_box() else {
        return Thinned { cloud: cloud.clone(), voxel_of: Vec::new(), counts: Vec::new() };
    };
    // At most so many voxels along a side that a voxel's number has 63 bits: a kilometre of half millimetres.
    let voxel_m = voxel_m.max((high - low).amax() / f64::from(1 << 20));
    let voxel = |p: &Point3<f64>| -> u64 {
        let place = ((p - low) / voxel_m).map(|c| c as u64);
        place.x << 42 | place.y << 21 | place.z
    };
    let mut order: Vec<(u64, u32)> =
        cloud.points.par_iter().enumerate().map(|(i, p)| (voxel(p), i as u32)).collect();
    order.par_sort_unstable();
    let groups: Vec<&[(u64, u32)]> = order.chunk_by(|a, b| a.0 == b.0).collect();
    let directions = |array: &Option<Vec<Unit<Vector3<f64>>>>| {
        array.as_ref().map(|array| groups.iter().map(|group| mean_direction(group, array)).collect())
    };
    let points = groups
        .iter()
        .map(|group| {
            let sum: Vector3<f64> = group.iter().map(|&(_, i)| cloud.points[i as usize] - low).sum();
            low + sum / group.len() as f64
        })
        .collect();
    let mut voxel_of = vec![0; cloud.len()];
    for (voxel, group) in groups.iter().enumerate() {
        group.iter().for_each(|&(_, i)| voxel_of[i as usize] = voxel as u32);
    }
    let cloud = PointCloud {
        points,
        normals: directions(&cloud.normals),
        views: directions(&cloud.views),
        sweeps: None,
    };
    let counts = groups.iter().map(|group| group.len() as f64).collect();
    Thinned { cloud, voxel_of, counts }
}

/// The mean direction, or the first one where directions cancel.
fn mean_direction(group: &[(u64, u32)], array: &[Unit<Vector3<f64>>]) -> Unit<Vector3<f64>> {
    let sum: Vector3<f64> = group.iter().map(|&(_, i)| array[i as usize].into_inner()).sum();
    Unit::try_new(sum, 1e-6).unwrap_or(array[group[0].1 as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_mean_point_for_each_voxel() {
        let points = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.2, 0.0, 0.0]].map(Point3::from).to_vec();
        let views = Some(vec![Vector3::z_axis(), Vector3::x_axis(), -Vector3::z_axis()]);
        let thinned = thin(&PointCloud { points, views, ..PointCloud::default() }, 1.0);
        assert_eq!(thinned.voxel_of, [0, 1, 0]);
        assert_eq!(thinned.counts, [2.0, 1.0]);
        assert_eq!(thinned.cloud.points, [[0.1, 0.0, 0.0], [1.5, 0.0, 0.0]].map(Point3::from));
        assert_eq!(thinned.cloud.views.unwrap(), [Vector3::z_axis(), Vector3::x_axis()]);
        assert!(thin(&PointCloud::default(), 1.0).cloud.is_empty());
    }
}
