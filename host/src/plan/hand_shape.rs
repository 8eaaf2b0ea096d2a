//! The hand in one posture, as a rigid body that the arm carries: balls and boxes.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::hand::{Hand, PalmBox, Posture};

/// A ball that is fixed in the palm frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Its centre, metres.
    pub center_in_palm: Point3<f64>,
    /// Its radius.
    pub radius_m: f64,
}

/// Fingers as balls and the palm as boxes, in the palm frame.
#[derive(Debug, Clone, PartialEq)]
pub struct HandShape {
    balls: Vec<Ball>,
    boxes: Vec<PalmBox>,
    bound: Ball,
}

impl HandShape {
    /// Of balls and boxes.
    #[must_use]
    pub fn new(balls: Vec<Ball>, boxes: Vec<PalmBox>) -> Self {
        let bound = bound(&balls, &boxes);
        Self { balls, boxes, bound }
    }

    /// Of a hand in a posture.
    #[must_use]
    pub fn of(hand: &Hand, posture: &Posture) -> Self {
        let mut balls = Vec::new();
        let mut centers = Vec::new();
        for finger in &hand.fingers {
            finger.bead_centers(posture, &mut centers);
            let beads = finger.beads().iter().zip(&centers);
            balls.extend(
                beads.map(|(bead, center)| Ball { center_in_palm: *center, radius_m: bead.radius_m }),
            );
        }
        Self::new(balls, hand.palm.clone())
    }

    /// The fingers.
    #[must_use]
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// The palm.
    #[must_use]
    pub fn boxes(&self) -> &[PalmBox] {
        &self.boxes
    }

    /// A ball about everything.
    #[must_use]
    pub fn bound(&self) -> &Ball {
        &self.bound
    }
}

/// About the middle of the box that holds everything, along the palm's axes.
fn bound(balls: &[Ball], boxes: &[PalmBox]) -> Ball {
    let corners = boxes.iter().flat_map(|part| {
        (0..8).map(move |corner| {
            let side = |axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
            let at = part.half_extents_m.component_mul(&Vector3::new(side(0), side(1), side(2)));
            Ball { center_in_palm: part.palm_from_box * Point3::from(at), radius_m: 0.0 }
        })
    });
    let all: Vec<Ball> = balls.iter().copied().chain(corners).collect();
    let Some(first) = all.first() else { return Ball { center_in_palm: Point3::origin(), radius_m: 0.0 } };
    let [mut low, mut high] = [first.center_in_palm; 2];
    for ball in &all {
        low = low.inf(&ball.center_in_palm);
        high = high.sup(&ball.center_in_palm);
    }
    let middle = nalgebra::center(&low, &high);
    let reach = |ball: &Ball| (ball.center_in_palm - middle).norm() + ball.radius_m;
    Ball { center_in_palm: middle, radius_m: all.iter().map(reach).fold(0.0, f64::max) }
}

/// The ends of a segment in the frame of a box.
pub(super) fn in_box(base_from_box: &Isometry3<f64>, ends: &[Point3<f64>; 2]) -> [Point3<f64>; 2] {
    ends.map(|end| base_from_box.inverse_transform_point(&end))
}

/// How high the lowest point of a box is, metres, in the frame of `base_from_box`.
pub(super) fn lowest_m(base_from_box: &Isometry3<f64>, half_extents_m: &Vector3<f64>) -> f64 {
    let up_in_box = base_from_box.inverse_transform_vector(&Vector3::z());
    base_from_box.translation.z - half_extents_m.dot(&up_in_box.abs())
}

#[cfg(test)]
mod tests {
    use nalgebra::Translation3;

    use super::*;

    #[test]
    fn the_bound_holds_every_ball_and_corner() {
        let hand = Hand::hit_dlr().unwrap();
        let shape = HandShape::of(&hand, &hand.clamped(Posture::ZERO));
        let bound = shape.bound();
        assert!(shape.balls().len() > 20 && !shape.boxes().is_empty());
        for ball in shape.balls() {
            let reach = (ball.center_in_palm - bound.center_in_palm).norm() + ball.radius_m;
            assert!(reach <= bound.radius_m + 1e-12);
        }
        assert!(bound.radius_m > 0.12 && bound.radius_m < 0.25, "{}", bound.radius_m);
        assert_eq!(HandShape::new(vec![], vec![]).bound().radius_m, 0.0);
    }

    #[test]
    fn a_tilted_box_reaches_down_by_its_half_diagonal() {
        let tilt = Isometry3::rotation(Vector3::x() * std::f64::consts::FRAC_PI_4);
        let base_from_box = Translation3::new(0.0, 0.0, 1.0) * tilt;
        let low = lowest_m(&base_from_box, &Vector3::new(9.0, 0.1, 0.1));
        assert!((low - (1.0 - 0.1 * 2f64.sqrt())).abs() < 1e-12);
    }
}
