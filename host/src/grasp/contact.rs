//! Where a finger touches, and how hard it may push there.

use nalgebra::{Point3, Unit, Vector3};
use thiserror::Error;

/// Largest magnitude of a coordinate or a length, metres.
///
/// No contact comes near it. Together with [`MAX_FRICTION`] and [`MAX_FORCE_N`] it keeps every product that the metric
/// forms far from overflow, so that nothing behind [`Contact::new`] has to ask for infinities again.
pub const MAX_LENGTH_M: f64 = 1e9;
/// Largest friction coefficient.
pub const MAX_FRICTION: f64 = 1e6;
/// Largest normal force limit, newtons.
pub const MAX_FORCE_N: f64 = 1e9;

/// Why numbers are not a contact.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ContactError {
    /// A coordinate is NaN, infinite or beyond [`MAX_LENGTH_M`].
    #[error("point ({x}, {y}, {z}) has a coordinate that is not a length up to {MAX_LENGTH_M:e} m")]
    Point {
        /// First coordinate, metres.
        x: f64,
        /// Second coordinate, metres.
        y: f64,
        /// Third coordinate, metres.
        z: f64,
    },
    /// The normal is zero, NaN or infinite, so it has no direction.
    #[error("normal ({x}, {y}, {z}) has no direction")]
    Normal {
        /// First component.
        x: f64,
        /// Second component.
        y: f64,
        /// Third component.
        z: f64,
    },
    /// The friction coefficient is negative, NaN or beyond [`MAX_FRICTION`].
    #[error("friction {0} is not a coefficient between 0 and {MAX_FRICTION:e}")]
    Friction(f64),
    /// The torsional lever is negative, NaN or beyond [`MAX_LENGTH_M`].
    #[error("torsional_m {0} is not a length between 0 and {MAX_LENGTH_M:e} m")]
    Torsion(f64),
    /// The force limit is not positive, NaN or beyond [`MAX_FORCE_N`].
    #[error("max_force_n {0} is not a positive force up to {MAX_FORCE_N:e} N")]
    Force(f64),
}

/// One contact of a finger with the object: a point, the direction in which the finger pushes, and its friction.
///
/// A fingertip that pushes with the normal force `f_n` transmits tangential force `f_t` and, when it is soft, a moment
/// `m_n` about the normal, as long as `|f_t|^2 + (m_n / torsional_m)^2 <= (friction f_n)^2`: the ellipsoid of a soft
/// finger, which for `torsional_m = 0` is the Coulomb cone of a hard point contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    point_in_object: Point3<f64>,
    inward_normal_in_object: Unit<Vector3<f64>>,
    friction: f64,
    torsional_m: f64,
    max_force_n: f64,
}

impl Contact {
    /// Limit of the normal force when none is given, newtons: the unit force of Ferrari and Canny's L-infinity set.
    pub const DEFAULT_MAX_FORCE_N: f64 = 1.0;

    /// A hard point contact with friction, limited to [`Contact::DEFAULT_MAX_FORCE_N`].
    ///
    /// The normal points **into** the object, along the force of the finger; it need not be a unit vector.
    pub fn new(
        point_in_object: Point3<f64>,
        inward_normal_in_object: Vector3<f64>,
        friction: f64,
    ) -> Result<Self, ContactError> {
        let Point3 { coords: p } = point_in_object;
        if !p.iter().all(|x| x.abs() <= MAX_LENGTH_M) {
            return Err(ContactError::Point { x: p.x, y: p.y, z: p.z });
        }
        let n = inward_normal_in_object;
        // Division by the largest component first: the square of 1e-200 would vanish.
        let largest = n.amax();
        if !(largest.is_finite() && largest > 0.0 && n.iter().all(|x| x.is_finite())) {
            return Err(ContactError::Normal { x: n.x, y: n.y, z: n.z });
        }
        if !(0.0..=MAX_FRICTION).contains(&friction) {
            return Err(ContactError::Friction(friction));
        }
        Ok(Self {
            point_in_object,
            inward_normal_in_object: Unit::new_normalize(n / largest),
            friction,
            torsional_m: 0.0,
            max_force_n: Self::DEFAULT_MAX_FORCE_N,
        })
    }

    /// The same contact as a soft finger: its largest moment about the normal is `torsional_m` times its largest
    /// friction force. 0 is a hard contact.
    pub fn with_torsion(self, torsional_m: f64) -> Result<Self, ContactError> {
        if !(0.0..=MAX_LENGTH_M).contains(&torsional_m) {
            return Err(ContactError::Torsion(torsional_m));
        }
        Ok(Self { torsional_m, ..self })
    }

    /// The same contact with another limit of the normal force, newtons. Only the L-infinity norm looks at it.
    pub fn with_max_force(self, max_force_n: f64) -> Result<Self, ContactError> {
        if !(max_force_n > 0.0 && max_force_n <= MAX_FORCE_N) {
            return Err(ContactError::Force(max_force_n));
        }
        Ok(Self { max_force_n, ..self })
    }

    /// Position in the object frame, metres.
    #[must_use]
    pub fn point_in_object(&self) -> Point3<f64> {
        self.point_in_object
    }

    /// Unit normal in the object frame, into the object.
    #[must_use]
    pub fn inward_normal_in_object(&self) -> Unit<Vector3<f64>> {
        self.inward_normal_in_object
    }

    /// Coulomb friction coefficient.
    #[must_use]
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Lever of the torsional friction, metres; 0 for a hard contact.
    #[must_use]
    pub fn torsional_m(&self) -> f64 {
        self.torsional_m
    }

    /// Largest normal force, newtons.
    #[must_use]
    pub fn max_force_n(&self) -> f64 {
        self.max_force_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_of_any_length_is_made_a_unit() {
        for length in [1e-300, 1e-200, 1e-3, 1.0, 1e200, 1e308] {
            let contact = Contact::new(Point3::origin(), Vector3::new(0.6, 0.0, -0.8) * length, 0.4).unwrap();
            let n = contact.inward_normal_in_object();
            assert!((n.into_inner() - Vector3::new(0.6, 0.0, -0.8)).norm() < 1e-15, "{length:e}: {n:?}");
        }
    }

    #[test]
    fn numbers_that_are_no_contact_are_named() {
        let (p, n) = (Point3::origin(), Vector3::x());
        let nan = f64::NAN;
        for normal in [Vector3::zeros(), Vector3::new(1.0, nan, 0.0), Vector3::new(f64::INFINITY, 0.0, 0.0)] {
            assert!(matches!(Contact::new(p, normal, 0.4), Err(ContactError::Normal { .. })), "{normal}");
        }
        for x in [nan, f64::INFINITY, 2e9] {
            assert!(matches!(
                Contact::new(Point3::new(0.0, x, 0.0), n, 0.4),
                Err(ContactError::Point { .. })
            ));
        }
        for friction in [nan, -0.1, f64::INFINITY] {
            assert!(matches!(Contact::new(p, n, friction), Err(ContactError::Friction(_))));
        }
        let contact = Contact::new(p, n, 0.4).unwrap();
        assert!(matches!(contact.with_torsion(-1e-3), Err(ContactError::Torsion(_))));
        assert!(matches!(contact.with_torsion(nan), Err(ContactError::Torsion(_))));
        for force in [0.0, -1.0, nan, f64::INFINITY] {
            assert!(matches!(contact.with_max_force(force), Err(ContactError::Force(_))));
        }
        let message = Contact::new(p, n, -0.25).unwrap_err().to_string();
        assert!(message.contains("-0.25"), "{message}");
    }
}
