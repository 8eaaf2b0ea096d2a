//! Distances between segments, points and boxes.

use nalgebra::{Point3, Vector3};

/// Halvings of the interval that holds the nearest point of a segment to a box: a thousandth of a millimetre at a metre.
const BISECTIONS: usize = 20;

/// Distance of a point from the segment between two others, metres.
#[must_use]
pub fn point_to_segment_m(point: &Point3<f64>, [a, b]: &[Point3<f64>; 2]) -> f64 {
    let way = b - a;
    let share = (point - a).dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE);
    (a + way * share.clamp(0.0, 1.0) - point).norm()
}

/// Distance between two segments, metres; either may be a point.
///
/// Where the lines' nearest points lie inside both segments it is theirs, else that of one end from the other segment.
#[must_use]
pub fn segment_to_segment_m(first: &[Point3<f64>; 2], second: &[Point3<f64>; 2]) -> f64 {
    let ends = (point_to_segment_m(&first[0], second).min(point_to_segment_m(&first[1], second)))
        .min(point_to_segment_m(&second[0], first))
        .min(point_to_segment_m(&second[1], first));
    let (u, v, w) = (first[1] - first[0], second[1] - second[0], first[0] - second[0]);
    let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let determinant = uu * vv - uv * uv;
    // For parallel segments an end is among the nearest points.
    if determinant <= 1e-12 * uu * vv {
        return ends;
    }
    let (s, t) = ((uv * vw - vv * uw) / determinant, (uu * vw - uv * uw) / determinant);
    if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
        return ends.min((w + u * s - v * t).norm());
    }
    ends
}

/// Distance between a segment and a box about the origin with edges along the axes, metres; 0 when they meet. At most a
/// micrometre (at a metre of length) too large.
///
/// The distance from the box is convex along the segment, so that its slope tells on which side the least one lies.
#[must_use]
pub fn segment_to_box_m(ends: &[Point3<f64>; 2], half_extents_m: &Vector3<f64>) -> f64 {
    let way = ends[1] - ends[0];
    let outside = |share: f64| {
        let point = ends[0].coords + way * share;
        point.zip_map(half_extents_m, |c, half| c - c.clamp(-half, half))
    };
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let slope = outside(middle).dot(&way);
        if slope > 0.0 {
            high = middle;
        } else if slope < 0.0 {
            low = middle;
        } else {
            return outside(middle).norm();
        }
    }
    outside(low).norm().min(outside(high).norm())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(Point3::from)
    }

    #[test]
    fn known_distances() {
        let p = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        let x_axis = [p(-1.0, 0.0, 0.0), p(1.0, 0.0, 0.0)];
        assert_eq!(point_to_segment_m(&p(0.5, 2.0, 0.0), &x_axis), 2.0);
        assert_eq!(point_to_segment_m(&p(4.0, 4.0, 0.0), &x_axis), 5.0);
        assert_eq!(segment_to_segment_m(&x_axis, &[p(0.0, -1.0, 0.5), p(0.0, 1.0, 0.5)]), 0.5);
        assert_eq!(segment_to_segment_m(&x_axis, &[p(-3.0, 1.0, 0.0), p(3.0, 1.0, 0.0)]), 1.0);
        assert_eq!(segment_to_segment_m(&x_axis, &[p(2.0, 0.0, 0.0), p(3.0, 0.0, 0.0)]), 1.0);
        assert_eq!(segment_to_segment_m(&[p(0.0, 3.0, 0.0); 2], &x_axis), 3.0);
        let half = Vector3::new(1.0, 2.0, 3.0);
        assert_eq!(segment_to_box_m(&[p(4.0, 6.0, -9.0), p(4.0, 6.0, 9.0)], &half), 5.0);
        assert_eq!(segment_to_box_m(&[p(-9.0, 0.0, 0.0), p(9.0, 0.0, 0.0)], &half), 0.0);
        assert!((segment_to_box_m(&[p(2.0, 3.0, 4.0), p(9.0, 9.0, 9.0)], &half) - 3f64.sqrt()).abs() < 1e-5);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Against the least over many points of both.
        #[test]
        fn no_pair_of_points_is_nearer(a in point(), b in point(), c in point(), d in point()) {
            let half = Vector3::new(0.2, 0.3, 0.1);
            let (first, second) = ([a, b], [c, d]);
            let found = segment_to_segment_m(&first, &second);
            let to_box = segment_to_box_m(&first, &half);
            let (mut least, mut least_box) = (f64::INFINITY, f64::INFINITY);
            let count = 400;
            for i in 0..=count {
                let on_first = a + (b - a) * (f64::from(i) / f64::from(count));
                least = least.min(point_to_segment_m(&on_first, &second));
                let nearest = on_first.coords.zip_map(&half, |c, half| c.clamp(-half, half));
                least_box = least_box.min((on_first.coords - nearest).norm());
            }
            let spacing = (b - a).norm() / f64::from(count);
            prop_assert!(found <= least + 1e-12 && found >= least - spacing);
            prop_assert!(to_box <= least_box + 1e-5 && to_box >= least_box - spacing);
        }
    }
}
