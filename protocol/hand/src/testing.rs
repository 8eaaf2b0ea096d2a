//! Seeded random poses for the tests.

use std::vec::Vec;

use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{FingerAngles, HandLimits, HandModel};

/// A source of finger poses.
pub(crate) struct Poses(ChaCha8Rng);

impl Poses {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..=high)
    }

    fn take(&mut self, count: usize, limits: &HandLimits<f64>) -> Vec<FingerAngles<f64>> {
        let ranges = [limits.abduction, limits.flexion, limits.middle];
        (0..count)
            .map(|_| FingerAngles::from_array(&ranges.map(|r| self.uniform(r.lower_rad, r.upper_rad))))
            .collect()
    }

    /// Poses evenly over the soft limits.
    pub(crate) fn take_soft(&mut self, count: usize) -> Vec<FingerAngles<f64>> {
        self.take(count, &HandModel::hit_dlr().soft_limits)
    }

    /// Poses evenly over the hard limits.
    pub(crate) fn take_hard(&mut self, count: usize) -> Vec<FingerAngles<f64>> {
        self.take(count, &HandModel::hit_dlr().hard_limits)
    }
}
