//! Convex hull of pixels: where a calibration knows what it says.

use serde::{Deserialize, Serialize};

/// A convex polygon, counter-clockwise as (u, v) axes go, pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Hull {
    corners_px: Vec<[f64; 2]>,
}

#[derive(Deserialize)]
struct Stored {
    corners_px: Vec<[f64; 2]>,
}

impl TryFrom<Stored> for Hull {
    type Error = String;

    fn try_from(Stored { corners_px }: Stored) -> Result<Self, String> {
        if corners_px.len() < 3 {
            return Err(format!("the hull has {} corners, 3 are the least", corners_px.len()));
        }
        if let Some([u, v]) = corners_px.iter().find(|corner| !corner.iter().all(|x| x.is_finite())) {
            return Err(format!("the hull has the corner ({u}, {v})"));
        }
        // Clockwise or flat, no pixel would be inside.
        let ends = corners_px.iter().zip(corners_px.iter().skip(1));
        if ends.map(|(&a, &b)| turn(corners_px[0], a, b)).sum::<f64>() <= 0.0 {
            return Err("the hull's corners do not go counter-clockwise around an area".to_owned());
        }
        Ok(Self { corners_px })
    }
}

/// Twice the area of a triangle; positive when it turns from u to v.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

impl Hull {
    /// Hull of points (Andrew's monotone chain); `None` when they enclose no area. Points must be finite.
    #[must_use]
    pub fn of(points_px: &[[f64; 2]]) -> Option<Self> {
        let mut sorted = points_px.to_vec();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let mut corners_px: Vec<[f64; 2]> = Vec::new();
        // Lower chain from left to right, then the upper one back.
        for pass in 0..2 {
            let base = corners_px.len();
            for &point in &sorted {
                while let [.., a, b] = corners_px[base..]
                    && turn(a, b, point) <= 0.0
                {
                    corners_px.pop();
                }
                corners_px.push(point);
            }
            corners_px.pop();
            if pass == 0 {
                sorted.reverse();
            }
        }
        (corners_px.len() >= 3).then_some(Self { corners_px })
    }

    /// Corners, counter-clockwise as (u, v) axes go.
    #[must_use]
    pub fn corners_px(&self) -> &[[f64; 2]] {
        &self.corners_px
    }

    /// How far a pixel is outside, pixels; 0 inside and on the edge. Infinite for what is no number.
    #[must_use]
    pub fn distance_px(&self, pixel: [f64; 2]) -> f64 {
        if !pixel.iter().all(|x| x.is_finite()) {
            return f64::INFINITY;
        }
        let edges = || {
            let ends = self.corners_px.iter().cycle().skip(1);
            self.corners_px.iter().zip(ends).map(|(&a, &b)| (a, b))
        };
        if edges().all(|(a, b)| turn(a, b, pixel) >= 0.0) {
            return 0.0;
        }
        edges().map(|(a, b)| to_segment(a, b, pixel)).fold(f64::INFINITY, f64::min)
    }
}

fn to_segment(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0].powi(2) + along[1].powi(2);
    let share = ((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1]) / length2;
    let share = share.clamp(0.0, 1.0);
    (p[0] - a[0] - share * along[0]).hypot(p[1] - a[1] - share * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_points_inside_and_on_its_edges() {
        let mut points: Vec<[f64; 2]> =
            (0..25).map(|i| [f64::from(i % 5) * 2.5, f64::from(i / 5) * 2.5]).collect();
        points.reverse();
        let hull = Hull::of(&points).unwrap();
        assert_eq!(hull.corners_px(), [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]);
        for inside in [[0.0, 0.0], [5.0, 10.0], [3.0, 7.0]] {
            assert_eq!(hull.distance_px(inside), 0.0);
        }
        assert_eq!(hull.distance_px([-2.0, 5.0]), 2.0);
        assert_eq!(hull.distance_px([13.0, 14.0]), 5.0);
        assert_eq!(hull.distance_px([f64::NAN, 5.0]), f64::INFINITY);
    }

    #[test]
    fn no_area_no_hull() {
        assert_eq!(Hull::of(&[]), None);
        assert_eq!(Hull::of(&[[1.0, 1.0]; 5]), None);
        assert_eq!(Hull::of(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]), None);
    }
}
