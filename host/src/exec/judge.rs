//! The verdict: from where the object truly was at the turns of the execution, or from what the hand felt.

use nalgebra::Isometry3;

use super::outcome::{Trouble, Verdict};
use super::phase::Phase;
use super::plan::ExecutionSettings;
use crate::link::TrueObject;

/// Where palm and object were at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sight {
    pub(super) base_from_palm: Isometry3<f64>,
    pub(super) object: TrueObject,
}

/// What there is to judge by.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Course {
    pub(super) at_start: Option<Sight>,
    pub(super) before_close: Option<Sight>,
    pub(super) closed: Option<Sight>,
    pub(super) gripped: Option<Sight>,
    pub(super) held: Option<Sight>,
    pub(super) shaken: Option<Sight>,
    pub(super) at_end: Option<Sight>,
    /// Greatest rise of the object's centre.
    pub(super) highest_m: f64,
    /// Why the course was left, and in which phase.
    pub(super) trouble: Option<(Trouble, Phase)>,
    /// Fingers that feel something at the end.
    pub(super) touching_at_end: usize,
}

impl Course {
    /// Takes down where things are when a phase begins.
    pub(super) fn begins(&mut self, phase: Phase, sight: Option<Sight>) {
        match phase {
            Phase::Prepare => self.at_start = sight,
            Phase::Close => self.before_close = sight,
            Phase::Squeeze => self.closed = sight,
            Phase::Lift => self.gripped = sight,
            Phase::Shake => self.held = sight,
            // After trouble it is on its way down for another reason.
            Phase::Lower if self.trouble.is_none() => self.shaken = sight,
            _ => {}
        }
    }

    /// How far the object moved while the fingers closed.
    pub(super) fn shift_m(&self) -> Option<f64> {
        moved_m(self.before_close, self.closed)
    }

    /// How far its centre had risen by the end of the hold, or at most if it did not get there.
    pub(super) fn rise_m(&self) -> Option<f64> {
        self.at_start?;
        rise_m(self.at_start, self.held).or(Some(self.highest_m))
    }

    /// How far it moved in the hand until the end of the hold, and of the shake, the larger one.
    pub(super) fn slip_m(&self) -> Option<f64> {
        [self.held, self.shaken].into_iter().filter_map(|later| slip_m(self.gripped, later)).reduce(f64::max)
    }

    /// How far from its first place it is at the end.
    pub(super) fn misplaced_m(&self) -> Option<f64> {
        self.shaken.and(moved_m(self.at_start, self.at_end))
    }

    /// What the hand's own sensors say.
    pub(super) fn felt(&self) -> Verdict {
        match self.trouble {
            Some((Trouble::Obstructed, _)) => Verdict::Obstructed,
            Some((Trouble::Missed, _)) => Verdict::Missed,
            Some((Trouble::SlipNotStopped, _)) => Verdict::SlipNotStopped,
            Some((Trouble::Lost, Phase::Lift)) => Verdict::NotLifted,
            Some((Trouble::Lost, Phase::Shake)) => Verdict::DroppedInShake,
            Some((Trouble::Lost, _)) => Verdict::Dropped,
            None if self.touching_at_end > 0 => Verdict::NotReleased,
            None => Verdict::Held,
        }
    }

    /// What is true, or felt where nobody sees the object.
    pub(super) fn verdict(&self, settings: &ExecutionSettings) -> Verdict {
        let most_m = settings.displacement_max_m;
        let (Some(start), Some(end)) = (self.at_start, self.at_end) else { return self.felt() };
        let lifted =
            |sight: Option<Sight>| rise_m(Some(start), sight).map(|rise| rise > 0.5 * settings.lift_m);
        let beyond = |moved_m: Option<f64>| moved_m.is_some_and(|moved| moved > most_m);
        if beyond(moved_m(Some(start), self.before_close)) {
            return Verdict::Disturbed;
        }
        match self.trouble {
            Some((Trouble::Obstructed, _)) if beyond(moved_m(Some(start), Some(end))) => {
                return Verdict::Disturbed;
            }
            Some((Trouble::Obstructed, _)) => return Verdict::Obstructed,
            Some((Trouble::Missed, _)) => return Verdict::Missed,
            _ => {}
        }
        let lost = if self.highest_m > 0.1 * settings.lift_m { Verdict::Dropped } else { Verdict::NotLifted };
        match (lifted(self.held), lifted(self.shaken)) {
            (Some(false), _) => lost,
            (Some(true), Some(false)) => Verdict::DroppedInShake,
            (Some(true), Some(true)) if beyond(self.slip_m()) => Verdict::Slipped,
            (Some(true), Some(true)) => self.put_down(start, end, most_m),
            // The course was left on the way.
            (held, _) => match self.trouble {
                Some((Trouble::SlipNotStopped, _)) => Verdict::SlipNotStopped,
                _ if held == Some(true) => Verdict::DroppedInShake,
                _ => lost,
            },
        }
    }

    /// Whether it stands where it stood, by its centre: what has fallen over has another height or another place.
    fn put_down(&self, start: Sight, end: Sight, most_m: f64) -> Verdict {
        let by = end.object.center_in_base - start.object.center_in_base;
        if self.touching_at_end > 0 && by.norm() > most_m {
            Verdict::NotReleased
        } else if by.norm() > most_m || by.z.abs() > most_m / 3.0 {
            Verdict::Misplaced
        } else {
            Verdict::Held
        }
    }
}

fn moved_m(from: Option<Sight>, to: Option<Sight>) -> Option<f64> {
    from.zip(to).map(|(a, b)| (b.object.center_in_base - a.object.center_in_base).norm())
}

fn rise_m(from: Option<Sight>, to: Option<Sight>) -> Option<f64> {
    from.zip(to).map(|(a, b)| b.object.center_in_base.z - a.object.center_in_base.z)
}

fn slip_m(from: Option<Sight>, to: Option<Sight>) -> Option<f64> {
    let in_palm = |sight: Sight| sight.base_from_palm.inverse_transform_point(&sight.object.center_in_base);
    from.zip(to).map(|(a, b)| (in_palm(b) - in_palm(a)).norm())
}
