//! Every answer against parry's own tree over the same mesh, and the cells' bounds against the answers.

use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::object::BuiltIn;
use crate::object::solids::cuboid;

/// parry alone, as an independent reference.
struct Reference(TriMesh);

impl Reference {
    fn new(mesh: &Mesh) -> Self {
        let vertices = mesh.vertices().iter().map(|p| to_parry(&p.coords)).collect();
        let flags = TriMeshFlags::ORIENTED | TriMeshFlags::MERGE_DUPLICATE_VERTICES;
        Self(TriMesh::with_flags(vertices, mesh.faces().to_vec(), flags).unwrap())
    }

    fn signed_distance_m(&self, point: &Point3<f64>) -> f64 {
        let asked = to_parry(&point.coords);
        let found = self.0.project_local_point(asked, false);
        let distance_m = (asked - found.point).length();
        if found.is_inside { -distance_m } else { distance_m }
    }

    fn cut_by(&self, object_from_shape: &Isometry3<f64>, shape: &dyn Shape) -> bool {
        let q = object_from_shape.rotation.quaternion();
        let pose = Pose::from_parts(
            to_parry(&object_from_shape.translation.vector),
            Rotation::from_xyzw(q.i, q.j, q.k, q.w),
        );
        intersection_test(&Pose::IDENTITY, &self.0, &pose, shape).unwrap().intersecting
    }
}

/// What is made of a mesh here: itself, or without the faces for which `keep` says no.
fn part(mesh: &Mesh, keep: impl Fn([Point3<f64>; 3]) -> bool) -> Mesh {
    let faces = (0..mesh.faces().len()).filter(|&f| keep(mesh.corners(f))).map(|f| mesh.faces()[f]).collect();
    Mesh::new(mesh.vertices().to_vec(), faces).unwrap()
}

/// A saddle of slivers: steps of 20 mm one way and of 0.02 mm the other.
fn slivers() -> Mesh {
    let at = |i: u32, j: u32| {
        let (x, y) = (f64::from(i) * 0.02, f64::from(j) * 2e-5);
        Point3::new(x, y, (x - 0.05).powi(2) * 5.0 - y)
    };
    let (columns, rows) = (6, 100);
    let vertices = (0..columns).flat_map(|i| (0..rows).map(move |j| at(i, j))).collect();
    let place = |i: u32, j: u32| i * rows + j;
    let faces = (0..columns - 1)
        .flat_map(|i| (0..rows - 1).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Mesh::new(vertices, faces).unwrap()
}

/// Convex, concave, open, thin, flat and far away.
fn meshes() -> Vec<(&'static str, Mesh)> {
    let built_in = |one: BuiltIn| one.object(1.0).unwrap().mesh;
    let lid = built_in(BuiltIn::TeacupCover);
    let corner = |x: f64, y: f64| Point3::new(x, y, 0.0);
    let square = [corner(0.0, 0.0), corner(0.1, 0.0), corner(0.1, 0.1), corner(0.0, 0.1)];
    let two = Mesh::new(square.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    // The same square from above and from below: closed, and of no volume.
    let flat = Mesh::new(square.to_vec(), vec![[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]]).unwrap();
    // Triangles that share no vertex index, as from an STL file.
    let soup = {
        let cube = built_in(BuiltIn::Cube);
        let vertices: Vec<_> = (0..cube.faces().len()).flat_map(|f| cube.corners(f)).collect();
        let faces = (0..vertices.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        Mesh::new(vertices, faces).unwrap()
    };
    vec![
        ("cube", built_in(BuiltIn::Cube)),
        ("soup", soup),
        ("mouse", built_in(BuiltIn::Mouse)),
        ("disk", built_in(BuiltIn::Disk)),
        ("open lid", part(&lid, |[a, b, c]| (a.z + b.z + c.z) / 3.0 > 0.02)),
        ("half lid", part(&lid, |[a, b, c]| a.x + b.x + c.x > 0.0)),
        ("far lid", lid.transformed(&Isometry3::translation(4000.0, -3000.0, 500.0))),
        ("lid", lid),
        ("two triangles", two),
        ("no volume", flat),
        ("slivers", slivers()),
        ("huge cube", cuboid([2e9, 1e9, 3e8]).unwrap()),
        ("tiny cube", cuboid([1e-12, 2e-12, 1e-12]).unwrap()),
    ]
}

/// Points near the surface and around it, some farther than the cells reach, and the corners themselves.
fn points(mesh: &Mesh, count: usize, rng: &mut impl Rng) -> Vec<Point3<f64>> {
    let (low, high) = mesh.bounding_box();
    let size = high - low;
    (0..count)
        .map(|i| {
            let [a, b, c] = mesh.corners(rng.random_range(0..mesh.faces().len()));
            let (u, v) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let on = a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v);
            let mut away = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            match i % 5 {
                0 => on + away() * 0.002,
                1 => on + away() * 0.02,
                2 => on + away().component_mul(&size) * 0.1,
                3 => nalgebra::center(&low, &high) + away().component_mul(&(size + Vector3::repeat(0.1))),
                _ => on + away() * (0.5 + size.norm()),
            }
        })
        .collect()
}

#[test]
fn distances_to_a_cube_are_the_closed_form_inside_and_out() {
    let mesh = cuboid([1.0; 3]).unwrap().transformed(&Isometry3::translation(0.5, 0.5, 0.0));
    let query = SurfaceQuery::new(&mesh).unwrap();
    for (point, expected) in [
        ([0.5, 0.5, 1.25], 0.25),
        ([0.5, 0.5, 0.9], -0.1),
        ([2.0, 2.0, 0.5], 2f64.sqrt()),
        ([1.5, 1.5, 1.5], 0.75f64.sqrt()),
        ([0.99, 0.98, 0.97], -0.01),
    ] {
        let found = query.nearest(&Point3::from(point)).signed_distance_m;
        assert!((found - expected).abs() < 1e-12, "{point:?}: {found} for {expected}");
    }
}

#[test]
fn nearest_points_are_those_of_parry() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (name, mesh) in meshes() {
        let (query, reference) = (SurfaceQuery::new(&mesh).unwrap(), Reference::new(&mesh));
        let scale_m = 1.0 + mesh.bounding_box().1.coords.amax();
        for point in points(&mesh, 3000, &mut rng) {
            let expected = reference.signed_distance_m(&point);
            let found = query.nearest(&point);
            let distance_m = found.signed_distance_m;
            assert!(
                (distance_m.abs() - expected.abs()).abs() <= 1e-12 * scale_m,
                "{name}, {point}: {distance_m} for {expected}"
            );
            // Nearer than rounding, or between two sheets of an open surface, either side is right.
            assert!(
                distance_m.signum() == expected.signum() || distance_m.abs() < 1e-12 * scale_m,
                "{name}, {point}: {distance_m} for {expected}"
            );
            let there = (point - found.point_in_object).norm();
            assert!((there - distance_m.abs()).abs() <= 1e-12 * scale_m, "{name}, {point}");

            for max_m in [0.5 * expected, 0.9 * expected.abs(), 1.1 * expected.abs()] {
                let within = query.nearest_within(&point, max_m);
                assert_eq!(within, (distance_m <= max_m).then_some(found), "{name}, {point}, {max_m}");
                assert_eq!(query.clear_of_ball(&point, max_m), within.is_none());
            }
        }
    }
}

#[test]
fn bounds_are_below_the_distance_and_near_it() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for (name, mesh) in meshes() {
        let query = SurfaceQuery::new(&mesh).unwrap();
        let scale_m = 1.0 + mesh.bounding_box().1.coords.amax();
        let cell_m = query.field.cell_m();
        for point in points(&mesh, 3000, &mut rng) {
            let bound_m = query.distance_bound_m(&point);
            let signed_m = query.nearest(&point).signed_distance_m;
            let outside_sphere = (point - query.center_in_object).norm() >= query.radius_m;
            let truth_m = if outside_sphere { signed_m.abs() } else { signed_m };
            assert!(bound_m <= truth_m + 1e-12 * scale_m, "{name}, {point}: {bound_m} above {truth_m}");
            // In a small cell the loss is twice the way to its middle, half a diagonal; large cells answer from four
            // of their half diagonals on.
            let least_m = truth_m - (2.0 * cell_m).max(truth_m / 3.0 + 1e-6 * scale_m);
            let in_cells = query.read(to_parry(&point.coords)).is_some();
            if query.sides.closed() && in_cells {
                assert!(bound_m >= least_m, "{name}, {point}: {bound_m} far below {truth_m}");
            }
        }
    }
}

#[test]
fn most_places_before_an_open_surface_are_proven_to_be_there() {
    // A mouse seen from above, as one scan leaves it.
    let mouse = BuiltIn::Mouse.object(1.0).unwrap().mesh;
    let query = SurfaceQuery::new(&part(&mouse, |[a, b, c]| a.z + b.z + c.z > 0.001)).unwrap();
    assert!(!query.sides.closed());
    let (mut before, mut proven) = (0, 0);
    for point in points(&mouse, 4000, &mut ChaCha8Rng::seed_from_u64(3)) {
        let signed_m = query.nearest(&point).signed_distance_m;
        if point.z > 0.0 && (0.003..0.02).contains(&signed_m) {
            before += 1;
            proven += usize::from(query.distance_bound_m(&point) > 0.0);
        }
    }
    assert!(before > 100 && 10 * proven > 9 * before, "{proven} of {before}");
}

#[test]
fn boxes_and_capsules_cut_what_they_cut_in_parry() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for (name, mesh) in meshes() {
        // parry's capsules find nothing as small as that.
        if name == "tiny cube" {
            continue;
        }
        let (query, reference) = (SurfaceQuery::new(&mesh).unwrap(), Reference::new(&mesh));
        let size_m = (mesh.bounding_box().1 - mesh.bounding_box().0).amax();
        let mut cut = 0;
        for point in points(&mesh, 400, &mut rng) {
            let mut vector = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
            let turn = nalgebra::UnitQuaternion::from_scaled_axis(vector() * 3.0);
            let half = vector().abs() * (0.5 * size_m);
            let object_from_box = Isometry3::from_parts(point.into(), turn);
            let expected = reference.cut_by(&object_from_box, &Cuboid::new(to_parry(&half)));
            assert_eq!(query.cuts_box(&object_from_box, &half), expected, "{name}, box at {point}");
            cut += usize::from(expected);

            let ends = [point, point + vector() * size_m];
            let radius_m = 0.1 * half.x;
            let [a, b] = ends.map(|p| to_parry(&p.coords));
            let expected = reference.cut_by(&Isometry3::identity(), &Capsule::new(a, b, radius_m));
            assert_eq!(query.cuts_capsule(&ends, radius_m), expected, "{name}, capsule at {point}");
        }
        assert!(cut > 40 && cut < 360, "{name}: {cut} of 400 boxes cut");
    }
}

#[test]
fn a_moving_box_cuts_where_it_does_at_one_of_its_stations() {
    let mesh = BuiltIn::TeacupCover.object(1.0).unwrap().mesh;
    let query = SurfaceQuery::new(&mesh).unwrap();
    let half = Vector3::new(0.01, 0.03, 0.02);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut cut, mut near) = (0, 0);
    for point in points(&mesh, 1500, &mut rng) {
        let mut vector = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(vector() * 3.0);
        let (start, way) = (Isometry3::from_parts(point.into(), turn), vector() * 0.08);
        let moved = |share: f64| nalgebra::Translation3::from(way * share) * start;
        let stations = (0..=80).any(|i| query.cuts_box(&moved(f64::from(i) / 80.0), &half));
        let found = query.cuts_moving_box(&start, &half, &way, 0.002);
        assert!(found || !stations, "{point}: missed");
        // A box two steps thicker all round covers what "yes" may be wrong by.
        let thicker = half + Vector3::repeat(0.004);
        let around = (0..=80).any(|i| query.cuts_box(&moved(f64::from(i) / 80.0), &thicker));
        assert!(around || !found, "{point}: nothing near");
        cut += usize::from(stations);
        near += usize::from(found);
    }
    assert!(cut > 100 && near < 1400 && near - cut < cut / 5, "{cut} cut, {near} found");
}

#[test]
fn answers_do_not_depend_on_the_threads() {
    use rayon::prelude::*;
    let mesh = BuiltIn::TeacupCover.object(1.0).unwrap().mesh;
    let asked = points(&mesh, 20_000, &mut ChaCha8Rng::seed_from_u64(6));
    let answers = |threads: usize| -> Vec<(u64, Nearest)> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let query = SurfaceQuery::new(&mesh).unwrap();
            asked.par_iter().map(|p| (query.distance_bound_m(p).to_bits(), query.nearest(p))).collect()
        })
    };
    let alone = answers(1);
    assert_eq!(alone, answers(4));
    // Nor on what was asked before.
    let query = SurfaceQuery::new(&mesh).unwrap();
    for (point, (bound, nearest)) in asked.iter().zip(&alone).rev() {
        assert_eq!((query.nearest(point), query.distance_bound_m(point).to_bits()), (*nearest, *bound));
    }
}

#[test]
fn the_index_takes_little_memory_whatever_the_shape() {
    for (name, mesh) in meshes() {
        let query = SurfaceQuery::new(&mesh).unwrap();
        let empty = query.field.bytes();
        assert!(empty < 3_000_000, "{name}: {empty} bytes before anything is asked");
        for point in points(&mesh, 2000, &mut ChaCha8Rng::seed_from_u64(7)) {
            let _ = query.distance_bound_m(&point);
        }
        let most = query.field.bytes_at_most();
        assert!(most <= 40_000_000 && query.field.bytes() <= most, "{name}: {most} bytes");
        let triangles = mesh.faces().len().max(mesh.vertices().len());
        assert!(query.bytes() - query.field.bytes() < 1000 + 600 * triangles, "{name}");
    }
}

#[test]
fn what_is_no_number_or_too_large_does_no_harm() {
    let query = SurfaceQuery::new(&cuboid([0.1; 3]).unwrap()).unwrap();
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 1e30] {
        let point = Point3::new(x, 0.0, 0.0);
        let _ = (query.nearest(&point), query.distance_bound_m(&point), query.clear_of_ball(&point, 1.0));
        let _ = query.cuts_box(&Isometry3::translation(x, 0.0, 0.0), &Vector3::repeat(0.1));
        let _ = query.cuts_capsule(&[point, Point3::origin()], 0.01);
        let _ = query.cuts_moving_box(&Isometry3::identity(), &Vector3::repeat(0.1), &point.coords, 0.0);
    }
    let far = SurfaceQuery::new(&cuboid([1e13; 3]).unwrap());
    assert!(matches!(far, Err(SurfaceQueryError::TooLarge(_))));
}
