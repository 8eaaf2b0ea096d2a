use nalgebra::{Isometry3, Point3};
use parry3d_f64::{math::Vector, query::PointQuery, shape::TriMesh};

use super::*;
use crate::{
    object::{BuiltIn, Object},
    scan::sweep::{SweepSettings, plan_sweeps, target_sphere},
    surface::{Closing, Settings, Table, reconstruct},
};

fn placed(object: &Object) -> Mesh {
    object.mesh.transformed(&Isometry3::translation(0.42, 0.0, 0.0))
}

fn sweeps_over(mesh: &Mesh, settings: &SweepSettings) -> Vec<Sweep> {
    let (center, radius) = target_sphere(mesh);
    plan_sweeps(&center, radius, &Instrument::default(), settings, &|_| true).sweeps
}

fn scan_of(mesh: &Mesh, instrument: &Instrument, seed: u64) -> Scan {
    let sweeps = sweeps_over(mesh, &SweepSettings::default());
    scan(mesh, Some(Plane::horizontal(0.0)), &sweeps, instrument, seed).unwrap()
}

fn distances(mesh: &Mesh, points: impl Iterator<Item = Point3<f64>>) -> Vec<f64> {
    let vertices = mesh.vertices().iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let shape = TriMesh::new(vertices, mesh.faces().to_vec()).unwrap();
    points.map(|p| shape.distance_to_local_point(Vector::new(p.x, p.y, p.z), false)).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn without_noise_every_point_lies_on_the_scene() {
    let mesh = placed(&BuiltIn::TeacupCover.object(1.0).unwrap());
    let exact = Instrument { stripe_noise_px: 0.0, ..Instrument::default() };
    let scan = scan_of(&mesh, &exact, 1);
    let off = distances(&mesh, scan.cloud.points.iter().copied());
    assert!(scan.cloud.points.iter().zip(off).all(|(p, d)| d.min(p.z.abs()) < 1e-9));
    assert!((5_000..60_000).contains(&scan.object_points), "{}", scan.object_points);
}

#[test]
fn noise_is_what_the_optics_make_of_it() {
    let mesh = placed(&BuiltIn::Disk.object(1.0).unwrap());
    let sweeps = sweeps_over(&mesh, &SweepSettings::paper());
    let scan = scan(&mesh, Some(Plane::horizontal(0.0)), &sweeps, &Instrument::default(), 5).unwrap();
    let top: Vec<f64> =
        scan.cloud.points.iter().filter(|p| p.z > 0.015).map(|p| (p.z - 0.02).powi(2)).collect();
    let sigma = mean(&top).sqrt();
    // 0.15 px of 0.57 mm depth, averaged over two cameras.
    assert!((50e-6..90e-6).contains(&sigma), "{sigma}");
}

#[test]
fn cameras_do_not_see_through_the_object() {
    // Straight down, the table right beside a cube is lit but hidden from one camera only; under the lid's rim and on
    // the walls nothing is lit.
    let mesh = placed(&BuiltIn::TeacupCover.object(1.0).unwrap());
    let sweeps = sweeps_over(&mesh, &SweepSettings::paper());
    let exact = Instrument { stripe_noise_px: 0.0, ..Instrument::default() };
    let scan = scan(&mesh, Some(Plane::horizontal(0.0)), &sweeps, &exact, 5).unwrap();
    let under_rim = |p: &&Point3<f64>| (p.x - 0.42).hypot(p.y) < 0.043 && p.z < 0.008;
    assert_eq!(scan.cloud.points.iter().filter(under_rim).count(), 0);
    assert!(scan.cloud.points.iter().any(|p| p.z < 1e-9));
}

#[test]
fn same_seed_same_cloud_on_any_number_of_threads() {
    let mesh = placed(&BuiltIn::Cube.object(1.0).unwrap());
    let run = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| scan_of(&mesh, &Instrument::default(), seed))
    };
    let one = run(1, 9);
    assert_eq!(one, run(3, 9));
    assert_ne!(one.cloud, run(1, 10).cloud);
}

#[test]
fn the_built_ins_come_back_as_closed_bodies() {
    for built_in in BuiltIn::ALL {
        let mesh = placed(&built_in.object(1.0).unwrap());
        let scan = scan_of(&mesh, &Instrument::default(), 2);
        let settings =
            Settings { table: Table::Plane(Plane::horizontal(0.0)), close: true, ..Settings::default() };
        let done = reconstruct(&scan.cloud, &settings).unwrap();
        let report = &done.report;
        assert!(report.watertight && report.components == 1, "{built_in}: {report:?}");
        assert_eq!(report.closing, Closing::OnTable, "{built_in}");
        let centers = (0..done.mesh.faces().len()).filter(|&f| done.mesh.is_measured(f)).map(|f| {
            let [a, b, c] = done.mesh.corners(f).map(|p| p.coords);
            Point3::from((a + b + c) / 3.0)
        });
        let error = mean(&distances(&mesh, centers));
        let volume = done.mesh.signed_volume_m3() / mesh.signed_volume_m3();
        println!("{built_in}: error {error:.2e} volume ratio {volume:.3} {report:?}");
        assert!(error < 3e-4, "{built_in}: mean error {error}");
        // The lid's hollow is below what any line of sight reaches: its body is three times its porcelain.
        let expected = if built_in == BuiltIn::TeacupCover { 2.5..5.0 } else { 0.95..1.05 };
        assert!(expected.contains(&volume), "{built_in}: volume ratio {volume}");
    }
}

#[test]
fn the_table_is_found_when_nobody_says_where_it_is() {
    let mesh = placed(&BuiltIn::Mouse.object(1.0).unwrap());
    let outliers = Instrument { outlier_share: 0.01, ..Instrument::default() };
    let scan = scan_of(&mesh, &outliers, 4);
    let settings = Settings { table: Table::Auto, close: true, ..Settings::default() };
    let done = reconstruct(&scan.cloud, &settings).unwrap();
    let table = done.report.table.unwrap();
    assert!(table.normal.z > 0.9999 && table.height(&Point3::new(0.42, 0.0, 0.0)).abs() < 2e-4, "{table:?}");
    assert!(done.report.watertight, "{:?}", done.report);
}

#[test]
fn nothing_to_scan_with_is_an_error() {
    let mesh = placed(&BuiltIn::Cube.object(1.0).unwrap());
    assert_eq!(scan(&mesh, None, &[], &Instrument::default(), 0), Err(ScanError::NoSweep));
    let sweeps = sweeps_over(&mesh, &SweepSettings::paper());
    let broken = Instrument { stripe_noise_px: f64::NAN, ..Instrument::default() };
    assert_eq!(scan(&mesh, None, &sweeps, &broken, 0), Err(ScanError::Instrument));
}
