use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// A Fibonacci sphere of radius 30 mm about (0, 0, 50 mm), with radial noise.
fn sphere(count: usize, noise_m: f64) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let points = (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (sin, cos) = (2.399_963 * i as f64).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let radius = 0.030 + noise_m * rng.random_range(-1.0..1.0);
            Point3::new(0.0, 0.0, 0.05) + Vector3::new(r * cos, r * sin, z) * radius
        })
        .collect();
    PointCloud::from_points(points).unwrap()
}

fn sphere_error(mesh: &Mesh) -> f64 {
    let error = |p: &Point3<f64>| ((p - Point3::new(0.0, 0.0, 0.05)).norm() - 0.030).abs();
    mesh.vertices().iter().map(error).sum::<f64>() / mesh.vertices().len() as f64
}

#[test]
fn a_sphere_without_views_is_closed_outward_and_exact() {
    let done = reconstruct(&sphere(8000, 0.0), &Settings { close: true, ..Settings::default() }).unwrap();
    assert!(done.report.watertight && done.report.components == 1, "{:?}", done.report);
    assert_eq!(done.report.closing, Closing::AlreadyClosed);
    assert!(sphere_error(&done.mesh) < 3e-5, "mean error {}", sphere_error(&done.mesh));
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.030_f64.powi(3);
    assert!((done.mesh.signed_volume_m3() / volume - 1.0).abs() < 0.005);
    assert!((0..done.mesh.faces().len()).all(|face| done.mesh.is_measured(face)));
}

#[test]
fn noise_is_averaged() {
    let noise = 2e-4;
    let done = reconstruct(&sphere(40_000, noise), &Settings::default()).unwrap();
    // Uniform noise of this half width has a mean deviation of half of it.
    assert!(sphere_error(&done.mesh) < 0.25 * noise, "mean error {}", sphere_error(&done.mesh));
    assert_eq!(done.report.components, 1);
}

#[test]
fn half_a_sphere_is_an_open_sheet_or_on_request_a_dome() {
    let half = sphere(8000, 0.0).filtered(|_, p| p.z > 0.05);
    let views = half.points.iter().map(|_| Vector3::z_axis()).collect();
    let half = PointCloud { views: Some(views), ..half };
    let sheet = reconstruct(&half, &Settings::default()).unwrap();
    assert!(!sheet.report.watertight && sheet.report.components == 1);
    let normal_up = (0..sheet.mesh.faces().len()).all(|f| sheet.mesh.face_normal(f).z > -0.2);
    assert!(normal_up);
    let dome = reconstruct(&half, &Settings { close: true, ..Settings::default() }).unwrap();
    assert_eq!(dome.report.closing, Closing::OnAssumedPlane);
    assert!(dome.report.watertight);
    let volume = 2.0 / 3.0 * std::f64::consts::PI * 0.030_f64.powi(3);
    let excess = dome.mesh.signed_volume_m3() / volume - 1.0;
    assert!(excess.abs() < 0.03, "volume is off by {excess}");
    let faces = dome.mesh.faces().len();
    let measured = (0..faces).filter(|&face| dome.mesh.is_measured(face)).count() as f64 / faces as f64;
    assert!((0.5..0.95).contains(&measured), "{measured}");
}

#[test]
fn a_given_table_makes_the_base() {
    let raised = sphere(8000, 0.0).filtered(|_, p| p.z > 0.05);
    let views = raised.points.iter().map(|_| Vector3::z_axis()).collect();
    let raised = PointCloud { views: Some(views), ..raised };
    let settings =
        Settings { close: true, table: Table::Plane(Plane::horizontal(0.0)), ..Settings::default() };
    let done = reconstruct(&raised, &settings).unwrap();
    assert!(done.report.watertight && done.report.closing == Closing::OnTable);
    let (low, high) = done.mesh.bounding_box();
    assert!(low.z.abs() < 1e-9 && (high.z - 0.08).abs() < 2e-4, "{low} {high}");
    let volume = std::f64::consts::PI * (2.0 / 3.0 * 0.030_f64.powi(3) + 0.030_f64.powi(2) * 0.05);
    assert!((done.mesh.signed_volume_m3() / volume - 1.0).abs() < 0.05);
}

#[test]
fn fewer_triangles_stay_within_the_bound_and_closed() {
    let cloud = sphere(8000, 0.0);
    let settings = Settings { close: true, ..Settings::default() };
    let all = reconstruct(&cloud, &settings).unwrap();
    let few =
        reconstruct(&cloud, &Settings { triangles: Some(1000), tolerance_m: Some(1e-3), ..settings.clone() });
    let few = few.unwrap();
    assert!(few.report.watertight && (998..=1000).contains(&few.report.triangles), "{:?}", few.report);
    assert!(sphere_error(&few.mesh) < 1e-3);
    let bound = Settings { tolerance_m: Some(2e-4), ..settings };
    let bounded = reconstruct(&cloud, &bound).unwrap();
    assert!(bounded.report.triangles < all.report.triangles / 4, "{:?}", bounded.report);
    for vertex in bounded.mesh.vertices() {
        assert!(((vertex - Point3::new(0.0, 0.0, 0.05)).norm() - 0.030).abs() < 3e-4);
    }
}

#[test]
fn a_sheet_shows_only_what_sensors_can_have_seen() {
    // A ball from above: the rim of the sheet, at the equator, would fold under.
    let cap = sphere(20_000, 5e-5).filtered(|_, p| p.z > 0.048);
    let views = cap.points.iter().map(|_| Vector3::z_axis()).collect();
    let cap = PointCloud { views: Some(views), ..cap };
    let sheet = reconstruct(&cap, &Settings::default()).unwrap().mesh;
    assert!((0..sheet.faces().len()).all(|face| sheet.face_normal(face).z > -0.12));
    let area = sheet.area_m2() / (2.0 * std::f64::consts::PI * 0.030 * 0.032);
    assert!((0.9..1.1).contains(&area), "{area}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let cloud = sphere(6000, 1e-4).filtered(|_, p| p.x < 0.02);
    let settings = Settings { close: true, ..Settings::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reconstruct(&cloud, &settings)).unwrap()
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.mesh, three.mesh);
}

#[test]
fn hostile_clouds_are_refused_with_a_reason() {
    let settings = Settings { close: true, table: Table::Auto, ..Settings::default() };
    let run = |points: Vec<Point3<f64>>| {
        reconstruct(&PointCloud { points, ..PointCloud::default() }, &settings).map(|done| done.report)
    };
    assert!(matches!(run(Vec::new()), Err(ReconstructError::TooFew { left: 0, .. })));
    assert!(matches!(
        run(vec![Point3::origin(); 500]),
        Err(ReconstructError::Degenerate | ReconstructError::TooFew { .. })
    ));
    let line =
        |scale: f64| (0..500).map(move |i| Point3::new(1.0, 2.0, -1.0) * (f64::from(i) * scale)).collect();
    for scale in [1e-9, 1.0, 1e200] {
        assert_eq!(run(line(scale)), Err(ReconstructError::Degenerate));
    }
    let mut nan = sphere(100, 0.0).points;
    nan[7].y = f64::NAN;
    assert!(matches!(run(nan), Err(ReconstructError::Cloud(CloudError::NotFinite { index: 7 }))));
    let views = Some(Vec::new());
    let short = PointCloud { views, ..sphere(100, 0.0) };
    assert!(matches!(reconstruct(&short, &settings), Err(ReconstructError::Cloud(_))));
    for cell_m in [0.0, -1.0, f64::NAN] {
        let settings = Settings { cell_m: Some(cell_m), ..Settings::default() };
        assert!(matches!(
            reconstruct(&sphere(100, 0.0), &settings),
            Err(ReconstructError::Setting { name: "cell_m", .. })
        ));
    }
    let fine = Settings { cell_m: Some(1e-12), ..Settings::default() };
    assert!(matches!(reconstruct(&sphere(100, 0.0), &fine), Err(ReconstructError::CellTooSmall { .. })));
}

#[test]
fn odd_clouds_never_panic() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for trial in 0..40 {
        let count = rng.random_range(30..400);
        let scale = 10_f64.powi(rng.random_range(-6..6));
        let flat = trial % 3;
        let mut points: Vec<Point3<f64>> = (0..count)
            .map(|_| {
                let mut p = [0, 1, 2].map(|_| rng.random_range(-scale..scale));
                if flat == 1 {
                    p[2] = 0.0;
                }
                Point3::from(p)
            })
            .collect();
        if flat == 2 {
            points.push(Point3::new(1e12, -1e12, 1e12));
            points.push(Point3::new(-1e300, 1e300, 0.0));
        }
        let cloud = PointCloud::from_points(points).unwrap();
        for close in [false, true] {
            let settings =
                Settings { close, table: Table::Auto, outliers: trial % 2 == 0, ..Settings::default() };
            if let Ok(done) = reconstruct(&cloud, &settings) {
                assert_eq!(done.report.watertight, done.mesh.is_watertight());
            }
        }
    }
}
