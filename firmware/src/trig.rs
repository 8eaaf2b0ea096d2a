//! Sine and cosine in single precision, for the control tick.
//!
//! The `f32` functions of libm work in `f64` inside, which a Cortex-M4F has to emulate: over two thousand
//! instructions a pair against some forty here. Only additions, products and one conversion to an integer and back, so the
//! host and the target give the same bits.

use core::f32::consts::FRAC_2_PI;

/// A quarter turn in three parts. The first two have so few digits that their products with a whole number of quarter
/// turns are exact; the third is the rest.
const QUARTER_TURN: [f32; 3] = [201.0 / 128.0, 63.0 / 131_072.0, 3.174_939_4e-6];

/// `(sin r - r) / r^3` and `(cos r - 1 + r^2/2) / r^4` over an eighth of a turn, as polynomials in `r^2` through their
/// values at Chebyshev's nodes; exact to 9e-9 and 6e-10 before rounding.
const SIN: [f32; 3] = [-0.166_666_65, 8.332_747e-3, -1.958_763_9e-4];
const COS: [f32; 3] = [0.041_666_664, -1.388_830_2e-3, 2.454_769e-5];

/// `(sin, cos)` of an angle in radians, to 1.2e-7 for angles within +-1000 rad. Beyond that the error grows with the
/// angle; an angle that is not finite gives NaN.
///
/// ```
/// use firmware::trig::sin_cos;
/// let (sin, cos) = sin_cos(0.5);
/// assert!((sin - 0.479_425_54).abs() < 1.2e-7 && (cos - 0.877_582_56).abs() < 1.2e-7);
/// ```
#[must_use]
pub fn sin_cos(angle_rad: f32) -> (f32, f32) {
    // The conversion truncates, so half a turn of the digit towards the angle's side rounds.
    let quarters = (angle_rad * FRAC_2_PI + if angle_rad < 0.0 { -0.5 } else { 0.5 }) as i32;
    let whole = quarters as f32;
    let [high, middle, low] = QUARTER_TURN;
    let r = ((angle_rad - whole * high) - whole * middle) - whole * low;

    let r2 = r * r;
    let sin = r + r * r2 * (SIN[0] + r2 * (SIN[1] + r2 * SIN[2]));
    let cos = 1.0 - 0.5 * r2 + r2 * r2 * (COS[0] + r2 * (COS[1] + r2 * COS[2]));
    match quarters & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst_error(angles: impl Iterator<Item = f32>) -> f64 {
        angles.fold(0.0, |worst: f64, angle| {
            let (sin, cos) = sin_cos(angle);
            let (sin_64, cos_64) = f64::from(angle).sin_cos();
            worst.max((f64::from(sin) - sin_64).abs()).max((f64::from(cos) - cos_64).abs())
        })
    }

    #[test]
    fn close_to_double_precision() {
        let near = worst_error((-1_000_000..=1_000_000).map(|i| i as f32 * 4e-6));
        assert!(near < 1.0e-7, "{near}");
        let far = worst_error((-1_000_000..=1_000_000).map(|i| i as f32 * 1.0e-3));
        assert!(far < 1.2e-7, "{far}");
    }

    #[test]
    fn exact_at_zero_and_odd_and_even() {
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        for i in 0..1000 {
            let (sin, cos) = sin_cos(i as f32 * 0.01);
            assert_eq!(sin_cos(i as f32 * -0.01), (-sin, cos));
        }
    }

    #[test]
    fn what_is_no_angle_has_no_sine() {
        for angle in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let (sin, cos) = sin_cos(angle);
            assert!(sin.is_nan() && cos.is_nan(), "{angle}");
        }
    }
}
