//! The circle that the laser plane cuts out of a sphere, found in a profile among whatever else the stripe lit.

use nalgebra::{Matrix3, Vector2, Vector3};

/// A circle in the laser plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Centre: y along the stripe, z away from the laser.
    pub center_m: [f64; 2],
    /// Radius of the cut, at most the sphere's.
    pub radius_m: f64,
}

/// An arc, and what belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub struct ArcFit {
    /// The circle.
    pub arc: Arc,
    /// Points near it, in the order of y.
    pub points_m: Vec<[f64; 2]>,
}

/// Points farther off the circle are not the sphere's.
const TOLERANCE_M: f64 = 0.0004;
const LEAST_POINTS: usize = 8;
/// A shorter arc tells little of its circle; and within the tolerance a straight line passes for one so long.
const LEAST_SPAN_RAD: f64 = 0.7;
const LEAST_RADIUS_M: f64 = 0.003;
/// Spheres of unknown radius are no larger.
pub(super) const LARGEST_RADIUS_M: f64 = 0.060;
/// How much larger than the sphere noise may make a cut.
const RADIUS_MARGIN: f64 = 1.03;
/// Distances between three points that propose a circle, as shares of the profile.
const STRIDES: [usize; 10] = [3, 4, 5, 6, 8, 11, 16, 22, 32, 45];
const REFINEMENTS: u32 = 5;

/// Finds the arc of a sphere that bulges towards the laser; `None` when there is none that is long enough.
///
/// Triples of points at regular distances propose circles; the one with most points near it is fitted to them by their
/// distances. `radius_m` is the sphere's, if known.
#[must_use]
pub fn fit_arc(points_m: &[[f64; 2]], radius_m: Option<f64>) -> Option<ArcFit> {
    let largest_m = radius_m.map_or(LARGEST_RADIUS_M, |radius| radius * RADIUS_MARGIN);
    let mut points: Vec<Vector2<f64>> = points_m.iter().map(|&p| p.into()).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    let admitted = |arc: &Arc| (LEAST_RADIUS_M..=largest_m).contains(&arc.radius_m);
    let mut best: Option<(f64, Arc)> = None;
    for stride in STRIDES.map(|share| points.len() / share).into_iter().filter(|&stride| stride > 1) {
        for first in 0..points.len().saturating_sub(2 * stride) {
            let corners = [first, first + stride, first + 2 * stride].map(|i| points[i]);
            let Some(arc) = through(corners).filter(|arc| admitted(arc) && bulges(arc, &corners[1])) else {
                continue;
            };
            let score: f64 =
                points.iter().map(|p| (1.0 - (off(&arc, p) / TOLERANCE_M).powi(2)).max(0.0)).sum();
            if best.is_none_or(|(highest, _)| score > highest) {
                best = Some((score, arc));
            }
        }
    }
    let (_, mut arc) = best?;
    let mut near = Vec::new();
    for _ in 0..REFINEMENTS {
        near.clear();
        near.extend(points.iter().copied().filter(|p| off(&arc, p).abs() < TOLERANCE_M && bulges(&arc, p)));
        if near.len() < LEAST_POINTS {
            return None;
        }
        arc = refined(arc, &near).filter(admitted)?;
    }
    let angle = |p: &Vector2<f64>| (p.x - arc.center_m[0]).atan2(arc.center_m[1] - p.y);
    let (low, high) =
        near.iter().map(angle).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(a), h.max(a)));
    let fit = ArcFit { arc, points_m: near.into_iter().map(Into::into).collect() };
    (high - low >= LEAST_SPAN_RAD).then_some(fit)
}

/// Distance from the circle, outwards.
fn off(arc: &Arc, point: &Vector2<f64>) -> f64 {
    (point - Vector2::from(arc.center_m)).norm() - arc.radius_m
}

/// Whether the point lies on the side of the circle that the laser sees.
fn bulges(arc: &Arc, point: &Vector2<f64>) -> bool {
    arc.center_m[1] > point.y
}

/// The circle through three points; `None` on a line.
fn through([a, b, c]: [Vector2<f64>; 3]) -> Option<Arc> {
    let (ab, ac) = (b - a, c - a);
    let area = 2.0 * ab.perp(&ac);
    let (bb, cc) = (ab.norm_squared(), ac.norm_squared());
    let offset = Vector2::new(ac.y * bb - ab.y * cc, ab.x * cc - ac.x * bb) / area;
    let arc = Arc { center_m: (a + offset).into(), radius_m: offset.norm() };
    arc.radius_m.is_finite().then_some(arc)
}

/// One step of Gauss and Newton on the distances, with Tukey's weights.
fn refined(arc: Arc, points: &[Vector2<f64>]) -> Option<Arc> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for point in points {
        let ray = point - Vector2::from(arc.center_m);
        let residual = ray.norm() - arc.radius_m;
        let weight = (1.0 - (residual / TOLERANCE_M).powi(2)).max(0.0).powi(2);
        let outward = ray.normalize();
        let row = Vector3::new(-outward.x, -outward.y, -1.0);
        normal += weight * row * row.transpose();
        right -= weight * residual * row;
    }
    let step = normal.cholesky()?.solve(&right);
    let [y, z] = arc.center_m;
    Some(Arc { center_m: [y + step.x, z + step.y], radius_m: arc.radius_m + step.z })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stripe 1 mm apart over a cut of radius 18 mm about (5, 210) mm, between a table and a post of half that width.
    fn stripe() -> Vec<[f64; 2]> {
        (-50..=50)
            .map(|i| {
                let y = 0.001 * f64::from(i);
                let ripple = 2e-5 * (f64::from(i) * 2.3).sin();
                let across = y - 0.005;
                let z = if across.abs() < 0.014 {
                    0.210 - (0.018_f64.powi(2) - across * across).sqrt()
                } else {
                    0.228
                };
                [y, z + ripple]
            })
            .collect()
    }

    #[test]
    fn an_arc_is_found_on_a_table_that_is_most_of_the_stripe() {
        for radius in [None, Some(0.020)] {
            let fit = fit_arc(&stripe(), radius).unwrap();
            let [y, z] = fit.arc.center_m;
            assert!((y - 0.005).abs() < 3e-5 && (z - 0.210).abs() < 5e-5, "{:?}", fit.arc);
            assert!((fit.arc.radius_m - 0.018).abs() < 5e-5);
            // All 27 of the ball, and at most where it meets the table two more.
            assert!((27..=29).contains(&fit.points_m.len()));
        }
    }

    #[test]
    fn a_table_a_hollow_and_a_larger_ball_are_no_arc() {
        let table: Vec<[f64; 2]> = (-50..50).map(|i| [0.001 * f64::from(i), 0.2]).collect();
        assert_eq!(fit_arc(&table, None), None);
        assert_eq!(fit_arc(&table, Some(0.020)), None);
        let hollow: Vec<[f64; 2]> = stripe().iter().map(|&[y, z]| [y, 0.4 - z]).collect();
        assert_eq!(fit_arc(&hollow, Some(0.020)), None);
        assert_eq!(fit_arc(&stripe(), Some(0.010)).map(|fit| fit.arc), None);
        assert_eq!(fit_arc(&[], None), None);
        assert_eq!(fit_arc(&[[f64::NAN; 2]; 40], None), None);
    }
}
