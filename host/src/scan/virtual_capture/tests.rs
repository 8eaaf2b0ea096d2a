use std::convert::Infallible;
use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use parry3d_f64::{math::Vector, query::PointQuery, shape::TriMesh};

use super::*;
use crate::object::{BuiltIn, Object};
use crate::scan::capture::{MeasureError, MeasureSettings, Measured};
use crate::scan::clock_offset::ClockOffset;
use crate::scan::joints::carry;
use crate::scan::optics::{Finish, Optics};
use crate::scan::{Instrument, SweepSettings, palm_from_scanner, plan_sweeps, target_sphere};
use crate::surface::{Mesh, Plane};

fn placed(object: &Object) -> Mesh {
    object.mesh.transformed(&Isometry3::translation(0.40, 0.0, 0.0))
}

fn carried(mesh: &Mesh, settings: &SweepSettings) -> Vec<CarriedSweep> {
    let (center, radius) = target_sphere(mesh);
    let arm = Arm::rx60();
    plan_sweeps(&center, radius, &Instrument::default(), settings, &|pass| {
        carry(&arm, &palm_from_scanner(), pass).is_some()
    })
    .sweeps
    .into_iter()
    .filter_map(|sweep| {
        let joints = carry(&arm, &palm_from_scanner(), &sweep.stripes)?;
        Some(CarriedSweep { sweep, joints })
    })
    .collect()
}

fn capture(mesh: &Mesh, sweeps: &[CarriedSweep], optics: &Optics, offset_s: f64) -> Capture {
    let instrument = Instrument::default();
    let rig = Rig::calibrated(&instrument, optics, 1).unwrap();
    let renderer = Renderer::new(mesh, Some(Plane::horizontal(0.0)), &instrument, optics).unwrap();
    let sink = |_: u32, _: Camera, _: &GrayImage| Ok::<(), Infallible>(());
    virtual_capture(
        &renderer,
        &Arm::rx60(),
        &rig,
        sweeps,
        Start::default(),
        CellSettings { offset_s, seed: 1 },
        &sink,
    )
    .unwrap()
}

/// Distances of the cloud's points from what there is, those above the table's and all.
fn errors(mesh: &Mesh, measured: &Measured) -> (Vec<f64>, Vec<f64>) {
    let vertices = mesh.vertices().iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let shape = TriMesh::new(vertices, mesh.faces().to_vec()).unwrap();
    let off =
        |p: &Point3<f64>| shape.distance_to_local_point(Vector::new(p.x, p.y, p.z), false).min(p.z.abs());
    let points = &measured.cloud.points;
    let all: Vec<f64> = points.iter().map(off).collect();
    let object = points.iter().zip(&all).filter(|(p, _)| p.z > 0.001).map(|(_, &e)| e).collect();
    (object, all)
}

fn share_within(errors: &[f64], bound_m: f64) -> f64 {
    errors.iter().filter(|&&e| e <= bound_m).count() as f64 / errors.len() as f64
}

#[test]
fn images_of_the_lid_give_its_cloud() {
    let mesh = placed(&BuiltIn::TeacupCover.object(1.0).unwrap());
    let sweeps = carried(&mesh, &SweepSettings::default());
    assert_eq!(sweeps.len(), 5);
    let clock = Instant::now();
    let glazed = Optics { object: Finish::glazed(), ..Optics::default() };
    let capture = capture(&mesh, &sweeps, &glazed, 0.0);
    println!("rendered and extracted in {:.2} s", clock.elapsed().as_secs_f64());
    let clock = Instant::now();
    let measured = capture.measure(&MeasureSettings::default()).unwrap();
    println!("measured in {:.3} s", clock.elapsed().as_secs_f64());
    let (object, all) = errors(&mesh, &measured);
    println!("{} points, {} above the table; {:?}", all.len(), object.len(), measured.report);
    for bound in [0.0001, 0.0002, 0.0003, 0.0005, 0.001, 0.002] {
        println!(
            "within {bound}: {:.4} above the table, {:.4} all",
            share_within(&object, bound),
            share_within(&all, bound)
        );
    }
    assert!(object.len() > 10_000, "{}", object.len());
    assert!(share_within(&object, 0.0003) >= 0.95);
    assert!(share_within(&all, 0.0003) >= 0.95);
    assert!(matches!(measured.report.clock, ClockOffset::Negligible { .. }), "{:?}", measured.report.clock);
    // Each line of sight leads to the laser.
    let views = measured.cloud.views.as_ref().unwrap();
    for (i, (point, view)) in measured.cloud.points.iter().zip(views).enumerate().step_by(997) {
        let frame = &capture.frames[measured.frame_of_point[i] as usize];
        let q_rad = capture.joints.at(frame.time_s).unwrap();
        let aperture = capture.arm.base_from_palm(&q_rad) * palm_from_scanner() * Point3::origin();
        assert!((view.into_inner() - (aperture - point).normalize()).norm() < 1e-9);
    }
}

#[test]
fn a_late_camera_is_found_out_and_put_right() {
    let mesh = placed(&BuiltIn::Mouse.object(1.0).unwrap());
    let sweeps = carried(&mesh, &SweepSettings::default());
    let late = capture(&mesh, &sweeps, &Optics::default(), 0.007);
    let measured = late.measure(&MeasureSettings::default()).unwrap();
    println!("{:?}", measured.report.clock);
    let ClockOffset::Applied { offset_s, sigma_s } = measured.report.clock else {
        panic!("{:?}", measured.report.clock);
    };
    assert!((offset_s - 0.007).abs() < 4.0 * sigma_s && sigma_s < 0.001, "{offset_s} +- {sigma_s}");
    let raw = late.measure(&MeasureSettings { correct_clock: false, ..Default::default() }).unwrap();
    let [bad, good] = [&raw, &measured].map(|m| share_within(&errors(&mesh, m).0, 0.0002));
    println!("within 0.2 mm: {bad:.3} as stamped, {good:.3} put right");
    assert!(good > bad + 0.05);
}

#[test]
fn either_camera_may_lose_the_stripe() {
    let mesh = placed(&BuiltIn::Cube.object(1.0).unwrap());
    let sweeps = carried(&mesh, &SweepSettings::paper());
    let both = capture(&mesh, &sweeps, &Optics::default(), 0.0);
    let whole = both.measure(&MeasureSettings::default()).unwrap();
    for camera in Camera::ALL {
        let mut half = both.clone();
        half.frames.iter_mut().for_each(|frame| frame.stripes[camera as usize] = None);
        let measured = half.measure(&MeasureSettings::default()).unwrap();
        assert_eq!(measured.report.missing_images, half.frames.len());
        assert_eq!(measured.report.pixels.agreed, 0);
        let (object, all) = errors(&mesh, &measured);
        println!(
            "without {camera:?}: {} of {} points, within 0.3 mm {:.4} of the object's, {:.4} of all",
            all.len(),
            whole.cloud.len(),
            share_within(&object, 0.0003),
            share_within(&all, 0.0003)
        );
        assert!(2 * all.len() > whole.cloud.len());
        assert!(share_within(&object, 0.0003) >= 0.95 && share_within(&all, 0.0003) >= 0.95);
    }
    // And in turn: every frame has one of the two.
    let mut turns = both;
    turns.frames.iter_mut().enumerate().for_each(|(i, frame)| frame.stripes[i % 2] = None);
    let measured = turns.measure(&MeasureSettings::default()).unwrap();
    assert!(share_within(&errors(&mesh, &measured).1, 0.0003) >= 0.95);
}

#[test]
fn joints_that_do_not_cover_a_frame_are_an_error() {
    let mesh = placed(&BuiltIn::Cube.object(1.0).unwrap());
    let sweeps = carried(&mesh, &SweepSettings { pitch_m: 0.02, ..SweepSettings::paper() });
    let mut capture = capture(&mesh, &sweeps, &Optics::default(), 0.0);
    capture.frames[2].time_s = 99.0;
    let error = capture.measure(&MeasureSettings::default()).unwrap_err();
    assert_eq!(error, MeasureError::Uncovered { frame: 2, time_s: 99.0 });
    assert_eq!(error.to_string(), "frame 2 at 99 s: the arm's joints do not cover that time");
    capture.frames.iter_mut().for_each(|frame| frame.stripes = [None, None]);
    capture.frames[2].time_s = capture.frames[1].time_s;
    assert_eq!(capture.measure(&MeasureSettings::default()), Err(MeasureError::Nothing));
}

#[test]
fn one_sweep_says_nothing_of_the_clocks() {
    let mesh = placed(&BuiltIn::Cube.object(1.0).unwrap());
    let sweeps = carried(&mesh, &SweepSettings::paper());
    let measured =
        capture(&mesh, &sweeps, &Optics::default(), 0.0).measure(&MeasureSettings::default()).unwrap();
    assert_eq!(measured.report.clock, ClockOffset::Undetermined);
}

#[test]
fn same_seed_same_capture_on_any_number_of_threads() {
    let mesh = placed(&BuiltIn::Disk.object(1.0).unwrap());
    let settings = SweepSettings { pitch_m: 0.004, ..SweepSettings::default() };
    let sweeps = carried(&mesh, &settings);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let capture = capture(&mesh, &sweeps, &Optics::default(), 0.0);
            let measured = capture.measure(&MeasureSettings::default()).unwrap();
            (capture, measured)
        })
    };
    assert_eq!(run(1), run(3));
}
