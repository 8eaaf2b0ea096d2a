//! Joint angles of a whole hand.

use std::ops::{Add, Index, IndexMut, Mul, Sub};

/// Most independent joints of a hand. The most jointed hands in use have 24.
pub const MAX_JOINTS: usize = 32;

/// Most fingers of a hand.
pub const MAX_FINGERS: usize = 8;

/// One number for each independent joint of a hand, rad (metres for a sliding joint), in the order of
/// [`Hand::joints`](super::Hand::joints); what lies behind the last joint is 0. Also used for changes of posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture(pub [f64; MAX_JOINTS]);

impl Posture {
    /// All joints at 0.
    pub const ZERO: Self = Self([0.0; MAX_JOINTS]);
}

impl Default for Posture {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Index<usize> for Posture {
    type Output = f64;

    fn index(&self, joint: usize) -> &f64 {
        &self.0[joint]
    }
}

impl IndexMut<usize> for Posture {
    fn index_mut(&mut self, joint: usize) -> &mut f64 {
        &mut self.0[joint]
    }
}

impl Add for Posture {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Sub for Posture {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Mul<f64> for Posture {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|angle| angle * factor))
    }
}
