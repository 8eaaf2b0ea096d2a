use nalgebra::{Rotation3, Translation3, UnitQuaternion};

use super::*;
use crate::object::solids::cuboid;
use crate::scan::calibrate::{Bench, BenchCamera, CalibrateSettings, Calibration, Evaluation, calibrate};
use crate::scan::optics::AlbedoEdge;
use crate::scan::stripe::{Across, LineOutcome, StripeExtractor};

/// A box, corners given.
fn block(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let middle = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
    let standing = cuboid([0, 1, 2].map(|axis| high[axis] - low[axis])).unwrap();
    standing.transformed(&Isometry3::translation(middle[0], middle[1], low[2]))
}

/// Looking straight down from the stand-off above the origin, x and y as the base's x and -y.
fn above() -> Isometry3<f64> {
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.2), UnitQuaternion::from_rotation_matrix(&down))
}

fn renderer(object: &Mesh, optics: &Optics) -> Renderer {
    Renderer::new(object, Some(Plane::horizontal(0.0)), &Instrument::default(), optics).unwrap()
}

/// What a camera's whole sensor sees from above; nothing of the other one is read.
fn exposure(renderer: &Renderer, camera: Camera, seed: u64) -> GrayImage {
    let mut windows = [Window { first_row_px: 0, rows_px: 0 }; 2];
    windows[camera as usize].rows_px = renderer.instrument.pixels[1];
    let [left, right] = renderer.exposures(&above(), windows, seed, 0);
    match camera {
        Camera::Left => left,
        Camera::Right => right,
    }
}

fn lines(object: &Mesh, optics: &Optics, camera: Camera) -> Vec<LineOutcome> {
    let image = exposure(&renderer(object, optics), camera, 7);
    StripeExtractor::default().image(&image, Across::Columns)
}

fn calibration(camera: Camera) -> Calibration {
    let camera = BenchCamera::of(&Instrument::default(), camera);
    let settings = CalibrateSettings { starts: 1, max_iterations: 20, ..Default::default() };
    calibrate(&Bench::default().measure(&camera, 1), &settings).unwrap().calibration
}

#[test]
fn images_through_extractor_and_calibration_give_the_surface() {
    // A block 10 mm high on the table, through a lens that distorts.
    let object = block([-0.02, -0.02, -0.001], [0.02, 0.02, 0.010]);
    for camera in Camera::ALL {
        let calibration = calibration(camera);
        let (mut squares, mut count, mut on_block) = (0.0, 0, 0);
        for (u, line) in lines(&object, &Optics::default(), camera).iter().enumerate() {
            let Some(center) = line.center() else { continue };
            let Evaluation::Point([y, depth]) = calibration.evaluate([u as f64, center.position_px]) else {
                continue;
            };
            // Half a spot at the edges is another matter.
            if (y.abs() - 0.02).abs() < 0.001 {
                continue;
            }
            let truth = if y.abs() < 0.02 { 0.19 } else { 0.2 };
            assert!((depth - truth).abs() < 0.001, "{camera:?} column {u}: {depth} instead of {truth}");
            squares += (depth - truth).powi(2);
            count += 1;
            on_block += u32::from(y.abs() < 0.02);
        }
        let rms_m = (squares / f64::from(count)).sqrt();
        println!("{camera:?}: {:.1} um rms over {count} columns", rms_m * 1e6);
        // A tenth of a pixel is 0.06 mm.
        assert!(rms_m < 0.0001, "{rms_m}");
        assert!(count > 400 && on_block > 180, "{count} {on_block}");
    }
}

#[test]
fn what_stands_before_a_camera_hides_the_stripe_from_it_only() {
    // A wall at negative x, between the stripe and the left camera.
    let wall = block([-0.02, -0.2, 0.0], [-0.003, 0.2, 0.08]);
    let seen = |camera| {
        let outcomes = lines(&wall, &Optics::default(), camera);
        outcomes.iter().filter(|outcome| outcome.center().is_some()).count()
    };
    assert_eq!(seen(Camera::Left), 0);
    assert!(seen(Camera::Right) > 600);
}

#[test]
fn exposure_saturates_and_darkness_is_dark() {
    let plate = block([-0.1, -0.1, -0.002], [0.1, 0.1, 0.0]);
    let with = |exposure| lines(&plate, &Optics { exposure, ..Default::default() }, Camera::Right);
    assert!(with(0.0).iter().all(|outcome| *outcome == LineOutcome::Dark));
    let middle = |outcomes: &[LineOutcome]| *outcomes[384].center().unwrap();
    let (normal, bright) = (middle(&with(150.0)), middle(&with(800.0)));
    assert_eq!(normal.saturated_px, 0);
    assert!((normal.peak - 150.0).abs() < 40.0, "{normal:?}");
    assert!(bright.saturated_px >= 3 && bright.width_px > normal.width_px, "{bright:?}");
}

#[test]
fn the_same_seed_gives_the_same_image() {
    let plate = block([-0.1, -0.1, -0.002], [0.1, 0.1, 0.0]);
    let renderer = renderer(&plate, &Optics::default());
    let image = |seed| exposure(&renderer, Camera::Left, seed);
    assert_eq!(image(3), image(3));
    assert_ne!(image(3), image(4));
}

#[test]
fn optics_without_sense_are_refused() {
    let plate = block([-0.1, -0.1, -0.002], [0.1, 0.1, 0.0]);
    let new =
        |instrument: &Instrument, optics: &Optics| Renderer::new(&plate, None, instrument, optics).err();
    let instrument = Instrument::default();
    assert_eq!(
        new(&instrument, &Optics { blur_px: f64::NAN, ..Default::default() }),
        Some(ScanError::Instrument)
    );
    let blind = Instrument { fan_rad: 0.0, ..instrument.clone() };
    assert_eq!(new(&blind, &Optics::default()), Some(ScanError::Instrument));
}

/// No noise of any kind.
fn quiet() -> Optics {
    Optics { speckle: 0.0, electrons_per_level: 0.0, read_noise: 0.0, ..Default::default() }
}

/// Brightest pixel of an image.
fn brightest(image: &GrayImage) -> u8 {
    image.as_raw().iter().copied().max().unwrap()
}

#[test]
fn a_change_of_colour_changes_the_light_there() {
    let plate = block([-0.1, -0.1, -0.002], [0.1, 0.1, 0.0]);
    // Dark at negative y of the base: y of the scanner runs the other way.
    let plane = Plane { normal: -Vector3::y_axis(), offset_m: 0.0 };
    let object = Finish { edges: vec![AlbedoEdge { plane, ratio: 0.25 }], ..Finish::default() };
    let optics = Optics { object, exposure: 160.0, ..quiet() };
    let renderer = Renderer::new(&plate, None, &Instrument::default(), &optics).unwrap();
    let image = exposure(&renderer, Camera::Left, 1);
    let column = |u: u32| (0..image.height()).map(|v| image.get_pixel(u, v).0[0]).max().unwrap();
    let (light, dark) = (f64::from(column(250)) - optics.ambient, f64::from(column(518)) - optics.ambient);
    assert!((dark / light - 0.25).abs() < 0.02, "{dark} {light}");
    assert_eq!(image.get_pixel(10, 10).0[0], optics.ambient as u8);
}

#[test]
fn gloss_lights_what_the_mirrored_sheet_meets() {
    // A wedge whose slope of 45 degrees turns the laser aside, onto a wall.
    let (a, w) = (0.012, 0.05);
    let prism = [[-a, -w, 0.0], [a, -w, 0.0], [-a, -w, 2.0 * a], [-a, w, 0.0], [a, w, 0.0], [-a, w, 2.0 * a]];
    let mut vertices = prism.map(Point3::from).to_vec();
    let mut faces =
        vec![[1, 4, 5], [1, 5, 2], [0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3]];
    let wall = block([0.03, -0.05, 0.0], [0.04, 0.05, 0.05]);
    faces.extend(wall.faces().iter().map(|face| face.map(|corner| corner + 6)));
    vertices.extend(wall.vertices());
    let scene = Mesh::new(vertices, faces).unwrap();
    let with = |gloss: f64| {
        let optics = Optics { object: Finish { gloss, ..Finish::default() }, ..quiet() };
        exposure(&renderer(&scene, &optics), Camera::Left, 1)
    };
    // The slope is met at its middle, as high as it is far, and the wall at the same height.
    let false_spot = above().inverse() * Point3::new(0.03, 0.0, a);
    let pixel = Optics::default().pixel(&Instrument::default(), Camera::Left, &false_spot).unwrap();
    let [u, v] = pixel.map(|x| x.round() as u32);
    let (matt, glossy) = (with(0.0), with(0.5));
    assert_eq!(matt.get_pixel(u, v).0[0], 5);
    let level = f64::from(glossy.get_pixel(u, v).0[0]) - 5.0;
    // Half of the light, which the wall faces, thinned out by the longer way.
    let expected = 0.5 * 200.0 * 0.2 / (0.2 - a + 0.03);
    assert!((level - expected).abs() < 0.1 * expected, "{level} instead of {expected}");
    // The extractor sees two stripes there, and does not choose.
    let outcome = StripeExtractor::default().image(&glossy, Across::Columns)[u as usize];
    assert!(outcome.center().is_none(), "{outcome:?}");
}

#[test]
fn a_glaze_that_mirrors_the_laser_into_a_camera_dazzles_that_one() {
    let far = block([0.5, 0.5, 0.0], [0.51, 0.51, 0.01]);
    // Half way between the laser's direction and the left camera's.
    let normal = Unit::new_normalize(Vector3::new(-0.06, 0.0, 0.2).normalize() + Vector3::z());
    let optics = Optics { table: Finish::glazed(), exposure: 120.0, ..quiet() };
    let table = Plane { normal, offset_m: 0.0 };
    let renderer = Renderer::new(&far, Some(table), &Instrument::default(), &optics).unwrap();
    let [left, right] = Camera::ALL.map(|camera| brightest(&exposure(&renderer, camera, 1)));
    assert_eq!(left, 255);
    assert!((100..=126).contains(&right), "{right}");
}

#[test]
fn a_window_is_the_rows_of_the_whole_image() {
    let object = block([-0.02, -0.02, -0.001], [0.02, 0.02, 0.010]);
    let renderer = renderer(&object, &quiet());
    let windows = [Window { first_row_px: 200, rows_px: 150 }, Window { first_row_px: 250, rows_px: 120 }];
    for (camera, part) in Camera::ALL.into_iter().zip(renderer.exposures(&above(), windows, 1, 0)) {
        let whole = exposure(&renderer, camera, 1);
        let Window { first_row_px, rows_px } = windows[camera as usize];
        let rows = image::imageops::crop_imm(&whole, 0, first_row_px, 768, rows_px).to_image();
        assert_eq!(part, rows);
        assert!(brightest(&part) > 150);
    }
}
