//! Integers that stand for physical quantities on the wire.
//!
//! Each is a newtype over a 16-bit integer with the size of its last digit as a derived constant, so that a raw count
//! is never taken for a number of radians. A full scale that is a power of two makes the way from integer to `f32`
//! exact. Conversion from `f32` rounds to the nearest digit, saturates at the ends, and answers `None` to NaN:
//! no wire value stands for "not a number", and zero would be an invented one.

/// Nearest integer, ties to even, saturating; `None` for NaN.
///
/// A number of less than 2^22 that 1.5 * 2^23 is added to has no digits left behind the point, and its integer stands in the low
/// bits of the sum; of any other number something else does, which is out of range. A cast is twice as long on the
/// target, for it has NaN and the ends of the range to think of.
fn nearest(digits: f32) -> Option<i32> {
    const SHIFT: f32 = 12_582_912.0;
    const MOST: i32 = 1 << 22;
    let integer = (digits + SHIFT).to_bits().wrapping_sub(SHIFT.to_bits()) as i32;
    if (-MOST..MOST).contains(&integer) {
        Some(integer)
    } else if digits.is_nan() {
        None
    } else {
        Some(if digits > 0.0 { i32::MAX } else { i32::MIN })
    }
}

macro_rules! wire_quantity {
    (
        $(#[$doc:meta])*
        $name:ident($int:ty), $lsb:ident = $full_scale:expr, $full_doc:literal,
        $from:ident, $to:ident, $unit:literal
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        #[repr(transparent)]
        pub struct $name(pub $int);

        impl $name {
            #[doc = concat!("Size of the last digit, ", $unit, ": ", $full_doc)]
            pub const $lsb: f32 = ($full_scale) / (<$int>::MAX as f32 + 1.0);
            /// Smallest value of the wire.
            pub const MIN: Self = Self(<$int>::MIN);
            /// Largest value of the wire.
            pub const MAX: Self = Self(<$int>::MAX);

            #[doc = concat!("Nearest wire value to a number of ", $unit, ", saturating; `None` for NaN.")]
            #[must_use]
            pub fn $from(value: f32) -> Option<Self> {
                let digits = nearest(value * (1.0 / Self::$lsb))?;
                Some(Self(digits.clamp(i32::from(<$int>::MIN), i32::from(<$int>::MAX)) as $int))
            }

            #[doc = concat!("The value in ", $unit, ".")]
            #[must_use]
            pub fn $to(self) -> f32 {
                f32::from(self.0) * Self::$lsb
            }
        }
    };
}

wire_quantity! {
    /// A joint angle.
    ///
    /// ```
    /// use protocol::units::AngleQ;
    /// let q = AngleQ::from_rad(0.5).expect("a number");
    /// assert!((q.to_rad() - 0.5).abs() <= AngleQ::RAD_PER_LSB / 2.0);
    /// assert_eq!(AngleQ::from_rad(1.0e9), Some(AngleQ::MAX));
    /// ```
    AngleQ(i16), RAD_PER_LSB = core::f32::consts::PI,
    "half a turn is full scale; 18 times finer than a sensor of 0.1 degrees.",
    from_rad, to_rad, "radians"
}

wire_quantity! {
    /// A joint velocity.
    VelocityQ(i16), RAD_PER_S_PER_LSB = 16.0,
    "16 rad/s is full scale, five times what the drives reach.",
    from_rad_per_s, to_rad_per_s, "radians per second"
}

wire_quantity! {
    /// A joint torque, positive in the direction of the angle.
    TorqueQ(i16), NM_PER_LSB = 4.0,
    "4 N m is full scale, over twice the range of the joint torque sensors.",
    from_nm, to_nm, "newton metres"
}

wire_quantity! {
    /// A component of a fingertip force.
    ForceQ(i16), N_PER_LSB = 32.0,
    "32 N is full scale, three times the continuous fingertip force.",
    from_n, to_n, "newtons"
}

wire_quantity! {
    /// A component of a fingertip torque. Fingertips see a few hundred newton millimetres at most, so this is finer
    /// than [`TorqueQ`].
    TipTorqueQ(i16), NM_PER_LSB = 0.5,
    "0.5 N m is full scale, over twice the range of the fingertip sensors.",
    from_nm, to_nm, "newton metres"
}

wire_quantity! {
    /// A translational stiffness; never negative.
    StiffnessQ(u16), N_PER_M_PER_LSB = 8192.0,
    "8192 N/m is full scale.",
    from_n_per_m, to_n_per_m, "newtons per metre"
}

wire_quantity! {
    /// A translational damping; never negative.
    DampingQ(u16), N_S_PER_M_PER_LSB = 256.0,
    "256 N s/m is full scale.",
    from_n_s_per_m, to_n_s_per_m, "newton seconds per metre"
}

#[cfg(test)]
mod tests {
    use super::*;

    macro_rules! check_quantity {
        ($test:ident, $name:ident, $lsb:ident, $from:ident, $to:ident) => {
            #[test]
            fn $test() {
                let lsb = $name::$lsb;
                // Every wire value survives the round trip, and every value between rounds to a neighbour.
                for raw in $name::MIN.0..=$name::MAX.0 {
                    let value = $name(raw).$to();
                    assert_eq!($name::$from(value), Some($name(raw)));
                    let beside = $name::$from(value + 0.3 * lsb).map(|q| q.0.abs_diff(raw));
                    assert_eq!(beside, Some(0), "{raw}");
                }
                let (low, high) = ($name::MIN.$to(), $name::MAX.$to());
                assert_eq!($name::$from(high + 1.0e3 * lsb), Some($name::MAX));
                assert_eq!($name::$from(low - 1.0e3 * lsb), Some($name::MIN));
                assert_eq!($name::$from(f32::INFINITY), Some($name::MAX));
                assert_eq!($name::$from(f32::NEG_INFINITY), Some($name::MIN));
                assert_eq!($name::$from(f32::NAN), None);
                assert_eq!($name::$from(-0.0), Some($name(0)));
            }
        };
    }

    check_quantity!(angle, AngleQ, RAD_PER_LSB, from_rad, to_rad);
    check_quantity!(velocity, VelocityQ, RAD_PER_S_PER_LSB, from_rad_per_s, to_rad_per_s);
    check_quantity!(torque, TorqueQ, NM_PER_LSB, from_nm, to_nm);
    check_quantity!(force, ForceQ, N_PER_LSB, from_n, to_n);
    check_quantity!(tip_torque, TipTorqueQ, NM_PER_LSB, from_nm, to_nm);
    check_quantity!(stiffness, StiffnessQ, N_PER_M_PER_LSB, from_n_per_m, to_n_per_m);
    check_quantity!(damping, DampingQ, N_S_PER_M_PER_LSB, from_n_s_per_m, to_n_s_per_m);

    #[test]
    fn known_values() {
        assert_eq!(AngleQ::from_rad(core::f32::consts::FRAC_PI_2), Some(AngleQ(16384)));
        assert_eq!(TorqueQ::from_nm(-1.0), Some(TorqueQ(-8192)));
        assert_eq!(TorqueQ(1).to_nm(), 1.0 / 8192.0);
        assert_eq!(ForceQ::from_n(10.0), Some(ForceQ(10240)));
        assert_eq!(StiffnessQ::from_n_per_m(800.0), Some(StiffnessQ(6400)));
        assert_eq!(StiffnessQ::from_n_per_m(-1.0), Some(StiffnessQ(0)));
    }
}
