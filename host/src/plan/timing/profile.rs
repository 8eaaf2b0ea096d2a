//! Progress along a path over time, with speed that changes evenly between grid points, and its moving average.

use super::path::Interval;

/// The fastest motion that the limits of speed and acceleration allow: `s(t)` in pieces of constant acceleration.
pub(super) struct Profile {
    /// Time, place, speed, and the integral of the place over time, at each grid point.
    points: Vec<[f64; 4]>,
}

impl Profile {
    /// From squared speeds at the ends of the intervals.
    pub(super) fn new(intervals: &[Interval], x: &[f64]) -> Self {
        let mut points = Vec::with_capacity(x.len());
        let [mut t, mut s, mut area] = [0.0; 3];
        points.push([t, s, x[0].sqrt(), area]);
        for (k, interval) in intervals.iter().enumerate() {
            let (here, next) = (x[k].sqrt(), x[k + 1].sqrt());
            let time = 2.0 * interval.length / (here + next);
            // The integral of a quadratic with end speeds `here` and `next`.
            area += time * (s + time * (2.0 * here + next) / 6.0);
            t += time;
            s += interval.length;
            points.push([t, s, next, area]);
        }
        Self { points }
    }

    /// Seconds until the end.
    pub(super) fn duration_s(&self) -> f64 {
        self.points.last().map_or(0.0, |point| point[0])
    }

    /// Squared speeds at the grid points with every peak cut at the height where it lasts for `window` seconds (the
    /// morphological opening): each point keeps the best of the least speeds of the windows that it lies in.
    pub(super) fn flattened(&self, window: f64) -> Vec<f64> {
        let count = self.points.len();
        let [time, speed] = [0, 2].map(|i| move |k: usize| self.points[k][i]);
        let least = |from_s: f64, to_s: f64| {
            let first = self.points.partition_point(|point| point[0] < from_s);
            let inside = self.points[first..].iter().take_while(|point| point[0] <= to_s);
            // Between points the speed is linear in time: its least is at an end or at a point.
            inside.map(|point| point[2]).fold(self.speed(from_s).min(self.speed(to_s)), f64::min)
        };
        // Windows that begin and that end at a point.
        let after: Vec<f64> = (0..count).map(|k| least(time(k), time(k) + window)).collect();
        let before: Vec<f64> = (0..count).map(|k| least(time(k) - window, time(k))).collect();
        (0..count)
            .map(|k| {
                let begun = (0..=k).rev().take_while(|&n| time(n) + window >= time(k)).map(|n| after[n]);
                let ending = (k..count).take_while(|&n| time(n) - window <= time(k)).map(|n| before[n]);
                begun.chain(ending).fold(0.0, f64::max).min(speed(k)).powi(2)
            })
            .collect()
    }

    /// Speed at a time; 0 before the start and after the end.
    fn speed(&self, t: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] <= t);
        match (self.points.get(after.wrapping_sub(1)), self.points.get(after)) {
            (Some(a), Some(b)) => a[2] + (b[2] - a[2]) * (t - a[0]) / (b[0] - a[0]),
            _ => 0.0,
        }
    }

    /// Mean place between `t - window` and `t`: the place at `t` of a motion whose speed is the moving average.
    pub(super) fn averaged(&self, t: f64, window: f64) -> f64 {
        (self.area(t) - self.area(t - window)) / window
    }

    /// Integral of the place from 0 to `t`. It rests at 0 before the start and at the end after it.
    fn area(&self, t: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] <= t);
        let Some(&[t0, s, speed, area]) = self.points.get(after.wrapping_sub(1)) else { return 0.0 };
        let time = t - t0;
        match self.points.get(after) {
            None => area + time * s,
            Some(&[t1, _, next, _]) => {
                let acceleration = (next - speed) / (t1 - t0);
                area + time * (s + time * (0.5 * speed + time * acceleration / 6.0))
            }
        }
    }
}
