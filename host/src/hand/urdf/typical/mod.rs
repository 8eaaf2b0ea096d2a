//! Typical grasps of any hand: for sets of fingers, postures in which their pads face that of the opposing finger.
//!
//! The joints of every finger are sampled; for each state of the opposing finger the others take the states that stand
//! best against it, in parallel as on a bar or around a centre as on a ball. The best of each kind are refined, opened as
//! wide as their pads still face each other, and kept when the range of openings is worth it.

mod patterns;
mod search;
mod shaping;

use nalgebra::{Unit, Vector3};

use super::flexion;
use super::opposition::{lateral, root, settings, shared};
use crate::hand::{Candidate, ContactKind, Finger, Joint, Posture};
use patterns::{Pattern, pairs, patterns};
use search::Search;

/// Most candidates, the power grasp not counted.
const MAX_CANDIDATES: usize = 15;

/// Starts of each pattern that are refined.
const STARTS: usize = 6;

/// A second setting of the same fingers is kept when its score is at least this share of the best.
const SECOND_SHARE: f64 = 0.75;

/// A candidate with how good it is.
struct Scored {
    candidate: Candidate,
    score: f64,
    pattern: usize,
}

/// Candidates, best first. Empty when no pads face each other. Finger 0 opposes the others; beside it, pairs of these.
pub(super) fn candidates(joints: &[Joint], fingers: &[Finger]) -> Vec<Candidate> {
    let across = lateral(joints, fingers, 0);
    // Fingers that face each other along the lateral direction have theirs across it.
    let of_pairs = Unit::try_new(Vector3::z().cross(&across), 1e-3).unwrap_or(across);
    let of_first = patterns(fingers.len(), |finger| root(&fingers[finger]).dot(&across));
    let mut searches = vec![(Search::new(joints, fingers, 0, across), of_first)];
    for (opposing, pattern) in pairs(fingers.len()) {
        searches.push((Search::new(joints, fingers, opposing, of_pairs), vec![pattern]));
    }
    let settings = settings(joints, &shared(joints, fingers));
    let mut scored: Vec<Scored> = Vec::new();
    let mut patterns_before = 0;
    for (search, patterns) in &searches {
        for (index, candidate, score) in best_of(search, patterns, &settings) {
            scored.push(Scored { candidate, score, pattern: patterns_before + index });
        }
        patterns_before += patterns.len();
    }
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    named(fingers, selected(joints, scored))
}

/// Candidates of one search with their patterns and scores.
fn best_of(search: &Search, patterns: &[Pattern], settings: &[Posture]) -> Vec<(usize, Candidate, f64)> {
    let mut starts: Vec<(f64, usize, Posture, f64)> = Vec::new();
    for setting in settings {
        search.starts(setting, patterns, &mut starts);
    }
    starts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut found = Vec::new();
    for (index, pattern) in patterns.iter().enumerate() {
        // The best starts, and no more: refining costs.
        for (_, _, posture, opening_m) in starts.iter().filter(|start| start.1 == index).take(STARTS) {
            let refined = search.refined(pattern, posture, *opening_m);
            if let Some((candidate, score)) = search.candidate(pattern, &refined) {
                found.push((index, candidate, score));
            }
        }
    }
    found
}

/// The best of each pattern, then their seconds where they differ, best first.
fn selected(joints: &[Joint], scored: Vec<Scored>) -> Vec<Scored> {
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
