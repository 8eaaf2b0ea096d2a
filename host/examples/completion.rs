//! How good the completion of one-sided scans is.
//!
//! `cargo run --release -p host --example completion [YAWS]` scans ten solids by one sweep of the virtual scanner, 35
//! degrees from the vertical, on a table that it knows, at YAWS (3 by default) turns of the object, and prints:
//!
//! - IoU: volume of the intersection over that of the union of truth and model, on cells of 1.5 mm;
//! - sides: share of the true outer side surface (its normal within 45 degrees of horizontal, nothing of the object in
//!   front of it) that lies within 2 mm of the model;
//! - seen empty: volume of the model, more than half a millimetre below its surface, that lines of sight pass (from
//!   2.5 mm before their points on), in cells of half a millimetre, mm^3;
//! - the model's area by provenance, per cent, and whether every model is watertight;
//!
//! then the same without symmetry.

use std::collections::HashSet;
use std::f64::consts::FRAC_PI_2;

use anyhow::Context;
use host::object::BuiltIn;
use host::object::solids::{HalfSuperellipsoid, ProfilePoint, cuboid, cylinder_profile, revolve};
use host::plan::surface_query::SurfaceQuery;
use host::scan::{Instrument, SweepSettings, plan_sweeps, scan, target_sphere};
use host::surface::{Mesh, Plane, PointCloud, Provenance, Settings, Table, reconstruct};
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const CELL_M: f64 = 0.0015;
const SAMPLES: usize = 4000;

/// A solid as closed meshes that may overlap.
struct Solid {
    name: &'static str,
    parts: Vec<Mesh>,
}

struct Figures {
    iou: f64,
    sides: f64,
    seen_empty_mm3: f64,
    shares: [f64; 4],
    watertight: bool,
}

fn main() -> anyhow::Result<()> {
    let yaws: u32 = std::env::args().nth(1).map_or(Ok(3), |text| text.parse()).context("YAWS")?;
    for symmetry in [true, false] {
        println!(
            "{:18} {:>6} {:>7} {:>11} {:>9} {:>9} {:>9} {:>6}  watertight   (symmetry: {symmetry})",
            "solid", "IoU %", "sides %", "seen empty", "measured", "mirrored", "extruded", "table"
        );
        let mut means = Vec::new();
        let solids = solids()?;
        for solid in &solids {
            let runs = (0..yaws)
                .map(|yaw| run(solid, (20.0 + 37.0 * f64::from(yaw)).to_radians(), u64::from(yaw), symmetry))
                .collect::<anyhow::Result<Vec<_>>>()?;
            let mean = |of: &dyn Fn(&Figures) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
            let (iou, sides) = (mean(&|f| f.iou), mean(&|f| f.sides));
            means.push((solid.name, iou, sides));
            let share = |i: usize| 100.0 * mean(&|f| f.shares[i]);
            println!(
                "{:18} {:6.1} {:7.1} {:11.1} {:9.1} {:9.1} {:9.1} {:6.1}  {}",
                solid.name,
                100.0 * iou,
                100.0 * sides,
                mean(&|f| f.seen_empty_mm3),
                share(0),
                share(1),
                share(2),
                share(3),
                runs.iter().all(|f| f.watertight)
            );
        }
        // One lid of the two: what its hollow is like no view from above knows.
        for (name, without) in [("mean, lid", "lid, filled"), ("mean, lid filled", "lid")] {
            let counted: Vec<_> = means.iter().filter(|(solid, ..)| *solid != without).collect();
            let mean = |of: &dyn Fn(&(&str, f64, f64)) -> f64| {
                100.0 * counted.iter().map(|each| of(each)).sum::<f64>() / counted.len() as f64
            };
            println!("{name:18} {:6.1} {:7.1}", mean(&|each| each.1), mean(&|each| each.2));
        }
    }
    Ok(())
}

fn solids() -> anyhow::Result<Vec<Solid>> {
    let one = |name, mesh| Solid { name, parts: vec![mesh] };
    let turned = |profile: &[[f64; 2]]| {
        revolve(&profile.iter().map(|&[r, z]| ProfilePoint::new(r, z)).collect::<Vec<_>>(), 96)
    };
    let lying = Isometry3::translation(0.0, 0.0, 0.025) * Isometry3::rotation(Vector3::x() * -FRAC_PI_2);
    let sphere: Vec<[f64; 2]> = (0..=48)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::PI * f64::from(i) / 48.0).sin_cos();
            [if i % 48 == 0 { 0.0 } else { 0.035 * sin }, 0.035 - 0.035 * cos]
        })
        .collect();
    let cup = [[0.0, 0.0], [0.025, 0.0], [0.040, 0.070], [0.037, 0.070], [0.0225, 0.004], [0.0, 0.004]];
    let mug = [[0.0, 0.0], [0.040, 0.0], [0.040, 0.090], [0.0365, 0.090], [0.0365, 0.005], [0.0, 0.005]];
    let bottle = [[0.0, 0.0], [0.033, 0.0], [0.033, 0.11], [0.014, 0.145], [0.014, 0.18], [0.0, 0.18]];
    let handle: Vec<[f64; 2]> = (0..24)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 24.0).sin_cos();
            [0.025 + 0.005 * cos, 0.005 * sin]
        })
        .collect();
    let upright = Isometry3::translation(0.042, 0.0, 0.045) * Isometry3::rotation(Vector3::x() * FRAC_PI_2);
    Ok(vec![
        one("box", cuboid([0.06, 0.09, 0.05])?),
        one("cylinder, upright", revolve(&cylinder_profile(0.03, 0.10), 96)?),
        one("cylinder, lying", revolve(&cylinder_profile(0.025, 0.10), 96)?.transformed(&lying)),
        one("sphere", turned(&sphere)?),
        one("frustum", turned(&[[0.0, 0.0], [0.04, 0.0], [0.02, 0.08], [0.0, 0.08]])?),
        one("cup", turned(&cup)?),
        one(
            "mouse",
            HalfSuperellipsoid {
                semi_axes_m: [0.0575, 0.031, 0.038],
                plan_exponent: 2.5,
                elevation_exponent: 2.2,
            }
            .mesh(96, 32)?,
        ),
        one("lid", BuiltIn::TeacupCover.object(1.0)?.mesh),
        one("lid, filled", filled_lid()?),
        one("bottle", turned(&bottle)?),
        Solid { name: "mug", parts: vec![turned(&mug)?, turned(&handle)?.transformed(&upright)] },
    ])
}

/// The built-in lid's outside, its hollow filled: what lies under it no view from above can know.
fn filled_lid() -> anyhow::Result<Mesh> {
    let lid = BuiltIn::TeacupCover.object(1.0)?.mesh;
    // Highest point at each radius: the outer face; below the rim's edge the flange stands on the table.
    let query = SurfaceQuery::new(&lid)?;
    let mut profile = vec![ProfilePoint::new(0.0, 0.0), ProfilePoint::new(0.038, 0.0)];
    profile.extend([[0.038, 0.010], [0.045, 0.010]].map(|[r, z]| ProfilePoint::new(r, z)));
    let down = -Vector3::z_axis();
    for i in (0..=44).rev() {
        let radius = 0.045 * (f64::from(i) / 45.0);
        let from = Point3::new(radius.max(1e-5), 1e-5, 0.2);
        let (way, _) = query.cast_ray(&from, &down).context("the lid has a top everywhere")?;
        profile.push(ProfilePoint::new(radius, 0.2 - way));
    }
    Ok(revolve(&profile, 96)?)
}

/// All parts in one array of faces, for the scanner.
fn joined(parts: &[Mesh]) -> anyhow::Result<Mesh> {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for part in parts {
        let first = vertices.len() as u32;
        vertices.extend_from_slice(part.vertices());
        faces.extend(part.faces().iter().map(|face| face.map(|index| index + first)));
    }
    Ok(Mesh::new(vertices, faces)?)
}

fn run(solid: &Solid, yaw_rad: f64, seed: u64, symmetry: bool) -> anyhow::Result<Figures> {
    let base_from_object =
        Isometry3::translation(0.4, 0.0, 0.0) * Isometry3::rotation(Vector3::z() * yaw_rad);
    let parts: Vec<Mesh> = solid.parts.iter().map(|part| part.transformed(&base_from_object)).collect();
    let whole = joined(&parts)?;
    let cloud = one_view(&whole, seed)?;
    let settings = Settings {
        table: Table::Plane(Plane::horizontal(0.0)),
        close: true,
        symmetry,
        seed,
        ..Settings::default()
    };
    let found = reconstruct(&cloud, &settings).with_context(|| solid.name)?.mesh;
    let model = SurfaceQuery::new(&found)?;
    let truth = parts.iter().map(SurfaceQuery::new).collect::<Result<Vec<_>, _>>()?;
    let is_true = |p: &Point3<f64>| truth.iter().any(|part| part.nearest(p).signed_distance_m < 0.0);

    let (low, high) = [whole.bounding_box(), found.bounding_box()]
        .into_iter()
        .reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
        .context("no box")?;
    let dims = ((high - low) / CELL_M).map(|cells| cells.ceil() as u32);
    let (mut both, mut either) = (0_u32, 0_u32);
    for i in 0..dims.x {
        for j in 0..dims.y {
            for k in 0..dims.z {
                let cell = Vector3::new(f64::from(i) + 0.5, f64::from(j) + 0.5, f64::from(k) + 0.5);
                let point = low + cell * CELL_M;
                let (true_one, model_one) = (is_true(&point), model.nearest(&point).signed_distance_m < 0.0);
                both += u32::from(true_one && model_one);
                either += u32::from(true_one || model_one);
            }
        }
    }
    // The measure measures the model, not its own cells: nothing of the true solid lies where one could look through.
    let of_truth_mm3: f64 = truth.iter().map(|part| seen_empty_mm3(&cloud, part, high.z)).sum();
    anyhow::ensure!(
        of_truth_mm3 == 0.0,
        "{}: {of_truth_mm3} mm^3 of the true solid in seen space",
        solid.name
    );
    let area_m2 = found.area_m2();
    Ok(Figures {
        iou: f64::from(both) / f64::from(either),
        sides: sides(&parts, &truth, &model, seed),
        seen_empty_mm3: seen_empty_mm3(&cloud, &model, high.z),
        shares: Provenance::ALL.map(|each| found.area_of_m2(each) / area_m2),
        watertight: found.is_watertight(),
    })
}

/// What one sweep sees, the scanner 35 degrees from the vertical.
fn one_view(mesh: &Mesh, seed: u64) -> anyhow::Result<PointCloud> {
    let instrument = Instrument::default();
    let (center, radius_m) = target_sphere(mesh);
    let settings =
        SweepSettings { inclined: 1, tilts_rad: vec![35_f64.to_radians()], ..SweepSettings::default() };
    let mut plan = plan_sweeps(&center, radius_m, &instrument, &settings, &|_| true);
    plan.sweeps.retain(|sweep| sweep.name.contains("tilted"));
    Ok(scan(mesh, Some(Plane::horizontal(0.0)), &plan.sweeps, &instrument, seed)?.cloud)
}

/// Volume of the model, more than half a millimetre below its surface, that lines of sight pass. Each is followed from
/// the surface of one hollow to the next, in cells of half a millimetre.
fn seen_empty_mm3(cloud: &PointCloud, model: &SurfaceQuery, top_m: f64) -> f64 {
    const FINE_M: f64 = 5e-4;
    let mut cells = HashSet::new();
    for (point, view) in cloud.points.iter().zip(cloud.views.iter().flatten()) {
        let mut way_m = 2.5e-3;
        loop {
            let at = point + view.into_inner() * way_m;
            if at.z > top_m || way_m > 1.0 {
                break;
            }
            let distance_m = model.nearest(&at).signed_distance_m;
            if distance_m < -FINE_M {
                let cell: [i64; 3] = (at.coords / FINE_M).map(|c| c.floor() as i64).into();
                cells.insert(cell);
            }
            way_m += (distance_m - FINE_M).max(0.5 * FINE_M);
        }
    }
    cells.len() as f64 * (FINE_M * 1e3).powi(3)
}

fn sides(parts: &[Mesh], truth: &[SurfaceQuery], model: &SurfaceQuery, seed: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let faces: Vec<(usize, usize, f64)> = parts
        .iter()
        .enumerate()
        .flat_map(|(number, part)| {
            (0..part.faces().len()).filter(|&f| part.face_normal(f).z.abs() < 0.707).map(move |f| {
                let [a, b, c] = part.corners(f);
                (number, f, (b - a).cross(&(c - a)).norm())
            })
        })
        .collect();
    let total: f64 = faces.iter().map(|face| face.2).sum();
    let (mut near, mut count) = (0_u32, 0_u32);
    for &(number, face, area) in &faces {
        let [a, b, c] = parts[number].corners(face);
        let normal = parts[number].face_normal(face).into_inner();
        let expected = SAMPLES as f64 * area / total;
        let samples = expected.floor() as usize + usize::from(rng.random::<f64>() < expected.fract());
        for _ in 0..samples {
            let (mut u, mut v): (f64, f64) = (rng.random(), rng.random());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let point = a + (b - a) * u + (c - a) * v;
            // Free for a finger's breadth in front, and not within another part.
            let is_outer = truth.iter().all(|part| {
                (1..=10).all(|step| {
                    part.nearest(&(point + normal * (5e-4 + 2e-3 * f64::from(step)))).signed_distance_m > 0.0
                }) && part.nearest(&(point + normal * 2e-4)).signed_distance_m > 0.0
            }) && truth
                .iter()
                .all(|part| part.nearest(&(point + normal * 0.06)).signed_distance_m > 0.0);
            if is_outer {
                count += 1;
                near += u32::from(model.nearest(&point).signed_distance_m.abs() < 2e-3);
            }
        }
    }
    f64::from(near) / f64::from(count.max(1))
}
