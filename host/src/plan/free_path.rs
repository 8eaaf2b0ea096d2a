//! A way through joint space past obstacles: two trees that grow towards each other, then shortcuts.
//!
//! RRT-Connect (Kuffner and LaValle, "RRT-Connect: An Efficient Approach to Single-Query Path Planning", ICRA 2000). The
//! tree of the goals has a root for each goal, so that the first goal that can be reached is. Written here because the
//! crate for it (`rrt`) checks points, not moves, and smooths by the thread's own random numbers.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::arm::Joints;

/// Greatest length of one step of a tree, in the metric of the search.
const STEP: f64 = 0.3;

/// Shortcuts that are tried.
const SHORTCUTS: usize = 100;

/// Configurations nearer to each other than this are one.
const SAME_POINT: f64 = 1e-9;

/// Where and how to search.
pub struct Search<'a> {
    /// Whether the straight move from the first configuration to the second one is free.
    pub is_free: &'a dyn Fn(&Joints, &Joints) -> bool,
    /// Least angles to visit, rad.
    pub lower_rad: Joints,
    /// Greatest angles to visit.
    pub upper_rad: Joints,
    /// Weight of each joint in the metric, per radian: how far it moves the hand, metres.
    pub weights: Joints,
    /// Seed of the random configurations.
    pub seed: u64,
    /// Most random configurations.
    pub iterations: usize,
}

/// A tree: configurations, each with the number of its parent (a root is its own).
struct Tree {
    nodes: Vec<(Joints, usize)>,
}

/// How far a tree grew.
enum Growth {
    /// Not at all.
    Trapped,
    /// To the node of this number, towards the target.
    Advanced(usize),
    /// To the target, the node of this number.
    Reached(usize),
}

impl Search<'_> {
    /// A free path of straight moves from the start to one of the goals, both included; `None` when none was found.
    /// Start and goals have to be free themselves.
    #[must_use]
    pub fn path(&self, start: &Joints, goals: &[Joints]) -> Option<Vec<Joints>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut trees = [
            Tree { nodes: vec![(*start, 0)] },
            Tree { nodes: goals.iter().enumerate().map(|(i, goal)| (*goal, i)).collect() },
        ];
        if goals.is_empty() {
            return None;
        }
        for iteration in 0..self.iterations {
            let (grows, other) = (iteration % 2, 1 - iteration % 2);
            let drawn = std::array::from_fn(|i| {
                self.lower_rad[i] + rng.random_range(0.0..1.0) * (self.upper_rad[i] - self.lower_rad[i])
            });
            let new = match self.grow(&mut trees[grows], &drawn) {
                Growth::Trapped => continue,
                Growth::Advanced(new) | Growth::Reached(new) => new,
            };
            let target = trees[grows].nodes[new].0;
            if let Some(met) = self.connect(&mut trees[other], &target) {
                let (from_start, from_goal) = if grows == 0 { (new, met) } else { (met, new) };
                let mut path = trees[0].to_root(from_start);
                path.reverse();
                // Both branches hold the configuration where they meet.
                path.extend(trees[1].to_root(from_goal).into_iter().skip(1));
                return Some(self.shortened(path, &mut rng));
            }
        }
        None
    }

    /// One step towards a configuration.
    fn grow(&self, tree: &mut Tree, towards: &Joints) -> Growth {
        let nearest = (0..tree.nodes.len())
            .map(|n| (n, self.distance(&tree.nodes[n].0, towards)))
            .reduce(|a, b| if b.1 < a.1 { b } else { a });
        let Some((parent, distance)) = nearest else { return Growth::Trapped };
        let from = tree.nodes[parent].0;
        let share = (STEP / distance).min(1.0);
        let is_whole = share >= 1.0;
        let to = if is_whole { *towards } else { between(&from, towards, share) };
        if distance <= SAME_POINT {
            return Growth::Reached(parent);
        }
        if !(self.is_free)(&from, &to) {
            return Growth::Trapped;
        }
        tree.nodes.push((to, parent));
        let new = tree.nodes.len() - 1;
        if is_whole { Growth::Reached(new) } else { Growth::Advanced(new) }
    }

    /// Steps towards a configuration until it is reached (its node) or the way is blocked.
    fn connect(&self, tree: &mut Tree, target: &Joints) -> Option<usize> {
        loop {
            match self.grow(tree, target) {
                Growth::Trapped => return None,
                Growth::Advanced(_) => {}
                Growth::Reached(node) => return Some(node),
            }
        }
    }

    /// The path with detours cut off: free straight moves between random places replace what lies between them.
    fn shortened(&self, mut path: Vec<Joints>, rng: &mut ChaCha8Rng) -> Vec<Joints> {
        for _ in 0..SHORTCUTS {
            let moves = path.len() - 1;
            if moves < 2 {
                break;
            }
            let mut places = [0.0; 2].map(|_: f64| rng.random_range(0.0..moves as f64));
            places.sort_by(f64::total_cmp);
            let [first, last] = places.map(|place| (place as usize).min(moves - 1));
            if first == last {
                continue;
            }
            let [from, to] = [(first, places[0]), (last, places[1])]
                .map(|(n, place)| between(&path[n], &path[n + 1], place - n as f64));
            let before: f64 = self.distance(&from, &path[first + 1])
                + path[first + 1..=last]
                    .windows(2)
                    .map(|pair| self.distance(&pair[0], &pair[1]))
                    .sum::<f64>()
                + self.distance(&path[last], &to);
            if self.distance(&from, &to) < before - SAME_POINT && (self.is_free)(&from, &to) {
                path.splice(first + 1..=last, [from, to]);
            }
        }
        path
    }

    fn distance(&self, a: &Joints, b: &Joints) -> f64 {
        (0..6).map(|i| (self.weights[i] * (a[i] - b[i])).powi(2)).sum::<f64>().sqrt()
    }
}

impl Tree {
    /// Configurations from a node to its root.
    fn to_root(&self, node: usize) -> Vec<Joints> {
        let mut path = vec![self.nodes[node].0];
        let mut at = node;
        while self.nodes[at].1 != at {
            at = self.nodes[at].1;
            path.push(self.nodes[at].0);
        }
        path
    }
}

fn between(a: &Joints, b: &Joints, share: f64) -> Joints {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall at joint 1 = 0 with a gap where joint 2 is above 0.5.
    fn wall_is_clear(a: &Joints, b: &Joints) -> bool {
        // The part of the move inside the wall's thickness, and joint 2 at its ends.
        let cross = |x: f64| (x - a[0]) / (b[0] - a[0]);
        let [low, high] = if a[0] == b[0] {
            if a[0].abs() > 0.1 {
                return true;
            }
            [0.0, 1.0]
        } else {
            let [s, t] = [cross(-0.1), cross(0.1)];
            [s.min(t).max(0.0), s.max(t).min(1.0)]
        };
        low > high || [low, high].iter().all(|&share| between(a, b, share)[1] > 0.5)
    }

    fn search<'a>(is_free: &'a dyn Fn(&Joints, &Joints) -> bool, seed: u64) -> Search<'a> {
        Search {
            is_free,
            lower_rad: [-1.0; 6],
            upper_rad: [1.0; 6],
            weights: [1.0; 6],
            seed,
            iterations: 2000,
        }
    }

    const LEFT: Joints = [-0.7, 0.0, 0.1, 0.0, 0.0, 0.2];
    const RIGHT: Joints = [0.6, -0.2, 0.0, 0.0, 0.3, 0.0];

    #[test]
    fn a_wall_is_passed_through_its_gap_and_the_way_is_short() {
        let length = |path: &[Joints]| {
            path.windows(2).map(|p| search(&wall_is_clear, 0).distance(&p[0], &p[1])).sum::<f64>()
        };
        for seed in 0..20 {
            let path = search(&wall_is_clear, seed).path(&LEFT, &[RIGHT]).unwrap();
            assert_eq!((path[0], path[path.len() - 1]), (LEFT, RIGHT));
            assert!(path.windows(2).all(|pair| wall_is_clear(&pair[0], &pair[1])));
            // In joints 1 and 2 alone, by hand: 0.78 to the near corner of the gap, 0.2 through it, 0.86 on.
            assert!(length(&path) > 1.9 && length(&path) < 3.2, "{}", length(&path));
            assert_eq!(search(&wall_is_clear, seed).path(&LEFT, &[RIGHT]), Some(path), "the seed decides");
        }
    }

    #[test]
    fn of_several_goals_one_that_can_be_reached_is() {
        // A closed box about the first goal.
        let boxed = |a: &Joints, b: &Joints| {
            let inside = |q: &Joints| (0..6).all(|i| (q[i] - RIGHT[i]).abs() < 0.2);
            let wall = |q: &Joints| (0..6).all(|i| (q[i] - RIGHT[i]).abs() < 0.3) && !inside(q);
            (0..=200).all(|i| !wall(&between(a, b, f64::from(i) / 200.0)))
        };
        let second = [0.0, 0.9, 0.9, 0.0, 0.0, 0.0];
        let path = search(&boxed, 3).path(&LEFT, &[RIGHT, second]).unwrap();
        assert_eq!(path[path.len() - 1], second);
        let few = Search { iterations: 100, ..search(&boxed, 3) };
        assert_eq!(few.path(&LEFT, &[RIGHT]), None);
        assert_eq!(few.path(&LEFT, &[]), None);
    }
}
