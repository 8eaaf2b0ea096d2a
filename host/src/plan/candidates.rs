//! The eight typical candidate grasps that the search starts from.
//!
//! The 2005 system names "four-finger, three-finger, nip, etc."; the set here is this project's reading of that, laid
//! over the precision rows of the GRASP taxonomy (Feix et al. 2016) that a thumb with three fingers can make. Spreads,
//! preshapes and size ranges are engineering choices, the ranges computed from the hand's kinematics.

use hand_model::FingerAngles;
use protocol::ids::FingerId;

/// Torsional friction of a soft tip, as the length e in `mu * sqrt(|f_t|^2 + (tau / e)^2)`, metres. 3 mm is the middle
/// of 2..4 mm for rubber tips under a few newtons; contact radius grows with force (Xydas and Kao 1999).
pub const SOFT_TIP_TORSION_M: f64 = 0.003;

/// How the used fingers touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactKind {
    /// Point contact with friction, as the 2005 system assumes.
    Hard,
    /// Soft finger: friction resists torsion about the normal too. Two point contacts can turn about the line through
    /// them, so grasps with two fingers are force closure only with this.
    Soft,
}

/// One typical grasp: which fingers, how they are spread and shaped before they close.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Name, as in the plan document.
    pub name: &'static str,
    /// Which fingers close, by [`FingerId::index`].
    pub uses: [bool; 4],
    /// Thumb rotation, rad.
    pub thumb_rotation_rad: f64,
    /// Abduction by finger, rad.
    pub abduction_rad: [f64; 4],
    /// Flexion and middle angle of the three fingers in the preshape, rad.
    pub fingers_rad: [f64; 2],
    /// Flexion and middle angle of the thumb in the preshape, rad.
    pub thumb_rad: [f64; 2],
    /// For hands that close towards one point, as on a ball or a rim: where the tips are to stand around it, as angles
    /// from the thumb's direction towards the index's side, rad, by finger. The fingers spread as near to these as
    /// their abduction lets them. `None` for hands that close in parallel, as on a bar.
    pub around_rad: Option<[f64; 4]>,
    /// Contact model.
    pub contact: ContactKind,
}

/// Posture of a finger that is stretched out of the way, and of every finger before it closes: abduction 0, flexion 0,
/// middle 10 degrees (the rest posture of published planners for this hand).
#[must_use]
pub fn open_finger(abduction_rad: f64) -> FingerAngles<f64> {
    FingerAngles { abduction_rad, flexion_rad: 0.0, middle_rad: 10f64.to_radians() }
}

impl Candidate {
    /// Number of fingers that close.
    #[must_use]
    pub fn finger_count(&self) -> usize {
        self.uses.iter().filter(|&&used| used).count()
    }

    /// Joint angles of a used finger at closing fraction `s`: 0 is [`open_finger`], 1 is the preshape, and beyond 1 the
    /// same straight line in joint space goes on. The two flexion joints stop at `limit_rad` each (their upper limits).
    #[must_use]
    pub fn finger_at(&self, finger: FingerId, s: f64, limit_rad: [f64; 2]) -> FingerAngles<f64> {
        let open = open_finger(self.abduction_rad[finger.index()]);
        let rate = self.closing_rate_rad(finger);
        FingerAngles {
            abduction_rad: open.abduction_rad,
            flexion_rad: (open.flexion_rad + s * rate[0]).min(limit_rad[0]),
            middle_rad: (open.middle_rad + s * rate[1]).min(limit_rad[1]),
        }
    }

    /// Change of flexion and middle angle per unit of closing fraction, rad.
    #[must_use]
    pub fn closing_rate_rad(&self, finger: FingerId) -> [f64; 2] {
        let open = open_finger(0.0);
        let preshape = if finger == FingerId::Thumb { self.thumb_rad } else { self.fingers_rad };
        [preshape[0] - open.flexion_rad, preshape[1] - open.middle_rad]
    }
}

/// The eight candidates, the four-finger ones first. Angles in degrees in the table, radians in the result.
#[must_use]
pub fn typical() -> [Candidate; 8] {
    use ContactKind::{Hard, Soft};
    // name, fingers (thumb, index, middle, ring), thumb rotation, spread (index, middle, ring), fingers, thumb
    type Around = Option<[f64; 3]>;
    let row = |name,
               uses,
               rotation: f64,
               spread: [f64; 3],
               fingers: [f64; 2],
               thumb: [f64; 2],
               around: Around,
               contact| {
        let [index, middle, ring] = spread.map(f64::to_radians);
        Candidate {
            name,
            uses,
            thumb_rotation_rad: rotation.to_radians(),
            abduction_rad: [0.0, index, middle, ring],
            fingers_rad: fingers.map(f64::to_radians),
            thumb_rad: thumb.map(f64::to_radians),
            around_rad: around.map(|a| [0.0, a[0].to_radians(), a[1].to_radians(), a[2].to_radians()]),
            contact,
        }
    };
    let (timr, tim, tir) = ([true; 4], [true, true, true, false], [true, true, false, true]);
    let (ti, tm) = ([true, true, false, false], [true, false, true, false]);
    [
        row(
            "quadpod",
            timr,
            90.0,
            [-10.0, 0.0, 10.0],
            [25.0, 30.0],
            [15.0, 20.0],
            Some([110.0, 180.0, -110.0]),
            Hard,
        ),
        row(
            "disk-rim",
            timr,
            90.0,
            [-15.0, 0.0, 15.0],
            [20.0, 15.0],
            [10.0, 15.0],
            Some([120.0, 180.0, -120.0]),
            Hard,
        ),
        row("prismatic-4", timr, 90.0, [2.0, 0.0, -2.0], [30.0, 30.0], [15.0, 20.0], None, Hard),
        row(
            "tripod",
            tim,
            90.0,
            [-5.0, 5.0, 0.0],
            [35.0, 30.0],
            [20.0, 25.0],
            Some([120.0, -120.0, 0.0]),
            Hard,
        ),
        row("prismatic-3", tim, 90.0, [2.0, 0.0, 0.0], [35.0, 30.0], [20.0, 25.0], None, Hard),
        row(
            "wide-triangle",
            tir,
            90.0,
            [-12.0, 0.0, 12.0],
            [25.0, 30.0],
            [15.0, 20.0],
            Some([120.0, 0.0, -120.0]),
            Hard,
        ),
        row("palmar-pinch", ti, 75.0, [0.0, 0.0, 0.0], [40.0, 35.0], [25.0, 30.0], None, Soft),
        row("nip", tm, 90.0, [0.0, 0.0, 0.0], [50.0, 40.0], [35.0, 40.0], None, Soft),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_passes_through_the_preshape_and_stops_at_the_limits() {
        for candidate in typical() {
            assert!(candidate.uses[FingerId::Thumb.index()], "{}: nothing opposes", candidate.name);
            assert_eq!(candidate.contact == ContactKind::Soft, candidate.finger_count() == 2);
            for finger in FingerId::ALL {
                let limit = [75f64.to_radians(); 2];
                let preshape = candidate.finger_at(finger, 1.0, limit);
                let wanted =
                    if finger == FingerId::Thumb { candidate.thumb_rad } else { candidate.fingers_rad };
                assert!((preshape.flexion_rad - wanted[0]).abs() < 1e-15);
                assert!((preshape.middle_rad - wanted[1]).abs() < 1e-15);
                let far = candidate.finger_at(finger, 100.0, limit);
                assert!(far.flexion_rad <= limit[0] && far.middle_rad <= limit[1]);
            }
        }
    }
}
