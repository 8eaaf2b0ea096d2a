//! A joint-space path with continuous curvature, cut into short intervals.

use super::MotionLimits;
use crate::plan::arm::Joints;

/// Points nearer to each other than this are one: between them, rounding would decide the direction.
const SAME_RAD: f64 = 1e-6;

/// Greatest length of an interval, radians; more does not make the motion faster by one part in a hundred.
const INTERVAL_RAD: f64 = 0.01;

/// Least number of intervals over a whole path.
const LEAST_INTERVALS: f64 = 64.0;

/// Least number of intervals in each half of a rounded corner: between them, speed changes and the path bends at the
/// same time.
const LEAST_IN_HALF_CORNER: f64 = 4.0;

/// A short part of the path: `q(s) = q + tangent s + bend s^2 / 2 + twist s^3 / 6` for `s` from 0 to `length`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    /// Joint angles at its start.
    pub(super) q: Joints,
    /// `q'` at its start.
    pub(super) tangent: Joints,
    /// `q''` at its start.
    pub(super) bend: Joints,
    /// `q'''`.
    pub(super) twist: Joints,
    /// In path parameter, which is about the joint-space length.
    pub(super) length: f64,
    /// Index of the path point at or just before it.
    pub(super) path_point: usize,
}

impl Interval {
    /// Joint angles at `s`.
    pub(super) fn at(&self, s: f64) -> Joints {
        std::array::from_fn(|i| {
            self.q[i] + s * (self.tangent[i] + s * (0.5 * self.bend[i] + s * self.twist[i] / 6.0))
        })
    }

    fn tangent_at(&self, s: f64) -> Joints {
        std::array::from_fn(|i| self.tangent[i] + s * (self.bend[i] + 0.5 * s * self.twist[i]))
    }

    fn bend_at(&self, s: f64) -> Joints {
        std::array::from_fn(|i| self.bend[i] + s * self.twist[i])
    }

    /// Joint angles at its end.
    pub(super) fn end(&self) -> Joints {
        self.at(self.length)
    }

    /// Bound of `|q'|` of each joint in the interval: a parabola rises above its chord by at most `length^2 q''' / 8`.
    fn greatest_slope(&self) -> Joints {
        let end = self.tangent_at(self.length);
        let sagitta = 0.125 * self.length * self.length;
        std::array::from_fn(|i| self.tangent[i].abs().max(end[i].abs()) + sagitta * self.twist[i].abs())
    }

    /// Greatest `|q''|` of each joint in the interval.
    fn greatest_bend(&self) -> Joints {
        let end = self.bend_at(self.length);
        std::array::from_fn(|i| self.bend[i].abs().max(end[i].abs()))
    }

    /// Greatest `(ds/dt)^2` at constant `ds/dt`.
    pub(super) fn greatest_squared_speed(&self, limits: &MotionLimits) -> f64 {
        let (slope, bend) = (self.greatest_slope(), self.greatest_bend());
        (0..6).fold(f64::INFINITY, |most, i| {
            let by_speed = (limits.speed_rad_per_s[i] / slope[i]).powi(2);
            let by_bend = limits.acceleration_rad_per_s2[i] / bend[i];
            let by_twist = (limits.jerk_rad_per_s3[i] / self.twist[i].abs()).cbrt().powi(2);
            most.min(by_speed).min(by_bend).min(by_twist)
        })
    }

    /// Greatest `(ds/dt)^2` at one end when it is `x` at the other one. The worst combination of speeding up and
    /// bending is assumed: `slope |x1 - x| / (2 length) + |bend| x1 <= acceleration` for each joint, with `x1 >= x`.
    pub(super) fn reachable(&self, x: f64, limits: &MotionLimits) -> f64 {
        let (slope, bend) = (self.greatest_slope(), self.greatest_bend());
        (0..6).fold(f64::INFINITY, |most, i| {
            let run = 2.0 * self.length;
            let x1 = (slope[i] * x + run * limits.acceleration_rad_per_s2[i]) / (slope[i] + run * bend[i]);
            most.min(x1)
        })
    }

    /// Appends the interval in `count` equal parts.
    fn cut_into(&self, count: f64, parts: &mut Vec<Self>) {
        let length = self.length / count;
        for i in 0..count as usize {
            let s = length * i as f64;
            let (tangent, bend) = (self.tangent_at(s), self.bend_at(s));
            parts.push(Self { q: self.at(s), tangent, bend, length, ..*self });
        }
    }
}

/// A straight line between two points of the path.
struct Segment {
    from: Joints,
    direction: Joints,
    length: f64,
    path_point: usize,
}

/// Cuts a path of at least one finite point into intervals, its corners rounded; none when it does not lead anywhere.
///
/// In a corner `q''` rises linearly to the middle and falls again, so that it is continuous. The corner is missed by at
/// most `corner_rad`.
pub(super) fn rounded(path: &[Joints], corner_rad: f64) -> Vec<Interval> {
    let segments = segments(path);
    let step = step(&segments);
    let mut parts = Vec::new();
    let mut used = 0.0;
    for (k, segment) in segments.iter().enumerate() {
        let next = segments.get(k + 1);
        // The curve leaves the segments `reach` before and after the corner, and misses it by
        // `reach |difference of directions| / 6`.
        let reach = next.map_or(0.0, |next| {
            let half = 0.5 * segment.length.min(next.length);
            half.min(6.0 * corner_rad / distance(&segment.direction, &next.direction))
        });
        let straight = Interval {
            q: along(&segment.from, &segment.direction, used),
            tangent: segment.direction,
            bend: [0.0; 6],
            twist: [0.0; 6],
            length: segment.length - used - reach,
            path_point: segment.path_point,
        };
        // Between two corners that meet in the middle of a segment nothing is left but rounding.
        if straight.length > 1e-9 * segment.length {
            straight.cut_into((straight.length / step).ceil(), &mut parts);
        }
        if let Some(next) = next {
            let twist = std::array::from_fn(|i| (next.direction[i] - segment.direction[i]) / (reach * reach));
            let first = Interval {
                q: along(&segment.from, &segment.direction, segment.length - reach),
                twist,
                length: reach,
                ..straight
            };
            let second = Interval {
                q: first.end(),
                tangent: first.tangent_at(reach),
                bend: first.bend_at(reach),
                twist: twist.map(|w| -w),
                ..first
            };
            let count = (reach / step).ceil().max(LEAST_IN_HALF_CORNER);
            first.cut_into(count, &mut parts);
            second.cut_into(count, &mut parts);
        }
        used = reach;
    }
    parts
}

/// Cuts a path into intervals of the cubic spline through all its points, with the lengths between them as parameter.
///
/// `q''` at each end is that of the parabola through the three points there.
pub(super) fn through(path: &[Joints]) -> Vec<Interval> {
    let segments = segments(path);
    let Some(last) = segments.last() else { return Vec::new() };
    let step = step(&segments);
    let bends = spline_bends(&segments);
    let ends =
        segments.iter().skip(1).map(|s| s.from).chain([along(&last.from, &last.direction, last.length)]);
    let mut parts = Vec::new();
    for ((segment, bend), end) in segments.iter().zip(bends.windows(2)).zip(ends) {
        let h = segment.length;
        let whole = Interval {
            q: segment.from,
            tangent: std::array::from_fn(|i| {
                (end[i] - segment.from[i]) / h - h * (2.0 * bend[0][i] + bend[1][i]) / 6.0
            }),
            bend: bend[0],
            twist: std::array::from_fn(|i| (bend[1][i] - bend[0][i]) / h),
            length: h,
            path_point: segment.path_point,
        };
        whole.cut_into((h / step).ceil(), &mut parts);
    }
    parts
}

/// `q''` of the spline at the points: the tridiagonal system of a continuous `q'`, by elimination.
fn spline_bends(segments: &[Segment]) -> Vec<Joints> {
    let inner = segments.len() - 1;
    let mut bends = vec![[0.0; 6]; segments.len() + 1];
    if inner == 0 {
        return bends;
    }
    // Six times the second divided difference is the right-hand side, twice it the end condition.
    let divided = |k: usize, i: usize| {
        (segments[k + 1].direction[i] - segments[k].direction[i])
            / (segments[k].length + segments[k + 1].length)
    };
    #[allow(clippy::needless_range_loop, reason = "the axis indexes every row of bends, not one of them")]
    for i in 0..6 {
        bends[0][i] = 2.0 * divided(0, i);
        bends[inner + 1][i] = 2.0 * divided(inner - 1, i);
        // Row k: share bends[k] + 2 bends[k + 1] + (1 - share) bends[k + 2] = 6 divided(k).
        let (mut above, mut right) = (Vec::with_capacity(inner), Vec::with_capacity(inner));
        for k in 0..inner {
            let share = segments[k].length / (segments[k].length + segments[k + 1].length);
            let (before_above, before_right) = match k {
                0 => (0.0, bends[0][i]),
                _ => (above[k - 1], right[k - 1]),
            };
            let pivot = 2.0 - share * before_above;
            above.push((1.0 - share) / pivot);
            right.push((6.0 * divided(k, i) - share * before_right) / pivot);
        }
        for k in (0..inner).rev() {
            bends[k + 1][i] = right[k] - above[k] * bends[k + 2][i];
        }
    }
    bends
}

/// The lines between the points, without repeated ones; the first and the last point are kept.
fn segments(path: &[Joints]) -> Vec<Segment> {
    let mut kept: Vec<usize> = Vec::with_capacity(path.len());
    for (i, q) in path.iter().enumerate() {
        if kept.last().is_none_or(|&before| distance(&path[before], q) > SAME_RAD) {
            kept.push(i);
        }
    }
    // A last point that is nearly a repetition stands for the one before it.
    if let (Some(last), true) = (kept.last_mut(), path.len() > 1)
        && *last != 0
    {
        *last = path.len() - 1;
    }
    kept.windows(2)
        .map(|pair| {
            let [from, to] = [pair[0], pair[1]].map(|i| path[i]);
            let length = distance(&from, &to);
            let direction = std::array::from_fn(|i| (to[i] - from[i]) / length);
            Segment { from, direction, length, path_point: pair[0] }
        })
        .collect()
}

fn step(segments: &[Segment]) -> f64 {
    let total: f64 = segments.iter().map(|segment| segment.length).sum();
    INTERVAL_RAD.min(total / LEAST_INTERVALS)
}

fn along(from: &Joints, direction: &Joints, length: f64) -> Joints {
    std::array::from_fn(|i| from[i] + direction[i] * length)
}

fn distance(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_continuous(parts: &[Interval]) {
        for pair in parts.windows(2) {
            let [a, b] = [&pair[0], &pair[1]];
            assert!(distance(&a.end(), &b.q) < 1e-12);
            assert!(distance(&a.tangent_at(a.length), &b.tangent) < 1e-9);
            let scale = 1.0 + distance(&b.bend, &[0.0; 6]) + distance(&a.bend, &[0.0; 6]);
            assert!(distance(&a.bend_at(a.length), &b.bend) < 1e-9 * scale);
        }
    }

    #[test]
    fn a_rounded_corner_is_continuous_to_its_curvature_and_misses_by_no_more_than_allowed() {
        let path = [[0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.5, 0.0, 0.0, 0.0], [0.0; 6]];
        for corner_rad in [0.002, 0.02, 10.0] {
            let parts = rounded(&path, corner_rad);
            assert_continuous(&parts);
            let missed = |corner: &Joints| {
                let nearest = |part: &Interval| {
                    (0..=10)
                        .map(|i| distance(&part.at(0.1 * part.length * f64::from(i)), corner))
                        .fold(f64::INFINITY, f64::min)
                };
                parts.iter().map(nearest).fold(f64::INFINITY, f64::min)
            };
            for corner in &path[1..3] {
                assert!(missed(corner) <= corner_rad * (1.0 + 1e-9), "{}", missed(corner));
                assert!(missed(corner) > 0.5 * corner_rad.min(0.1));
            }
            assert_eq!(parts[0].q, path[0]);
            assert!(distance(&parts.last().unwrap().end(), &path[3]) < 1e-12);
        }
    }

    #[test]
    fn a_spline_through_an_arc_is_the_arc_to_the_fourth_order() {
        let arc = |phi: f64| [phi.cos(), phi.sin(), 0.0, 0.0, 0.0, 0.0];
        let worst = |count: u32| {
            let step = 1.2 / f64::from(count);
            let path: Vec<Joints> = (0..=count).map(|k| arc(step * f64::from(k))).collect();
            let parts = through(&path);
            assert_continuous(&parts);
            assert!(path.iter().all(|q| parts.iter().any(|part| distance(&part.q, q) < 1e-12)
                || distance(&parts.last().unwrap().end(), q) < 1e-12));
            parts
                .iter()
                .map(|part| (distance(&part.at(0.5 * part.length), &[0.0; 6]) - 1.0).abs())
                .fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(12), worst(24));
        assert!(coarse < 1e-4 && fine < coarse / 7.0, "{coarse} {fine}");
    }

    #[test]
    fn repeated_points_leave_no_interval() {
        for cut in [|path: &[Joints]| rounded(path, 0.01), through] {
            assert!(cut(&[[1.0; 6]]).is_empty());
            assert!(cut(&[[1.0; 6], [1.0; 6], [1.0; 6]]).is_empty());
            let twice = cut(&[[0.0; 6], [0.0; 6], [1.0; 6], [1.0; 6]]);
            let once = cut(&[[0.0; 6], [1.0; 6]]);
            assert_eq!(twice, once.iter().map(|i| Interval { path_point: 0, ..*i }).collect::<Vec<_>>());
        }
    }
}
