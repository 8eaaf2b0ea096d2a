//! Typical grasps of any hand: for sets of fingers, postures in which their pads face that of the opposing finger.
//!
//! The joints of every finger are sampled; for each state of the opposing finger the others take the states that stand
//! best against it, in parallel as on a bar or around a centre as on a ball. The best of each kind are refined, opened as
//! wide as their pads still face each other, and kept when the range of openings is worth it.

use nalgebra::{Point3, Unit, Vector3};

use super::flexion;
use super::opposition::{State, combined, lateral, places, root, settings, shared, turning};
use crate::hand::{Candidate, ContactKind, Finger, Joint, MAX_FINGERS, Posture};

/// Most candidates, the power grasp not counted.
pub(super) const MAX_CANDIDATES: usize = 15;

/// Distances of the tips in a preshape that are looked at, as shares of a finger's length, beside the tips' radii.
const OPENINGS: [f64; 2] = [0.25, 0.45];

/// Deviations that cost as much as pads 60 degrees off: of the distance, and of the height over the common plane, metres.
const DISTANCE_M: f64 = 0.03;
const HEIGHT_M: f64 = 0.02;

/// Pads face each other in a preshape at least to this cosine (mean over the fingers), and while open to the second.
const FACING_MIN: f64 = 0.3;
const FACING_OPEN_MIN: f64 = 0.0;

/// The same on the mean over the closing from half to one and a half times the preshape.
const FACING_MEAN_MIN: f64 = 0.15;

/// Least range of openings, metres.
const RANGE_MIN_M: f64 = 0.012;

/// Range of openings that counts half, metres.
const RANGE_M: f64 = 0.04;

/// A second setting of the same fingers is kept when its score is at least this share of the best.
const SECOND_SHARE: f64 = 0.75;

/// How a set of fingers stands against the opposing one. The set without that one, in order along the lateral direction.
#[derive(Debug, Clone)]
struct Pattern {
    others: Vec<usize>,
    /// Angles around the centre from the opposing finger towards the lateral direction, by finger; `None` in parallel.
    around_rad: Option<Vec<f64>>,
}

/// A candidate with how good it is.
struct Scored {
    candidate: Candidate,
    score: f64,
    pattern: usize,
}

/// What does not change while candidates are looked for. Finger 0 opposes.
struct Search<'a> {
    joints: &'a [Joint],
    fingers: &'a [Finger],
    lateral: Unit<Vector3<f64>>,
    /// Mean of the fingers' roots, palm frame.
    roots: Vector3<f64>,
    length_m: f64,
}

/// Candidates, best first. Empty when no pads face each other.
pub(super) fn candidates(joints: &[Joint], fingers: &[Finger]) -> Vec<Candidate> {
    let search = Search::new(joints, fingers);
    let patterns = patterns(fingers.len(), |finger| root(&fingers[finger]).dot(&search.lateral));
    let shared = shared(joints, fingers);
    let mut scored: Vec<Scored> = Vec::new();
    let mut starts: Vec<(f64, usize, Posture, f64)> = Vec::new();
    for setting in settings(joints, &shared) {
        search.starts(&setting, &shared, &patterns, &mut starts);
    }
    starts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (index, pattern) in patterns.iter().enumerate() {
        // The best start of some settings, and no more: refining costs.
        for (_, _, posture, opening_m) in starts.iter().filter(|start| start.1 == index).take(6) {
            let refined = search.refined(pattern, posture, *opening_m);
            if let Some((candidate, score)) = search.candidate(pattern, &refined) {
                scored.push(Scored { candidate, score, pattern: index });
            }
        }
    }
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    named(fingers, selected(joints, &patterns, scored))
}

/// The best of each pattern, then their seconds where they differ, best first.
fn selected(joints: &[Joint], patterns: &[Pattern], scored: Vec<Scored>) -> Vec<Scored> {
    let mut kept: Vec<Scored> = Vec::new();
    let mut seconds: Vec<Scored> = Vec::new();
    for next in scored {
        let best = kept.iter().find(|other| other.pattern == next.pattern);
        let differs = |other: &Scored| {
            let a = other.candidate.posture_at(joints, 1.0);
            let b = next.candidate.posture_at(joints, 1.0);
            joints.iter().enumerate().any(|(i, joint)| {
                let range = (joint.upper_rad - joint.lower_rad).max(1e-9);
                joint.flexes.is_none() && (a[i] - b[i]).abs() > 0.3 * range
            })
        };
        match best {
            None => kept.push(next),
            Some(best) => {
                let is_new = seconds.iter().filter(|s| s.pattern == next.pattern).count() == 0;
                if is_new && next.score >= SECOND_SHARE * best.score && differs(best) {
                    seconds.push(next);
                }
            }
        }
    }
    debug_assert!(kept.len() <= patterns.len());
    kept.truncate(MAX_CANDIDATES);
    seconds.truncate(MAX_CANDIDATES - kept.len());
    kept.append(&mut seconds);
    kept.sort_by(|a, b| b.score.total_cmp(&a.score));
    kept
}

fn named(fingers: &[Finger], scored: Vec<Scored>) -> Vec<Candidate> {
    let mut candidates: Vec<Candidate> = Vec::new();
    for Scored { mut candidate, .. } in scored {
        let count = candidate.finger_count();
        let who = if count == fingers.len() && count > 2 {
            "all".to_owned()
        } else {
            let names: Vec<&str> = candidate.fingers().map(|f| fingers[f].name.as_str()).collect();
            names.join("-")
        };
        let how = match (count, candidate.around_rad) {
            (2, _) => "pinch",
            (_, Some(_)) => "radial",
            (_, None) => "parallel",
        };
        let name = format!("{who}-{how}");
        let same = candidates.iter().filter(|other| other.name.starts_with(&name)).count();
        candidate.name = if same == 0 { name } else { format!("{name}-{}", same + 1) };
        candidates.push(candidate);
    }
    candidates
}

/// Sets of fingers beside finger 0, in parallel and around a centre.
fn patterns(fingers: usize, along: impl Fn(usize) -> f64) -> Vec<Pattern> {
    let others: Vec<usize> = (1..fingers).collect();
    let n = others.len();
    let mut sets: Vec<Vec<usize>> = vec![others.clone()];
    for size in [3, 2, 1] {
        if size >= n {
            continue;
        }
        for first in 0..=n - size {
            sets.push(others[first..first + size].to_vec());
        }
        if size == 2 {
            sets.push(vec![others[0], others[n - 1]]);
        }
    }
    sets.dedup();
    let mut patterns = Vec::new();
    for set in sets {
        patterns.push(Pattern { others: set.clone(), around_rad: None });
        if set.len() > 1 {
            // Evenly over an arc that grows with their number, the one farthest along the lateral direction first.
            let mut ranks: Vec<usize> = (0..set.len()).collect();
            ranks.sort_by(|&a, &b| along(set[b]).total_cmp(&along(set[a])));
            let arc_rad = (120.0 + 20.0 * (set.len() - 2) as f64).min(180.0).to_radians();
            let mut around_rad = vec![0.0; set.len()];
            for (rank, &place) in ranks.iter().enumerate() {
                let share = rank as f64 / (set.len() - 1) as f64;
                around_rad[place] = std::f64::consts::PI + arc_rad * (share - 0.5);
            }
            patterns.push(Pattern { others: set, around_rad: Some(around_rad) });
        }
    }
    patterns
}

/// Axes at an opposing finger: from the others to it, lateral, and away from the palm.
struct Axes {
    x: Vector3<f64>,
    lateral: Vector3<f64>,
    z: Vector3<f64>,
}

impl<'a> Search<'a> {
    fn new(joints: &'a [Joint], fingers: &'a [Finger]) -> Self {
        let middle = flexion::middle(joints);
        let count = fingers.len() as f64;
        let length_m = |finger: &Finger| {
            let open = State::new(finger, &flexion::open(joints, finger, &middle));
            (open.tip.coords - root(finger)).norm()
        };
        Self {
            joints,
            fingers,
            lateral: lateral(joints, fingers, 0),
            roots: fingers.iter().map(root).sum::<Vector3<f64>>() / count,
            length_m: fingers.iter().map(length_m).sum::<f64>() / count,
        }
    }

    fn axes(&self, x: &Vector3<f64>, center: &Point3<f64>) -> Axes {
        let lateral = self.lateral.into_inner();
        let lateral = (lateral - x * x.dot(&lateral)).try_normalize(1e-6).unwrap_or(lateral);
        let z = x.cross(&lateral);
        let is_away = z.dot(&(center.coords - self.roots)) >= 0.0;
        Axes { x: *x, lateral, z: if is_away { z } else { -z } }
    }

    /// States of a finger over a setting: its turning joints and its closing joints on a grid.
    fn states(&self, finger: usize, setting: &Posture, shared: &[usize]) -> Vec<(usize, State)> {
        let chain = &self.fingers[finger];
        let turning = turning(self.joints, chain, shared);
        let n = if turning.len() < 3 { 5 } else { 3 };
        let mut turned: Vec<(usize, Posture)> = vec![(0, *setting)];
        for (k, &joint) in turning.iter().take(3).enumerate() {
            let values = places(&self.joints[joint], n);
            turned = turned
                .iter()
                .flat_map(|(bucket, posture)| {
                    combined(&[*posture], joint, &values)
                        .into_iter()
                        .enumerate()
                        .map(move |(place, posture)| (if k == 0 { place } else { *bucket }, posture))
                })
                .collect();
        }
        let flexing = flexion::flexing_joints(self.joints, chain);
        let mut states = Vec::new();
        for (bucket, posture) in &turned {
            let open = flexion::open(self.joints, chain, posture);
            let closed = flexion::closed(self.joints, chain, posture);
            let mut postures = vec![open];
            for (k, &joint) in flexing.iter().take(3).enumerate() {
                let n = match (flexing.len(), k) {
                    (1, _) => 14,
                    (2, 0) => 8,
                    (2, _) => 5,
                    (_, 0) => 6,
                    _ => 4,
                };
                let value = |k: usize| {
                    let share = 0.03 + 0.82 * k as f64 / f64::from(n - 1);
                    open[joint] + (closed[joint] - open[joint]) * share
                };
                let values: Vec<f64> = (0..n as usize).map(value).collect();
                postures = combined(&postures, joint, &values);
            }
            states.extend(postures.iter().map(|posture| (*bucket, State::new(chain, posture))));
        }
        states
    }

    /// The cheapest start of each pattern for each place of the opposing finger's first turning joint.
    fn starts(
        &self,
        setting: &Posture,
        shared: &[usize],
        patterns: &[Pattern],
        starts: &mut Vec<(f64, usize, Posture, f64)>,
    ) {
        let states: Vec<Vec<(usize, State)>> =
            (0..self.fingers.len()).map(|finger| self.states(finger, setting, shared)).collect();
        let one_drive = self.one_drive();
        let mut best: Vec<Vec<Option<(f64, Posture, f64)>>> = vec![vec![None; 5]; patterns.len()];
        for (bucket, own) in &states[0] {
            let slant = own.pad.dot(&self.lateral).powi(2);
            // Turned away from the others: nothing stands against it.
            if slant > 0.5 {
                continue;
            }
            for share in OPENINGS {
                let opening_m = share * self.length_m + 2.0 * self.fingers[0].tip_radius_m();
                let center = own.tip + own.pad * (0.5 * opening_m);
                let axes = self.axes(&-own.pad, &center);
                let mut known: Vec<(usize, f64, (f64, usize))> = Vec::new();
                for (index, pattern) in patterns.iter().enumerate() {
                    let mut cost = 1.5 * slant;
                    let mut posture = own.posture;
                    let mut aside_m = 0.0;
                    for (k, &finger) in pattern.others.iter().enumerate() {
                        let angle = pattern.around_rad.as_ref().map_or(f64::NAN, |around| around[k]);
                        let same = |entry: &&(usize, f64, (f64, usize))| {
                            entry.0 == finger && entry.1.to_bits() == angle.to_bits()
                        };
                        let found = known.iter().find(same).map(|entry| entry.2);
                        let (least, state) = found.unwrap_or_else(|| {
                            let around = pattern.around_rad.as_ref().map(|around| around[k]);
                            let costs = states[finger].iter().enumerate().map(|(i, (_, state))| {
                                let conflict =
                                    one_drive.iter().any(|&j| state.posture[j] != own.posture[j]);
                                let cost = self.cost(own, state, &axes, opening_m, around);
                                (if conflict { f64::INFINITY } else { cost }, i)
                            });
                            let least = costs.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0));
                            known.push((finger, angle, least));
                            least
                        });
                        cost += least / pattern.others.len() as f64;
                        let Some((_, state)) = states[finger].get(state) else { continue };
                        aside_m += (state.tip - own.tip).dot(&axes.lateral) / pattern.others.len() as f64;
                        for &joint in self.fingers[finger].joints() {
                            posture[joint] = state.posture[joint];
                        }
                    }
                    cost += 0.3 * (aside_m / DISTANCE_M).powi(2).min(4.0);
                    let slot = &mut best[index][(*bucket).min(4)];
                    if cost.is_finite() && slot.as_ref().is_none_or(|(least, ..)| cost < *least) {
                        *slot = Some((cost, posture, opening_m));
                    }
                }
            }
        }
        for (index, slots) in best.into_iter().enumerate() {
            starts.extend(slots.into_iter().flatten().map(|(cost, posture, m)| (cost, index, posture, m)));
        }
    }

    /// Joints that close more than one finger.
    fn one_drive(&self) -> Vec<usize> {
        let count = |joint: usize| self.fingers.iter().filter(|f| f.joints().contains(&joint)).count();
        (0..self.joints.len()).filter(|&j| self.joints[j].flexes.is_some() && count(j) > 1).collect()
    }

    /// What is wrong with a finger's state against an opposing one: 0 nothing.
    fn cost(&self, own: &State, state: &State, axes: &Axes, opening_m: f64, around_rad: Option<f64>) -> f64 {
        let to = state.tip - own.tip;
        let height = (to.dot(&axes.z) / HEIGHT_M).powi(2);
        match around_rad {
            None => {
                let off = ((-to.dot(&axes.x) - opening_m) / DISTANCE_M).powi(2);
                1.0 - state.pad.dot(&axes.x) + (0.5 * (off + height)).min(4.0)
            }
            Some(angle) => {
                let (sin, cos) = angle.sin_cos();
                let outward = axes.x * cos + axes.lateral * sin;
                let wanted = (outward - axes.x) * (0.5 * opening_m);
                let off = (to - wanted) - axes.z * (to - wanted).dot(&axes.z);
                1.0 + state.pad.dot(&outward) + (0.5 * (off.norm_squared() / HEIGHT_M.powi(2) + height)).min(4.0)
            }
        }
    }

    /// The whole cost of a posture, with the axes from its own tips.
    fn total(&self, pattern: &Pattern, posture: &Posture, opening_m: f64) -> f64 {
        let own = State::new(&self.fingers[0], posture);
        let others: Vec<State> =
            pattern.others.iter().map(|&finger| State::new(&self.fingers[finger], posture)).collect();
        let mean = mean(&others);
        let Some(x) = (own.tip.coords - mean).try_normalize(1e-6) else { return f64::INFINITY };
        let center = Point3::from(0.5 * (own.tip.coords + mean));
        let axes = self.axes(&x, &center);
        let mut cost = 2.0 * (1.0 + own.pad.dot(&x)) + 1.5 * x.dot(&self.lateral).powi(2);
        for (k, state) in others.iter().enumerate() {
            let around = pattern.around_rad.as_ref().map(|around| around[k]);
            cost += self.cost(&own, state, &axes, opening_m, around) / others.len() as f64;
        }
        // Little, so that joints that change nothing stay in the middle.
        for &finger in std::iter::once(&0).chain(&pattern.others) {
            for &joint in self.fingers[finger].joints() {
                let limits = &self.joints[joint];
                let half = 0.5 * (limits.upper_rad - limits.lower_rad);
                let off = (posture[joint] - 0.5 * (limits.lower_rad + limits.upper_rad)) / half.max(1e-9);
                cost += 0.02 * off.powi(2);
            }
        }
        cost
    }

    /// Joint by joint downhill, with steps from a tenth of the range to a two-hundredth.
    fn refined(&self, pattern: &Pattern, from: &Posture, opening_m: f64) -> Posture {
        let mut joints: Vec<usize> = Vec::new();
        for &finger in std::iter::once(&0).chain(&pattern.others) {
            for &joint in self.fingers[finger].joints() {
                if !joints.contains(&joint) {
                    joints.push(joint);
                }
            }
        }
        let mut best = *from;
        let mut least = self.total(pattern, &best, opening_m);
        for share in [0.1, 0.05, 0.02, 0.01, 0.005] {
            for _ in 0..3 {
                for &joint in &joints {
                    let limits = &self.joints[joint];
                    let step = share * (limits.upper_rad - limits.lower_rad);
                    for sign in [-1.0, 1.0] {
                        let mut tried = best;
                        tried[joint] =
                            (tried[joint] + sign * step).clamp(limits.lower_rad, limits.upper_rad);
                        let cost = self.total(pattern, &tried, opening_m);
                        if cost < least - 1e-9 {
                            (best, least) = (tried, cost);
                        }
                    }
                }
            }
        }
        best
    }

    /// How the used fingers stand at a posture: the opening along `line`, metres, and the mean cosine to which pads face.
    fn stand(&self, pattern: &Pattern, posture: &Posture, line: Option<&Vector3<f64>>) -> (f64, f64) {
        let own = State::new(&self.fingers[0], posture);
        let others: Vec<State> =
            pattern.others.iter().map(|&finger| State::new(&self.fingers[finger], posture)).collect();
        let across = own.tip.coords - mean(&others);
        let Some(x) = across.try_normalize(1e-6) else { return (0.0, 0.0) };
        let axes = self.axes(&x, &own.tip);
        let faced = |(k, state): (usize, &State)| match &pattern.around_rad {
            None => state.pad.dot(&x),
            Some(around) => {
                let (sin, cos) = around[k].sin_cos();
                -state.pad.dot(&(x * cos + axes.lateral * sin))
            }
        };
        let others_face = others.iter().enumerate().map(faced).sum::<f64>() / others.len() as f64;
        (across.dot(line.unwrap_or(&x)), others_face.min(-own.pad.dot(&x)))
    }

    /// The candidate whose preshape is `posture`, and its score; `None` when its pads do not face, or over too small a
    /// range.
    fn candidate(&self, pattern: &Pattern, posture: &Posture) -> Option<(Candidate, f64)> {
        let mut open = flexion::middle(self.joints);
        let mut uses = [false; MAX_FINGERS];
        // The unused first: a drive that they share is then set by the used ones.
        for finger in 0..self.fingers.len() {
            uses[finger] = finger == 0 || pattern.others.contains(&finger);
        }
        for is_used in [false, true] {
            for (finger, chain) in self.fingers.iter().enumerate().filter(|(f, _)| uses[*f] == is_used) {
                let from = if is_used { posture } else { &open };
                let opened = flexion::open(self.joints, chain, from);
                for &joint in chain.joints() {
                    let is_closing = self.joints[joint].flexes.is_some();
                    open[joint] = if is_used && !is_closing { posture[joint] } else { opened[joint] };
                }
                debug_assert!(finger < MAX_FINGERS);
            }
        }
        let mut preshape = open;
        for finger in (0..self.fingers.len()).filter(|&finger| uses[finger]) {
            for &joint in self.fingers[finger].joints() {
                preshape[joint] = posture[joint];
            }
        }
        // As open as pads still face, and as the opening still falls.
        let way = preshape - open;
        let (_, preshape_faces) = self.stand(pattern, &preshape, None);
        if preshape_faces < FACING_MIN {
            return None;
        }
        let mut begin = (0..=9).map(|k| 0.1 * f64::from(k)).find(|&t| {
            self.stand(pattern, &(open + way * t), None).1 >= FACING_OPEN_MIN.min(preshape_faces)
        })?;
        while begin < 0.85
            && self.stand(pattern, &(open + way * (begin + 0.05)), None).0
                >= self.stand(pattern, &(open + way * begin), None).0
        {
            begin += 0.05;
        }
        let mut candidate = Candidate {
            name: String::new(),
            uses,
            opposing: 0,
            open: open + way * begin,
            closing: way * (1.0 - begin),
            lateral_in_palm: self.lateral,
            around_rad: None,
            contact: if pattern.others.len() == 1 { ContactKind::Soft } else { ContactKind::Hard },
            wraps: false,
        };
        self.scale_closing(pattern, &mut candidate);
        let at = |s: f64| candidate.posture_at(self.joints, s);
        let own = State::new(&self.fingers[0], &at(0.0));
        let others: Vec<State> =
            pattern.others.iter().map(|&f| State::new(&self.fingers[f], &at(0.0))).collect();
        let line = (own.tip.coords - mean(&others)).try_normalize(1e-6)?;
        let opening_m = |s: f64| self.stand(pattern, &at(s), Some(&line)).0;
        let range_m = opening_m(0.0) - opening_m(2.0).max(0.0);
        let facing = [0.5, 1.0, 1.5].map(|s| self.stand(pattern, &at(s), None).1).iter().sum::<f64>() / 3.0;
        let heights = self.unevenness_m(pattern, &at(1.0));
        if range_m < RANGE_MIN_M || facing < FACING_MEAN_MIN {
            return None;
        }
        // y of the grasp frame makes z point away from the palm.
        let center = Point3::from(0.5 * (own.tip.coords + mean(&others)));
        let lateral = self.lateral.into_inner();
        let is_along = line.cross(&lateral).dot(&(center.coords - self.roots)) >= 0.0;
        let sign = if is_along { 1.0 } else { -1.0 };
        candidate.lateral_in_palm = Unit::new_unchecked(lateral * sign);
        candidate.around_rad = pattern.around_rad.as_ref().map(|around| {
            let mut by_finger = [0.0; MAX_FINGERS];
            for (&finger, angle) in pattern.others.iter().zip(around) {
                by_finger[finger] = wrapped(sign * angle);
            }
            by_finger
        });
        let score = facing * range_m / (range_m + RANGE_M) * (1.0 + 0.1 * (pattern.others.len() - 1) as f64)
            / (1.0 + heights / HEIGHT_M);
        Some((candidate, score))
    }

    /// Scales the closing so that tips meet, or come as near as they do, at twice the preshape: openings are looked for
    /// up to there.
    fn scale_closing(&self, pattern: &Pattern, candidate: &mut Candidate) {
        let line = {
            let own = State::new(&self.fingers[0], &candidate.open);
            let others: Vec<State> =
                pattern.others.iter().map(|&f| State::new(&self.fingers[f], &candidate.open)).collect();
            (own.tip.coords - mean(&others)).try_normalize(1e-6)
        };
        let Some(line) = line else { return };
        let touch_m = 2.0 * self.fingers[0].tip_radius_m();
        let (mut nearest, mut meeting) = (f64::INFINITY, 2.0);
        for k in 1..=60 {
            let s = 0.1 * f64::from(k);
            let (opening_m, _) = self.stand(pattern, &candidate.posture_at(self.joints, s), Some(&line));
            if opening_m < nearest - 1e-5 {
                (nearest, meeting) = (opening_m, s);
            } else {
                break;
            }
            if opening_m < 0.8 * touch_m {
                break;
            }
        }
        candidate.closing = candidate.closing * (0.5 * meeting);
    }

    /// Root mean square height of the tips over their common plane, metres.
    fn unevenness_m(&self, pattern: &Pattern, posture: &Posture) -> f64 {
        let own = State::new(&self.fingers[0], posture);
        let others: Vec<State> =
            pattern.others.iter().map(|&f| State::new(&self.fingers[f], posture)).collect();
        let mean_of = mean(&others);
        let Some(x) = (own.tip.coords - mean_of).try_normalize(1e-6) else { return f64::INFINITY };
        let axes = self.axes(&x, &own.tip);
        let squares = others.iter().map(|state| (state.tip.coords - mean_of).dot(&axes.z).powi(2));
        (squares.sum::<f64>() / others.len() as f64).sqrt()
    }
}

fn mean(states: &[State]) -> Vector3<f64> {
    states.iter().map(|state| state.tip.coords).sum::<Vector3<f64>>() / states.len().max(1) as f64
}

/// An angle in -pi..=pi.
fn wrapped(angle_rad: f64) -> f64 {
    let turns = (angle_rad / std::f64::consts::TAU).round();
    angle_rad - turns * std::f64::consts::TAU
}

/// The power grasp: all fingers from where they stand widest, every closing joint to its end.
pub(super) fn power(joints: &[Joint], fingers: &[Finger], candidates: &[Candidate]) -> Option<Candidate> {
    let all = |candidate: &&Candidate| candidate.finger_count() == fingers.len();
    let widest = candidates
        .iter()
        .filter(all)
        .find(|candidate| candidate.around_rad.is_none())
        .or_else(|| candidates.iter().find(all))?;
    let mut closed = widest.open;
    for finger in fingers {
        closed = flexion::closed(joints, finger, &closed);
    }
    Some(Candidate {
        name: "power".to_owned(),
        // At 2 closed, at 1 half closed.
        closing: (closed - widest.open) * 0.5,
        around_rad: None,
        contact: ContactKind::Hard,
        wraps: true,
        ..widest.clone()
    })
}
