//! From a posture in which pads face each other to a candidate: how far it opens, how it closes, what it is worth.

use nalgebra::{Point3, Unit, Vector3};

use super::patterns::Pattern;
use super::search::{HEIGHT_M, Search, mean};
use crate::hand::urdf::flexion;
use crate::hand::urdf::opposition::State;
use crate::hand::{Candidate, ContactKind, MAX_FINGERS, Posture};

/// Pads face each other in a preshape at least to this cosine (mean over the fingers), and while open to the second.
const FACING_MIN: f64 = 0.3;
const FACING_OPEN_MIN: f64 = 0.0;

/// The same on the mean over the closing from half to one and a half times the preshape.
const FACING_MEAN_MIN: f64 = 0.15;

/// Least range of openings, metres.
const RANGE_MIN_M: f64 = 0.012;

/// Range of openings that counts half, metres.
const RANGE_M: f64 = 0.04;

impl Search<'_> {
    /// How the used fingers stand at a posture: the opening along `line`, metres, and the mean cosine to which pads face.
    fn stand(&self, pattern: &Pattern, posture: &Posture, line: Option<&Vector3<f64>>) -> (f64, f64) {
        let own = State::new(&self.fingers[self.opposing], posture);
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
    pub(super) fn candidate(&self, pattern: &Pattern, posture: &Posture) -> Option<(Candidate, f64)> {
        let mut open = flexion::middle(self.joints);
        let mut uses = [false; MAX_FINGERS];
        for (finger, slot) in uses.iter_mut().enumerate().take(self.fingers.len()) {
            *slot = finger == self.opposing || pattern.others.contains(&finger);
        }
        // The unused first: a drive that they share is then set by the used ones.
        for is_used in [false, true] {
            for (_, chain) in self.fingers.iter().enumerate().filter(|(f, _)| uses[*f] == is_used) {
                let from = if is_used { posture } else { &open };
                let opened = flexion::open(self.joints, chain, from);
                for &joint in chain.joints() {
                    let is_closing = self.joints[joint].flexes.is_some();
                    open[joint] = if is_used && !is_closing { posture[joint] } else { opened[joint] };
                }
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
        let mut begin = (0..=9)
            .map(|k| 0.1 * f64::from(k))
            .find(|&t| self.stand(pattern, &(open + way * t), None).1 >= FACING_OPEN_MIN)?;
        while begin < 0.85
            && self.stand(pattern, &(open + way * (begin + 0.05)), None).0
                >= self.stand(pattern, &(open + way * begin), None).0
        {
            begin += 0.05;
        }
        let mut candidate = Candidate {
            name: String::new(),
            uses,
            opposing: self.opposing,
            open: open + way * begin,
            closing: way * (1.0 - begin),
            lateral_in_palm: self.lateral,
            around_rad: None,
            contact: if pattern.others.len() == 1 { ContactKind::Soft } else { ContactKind::Hard },
            wraps: false,
        };
        self.scale_closing(pattern, &mut candidate);
        let at = |s: f64| candidate.posture_at(self.joints, s);
        let own = State::new(&self.fingers[self.opposing], &at(0.0));
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
            let own = State::new(&self.fingers[self.opposing], &candidate.open);
            let others: Vec<State> =
                pattern.others.iter().map(|&f| State::new(&self.fingers[f], &candidate.open)).collect();
            (own.tip.coords - mean(&others)).try_normalize(1e-6)
        };
        let Some(line) = line else { return };
        let touch_m = 2.0 * self.fingers[self.opposing].tip_radius_m();
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
        let own = State::new(&self.fingers[self.opposing], posture);
        let others: Vec<State> =
            pattern.others.iter().map(|&f| State::new(&self.fingers[f], posture)).collect();
        let mean_of = mean(&others);
        let Some(x) = (own.tip.coords - mean_of).try_normalize(1e-6) else { return f64::INFINITY };
        let axes = self.axes(&x, &own.tip);
        let squares = others.iter().map(|state| (state.tip.coords - mean_of).dot(&axes.z).powi(2));
        (squares.sum::<f64>() / others.len() as f64).sqrt()
    }
}

/// An angle in -pi..=pi.
fn wrapped(angle_rad: f64) -> f64 {
    let turns = (angle_rad / std::f64::consts::TAU).round();
    angle_rad - turns * std::f64::consts::TAU
}
