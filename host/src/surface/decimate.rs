//! Fewer triangles, within a bound.
//!
//! Edges collapse in the order of their quadric errors (Garland and Heckbert 1997). Each face carries the vertices and middles
//! of the original faces that it stands for; a collapse is refused when one of them would be farther than the bound from
//! the new faces, or corners, middles of edges or of faces of these from the original surface. Borders, and lines at which the provenance changes, collapse along themselves
//! only; nothing collapses that would leave a manifold, fold a face over, or make a sliver of it.

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, HashMap, HashSet};

use nalgebra::{Matrix3, Point3, Vector3};

use super::{
    grid::{Grid, Neighbour},
    mesh::Mesh,
};

/// Least cosine between the normals of a face before and after a collapse.
const LEAST_TURN: f64 = 0.3;
/// Vertices about which the nearest face of the original is looked for.
const NEAREST: usize = 4;
/// Most times that all edges are gone over.
const PASSES: usize = 5;
/// Least height of a triangle, as a share of its longest side, unless it was worse before.
const THINNEST: f64 = 0.02;
/// Weight of the planes across borders.
const BORDER_WEIGHT: f64 = 10.0;
/// Pulls vertices of flat places to where they are, so that their quadrics have one minimum; a share of the area's.
const STAY: f64 = 1e-6;

/// How far to go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Stop at this many triangles.
    pub triangles: usize,
    /// Farthest that the surface may move, metres.
    pub tolerance_m: f64,
}

/// The mesh with fewer triangles: collapses edges until a limit is met, or none is left that may collapse.
///
/// A closed mesh stays closed and manifold; faces keep their provenance.
#[must_use]
pub fn decimate(mesh: &Mesh, limits: &Limits) -> Mesh {
    let mut work = Work::new(mesh, *limits);
    work.run();
    work.finished(mesh)
}

/// A symmetric 4 x 4 form, the squared distances to some planes.
#[derive(Debug, Clone, Copy)]
struct Quadric {
    form: Matrix3<f64>,
    pull: Vector3<f64>,
    rest: f64,
}

impl Quadric {
    const ZERO: Self = Self {
        form: Matrix3::new(0., 0., 0., 0., 0., 0., 0., 0., 0.),
        pull: Vector3::new(0., 0., 0.),
        rest: 0.,
    };

    fn of_plane(normal: &Vector3<f64>, at: &Vector3<f64>, weight: f64) -> Self {
        let height = normal.dot(at);
        Self {
            form: normal * normal.transpose() * weight,
            pull: normal * (height * weight),
            rest: height * height * weight,
        }
    }

    fn of_point(at: &Vector3<f64>, weight: f64) -> Self {
        Self { form: Matrix3::identity() * weight, pull: at * weight, rest: at.norm_squared() * weight }
    }

    fn plus(&self, other: &Self) -> Self {
        Self { form: self.form + other.form, pull: self.pull + other.pull, rest: self.rest + other.rest }
    }

    fn at(&self, p: &Vector3<f64>) -> f64 {
        (p.dot(&(self.form * p)) - 2.0 * self.pull.dot(p) + self.rest).max(0.0)
    }
}

/// An edge that may collapse. Ordered by cost, then by its vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Candidate {
    cost: f64,
    ends: [u32; 2],
    /// Sum of the ends' versions when the cost was found.
    version: u32,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.cost
            .total_cmp(&other.cost)
            .then(self.ends.cmp(&other.ends))
            .then(self.version.cmp(&other.version))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

struct Work {
    limits: Limits,
    /// Coordinates about the mesh's middle: quadrics subtract squares of them.
    at: Vec<Vector3<f64>>,
    middle: Vector3<f64>,
    /// `None` once gone.
    faces: Vec<Option<[u32; 3]>>,
    left: usize,
    faces_of: Vec<Vec<u32>>,
    original: Original,
    /// For each face numbers of the places of the original that it stands for.
    carried: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    version: Vec<u32>,
    /// Edges at which the surface or its provenance ends.
    rims: HashSet<[u32; 2]>,
    on_rim: Vec<bool>,
    heap: BinaryHeap<Reverse<Candidate>>,
}

/// The surface as it was.
struct Original {
    corners: Vec<[Vector3<f64>; 3]>,
    /// Vertices, then middles of faces.
    places: Vec<Vector3<f64>>,
    /// Of the vertices.
    grid: Grid,
    faces_of: Vec<Vec<u32>>,
}

impl Original {
    fn new(at: &[Vector3<f64>], faces: &[[u32; 3]], faces_of: &[Vec<u32>]) -> Self {
        let corners: Vec<[Vector3<f64>; 3]> = faces.iter().map(|face| face.map(|v| at[v as usize])).collect();
        let middles = corners.iter().map(|[a, b, c]| (a + b + c) / 3.0);
        let places = at.iter().copied().chain(middles).collect();
        let points: Vec<Point3<f64>> = at.iter().copied().map(Point3::from).collect();
        Self { corners, places, grid: Grid::for_surface(&points), faces_of: faces_of.to_vec() }
    }

    /// At most how far a place is from the surface: the distance to the faces about the nearest few vertices.
    fn distance_m(&self, place: &Vector3<f64>, found: &mut Vec<Neighbour>) -> f64 {
        self.grid.nearest(&Point3::from(*place), NEAREST, found);
        let near = found.iter().flat_map(|n| &self.faces_of[n.1 as usize]);
        near.map(|&f| to_triangle(place, &self.corners[f as usize])).fold(f64::INFINITY, f64::min)
    }
}

fn ordered(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Work {
    fn new(mesh: &Mesh, limits: Limits) -> Self {
        let (low, high) = mesh.bounding_box();
        let middle = 0.5 * (low.coords + high.coords);
        let at: Vec<Vector3<f64>> = mesh.vertices().iter().map(|p| p.coords - middle).collect();
        let faces: Vec<Option<[u32; 3]>> = mesh.faces().iter().copied().map(Some).collect();
        let mut faces_of = vec![Vec::new(); at.len()];
        let mut quadrics = vec![Quadric::ZERO; at.len()];
        let mut edges: HashMap<[u32; 2], Vec<u32>> = HashMap::with_capacity(faces.len() * 3 / 2);
        for (number, face) in mesh.faces().iter().enumerate() {
            let [a, b, c] = face.map(|v| at[v as usize]);
            let across = (b - a).cross(&(c - a));
            let (area, normal) = (0.5 * across.norm(), across.normalize());
            let plane = Quadric::of_plane(&normal, &a, area);
            for (i, &v) in face.iter().enumerate() {
                faces_of[v as usize].push(number as u32);
                let stay = Quadric::of_point(&at[v as usize], STAY * area);
                quadrics[v as usize] = quadrics[v as usize].plus(&plane).plus(&stay);
                edges.entry(ordered(v, face[(i + 1) % 3])).or_default().push(number as u32);
            }
        }
        let source = |face: u32| mesh.provenance().map(|all| all[face as usize]);
        let (mut rims, mut on_rim) = (HashSet::new(), vec![false; at.len()]);
        for (ends, around) in &edges {
            if around.len() == 2 && source(around[0]) == source(around[1]) {
                continue;
            }
            rims.insert(*ends);
            ends.iter().for_each(|&v| on_rim[v as usize] = true);
        }
        // In the order of the faces, since sums of floats depend on it.
        for (number, face) in mesh.faces().iter().enumerate() {
            for i in 0..3 {
                let (from, to) = (face[i], face[(i + 1) % 3]);
                if !rims.contains(&ordered(from, to)) {
                    continue;
                }
                let way = at[to as usize] - at[from as usize];
                let normal = mesh.face_normal(number).cross(&way);
                if let Some(normal) = normal.try_normalize(f64::MIN_POSITIVE) {
                    let weight = BORDER_WEIGHT * way.norm_squared();
                    let wall = Quadric::of_plane(&normal, &at[from as usize], weight);
                    for v in [from, to] {
                        quadrics[v as usize] = quadrics[v as usize].plus(&wall);
                    }
                }
            }
        }
        let mut carried: Vec<Vec<u32>> = (0..faces.len()).map(|f| vec![(at.len() + f) as u32]).collect();
        for (v, around) in faces_of.iter().enumerate() {
            if let Some(&first) = around.first() {
                carried[first as usize].push(v as u32);
            }
        }
        let mut work = Self {
            limits,
            left: faces.len(),
            original: Original::new(&at, mesh.faces(), &faces_of),
            carried,
            version: vec![0; at.len()],
            heap: BinaryHeap::new(),
            at,
            middle,
            faces,
            faces_of,
            quadrics,
            rims,
            on_rim,
        };
        for ends in edges.into_keys() {
            work.offer(ends);
        }
        work
    }

    fn offer(&mut self, [a, b]: [u32; 2]) {
        if let Some(&(_, cost)) = self.places(a, b).first() {
            let version = self.version[a as usize].wrapping_add(self.version[b as usize]);
            self.heap.push(Reverse(Candidate { cost, ends: ordered(a, b), version }));
        }
    }

    /// Where the two ends of an edge may go, and at what cost, the cheapest first; nowhere when they must not.
    fn places(&self, a: u32, b: u32) -> Vec<(Vector3<f64>, f64)> {
        let quadric = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        let [pa, pb] = [a, b].map(|v| self.at[v as usize]);
        let cost = |p: Vector3<f64>| (p, quadric.at(&p));
        match (self.on_rim[a as usize], self.on_rim[b as usize]) {
            (true, true) if !self.rims.contains(&ordered(a, b)) => return Vec::new(),
            (true, false) => return vec![cost(pa)],
            (false, true) => return vec![cost(pb)],
            _ => {}
        }
        let best = quadric.form.try_inverse().map(|inverse| inverse * quadric.pull);
        let reach = (pa - pb).norm();
        let near = best.filter(|p| (p - 0.5 * (pa + pb)).norm() < 2.0 * reach);
        let mut places: Vec<_> = [pa, pb, 0.5 * (pa + pb)].into_iter().chain(near).map(cost).collect();
        places.sort_by(|x, y| x.1.total_cmp(&y.1));
        places
    }

    /// Goes over all edges as long as some collapse: one that was refused may be allowed when its surroundings are others.
    fn run(&mut self) {
        for _ in 0..PASSES {
            let left = self.left;
            self.pass();
            if self.left == left || self.left <= self.limits.triangles {
                return;
            }
            let mut edges: Vec<[u32; 2]> = self
                .faces
                .iter()
                .flatten()
                .flat_map(|f| [0, 1, 2].map(|i| ordered(f[i], f[(i + 1) % 3])))
                .collect();
            edges.sort_unstable();
            edges.dedup();
            edges.into_iter().for_each(|ends| self.offer(ends));
        }
    }

    fn pass(&mut self) {
        while self.left > self.limits.triangles {
            let Some(Reverse(Candidate { ends: [a, b], version, .. })) = self.heap.pop() else { return };
            if self.version[a as usize].wrapping_add(self.version[b as usize]) != version
                || self.faces_of[a as usize].is_empty()
                || self.faces_of[b as usize].is_empty()
            {
                continue;
            }
            // The cheapest place may be too far by a hair where an end itself would do.
            let _ = self.places(a, b).into_iter().any(|(to, _)| self.collapse(a, b, to));
        }
    }

    fn around(&self, v: u32) -> Vec<u32> {
        let corners = self.faces_of[v as usize].iter().filter_map(|&f| self.faces[f as usize]).flatten();
        let mut around: Vec<u32> = corners.filter(|&w| w != v).collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// Whether the edge collapsed.
    fn collapse(&mut self, a: u32, b: u32, to: Vector3<f64>) -> bool {
        let (around_a, around_b) = (self.around(a), self.around(b));
        let shared: Vec<u32> =
            around_a.iter().copied().filter(|v| around_b.binary_search(v).is_ok()).collect();
        let patch: Vec<u32> = {
            let mut all = [self.faces_of[a as usize].as_slice(), &self.faces_of[b as usize]].concat();
            all.sort_unstable();
            all.dedup();
            all
        };
        let (gone, kept): (Vec<u32>, Vec<u32>) = patch.iter().copied().partition(|&f| {
            self.faces[f as usize].is_some_and(|face| face.contains(&a) && face.contains(&b))
        });
        // The link condition: the edge's own faces are all that the two fans have in common.
        if shared.len() != gone.len() || gone.is_empty() || gone.len() > 2 || kept.is_empty() {
            return false;
        }
        let corners = |f: u32| self.faces[f as usize].map(|face| face.map(|v| self.at[v as usize]));
        let moved = |f: u32| {
            self.faces[f as usize]
                .map(|face| face.map(|v| if v == a || v == b { to } else { self.at[v as usize] }))
        };
        for &f in &kept {
            let (Some(old), Some(new)) = (corners(f), moved(f)) else { return false };
            let [before, after] = [old, new].map(|[p, q, r]| (q - p).cross(&(r - p)));
            let thin = |[p, q, r]: [Vector3<f64>; 3], across: &Vector3<f64>| {
                across.norm() / (q - p).norm_squared().max((r - p).norm_squared()).max((r - q).norm_squared())
            };
            let (worse, was) = (thin(new, &after), thin(old, &before));
            if before.dot(&after) < LEAST_TURN * before.norm() * after.norm() || worse < THINNEST.min(was) {
                return false;
            }
        }
        let new: Vec<[Vector3<f64>; 3]> = kept.iter().filter_map(|&f| moved(f)).collect();
        let tolerance_m = self.limits.tolerance_m;
        let mut found = Vec::new();
        let is_near = |place: Vector3<f64>, found: &mut Vec<Neighbour>| {
            self.original.distance_m(&place, found) <= tolerance_m
        };
        let stays = new.iter().all(|&[p, q, r]| {
            [0.5 * (p + q), 0.5 * (q + r), 0.5 * (r + p), (p + q + r) / 3.0]
                .into_iter()
                .all(|place| is_near(place, &mut found))
        });
        if !stays || !is_near(to, &mut found) {
            return false;
        }
        let mut carried = vec![Vec::new(); kept.len()];
        for &place in patch.iter().flat_map(|&f| &self.carried[f as usize]) {
            let at = self.original.places[place as usize];
            let distances = new.iter().map(|triangle| to_triangle(&at, triangle)).enumerate();
            match distances.min_by(|x, y| x.1.total_cmp(&y.1)) {
                Some((nearest, distance_m)) if distance_m <= tolerance_m => carried[nearest].push(place),
                _ => return false,
            }
        }
        for (&f, places) in kept.iter().zip(carried) {
            self.carried[f as usize] = places;
        }
        gone.iter().for_each(|&f| self.carried[f as usize] = Vec::new());
        self.replace(a, b, to, &gone, &kept, &shared);
        true
    }

    fn replace(&mut self, a: u32, b: u32, to: Vector3<f64>, gone: &[u32], kept: &[u32], shared: &[u32]) {
        // Rims that ended at b end at a now.
        for v in self.around(b) {
            if self.rims.remove(&ordered(b, v)) && v != a {
                self.rims.insert(ordered(a, v));
            }
        }
        for &f in gone {
            self.faces[f as usize] = None;
            self.left -= 1;
            for &v in shared {
                self.faces_of[v as usize].retain(|&other| other != f);
            }
        }
        for &f in kept {
            if let Some(face) = &mut self.faces[f as usize] {
                face.iter_mut().filter(|v| **v == b).for_each(|v| *v = a);
            }
        }
        self.faces_of[a as usize] = kept.to_vec();
        self.faces_of[b as usize] = Vec::new();
        self.quadrics[a as usize] = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        self.at[a as usize] = to;
        self.on_rim[a as usize] |= self.on_rim[b as usize];
        self.version[a as usize] += 1;
        self.version[b as usize] += 1;
        for v in self.around(a) {
            self.offer([a, v]);
        }
    }

    fn finished(self, mesh: &Mesh) -> Mesh {
        let mut index_of = vec![u32::MAX; self.at.len()];
        let (mut vertices, mut faces, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        for (number, face) in self.faces.iter().enumerate() {
            let Some(face) = face else { continue };
            faces.push(face.map(|v| {
                let index = &mut index_of[v as usize];
                if *index == u32::MAX {
                    *index = vertices.len() as u32;
                    vertices.push(Point3::from(self.at[v as usize] + self.middle));
                }
                *index
            }));
            sources.extend(mesh.provenance().map(|all| all[number]));
        }
        // Every face kept an area; should one not have, the mesh stays as it was.
        let fewer = Mesh::new(vertices, faces).ok();
        match mesh.provenance() {
            Some(_) => fewer.and_then(|fewer| fewer.with_provenance(sources).ok()),
            None => fewer,
        }
        .unwrap_or_else(|| mesh.clone())
    }
}

/// Distance from a point to a triangle (Ericson 2005, section 5.1.5).
fn to_triangle(p: &Vector3<f64>, &[a, b, c]: &[Vector3<f64>; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.norm();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.norm();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (ap - ab * (d1 / (d1 - d3))).norm();
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.norm();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (ap - ac * (d2 / (d2 - d6))).norm();
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return (bp - (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))).norm();
    }
    let total = va + vb + vc;
    (ap - ab * (vb / total) - ac * (vc / total)).norm()
}

#[cfg(test)]
mod tests {
    use parry3d_f64::{math::Vector, query::PointQuery, shape::TriMesh};

    use super::*;
    use crate::{object::BuiltIn, surface::Provenance};

    /// The built-in object with each face split into `n * n`.
    fn fine(object: BuiltIn, n: u32) -> Mesh {
        let coarse = object.object(1.0).unwrap().mesh;
        let mut index_of = HashMap::new();
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for face in 0..coarse.faces().len() {
            let [a, b, c] = coarse.corners(face);
            let mut at = |i: u32, k: u32| {
                let [u, v] = [i, k].map(|s| f64::from(s) / f64::from(n));
                let p = a + (b - a) * u + (c - a) * v;
                let key = [p.x, p.y, p.z].map(|x| (x * 1e8).round() as i64);
                *index_of.entry(key).or_insert_with(|| {
                    vertices.push(p);
                    vertices.len() as u32 - 1
                })
            };
            for i in 0..n {
                for k in 0..n - i {
                    faces.push([at(i, k), at(i + 1, k), at(i, k + 1)]);
                    if i + k + 1 < n {
                        faces.push([at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]);
                    }
                }
            }
        }
        Mesh::new(vertices, faces).unwrap()
    }

    fn farthest(from: &Mesh, to: &Mesh) -> f64 {
        let vertices = to.vertices().iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let shape = TriMesh::new(vertices, to.faces().to_vec()).unwrap();
        let middles = (0..from.faces().len()).map(|f| {
            let [a, b, c] = from.corners(f).map(|p| p.coords);
            Point3::from((a + b + c) / 3.0)
        });
        let distance = |p: Point3<f64>| shape.distance_to_local_point(Vector::new(p.x, p.y, p.z), false);
        from.vertices().iter().copied().chain(middles).map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn the_bound_holds_both_ways_and_closed_stays_closed() {
        for (object, n) in [(BuiltIn::Mouse, 2), (BuiltIn::TeacupCover, 2), (BuiltIn::Cube, 24)] {
            let mesh = fine(object, n);
            for tolerance_m in [5e-5, 5e-4] {
                let limits = Limits { triangles: 0, tolerance_m };
                let fewer = decimate(&mesh, &limits);
                assert!(fewer.faces().len() * 3 < mesh.faces().len(), "{object}: {}", fewer.faces().len());
                assert!(fewer.is_watertight() && fewer.components() == 1, "{object}");
                let [out, back] = [farthest(&fewer, &mesh), farthest(&mesh, &fewer)];
                assert!(out.max(back) <= tolerance_m, "{object}: {out} {back}");
                let lost = fewer.signed_volume_m3() / mesh.signed_volume_m3() - 1.0;
                assert!(lost.abs() < 0.02, "{object}: {lost}");
            }
        }
    }

    #[test]
    fn a_cube_needs_few_triangles_and_a_count_is_kept() {
        let mesh = fine(BuiltIn::Cube, 10);
        let all = Limits { triangles: 0, tolerance_m: 1e-6 };
        let fewest = decimate(&mesh, &all);
        assert!(fewest.faces().len() <= 30, "{}", fewest.faces().len());
        assert!((fewest.signed_volume_m3() / mesh.signed_volume_m3() - 1.0).abs() < 2e-4);
        let some = decimate(&mesh, &Limits { triangles: 400, ..all });
        assert!((398..=400).contains(&some.faces().len()), "{}", some.faces().len());
    }

    #[test]
    fn lines_of_provenance_and_borders_stay() {
        let mesh = fine(BuiltIn::Cube, 10);
        let source = |f: usize| {
            let [a, b, c] = mesh.corners(f).map(|p| p.coords);
            if ((a + b + c) / 3.0).x > 0.0 { Provenance::Measured } else { Provenance::Extruded }
        };
        let sources = (0..mesh.faces().len()).map(source).collect();
        let marked = mesh.clone().with_provenance(sources).unwrap();
        let limits = Limits { triangles: 0, tolerance_m: 1e-6 };
        let fewer = decimate(&marked, &limits);
        assert!(fewer.faces().len() < 60, "{}", fewer.faces().len());
        for each in [Provenance::Measured, Provenance::Extruded] {
            assert!((fewer.area_of_m2(each) / marked.area_of_m2(each) - 1.0).abs() < 1e-3, "{each}");
        }
        let open = Mesh::new(mesh.vertices().to_vec(), mesh.faces()[100..].to_vec()).unwrap();
        let fewer = decimate(&open, &limits);
        assert!((fewer.area_m2() / open.area_m2() - 1.0).abs() < 1e-3);
    }
}
