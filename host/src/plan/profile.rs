//! Timing of a straight motion from rest to rest.
//!
//! Take-off and set-down are Paul's quartics (*Robot Manipulators*, 1981) with a constant speed between them. Everything
//! that follows one profile, the joints of all fingers for example, arrives at the same time and softly.

/// Share of the time that each of take-off and set-down takes.
pub(super) const BLEND: f64 = 0.4;

/// Progress along a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Share of the way, 0 to 1.
    pub share: f64,
    /// Its rate.
    pub rate_per_s: f64,
}

/// Progress after `time_s` of a motion that takes `duration_s` > 0.
#[must_use]
pub fn rest_to_rest(time_s: f64, duration_s: f64) -> Progress {
    let u = (time_s / duration_s).clamp(0.0, 1.0);
    // The quartic covers half of what the cruise would in the same time.
    let cruise = 1.0 / (1.0 - BLEND);
    let take_off = |u: f64| {
        let h = u / BLEND;
        (0.5 * cruise * BLEND * h * h * h * (2.0 - h), cruise * h * h * (3.0 - 2.0 * h))
    };
    let (share, rate) = if u < BLEND {
        take_off(u)
    } else if u > 1.0 - BLEND {
        let (left, rate) = take_off(1.0 - u);
        (1.0 - left, rate)
    } else {
        (cruise * (u - 0.5 * BLEND), cruise)
    };
    Progress { share, rate_per_s: rate / duration_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_from_rest_to_rest() {
        for (time, share) in [(-1.0, 0.0), (0.0, 0.0), (1.5, 0.5), (3.0, 1.0), (9.0, 1.0)] {
            assert!((rest_to_rest(time, 3.0).share - share).abs() < 1e-15);
        }
        assert_eq!(rest_to_rest(0.0, 3.0).rate_per_s, 0.0);
        assert_eq!(rest_to_rest(3.0, 3.0).rate_per_s, 0.0);
    }

    #[test]
    fn rate_is_the_derivative_and_is_continuous() {
        let step = 1e-5;
        for i in 1..3000 {
            let t = f64::from(i) * 1e-3;
            let (low, high) = (rest_to_rest(t - step, 3.0), rest_to_rest(t + step, 3.0));
            let slope = (high.share - low.share) / (2.0 * step);
            assert!((slope - rest_to_rest(t, 3.0).rate_per_s).abs() < 1e-8, "{t}");
            assert!((high.rate_per_s - low.rate_per_s).abs() < 5.0 * step, "{t}");
        }
    }
}
