//! The signed distance to the tangent planes, on the lattice nodes near the samples only.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::{grid::Grid, tangent::Tangent};

/// Bits of one coordinate in a node's key.
const BITS: u32 = 21;
const MASK: u64 = (1 << BITS) - 1;
/// Key difference of neighbours along x, y and z.
pub(super) const STRIDE: [u64; 3] = [1, 1 << BITS, 1 << (2 * BITS)];

/// A cubic lattice; node (i, j, k) lies at `low + cell_m * (i, j, k)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Node (0, 0, 0), metres.
    pub low: Point3<f64>,
    /// Edge of a cell.
    pub cell_m: f64,
}

impl Lattice {
    /// Longest side, in cells, that a lattice can have.
    pub const LONGEST: f64 = (MASK - 16) as f64;

    /// Position of the node with this key.
    #[must_use]
    pub fn position(&self, key: u64) -> Point3<f64> {
        self.low + Vector3::from(unpack(key).map(|c| c as f64)) * self.cell_m
    }

    /// Key of the lower corner of the cell that holds `point`, which must lie above `low` by less than
    /// [`Lattice::LONGEST`] cells.
    #[must_use]
    pub fn cell_of(&self, point: &Point3<f64>) -> u64 {
        pack(((point - self.low) / self.cell_m).map(|c| c as u64).into())
    }
}

/// Key of node (i, j, k); keys sort by k, then j, then i.
pub(super) const fn pack([i, j, k]: [u64; 3]) -> u64 {
    i | j << BITS | k << (2 * BITS)
}

/// Node (i, j, k) of a key.
pub(super) const fn unpack(key: u64) -> [u64; 3] {
    [key & MASK, key >> BITS & MASK, key >> (2 * BITS)]
}

/// A scalar field on some nodes of a lattice. It has no value elsewhere, and no surface is drawn there.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Where the nodes lie.
    pub lattice: Lattice,
    /// Nodes that have a value, ascending.
    pub keys: Vec<u64>,
    /// Signed distance at each of them, metres: negative inside.
    pub values: Vec<f64>,
}

/// How far measured samples support a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Hoppe's rho + delta: sampling density plus noise, metres. Where the foot of the perpendicular lies farther than
    /// this from its sample the distance is undefined, so that borders and holes survive.
    pub radius_m: f64,
    /// Distance over which neighbouring tangent planes are blended, metres; Hoppe's single nearest plane is the limit
    /// of 0, at which the surface has a small step between any two samples.
    pub blend_m: f64,
}

/// Signed distance (Hoppe et al. 1992, section 3.2) on the nodes within two cells of a tangent plane's origin.
///
/// The nearest origin decides whether the distance is defined. Its value is the mean over nearby planes that face
/// the same way within 60 degrees, so that the two sides of a wall and the two faces of an edge do not mix.
#[must_use]
pub fn signed_distance(tangents: &[Tangent], grid: &Grid, lattice: Lattice, support: &Support) -> Field {
    let mut keys: Vec<u64> = tangents.iter().map(|t| lattice.cell_of(&t.origin)).collect();
    // Corners of the samples' own cells and of those around them, axis by axis to keep the lists short.
    for stride in STRIDE {
        keys.par_sort_unstable();
        keys.dedup();
        keys = keys.iter().flat_map(|&key| [key - stride, key, key + stride, key + 2 * stride]).collect();
    }
    keys.par_sort_unstable();
    keys.dedup();
    let values: Vec<Option<f64>> = keys
        .par_iter()
        .map_init(Vec::new, |found, &key| evaluate(tangents, grid, &lattice.position(key), support, found))
        .collect();
    let (keys, values) = keys.into_iter().zip(values).filter_map(|(k, v)| Some((k, v?))).unzip();
    Field { lattice, keys, values }
}

fn evaluate(
    tangents: &[Tangent],
    grid: &Grid,
    node: &Point3<f64>,
    support: &Support,
    found: &mut Vec<(f64, u32)>,
) -> Option<f64> {
    grid.nearest(node, 1, found);
    let &(nearest2, index) = found.first()?;
    let nearest = tangents[index as usize];
    let offset = node - nearest.origin;
    let height = offset.dot(&nearest.normal);
    if (offset - nearest.normal.into_inner() * height).norm() >= support.radius_m {
        return None;
    }
    if support.blend_m <= 0.0 {
        return Some(height);
    }
    grid.within(node, (nearest2 + 4.0 * support.blend_m.powi(2)).sqrt(), found);
    let (mut sum, mut total) = (0.0, 0.0);
    for &(d2, i) in found.iter() {
        let tangent = &tangents[i as usize];
        if tangent.normal.dot(&nearest.normal) > 0.5 {
            let weight = ((nearest2 - d2) / support.blend_m.powi(2)).exp();
            sum += weight * (node - tangent.origin).dot(&tangent.normal);
            total += weight;
        }
    }
    // The nearest plane itself has weight one.
    Some(sum / total)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_keep_their_node() {
        for node in [[0, 0, 0], [1, 2, 3], [MASK, 0, MASK - 1]] {
            assert_eq!(unpack(pack(node)), node);
        }
        assert_eq!(pack([3, 4, 5]) + STRIDE[2], pack([3, 4, 6]));
    }

    #[test]
    fn distance_to_a_sheet_is_linear_above_it_and_undefined_beside_it() {
        let tangents: Vec<_> = (0..100)
            .map(|i| Tangent {
                origin: Point3::new(f64::from(i % 10), f64::from(i / 10), 0.0),
                normal: Vector3::z_axis(),
            })
            .collect();
        let origins: Vec<_> = tangents.iter().map(|t| t.origin).collect();
        let lattice = Lattice { low: Point3::new(-4.3, -4.3, -4.3), cell_m: 1.0 };
        let support = Support { radius_m: 1.2, blend_m: 0.8 };
        let field = signed_distance(&tangents, &Grid::for_surface(&origins), lattice, &support);
        assert!(!field.keys.is_empty() && field.keys.is_sorted());
        for (&key, value) in field.keys.iter().zip(&field.values) {
            let node = lattice.position(key);
            assert!((value - node.z).abs() < 1e-12);
            assert!(node.x > -1.2 && node.x < 10.2 && node.y > -1.2 && node.y < 10.2, "{node}");
        }
    }
}
