//! Slivers: short edges that contouring leaves where the surface passes close by a node of its lattice.

use nalgebra::{Point3, Vector3};

use super::mesh::Mesh;

/// Rounds; each collapses edges that no face touches two of.
const ROUNDS: usize = 6;
/// Least cosine between the normals of a face before and after.
const LEAST_TURN: f64 = 0.3;
/// Least height of a triangle, as a share of its longest side, unless it was worse before.
const THINNEST: f64 = 0.02;

/// The mesh with its edges below `shorter_m` collapsed, where the surface moves by no more than `tolerance_m`: so near are
/// the new corner to the planes of the faces as they were, and the old corners to the planes of the new ones.
///
/// Borders, and edges at which the provenance changes, stay where they are. A closed mesh stays closed and manifold.
/// [`decimate`](super::decimate::decimate) bounds the distance to the whole surface and takes ten times as long.
#[must_use]
pub(super) fn without_slivers(mesh: Mesh, shorter_m: f64, tolerance_m: f64) -> Mesh {
    let mut work = Work::new(&mesh);
    for _ in 0..ROUNDS {
        if !work.round(shorter_m, tolerance_m) {
            break;
        }
    }
    work.finished(mesh)
}

struct Work {
    at: Vec<Point3<f64>>,
    /// Corners, and number of the original face.
    faces: Vec<([u32; 3], u32)>,
    /// Vertices at which the surface or its provenance ends, or more than two faces meet.
    fixed: Vec<bool>,
}

/// The faces of every vertex, in one array.
struct Around {
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Around {
    fn new(vertices: usize, faces: &[([u32; 3], u32)]) -> Self {
        let mut starts = vec![0_u32; vertices + 1];
        for &v in faces.iter().flat_map(|(face, _)| face) {
            starts[v as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut of = vec![0; 3 * faces.len()];
        for (number, (face, _)) in faces.iter().enumerate() {
            for &v in face {
                of[next[v as usize] as usize] = number as u32;
                next[v as usize] += 1;
            }
        }
        Self { starts, faces: of }
    }

    fn of(&self, v: u32) -> &[u32] {
        &self.faces[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }
}

impl Work {
    fn new(mesh: &Mesh) -> Self {
        let faces: Vec<([u32; 3], u32)> = mesh.faces().iter().copied().zip(0..).collect();
        let mut fixed = vec![false; mesh.vertices().len()];
        let around = Around::new(fixed.len(), &faces);
        let source = |face: u32| mesh.provenance().map(|all| all[face as usize]);
        for (number, (face, _)) in (0..).zip(&faces) {
            for (from, to) in edges(*face) {
                let mut others = around
                    .of(from)
                    .iter()
                    .filter(|&&other| other != number && faces[other as usize].0.contains(&to));
                let is_inner = others.next().is_some_and(|&other| {
                    edges(faces[other as usize].0).contains(&(to, from)) && source(other) == source(number)
                });
                if !is_inner || others.next().is_some() {
                    fixed[from as usize] = true;
                    fixed[to as usize] = true;
                }
            }
        }
        Self { at: mesh.vertices().to_vec(), faces, fixed }
    }

    /// Collapses what it can; whether that was anything.
    fn round(&mut self, shorter_m: f64, tolerance_m: f64) -> bool {
        let mut short: Vec<(f64, u32, u32)> = Vec::new();
        for (from, to) in self.faces.iter().flat_map(|(face, _)| edges(*face)) {
            let length = (self.at[to as usize] - self.at[from as usize]).norm();
            // Each inner edge is met in both directions.
            if from < to && length < shorter_m && !(self.fixed[from as usize] && self.fixed[to as usize]) {
                short.push((length, from, to));
            }
        }
        short.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        if short.is_empty() {
            return false;
        }
        let around = Around::new(self.at.len(), &self.faces);
        let mut changed = vec![false; self.faces.len()];
        let mut gone = vec![false; self.faces.len()];
        let mut any = false;
        for (_, a, b) in short {
            let near = [a, b].map(|v| around.of(v));
            if near.iter().any(|faces| faces.iter().any(|&f| changed[f as usize])) {
                continue;
            }
            let (keep, drop) = if self.fixed[b as usize] { (b, a) } else { (a, b) };
            let place = if self.fixed[keep as usize] {
                self.at[keep as usize]
            } else {
                nalgebra::center(&self.at[a as usize], &self.at[b as usize])
            };
            if !self.may_collapse(near, [a, b], &place, tolerance_m) {
                continue;
            }
            self.at[keep as usize] = place;
            for &f in near[0].iter().chain(near[1]) {
                changed[f as usize] = true;
                let face = &mut self.faces[f as usize].0;
                if face.contains(&a) && face.contains(&b) {
                    gone[f as usize] = true;
                }
            }
            for &f in around.of(drop).iter().filter(|&&f| !gone[f as usize]) {
                self.faces[f as usize].0.iter_mut().filter(|v| **v == drop).for_each(|v| *v = keep);
            }
            any = true;
        }
        let mut numbers = gone.iter();
        self.faces.retain(|_| !numbers.next().is_some_and(|gone| *gone));
        any
    }

    /// Whether the ends of an edge may become one vertex at `place`: the surface stays a manifold, no face turns over or
    /// gets too thin, and nothing moves too far.
    fn may_collapse(&self, near: [&[u32]; 2], ends: [u32; 2], place: &Point3<f64>, tolerance_m: f64) -> bool {
        let corners_of = |faces: &[u32]| -> Vec<u32> {
            let mut found: Vec<u32> = faces.iter().flat_map(|&f| self.faces[f as usize].0).collect();
            found.sort_unstable();
            found.dedup();
            found.retain(|v| !ends.contains(v));
            found
        };
        let [first, second] = near.map(corners_of);
        // The link condition: the two vertices opposite the edge, and no others, neighbour both ends.
        if first.iter().filter(|v| second.binary_search(v).is_ok()).count() != 2 {
            return false;
        }
        let old = ends.map(|v| self.at[v as usize]);
        near[0].iter().chain(near[1]).all(|&f| {
            let face = self.faces[f as usize].0;
            let before = face.map(|v| self.at[v as usize]);
            let plane = across(&before);
            let height = |normal: &Vector3<f64>, on: &Point3<f64>, p: &Point3<f64>| {
                normal.dot(&(p - on)).abs() <= tolerance_m * normal.norm()
            };
            if !height(&plane, &before[0], place) {
                return false;
            }
            if ends.iter().all(|end| face.contains(end)) {
                return true;
            }
            let after = face.map(|v| if ends.contains(&v) { *place } else { self.at[v as usize] });
            let turned = across(&after);
            let is_turned = plane.dot(&turned) <= LEAST_TURN * plane.norm() * turned.norm();
            let thin = thinness(&after);
            !is_turned
                && (thin > THINNEST || thin > thinness(&before))
                && old.iter().all(|p| height(&turned, place, p))
        })
    }

    fn finished(self, mesh: Mesh) -> Mesh {
        if self.faces.len() == mesh.faces().len() {
            return mesh;
        }
        let mut number_of = vec![u32::MAX; self.at.len()];
        let mut vertices = Vec::new();
        let mut faces = Vec::with_capacity(self.faces.len());
        for (face, _) in &self.faces {
            faces.push(face.map(|v| {
                if number_of[v as usize] == u32::MAX {
                    number_of[v as usize] = vertices.len() as u32;
                    vertices.push(self.at[v as usize]);
                }
                number_of[v as usize]
            }));
        }
        let provenance = mesh.provenance().map(|all| self.faces.iter().map(|f| all[f.1 as usize]).collect());
        let found = Mesh::new(vertices, faces).and_then(|found| match provenance {
            Some(provenance) => found.with_provenance(provenance),
            None => Ok(found),
        });
        // No face loses its area, so that this never happens.
        found.unwrap_or(mesh)
    }
}

fn edges([a, b, c]: [u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)]
}

/// Normal of a triangle times twice its area.
fn across([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

/// Height of a triangle over its longest side, as a share of that.
fn thinness(corners: &[Point3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    if longest > 0.0 { across(corners).norm() / longest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Provenance;

    /// A closed band of squares about z, some corners nearly the same, with a cap at either end.
    fn drum() -> Mesh {
        let angle = |i: usize| if i % 5 == 1 { 0.02 + (i - 1) as f64 } else { i as f64 };
        let turn = std::f64::consts::TAU / 40.0;
        let mut vertices = Vec::new();
        for k in 0..6 {
            for i in 0..40 {
                let (sin, cos) = (angle(i) * turn).sin_cos();
                vertices.push(Point3::new(10.0 * cos, 10.0 * sin, f64::from(k)));
            }
        }
        let at = |k: u32, i: u32| 40 * k + i % 40;
        let mut faces = Vec::new();
        for (k, i) in (0..5).flat_map(|k| (0..40).map(move |i| (k, i))) {
            faces.push([at(k, i), at(k, i + 1), at(k + 1, i + 1)]);
            faces.push([at(k, i), at(k + 1, i + 1), at(k + 1, i)]);
        }
        let [low, high] = [240, 241];
        vertices.extend([Point3::origin(), Point3::new(0.0, 0.0, 5.0)]);
        for i in 0..40 {
            faces.push([low, at(0, i + 1), at(0, i)]);
            faces.push([high, at(5, i), at(5, i + 1)]);
        }
        Mesh::new(vertices, faces).unwrap()
    }

    fn shortest(mesh: &Mesh) -> f64 {
        let lengths = (0..mesh.faces().len()).flat_map(|f| {
            let [a, b, c] = mesh.corners(f);
            [(b - a).norm(), (c - b).norm(), (a - c).norm()]
        });
        lengths.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn short_edges_of_a_closed_mesh_go_and_it_stays_closed_and_in_place() {
        let mesh = drum();
        assert!(mesh.is_watertight() && shortest(&mesh) < 0.1);
        let volume = mesh.signed_volume_m3();
        let found = without_slivers(mesh.clone(), 0.3, 0.05);
        assert!(found.is_watertight() && found.components() == 1);
        assert!(shortest(&found) > 0.3, "{}", shortest(&found));
        assert!((found.signed_volume_m3() / volume - 1.0).abs() < 2e-3);
        for p in found.vertices() {
            let on_cap = (p.z.abs() < 1e-9 || (p.z - 5.0).abs() < 1e-9) && p.x.hypot(p.y) < 10.01;
            assert!(on_cap || (p.x.hypot(p.y) - 10.0).abs() < 0.05, "{p}");
        }
        // A bound that is met nowhere, and a length that no edge is below.
        assert_eq!(without_slivers(mesh.clone(), 0.3, 0.0).faces().len(), mesh.faces().len());
        assert_eq!(without_slivers(mesh.clone(), 0.01, 0.05), mesh);
    }

    #[test]
    fn borders_and_lines_of_provenance_stay() {
        let mesh = drum();
        let count = mesh.faces().len();
        let sources = (0..count).map(|f| match mesh.corners(f).iter().map(|p| p.z).fold(0.0, f64::max) {
            z if z < 2.5 => Provenance::Extruded,
            _ => Provenance::Measured,
        });
        let marked = mesh.clone().with_provenance(sources.collect()).unwrap();
        let found = without_slivers(marked, 0.3, 0.05);
        let on_line = |mesh: &Mesh| mesh.vertices().iter().filter(|p| p.z == 2.0).count();
        assert_eq!(on_line(&found), on_line(&mesh));
        assert!(found.is_watertight() && found.faces().len() < count);

        // Without its caps.
        let open = Mesh::new(mesh.vertices().to_vec(), mesh.faces()[..400].to_vec()).unwrap();
        let found = without_slivers(open.clone(), 0.3, 0.05);
        for z in [0.0, 5.0] {
            let border =
                |mesh: &Mesh| mesh.vertices().iter().filter(|p| p.z == z && p.x.hypot(p.y) > 1.0).count();
            assert_eq!(border(&found), border(&open));
        }
        assert_eq!(found.open_edges(), open.open_edges());
    }
}
