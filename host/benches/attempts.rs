//! Speed of the grasp search on the paper's object: `cargo bench -p host --bench attempts`.
//!
//! Prints, for the teacup's cover in 10,000 and in 100,000 triangles: attempts a second of both strategies, what an attempt
//! spends its time on, and the time from the mesh to the first grasp above the threshold. The shares come from running
//! the steps alone on the sites of one search, so that the search itself carries no clock.
#![allow(
    clippy::expect_used,
    reason = "a benchmark without its object or its threads has nothing to measure"
)]

use std::collections::HashMap;
use std::hint::black_box;
use std::time::Instant;

use host::grasp::{Contact, Workspace, evaluate};
use host::object::BuiltIn;
use host::plan::arm::Arm;
use host::plan::attempt::{Rejection, close_hand, is_open_to};
use host::plan::preshape::PreshapeTable;
use host::plan::scene::Scene;
use host::plan::search::{Proposal, SearchResult, SearchSettings, Tried, attempt_rng, try_all};
use host::plan::surface_query::SurfaceQuery;
use host::plan::{best, paper};
use host::surface::Mesh;
use nalgebra::{Isometry3, Point3};

/// Each figure is the median of this many runs.
const RUNS: usize = 5;

/// Attempts of a measured search.
const ATTEMPTS: usize = 2000;

/// The same surface in at least `least` triangles: the longest edges halved.
fn refined(mesh: &Mesh, least: usize) -> Mesh {
    let mut vertices = mesh.vertices().to_vec();
    let mut faces = mesh.faces().to_vec();
    let edge = |a: u32, b: u32| (a.min(b), a.max(b));
    while faces.len() < least {
        let length = |&(a, b): &(u32, u32)| nalgebra::distance(&vertices[a as usize], &vertices[b as usize]);
        let mut edges: Vec<_> =
            faces.iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
        edges.sort_unstable();
        edges.dedup();
        edges.sort_by(|one, other| length(other).total_cmp(&length(one)));
        // Each adds two triangles; not too many at a time, or short ones are halved with the long.
        edges.truncate((edges.len() / 8).min((least - faces.len()).div_ceil(2)));
        let mut halves: HashMap<(u32, u32), u32> = HashMap::new();
        for (a, b) in edges {
            halves.insert((a, b), vertices.len() as u32);
            let middle: Point3<f64> = nalgebra::center(&vertices[a as usize], &vertices[b as usize]);
            vertices.push(middle);
        }
        // A corner after a halved edge is cut off with it, until no halved edge is left.
        let mut open = std::mem::take(&mut faces);
        while let Some([a, b, c]) = open.pop() {
            let turned = [[a, b, c], [b, c, a], [c, a, b]];
            let halved = turned.iter().find_map(|&face| Some((face, *halves.get(&edge(face[0], face[1]))?)));
            match halved {
                Some(([a, b, c], middle)) => open.extend([[a, middle, c], [middle, b, c]]),
                None => faces.push([a, b, c]),
            }
        }
    }
    Mesh::new(vertices, faces).expect("a mesh")
}

fn scene(mesh: &Mesh) -> Scene {
    let base_from_object = Isometry3::translation(0.40, 0.0, 0.0);
    Scene::new(mesh.clone(), base_from_object, Some(0.0), Some(Arm::rx60())).expect("a scene")
}

fn settings(attempts: usize, threshold: f64) -> SearchSettings {
    SearchSettings { attempts, threshold, ..SearchSettings::default() }
}

fn quiet(_: usize) {}

fn seconds<T>(run: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    black_box(run());
    start.elapsed().as_secs_f64()
}

fn median_of(mut run: impl FnMut() -> f64) -> f64 {
    let mut figures: Vec<f64> = (0..RUNS).map(|_| run()).collect();
    figures.sort_by(f64::total_cmp);
    figures[RUNS / 2]
}

type Search = fn(&Scene, &SearchSettings, &dyn Fn(usize)) -> SearchResult;

/// Attempts a second, each search on a scene of its own, as a plan makes them.
fn rate(mesh: &Mesh, search: Search) -> f64 {
    median_of(|| {
        let scene = scene(mesh);
        let mut attempts = 0;
        let took = seconds(|| attempts = search(&scene, &settings(ATTEMPTS, 2.0), &quiet).attempts);
        attempts as f64 / took
    })
}

/// Time of each step, as a share of proposing and trying the sites of one search, on one core.
fn shares(scene: &Scene) {
    let tables: Vec<PreshapeTable> =
        scene.hand.candidates.iter().cloned().enumerate().map(|(i, c)| PreshapeTable::new(i, c)).collect();
    let sampled: Vec<Proposal> = (0..ATTEMPTS)
        .map(|index| {
            let rng = Box::new(attempt_rng(1, index));
            Proposal::Sampled { candidate: index % tables.len(), rng }
        })
        .collect();
    let tried: Vec<Tried> = try_all(scene, &tables, &sampled);
    let at: Vec<Proposal> =
        tried.iter().map(|t| Proposal::At { candidate: t.candidate, site: Box::new(t.site) }).collect();
    // A refusal that comes later has passed the checks before it.
    let came_to =
        |t: &&Tried, check: Rejection| t.outcome.as_ref().err().is_none_or(|reason| *reason >= check);
    let closed: Vec<&Tried> = tried.iter().filter(|t| came_to(t, Rejection::FingerInObject)).collect();
    let contacts: Vec<Vec<Contact>> = closed
        .iter()
        .filter(|t| came_to(t, Rejection::NoForceClosure))
        .map(|t| {
            let closed = close_hand(scene, tables[t.candidate].candidate(), &t.site);
            let contact = |point: Point3<f64>, normal| Contact::new(point, normal, scene.friction).ok();
            closed
                .touches()
                .filter_map(|(_, touch)| {
                    contact(touch.point_in_object, touch.inward_normal_in_object.into_inner())
                })
                .collect()
        })
        .collect();

    let whole = median_of(|| seconds(|| try_all(scene, &tables, &sampled)));
    let trying = median_of(|| seconds(|| try_all(scene, &tables, &at)));
    let reaching = median_of(|| {
        seconds(|| {
            tried.iter().filter(|t| is_open_to(scene, tables[t.candidate].candidate(), &t.site)).count()
        })
    });
    let closing = median_of(|| {
        seconds(|| {
            for t in &closed {
                black_box(close_hand(scene, tables[t.candidate].candidate(), &t.site));
            }
        })
    });
    let mut workspace = Workspace::new();
    let measuring = median_of(|| {
        seconds(|| {
            for contacts in &contacts {
                let _ =
                    black_box(evaluate(contacts, &scene.wrench_reference, &scene.quality, &mut workspace));
            }
        })
    });
    let grasps = tried.iter().filter(|t| t.outcome.is_ok()).count();
    println!(
        "  of {ATTEMPTS} sampled attempts, {} closed and {grasps} are grasps; of their time",
        closed.len()
    );
    for (step, took) in [
        ("proposing and settling", whole - trying),
        ("palm and arm's reach", reaching),
        ("closing", closing),
        ("metric", measuring),
        ("opening, ways, arm's links", trying - reaching - closing - measuring),
    ] {
        println!(
            "    {step:28} {:5.1} %  {:7.1} us an attempt",
            100.0 * took / whole,
            1e6 * took / ATTEMPTS as f64
        );
    }
}

fn main() {
    let lid = BuiltIn::TeacupCover.object(1.0).expect("the lid").mesh;
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for triangles in [10_000, 100_000] {
        let mesh = refined(&lid, triangles);
        println!("teacup cover, {} triangles", mesh.faces().len());
        for (name, search) in [("paper", paper::search as Search), ("default", best::search)] {
            println!(
                "  {name:8} {:8.0} attempts/s on one core, {:8.0} on all",
                alone.install(|| rate(&mesh, search)),
                rate(&mesh, search)
            );
        }
        alone.install(|| shares(&scene(&mesh)));
        let index = median_of(|| seconds(|| SurfaceQuery::new(&mesh)));
        let scene_s = median_of(|| seconds(|| scene(&mesh)));
        let mut attempts = None;
        let first = median_of(|| {
            seconds(|| {
                let scene = scene(&mesh);
                attempts = paper::search(&scene, &settings(300, 0.2), &quiet).attempts_to_threshold;
            })
        });
        println!(
            "  from the mesh to epsilon 0.2: {:.1} ms, attempt {attempts:?} (scene {:.1} ms, of it distance index {:.1} ms)",
            1e3 * first,
            1e3 * scene_s,
            1e3 * index
        );
    }
}
