use std::vec::Vec;

use proptest::prelude::*;

use super::super::ThumbMode;
use super::super::transition::Transition;
use super::*;

const PACE: Pace = Pace { half_us: 25_000, speed_max_rad_per_s: 3.0 };
const PERIOD_US: u32 = 125;

fn step(segments: &mut Segments, elapsed_us: u32, target: &mut Target) {
    let weights = segments.advance(elapsed_us, &PACE);
    for joint in 0..JOINT_COUNT {
        segments.write(joint, &weights, target);
    }
}

/// Joint by joint something else.
fn goal(scale: f32) -> [f32; JOINT_COUNT] {
    core::array::from_fn(|i| scale * (1.0 - 0.1 * i as f32))
}

fn segment(scale: f32, time_us: u32) -> Segment {
    Segment { goal_rad: goal(scale), time_us }
}

struct Hand {
    segments: Segments,
    target: Target,
    /// Motions of joint 2, period by period.
    seen: Vec<[f32; 2]>,
}

impl Hand {
    fn new() -> Self {
        let zero = [0.0; JOINT_COUNT];
        Self {
            segments: Segments::at_rest(&zero),
            target: Target::hold(zero, ThumbMode::Position),
            seen: Vec::new(),
        }
    }

    fn run(&mut self, periods: u32) {
        for _ in 0..periods {
            step(&mut self.segments, PERIOD_US, &mut self.target);
            self.seen.push([self.target.position_rad[2], self.target.velocity_rad_per_s[2]]);
        }
    }

    fn run_to_rest(&mut self) {
        for _ in 0..200_000 {
            if self.segments.is_at_rest() {
                return;
            }
            self.run(1);
        }
        panic!("it never comes to rest");
    }

    /// Largest differences of position and of velocity from one period to the next, and of the mean speed between two
    /// periods from that of their ends.
    fn steps(&self) -> [f32; 3] {
        let mut most = [0.0_f32; 3];
        for pair in self.seen.windows(2) {
            let [[p0, v0], [p1, v1]] = [pair[0], pair[1]];
            most[0] = most[0].max((p1 - p0).abs());
            most[1] = most[1].max((v1 - v0).abs());
            most[2] = most[2].max(((p1 - p0) - 0.5 * (v0 + v1) * PERIOD_US as f32 * 1e-6).abs());
        }
        most
    }
}

#[test]
fn corners_are_pauls() {
    let mut hand = Hand::new();
    hand.segments.add(&segment(0.4, 400_000), false, &PACE).expect("slow");
    hand.segments.add(&segment(-0.2, 500_000), false, &PACE).expect("slow");
    // The first segment's corner is half a blend after its beginning; the second's is at the first's end.
    hand.run((25_000 + 400_000 - 25_000) / PERIOD_US);
    let (from, to) = (goal(0.4)[2], goal(-0.2)[2]);
    let speed = from / 0.4;
    let corner = Transition {
        from_rad: from - speed * 0.025,
        corner_rad: from,
        to_rad: to,
        half_s: 0.025,
        segment_s: 0.5,
    };
    for period in 1..400_u32 {
        hand.run(1);
        let paul = corner.at(-0.025 + (period * PERIOD_US) as f32 * 1e-6);
        let [position_rad, velocity_rad_per_s] = hand.seen[hand.seen.len() - 1];
        assert!((position_rad - paul.position_rad).abs() < 2e-6, "{period}");
        assert!((velocity_rad_per_s - paul.velocity_rad_per_s).abs() < 1e-4, "{period}");
    }
    hand.run_to_rest();
    assert_eq!(hand.target.position_rad, goal(-0.2));
    assert_eq!(hand.target.velocity_rad_per_s, [0.0; JOINT_COUNT]);
}

#[test]
fn all_joints_arrive_together() {
    let mut hand = Hand::new();
    hand.segments.add(&segment(0.6, 400_000), false, &PACE).expect("slow");
    let mut last = [0; JOINT_COUNT];
    for period in 0..8000 {
        hand.run(1);
        for (last, (now, goal)) in last.iter_mut().zip(hand.target.position_rad.iter().zip(goal(0.6))) {
            // Within a thousandth of its own way.
            if (now - goal).abs() > 1e-3 * goal.abs().max(1e-3) {
                *last = period;
            }
        }
    }
    // The joint that does not move is there all the time.
    let moving = || last.iter().filter(|&&period| period > 0);
    assert_eq!(moving().count(), JOINT_COUNT - 1);
    assert!(moving().max().expect("some") - moving().min().expect("some") <= 1, "{last:?}");
}

#[test]
fn a_new_segment_in_a_blend_makes_no_step() {
    // In the beginning, at corners, on the straight and while it comes to rest; instead of others, or behind them.
    for replaces in [false, true] {
        for at in (0..5000).step_by(93) {
            let mut hand = Hand::new();
            hand.segments.add(&segment(0.5, 300_000), false, &PACE).expect("slow");
            hand.run(at);
            hand.segments.add(&segment(-0.3, 400_000), replaces, &PACE).expect("slow");
            hand.run_to_rest();
            assert_eq!(hand.target.position_rad, goal(-0.3), "{at}");
            let [position, velocity, bend] = hand.steps();
            // Fastest 0.8 / 0.4 rad/s and an overshoot; 1.5 times the change of speed over a blend is the peak acceleration.
            assert!(position < 3.6 * 125e-6, "{at}: {position}");
            assert!(velocity < 2.5 * 4.5 / 0.05 * 125e-6, "{at}: {velocity}");
            assert!(bend < 1e-6, "{at}: {bend}");
        }
    }
}

#[test]
fn acceleration_has_no_step_where_a_blend_is_left() {
    let mut segments = Segments::at_rest(&[0.0; JOINT_COUNT]);
    let mut target = Target::hold([0.0; JOINT_COUNT], ThumbMode::Position);
    segments.add(&segment(0.5, 300_000), false, &PACE).expect("slow");
    for _ in 0..130 {
        step(&mut segments, PERIOD_US, &mut target);
    }
    let before: Vec<_> = (0..JOINT_COUNT).map(|i| segments.motion(&segments.corners[i])).collect();
    assert!(before[0].acceleration_rad_per_s2.abs() > 20.0);
    segments.add(&segment(0.0, 300_000), true, &PACE).expect("slow");
    for (i, before) in before.iter().enumerate() {
        let after = segments.motion(&segments.corners[i]);
        assert!((after.position_rad - before.position_rad).abs() < 1e-7);
        assert!((after.velocity_rad_per_s - before.velocity_rad_per_s).abs() < 1e-5);
        assert!((after.acceleration_rad_per_s2 - before.acceleration_rad_per_s2).abs() < 1e-2);
    }
}

#[test]
fn what_cannot_be_followed_is_refused_and_changes_nothing() {
    let mut hand = Hand::new();
    for _ in 0..=QUEUE_LEN {
        hand.segments.add(&segment(0.1, 200_000), false, &PACE).expect("room");
    }
    let before = hand.segments;
    assert_eq!(hand.segments.add(&segment(0.1, 200_000), false, &PACE), Err(SegmentError::Full));
    assert_eq!(hand.segments, before);
    for (scale, time_us) in
        [(0.1, 49_999), (0.1, 60_000_001), (0.71, 200_000), (f32::NAN, 200_000), (f32::MAX, 1 << 20)]
    {
        assert_eq!(
            hand.segments.add(&segment(scale, time_us), true, &PACE),
            Err(SegmentError::Time),
            "{scale}"
        );
        assert_eq!(hand.segments, before);
    }
}

proptest! {
    #[test]
    fn whatever_comes_when_it_comes_nothing_steps(
        orders in proptest::collection::vec((-0.5_f32..0.5, 50_000_u32..400_000, any::<bool>(), 1_u32..2000), 1..40),
    ) {
        let mut hand = Hand::new();
        for (scale, time_us, replaces, periods) in orders {
            let _ = hand.segments.add(&segment(scale, time_us), replaces, &PACE);
            hand.run(periods);
        }
        hand.run_to_rest();
        let [position, velocity, bend] = hand.steps();
        // From one straight piece to the opposite one, with the overshoot of an acceleration.
        prop_assert!(position < 2.0 * 3.0 * 125e-6, "{}", position);
        prop_assert!(velocity < 2.0 * 6.0 * 4.5 / 0.05 * 125e-6, "{}", velocity);
        prop_assert!(bend < 2e-6, "{}", bend);
    }
}
