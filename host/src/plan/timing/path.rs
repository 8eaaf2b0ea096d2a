//! A joint-space path with rounded corners, cut into short intervals.

use super::MotionLimits;
use crate::plan::arm::Joints;

/// Points nearer to each other than this are one: between them, rounding would decide the direction.
const SAME_RAD: f64 = 1e-6;

/// Greatest length of an interval, radians; more does not make the motion faster by one part in a hundred.
const INTERVAL_RAD: f64 = 0.01;

/// Least number of intervals over a whole path.
const LEAST_INTERVALS: f64 = 64.0;

/// Least number of intervals in a rounded corner: between them, speed changes and the path bends at the same time.
const LEAST_IN_CORNER: f64 = 4.0;

/// A short part of the path: `q(s) = q + tangent s + bend s^2 / 2` for `s` from 0 to `length`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    /// Joint angles at its start.
    pub(super) q: Joints,
    /// `q'` at its start.
    pub(super) tangent: Joints,
    /// `q''`.
    pub(super) bend: Joints,
    /// In path parameter, which is the joint-space length outside corners.
    pub(super) length: f64,
    /// Index of the path point at or just before it.
    pub(super) path_point: usize,
}

impl Interval {
    fn at(&self, s: f64) -> Joints {
        std::array::from_fn(|i| self.q[i] + s * (self.tangent[i] + 0.5 * s * self.bend[i]))
    }

    fn tangent_at(&self, s: f64) -> Joints {
        std::array::from_fn(|i| self.tangent[i] + s * self.bend[i])
    }

    /// Joint angles at its end.
    pub(super) fn end(&self) -> Joints {
        self.at(self.length)
    }

    /// Whether it goes on in the straight line of `before`.
    pub(super) fn continues(&self, before: &Self) -> bool {
        self.bend == [0.0; 6] && before.bend == [0.0; 6] && self.tangent == before.tangent
    }

    /// Greatest `|q'|` of each joint in the interval.
    fn greatest_slope(&self) -> Joints {
        let end = self.tangent_at(self.length);
        std::array::from_fn(|i| self.tangent[i].abs().max(end[i].abs()))
    }

    /// Greatest `(ds/dt)^2` at constant `ds/dt`.
    pub(super) fn greatest_squared_speed(&self, limits: &MotionLimits) -> f64 {
        let slope = self.greatest_slope();
        (0..6).fold(f64::INFINITY, |most, i| {
            let by_speed = (limits.speed_rad_per_s[i] / slope[i]).powi(2);
            let by_bend = limits.acceleration_rad_per_s2[i] / self.bend[i].abs();
            most.min(by_speed).min(by_bend)
        })
    }

    /// Greatest `(ds/dt)^2` at one end when it is `x` at the other one. The worst combination of speeding up and
    /// bending is assumed: `slope |x1 - x| / (2 length) + |bend| x1 <= acceleration` for each joint, with `x1 >= x`.
    pub(super) fn reachable(&self, x: f64, limits: &MotionLimits) -> f64 {
        let slope = self.greatest_slope();
        (0..6).fold(f64::INFINITY, |most, i| {
            let run = 2.0 * self.length;
            let x1 = (slope[i] * x + run * limits.acceleration_rad_per_s2[i])
                / (slope[i] + run * self.bend[i].abs());
            most.min(x1)
        })
    }

    /// Appends the interval in `count` equal parts.
    fn cut_into(&self, count: f64, parts: &mut Vec<Self>) {
        let length = self.length / count;
        for i in 0..count as usize {
            let s = length * i as f64;
            parts.push(Self { q: self.at(s), tangent: self.tangent_at(s), length, ..*self });
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

/// Cuts a path of at least one finite point into intervals; none when it does not lead anywhere.
pub(super) fn intervals(path: &[Joints], corner_rad: f64) -> Vec<Interval> {
    let segments = segments(path);
    let total: f64 = segments.iter().map(|segment| segment.length).sum();
    let step = INTERVAL_RAD.min(total / LEAST_INTERVALS);
    let mut parts = Vec::new();
    let mut used = 0.0;
    for (k, segment) in segments.iter().enumerate() {
        let next = segments.get(k + 1);
        // The parabola leaves the segments `reach` before and after the corner, and misses it by
        // `reach |difference of directions| / 4`.
        let reach = next.map_or(0.0, |next| {
            let half = 0.5 * segment.length.min(next.length);
            half.min(4.0 * corner_rad / distance(&segment.direction, &next.direction))
        });
        let straight = Interval {
            q: along(&segment.from, &segment.direction, used),
            tangent: segment.direction,
            bend: [0.0; 6],
            length: segment.length - used - reach,
            path_point: segment.path_point,
        };
        // Between two corners that meet in the middle of a segment nothing is left but rounding.
        if straight.length > 1e-9 * segment.length {
            straight.cut_into((straight.length / step).ceil(), &mut parts);
        }
        if let Some(next) = next {
            let corner = Interval {
                q: along(&segment.from, &segment.direction, segment.length - reach),
                tangent: segment.direction,
                bend: std::array::from_fn(|i| (next.direction[i] - segment.direction[i]) / (2.0 * reach)),
                length: 2.0 * reach,
                path_point: segment.path_point,
            };
            corner.cut_into((corner.length / step).ceil().max(LEAST_IN_CORNER), &mut parts);
        }
        used = reach;
    }
    parts
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

fn along(from: &Joints, direction: &Joints, length: f64) -> Joints {
    std::array::from_fn(|i| from[i] + direction[i] * length)
}

fn distance(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_corner_is_continuous_and_misses_by_no_more_than_allowed() {
        let path = [[0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.5, 0.0, 0.0, 0.0], [0.0; 6]];
        for corner_rad in [0.002, 0.02, 10.0] {
            let parts = intervals(&path, corner_rad);
            for pair in parts.windows(2) {
                assert!(distance(&pair[0].end(), &pair[1].q) < 1e-12);
                let tangent = pair[0].tangent_at(pair[0].length);
                assert!(distance(&tangent, &pair[1].tangent) < 1e-9);
            }
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
    fn repeated_points_leave_no_interval() {
        assert!(intervals(&[[1.0; 6]], 0.01).is_empty());
        assert!(intervals(&[[1.0; 6], [1.0; 6], [1.0; 6]], 0.01).is_empty());
        let twice = intervals(&[[0.0; 6], [0.0; 6], [1.0; 6], [1.0; 6]], 0.01);
        assert_eq!(
            twice,
            intervals(&[[0.0; 6], [1.0; 6]], 0.01)
                .iter()
                .map(|i| Interval { path_point: 0, ..*i })
                .collect::<Vec<_>>()
        );
    }
}
