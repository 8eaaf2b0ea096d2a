//! How near a search comes to a larger one: the best epsilon that `best` finds on one object after another.
//!
//! `cargo run --release -p host --example search_depth ATTEMPTS SEEDS [FILE..]` plans with the default arm and table on mesh files
//! (metres), or without any on the built-in objects and some boxes, cylinders, tubes and cones. One line for each object and
//! seed (1 to SEEDS): greatest epsilon and whose it is, epsilon of the first grasp in the order of the ranking, number of
//! grasps, seconds, greatest epsilon of each candidate.

use std::time::Instant;

use anyhow::Context;
use host::io::{Geometry, Unit, read_geometry};
use host::object::BuiltIn;
use host::object::solids::{ProfilePoint, cuboid, cylinder_profile, revolve};
use host::plan::arm::Arm;
use host::plan::best;
use host::plan::scene::Scene;
use host::plan::search::SearchSettings;
use host::surface::Mesh;
use nalgebra::Isometry3;

/// Where `prehend plan` puts objects, base frame.
const SPOT_M: [f64; 2] = [0.40, 0.0];

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let attempts: usize = arguments.next().context("ATTEMPTS")?.parse().context("ATTEMPTS")?;
    let seeds: u64 = arguments.next().context("SEEDS")?.parse().context("SEEDS")?;
    let files: Vec<String> = arguments.collect();
    let objects = if files.is_empty() { made_up()? } else { read(&files)? };
    for (name, mesh) in objects {
        for seed in 1..=seeds {
            let start = Instant::now();
            let scene = scene(&mesh)?;
            let settings = SearchSettings { attempts, seed, ranked: 100, ..SearchSettings::default() };
            let result = best::search(&scene, &settings, &|_| ());
            let took_s = start.elapsed().as_secs_f64();
            let mut of_candidate = vec![0.0_f64; scene.hand.candidates.len()];
            for grasp in &result.grasps {
                let best = &mut of_candidate[grasp.candidate];
                *best = best.max(grasp.quality.epsilon_low);
            }
            let best =
                (0..of_candidate.len()).fold(0, |a, b| if of_candidate[b] > of_candidate[a] { b } else { a });
            let first = result.grasps.first().map_or(0.0, |grasp| grasp.quality.epsilon_low);
            print!(
                "{name:22} {seed:2} {:.4} {:13} first {first:.4} grasps {:6} {took_s:6.2} s ",
                of_candidate[best],
                scene.hand.candidates[best].name,
                result.grasps.len(),
            );
            for epsilon in of_candidate {
                print!(" {epsilon:.3}");
            }
            println!();
        }
    }
    Ok(())
}

fn scene(mesh: &Mesh) -> anyhow::Result<Scene> {
    let (low, high) = mesh.bounding_box();
    let middle = nalgebra::center(&low, &high);
    let standing = Isometry3::translation(SPOT_M[0] - middle.x, SPOT_M[1] - middle.y, -low.z);
    Ok(Scene::new(mesh.clone(), standing, Some(0.0), Some(Arm::rx60()))?)
}

fn read(files: &[String]) -> anyhow::Result<Vec<(String, Mesh)>> {
    let one = |file: &String| {
        let Geometry::Mesh(mesh) = read_geometry(file.as_ref(), Unit::Metre)?.value else {
            anyhow::bail!("{file}: no mesh");
        };
        let name = file.rsplit('/').next().unwrap_or(file).to_owned();
        Ok((name, mesh))
    };
    files.iter().map(one).collect()
}

fn made_up() -> anyhow::Result<Vec<(String, Mesh)>> {
    let mut objects = Vec::new();
    for built_in in BuiltIn::ALL {
        objects.push((built_in.name().to_owned(), built_in.object(1.0)?.mesh));
    }
    for sides_mm in [[30.0, 40.0, 120.0], [60.0, 90.0, 30.0], [40.0, 160.0, 60.0], [75.0, 75.0, 75.0]] {
        let name = format!("box {}x{}x{}", sides_mm[0], sides_mm[1], sides_mm[2]);
        objects.push((name, cuboid(sides_mm.map(|mm| 1e-3 * mm))?));
    }
    for [radius_mm, height_mm] in [[12.0, 140.0], [25.0, 150.0], [40.0, 40.0], [45.0, 180.0]] {
        let name = format!("cylinder d{}x{}", 2.0 * radius_mm, height_mm);
        objects.push((name, revolve(&cylinder_profile(1e-3 * radius_mm, 1e-3 * height_mm), 96)?));
    }
    let turned = |points: &[[f64; 2]]| {
        let profile: Vec<_> = points.iter().map(|[r, z]| ProfilePoint::new(1e-3 * r, 1e-3 * z)).collect();
        revolve(&profile, 96)
    };
    objects
        .push(("tube d70x80".to_owned(), turned(&[[31.0, 0.0], [35.0, 0.0], [35.0, 80.0], [31.0, 80.0]])?));
    objects
        .push(("ring d100x25".to_owned(), turned(&[[38.0, 0.0], [50.0, 0.0], [50.0, 25.0], [38.0, 25.0]])?));
    objects
        .push(("cone d80x120".to_owned(), turned(&[[0.0, 0.0], [40.0, 0.0], [12.0, 120.0], [0.0, 120.0]])?));
    let bottle =
        [[0.0, 0.0], [32.0, 0.0], [35.0, 5.0], [35.0, 100.0], [15.0, 140.0], [15.0, 180.0], [0.0, 180.0]];
    objects.push(("bottle d70x180".to_owned(), turned(&bottle)?));
    Ok(objects)
}
