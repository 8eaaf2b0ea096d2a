//! The signed distance to the tangent planes, on the lattice nodes near the samples only.

use nalgebra::{Point3, Unit, Vector3};
use rayon::prelude::*;

use super::{
    grid::{Grid, Neighbour},
    tangent::Tangent,
};

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

/// Tangent planes that the signed distance is taken to.
pub(super) struct Planes<'a> {
    pub(super) tangents: &'a [Tangent],
    /// The origins of the planes.
    pub(super) grid: &'a Grid,
    pub(super) support: Support,
    /// Whether edges show above the noise, so that faces are told apart.
    pub(super) shows_edges: bool,
}

/// Distance to the surface near a point, and its direction there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Distance {
    /// Metres, negative inside.
    pub(super) signed_m: f64,
    /// Outward normal of the face that the distance is taken to.
    pub(super) normal: Unit<Vector3<f64>>,
}

/// Signed distance (Hoppe et al. 1992, section 3.2) on the nodes within two cells of a tangent plane's origin.
///
/// The nearest origin decides whether the distance is defined. Its value is that of the faces nearby, see
/// [`Planes::distance`].
#[must_use]
pub(super) fn signed_distance(planes: &Planes<'_>, lattice: Lattice) -> Field {
    let mut keys: Vec<u64> = planes.tangents.iter().map(|t| lattice.cell_of(&t.origin)).collect();
    // Corners of the samples' own cells and of those around them, axis by axis to keep the lists short.
    for stride in STRIDE {
        keys.par_sort_unstable();
        keys.dedup();
        keys = keys.iter().flat_map(|&key| [key - stride, key, key + stride, key + 2 * stride]).collect();
    }
    keys.par_sort_unstable();
    keys.dedup();
    let values: Vec<Option<Distance>> = keys
        .par_iter()
        .map_init(Vec::new, |found, &key| planes.distance(&lattice.position(key), found))
        .collect();
    let (keys, values) = keys.into_iter().zip(values).filter_map(|(k, v)| Some((k, v?.signed_m))).unzip();
    Field { lattice, keys, values }
}

/// Least cosine between the normals of one face's tangent planes: 30 degrees.
const SAME_FACE: f64 = 0.866;
/// The same where edges do not show: 60 degrees.
const ONE_SIDE: f64 = 0.5;
/// Least cosine between the normals of two faces that can meet in an edge; beyond are the two sides of a wall.
const MEETING_FACES: f64 = -0.5;
/// Most faces that meet at a point.
const MOST_FACES: usize = 3;
/// Fewest tangent planes of a second face: one alone may be a stray.
const FEWEST_PLANES: usize = 2;

/// How far faces that meet in an edge must lie behind or before each other, as a share of the blending distance. Where
/// they do so by less, noise would decide between convex and concave.
const CLEAR_EDGE: f64 = 0.15;

/// Some tangent planes that face the same way, blended.
struct Face {
    origin: Vector3<f64>,
    normal: Vector3<f64>,
    height_m: f64,
    planes: usize,
}

impl Face {
    fn distance(&self) -> Distance {
        Distance { signed_m: self.height_m, normal: Unit::new_normalize(self.normal) }
    }
}

impl Planes<'_> {
    /// Distance at `node`, or `None` where no sample supports a surface.
    ///
    /// Near an edge, planes of both its faces lie about a node, and their mean would round it. So planes are sorted into
    /// faces by their normals, from the nearest outwards, and blended within a face only. Where two faces meet in a
    /// convex edge the body is what lies behind both, and the distance the greater of the two; at a concave edge it is
    /// the smaller.
    pub(super) fn distance(&self, node: &Point3<f64>, found: &mut Vec<Neighbour>) -> Option<Distance> {
        let Self { tangents, grid, support, .. } = self;
        grid.nearest(node, 1, found);
        let &(nearest2, index) = found.first()?;
        let nearest = tangents[index as usize];
        let offset = node - nearest.origin;
        let height = offset.dot(&nearest.normal);
        if (offset - nearest.normal.into_inner() * height).norm() >= support.radius_m {
            return None;
        }
        if support.blend_m <= 0.0 {
            return Some(Distance { signed_m: height, normal: nearest.normal });
        }
        if !self.shows_edges {
            // One face: planes that look the way of the nearest within 60 degrees, so that the two sides of a wall and the
            // faces of an edge do not mix.
            grid.within(node, (nearest2 + 4.0 * support.blend_m.powi(2)).sqrt(), found);
            return Some(self.take_face(node, nearest2, &nearest.normal, ONE_SIDE, found).distance());
        }
        grid.within(node, nearest2.sqrt() + 2.0 * support.blend_m, found);
        let mut first = self.take_face(node, nearest2, &nearest.normal, SAME_FACE, found);
        let mut distance = first.distance();
        for _ in 1..MOST_FACES {
            let mut normals = found.iter().map(|&(_, i)| tangents[i as usize].normal);
            let Some(seed) = normals.find(|n| n.dot(&first.normal) > MEETING_FACES) else { break };
            let face = self.take_face(node, nearest2, &seed, SAME_FACE, found);
            if face.planes < FEWEST_PLANES {
                continue;
            }
            if first.planes < FEWEST_PLANES {
                (distance, first) = (face.distance(), face);
                continue;
            }
            // How far each face lies in front of the other: behind at a convex edge, before at a concave one.
            let way = face.origin - first.origin;
            let (face_m, first_m) = (way.dot(&first.normal), -way.dot(&face.normal));
            let clear_m = CLEAR_EDGE * support.blend_m;
            let convex = face_m.max(first_m) < clear_m && face_m + first_m < -2.0 * clear_m;
            let concave = face_m.min(first_m) > -clear_m && face_m + first_m > 2.0 * clear_m;
            let (cut, filled) = (face.height_m > distance.signed_m, face.height_m < distance.signed_m);
            if convex && cut || concave && filled {
                distance = face.distance();
            }
        }
        Some(distance)
    }

    /// Blends the planes that face as `seed` does, and takes them out of `found`.
    fn take_face(
        &self,
        node: &Point3<f64>,
        nearest2: f64,
        seed: &Unit<Vector3<f64>>,
        least_cosine: f64,
        found: &mut Vec<Neighbour>,
    ) -> Face {
        let mut total = 0.0;
        let mut face = Face { origin: Vector3::zeros(), normal: Vector3::zeros(), height_m: 0.0, planes: 0 };
        found.retain(|&(d2, i)| {
            let tangent = &self.tangents[i as usize];
            if tangent.normal.dot(seed) <= least_cosine {
                return true;
            }
            let weight = ((nearest2 - d2) / self.support.blend_m.powi(2)).exp();
            let offset = node - tangent.origin;
            face.origin -= offset * weight;
            face.normal += tangent.normal.into_inner() * weight;
            face.height_m += weight * offset.dot(&tangent.normal);
            total += weight;
            face.planes += 1;
            false
        });
        // The seed itself is one of them.
        face.origin /= total;
        face.height_m /= total;
        face.normal /= face.normal.norm();
        face
    }
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
        let grid = Grid::for_surface(&origins);
        let field = signed_distance(
            &Planes { tangents: &tangents, grid: &grid, support, shows_edges: true },
            lattice,
        );
        assert!(!field.keys.is_empty() && field.keys.is_sorted());
        for (&key, value) in field.keys.iter().zip(&field.values) {
            let node = lattice.position(key);
            assert!((value - node.z).abs() < 1e-12);
            assert!(node.x > -1.2 && node.x < 10.2 && node.y > -1.2 && node.y < 10.2, "{node}");
        }
    }
}
