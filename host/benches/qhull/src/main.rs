//! Times and checks the grasp metric against Qhull: the same grasps, one after the other, in one thread, by its CPU time.
//!
//! Qhull gets the wrenches ready-made; the metric starts from the contacts. `--quick` takes a tenth of the grasps.

mod grasps;
mod hull;

use grasps::Grasp;
use host::grasp::{Closure, ConeModel, Settings, Workspace, evaluate, evaluate_above};
use hull::HullEpsilon;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rustix::time::{ClockId, clock_gettime};

/// Evaluations that one timing is the mean of: the clock takes a fifth of a microsecond to read.
const REPEATS: u32 = 10;

fn cpu_time_us() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e6 + now.tv_nsec as f64 * 1e-3
}

fn timed<T>(repeats: u32, mut work: impl FnMut() -> T) -> (T, f64) {
    let mut result = work();
    let start = cpu_time_us();
    for _ in 0..repeats {
        result = std::hint::black_box(work());
    }
    (result, (cpu_time_us() - start) / f64::from(repeats))
}

/// The value that a share of the values do not exceed.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
}

fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

fn pyramid(edges: u16) -> Settings {
    let cone = ConeModel::edges(edges.into()).expect("a pyramid");
    Settings { cone, tolerance: 0.0, ..Settings::default() }
}

/// What the whole comparison finds out about agreement.
#[derive(Default)]
struct Agreement {
    compared: usize,
    closures: usize,
    qhull_failed: usize,
    unfinished: usize,
    /// Differences beyond 1e-9 of epsilon + 1e-12.
    beyond: usize,
    worst: f64,
    worst_relative: f64,
}

impl Agreement {
    fn note(&mut self, found: &Closure, hull: HullEpsilon) {
        self.compared += 1;
        let epsilon = match found {
            Closure::Force(quality) => quality.epsilon_low,
            Closure::None(_) => 0.0,
            Closure::Below(_) | Closure::Above(_) | Closure::Unfinished(_) => {
                self.unfinished += 1;
                return;
            }
        };
        let HullEpsilon::Distance(expected) = hull else {
            self.qhull_failed += 1;
            return;
        };
        self.closures += usize::from(expected > 0.0);
        let difference = (epsilon - expected).abs();
        if difference > 1e-9 * expected + 1e-12 {
            self.beyond += 1;
            println!("difference: epsilon {epsilon:e}, Qhull {expected:e}");
        }
        self.worst = self.worst.max(difference);
        if expected > 1e-6 {
            self.worst_relative = self.worst_relative.max(difference / expected);
        }
    }
}

/// Workspaces of both algorithms.
struct Bench {
    fast: Workspace,
    whole: Workspace,
    agreement: Agreement,
}

impl Bench {
    fn closes(&mut self, grasp: &Grasp, settings: &Settings) -> bool {
        let found = evaluate(&grasp.contacts, &grasp.reference, settings, &mut self.fast);
        matches!(found, Closure::Force(_))
    }

    /// Takes grasps of one class in turn by Qhull, by the metric and by the whole polytope, and prints a row.
    fn row(&mut self, name: &str, grasps: &[Grasp], edges: u16) {
        let settings = pyramid(edges);
        let (mut qhull, mut joggled, mut fast, mut whole) = (vec![], vec![], vec![], vec![]);
        for grasp in grasps {
            let mut wrenches = hull::edge_wrenches(grasp, edges);
            let start = cpu_time_us();
            let hull = hull::epsilon(&mut wrenches, &[]);
            qhull.push(cpu_time_us() - start);
            let (found, us) =
                timed(REPEATS, || evaluate(&grasp.contacts, &grasp.reference, &settings, &mut self.fast));
            fast.push(us);
            let (_, us) =
                timed(REPEATS, || evaluate(&grasp.contacts, &grasp.reference, &settings, &mut self.whole));
            whole.push(us);
            if edges == 8 {
                let start = cpu_time_us();
                hull::epsilon(&mut wrenches, &["QJ"]);
                joggled.push(cpu_time_us() - start);
            }
            self.agreement.note(&found, hull);
        }
        let ratios: Vec<f64> = qhull.iter().zip(&fast).map(|(q, f)| q / f).collect();
        println!(
            "{name:<28} {:>5} {:>9.2} {:>9.2} {:>8.1} {:>8.1} {:>8.1} {:>8.0} {:>7.0} {:>7.0}",
            grasps.len(),
            median(&qhull) * 1e-3,
            median(&joggled) * 1e-3,
            median(&fast),
            quantile(&fast, 0.95),
            median(&whole),
            median(&ratios),
            quantile(&ratios, 0.05),
            quantile(&ratios, 0.0),
        );
    }
}

fn heading(title: &str) {
    println!(
        "\n{title}\n{:<28} {:>5} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7}",
        "class", "n", "Qx ms", "QJ ms", "us", "us p95", "whole us", "Qx/us", "p5", "min"
    );
}

fn main() {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let per_class = if quick { 10 } else { 100 };
    let mut bench =
        Bench { fast: Workspace::new(), whole: Workspace::whole_polytope(), agreement: Agreement::default() };
    let mut rng = ChaCha8Rng::seed_from_u64(1);

    heading("random force-closure grasps: medians of CPU time, and of the ratio per grasp");
    for edges in [8, 16] {
        for count in [3, 4, 5] {
            for friction in [0.4, 0.8] {
                let mut closed = Vec::new();
                while closed.len() < per_class {
                    let grasp = grasps::random(&mut rng, count, friction);
                    if bench.closes(&grasp, &pyramid(edges)) {
                        closed.push(grasp);
                    }
                }
                bench.row(&format!("n {count} mu {friction} m {edges}"), &closed, edges);
            }
        }
    }

    heading("no force closure, friction 0.4");
    for edges in [8, 16] {
        for count in [3, 4, 5] {
            let mut open = Vec::new();
            while open.len() < per_class {
                let grasp = grasps::random(&mut rng, count, 0.4);
                if !bench.closes(&grasp, &pyramid(edges)) {
                    open.push(grasp);
                }
            }
            bench.row(&format!("n {count} m {edges}"), &open, edges);
        }
    }

    heading("round wrench spaces, friction 0.8");
    for edges in [8, 16] {
        for count in [3, 4, 5] {
            let mut ranked = Vec::new();
            while ranked.len() < 20 * per_class {
                let grasp = grasps::random(&mut rng, count, 0.8);
                let found = evaluate(&grasp.contacts, &grasp.reference, &pyramid(edges), &mut bench.fast);
                if let Closure::Force(quality) = found {
                    ranked.push((quality.epsilon(), grasp));
                }
            }
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            let best: Vec<Grasp> = ranked.drain(..per_class).map(|(_, grasp)| grasp).collect();
            bench.row(&format!("best 5 %, n {count} m {edges}"), &best, edges);
            for (name, noise) in [("equator + 0.3", 0.3), ("equator", 0.0)] {
                let few = per_class / 3;
                let around: Vec<Grasp> =
                    (0..few).map(|_| grasps::equator(&mut rng, count, 0.8, noise)).collect();
                bench.row(&format!("{name}, n {count} m {edges}"), &around, edges);
            }
        }
    }
    exact_cones(&mut bench, &mut rng, 10 * per_class);
    ranking(&mut bench, &mut rng, 200 * per_class);
    agreement(&mut bench, &mut rng, 100 * per_class);
}

fn exact_cones(bench: &mut Bench, rng: &mut ChaCha8Rng, per_class: usize) {
    println!(
        "\nexact cones, force-closure grasps: CPU time, us\n{:<28} {:>9} {:>9} {:>9}",
        "class", "1e-3", "1e-6", "p95"
    );
    for count in [3, 4, 5] {
        for friction in [0.4, 0.8] {
            let mut times = [vec![], vec![]];
            while times[0].len() < per_class {
                let grasp = grasps::random(rng, count, friction);
                if !bench.closes(&grasp, &Settings::default()) {
                    continue;
                }
                for (tolerance, times) in [1e-3, 1e-6].into_iter().zip(&mut times) {
                    let settings = Settings { tolerance, ..Settings::default() };
                    let work = || evaluate(&grasp.contacts, &grasp.reference, &settings, &mut bench.fast);
                    let (found, us) = timed(REPEATS, work);
                    bench.agreement.unfinished += usize::from(matches!(found, Closure::Unfinished(_)));
                    times.push(us);
                }
            }
            let name = format!("n {count} mu {friction}");
            let [rough, fine] = times;
            println!(
                "{name:<28} {:>9.1} {:>9.1} {:>9.1}",
                median(&rough),
                median(&fine),
                quantile(&fine, 0.95)
            );
        }
    }
}

/// Every grasp once, as a planner meets them: how many a second when all are measured, and when only the best is wanted.
fn ranking(bench: &mut Bench, rng: &mut ChaCha8Rng, count: usize) {
    println!(
        "\nranking, friction 0.8, each grasp once: grasps/s\n{:<28} {:>9} {:>9} {:>9} {:>9}",
        "class", "closed", "all", "best", "same best"
    );
    let exact = Settings { tolerance: 1e-4, ..Settings::default() };
    for (name, settings) in [("m 8", pyramid(8)), ("exact cone 1e-4", exact)] {
        for contacts in [3, 4, 5] {
            let grasps: Vec<Grasp> = (0..count).map(|_| grasps::random(rng, contacts, 0.8)).collect();
            let mut best_of_all = (0.0, 0);
            let mut closed = 0;
            let start = cpu_time_us();
            for (at, grasp) in grasps.iter().enumerate() {
                let found = evaluate(&grasp.contacts, &grasp.reference, &settings, &mut bench.fast);
                if let Closure::Force(quality) = found {
                    closed += 1;
                    if quality.epsilon() > best_of_all.0 {
                        best_of_all = (quality.epsilon(), at);
                    }
                }
            }
            let all_us = cpu_time_us() - start;
            let mut best = (0.0, 0);
            let start = cpu_time_us();
            for (at, grasp) in grasps.iter().enumerate() {
                let found =
                    evaluate_above(&grasp.contacts, &grasp.reference, &settings, best.0, &mut bench.fast);
                if let Closure::Force(quality) = found
                    && quality.epsilon() > best.0
                {
                    best = (quality.epsilon(), at);
                }
            }
            let best_us = cpu_time_us() - start;
            let per_s = |us: f64| count as f64 / (us * 1e-6);
            println!(
                "{:<28} {:>8.0}% {:>9.0} {:>9.0} {:>9}",
                format!("n {contacts} {name}"),
                100.0 * closed as f64 / count as f64,
                per_s(all_us),
                per_s(best_us),
                best == best_of_all,
            );
        }
    }
}

/// Random, round and nearly flat grasps against Qhull, and what all comparisons of the run came to.
fn agreement(bench: &mut Bench, rng: &mut ChaCha8Rng, count: usize) {
    for trial in 0..count {
        let contacts = 3 + trial % 3;
        let friction = [0.2, 0.4, 0.8][trial / 3 % 3];
        let grasp = match trial % 20 {
            0 => grasps::equator(rng, contacts, friction, 0.3),
            1 => grasps::near_a_line(rng, contacts, friction, 10.0_f64.powi(-1 - (trial / 20 % 6) as i32)),
            _ => grasps::random(rng, contacts, friction),
        };
        let settings = pyramid(8);
        let found = evaluate(&grasp.contacts, &grasp.reference, &settings, &mut bench.fast);
        bench.agreement.note(&found, hull::epsilon(&mut hull::edge_wrenches(&grasp, 8), &[]));
    }
    let Agreement { compared, closures, qhull_failed, unfinished, beyond, worst, worst_relative } =
        bench.agreement;
    println!(
        "\nagreement with Qhull on {compared} grasps, {closures} of them closed: worst difference {worst:.1e}, relative \
         {worst_relative:.1e} (epsilon > 1e-6); {beyond} beyond 1e-9 relative + 1e-12; {unfinished} not finished; Qhull \
         gave up on {qhull_failed}"
    );
}
