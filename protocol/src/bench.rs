//! Lock-step between a simulated hand and an emulated board: one frame each way for each control period. The board
//! waits for its frame, so time stands still in between and every run is the same.
//!
//! The frames go over pipes that lose nothing; what the *bus* does to its bytes they carry as it is.

use crate::bytes::{Field, Reader, Writer};
use crate::ids::{FINGER_COUNT, JOINT_COUNT};

/// Most bytes of the bus in one control period and one direction.
pub const BUS_MAX: usize = 512;

/// Bytes of the bus that pass in one control period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusBytes {
    len: u16,
    bytes: [u8; BUS_MAX],
}

impl Default for BusBytes {
    fn default() -> Self {
        Self { len: 0, bytes: [0; BUS_MAX] }
    }
}

impl BusBytes {
    const LEN: usize = u16::LEN + <[u8; BUS_MAX]>::LEN;

    /// These bytes; `None` if they are too many.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let mut all = Self { len: u16::try_from(bytes.len()).ok()?, ..Self::default() };
        all.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(all)
    }

    /// Bytes that `fill` writes into the room it is given; it returns how many.
    pub fn filled(fill: impl FnOnce(&mut [u8]) -> usize) -> Self {
        let mut all = Self::default();
        all.len = fill(&mut all.bytes).min(BUS_MAX) as u16;
        all
    }

    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&self.bytes)
    }

    fn put(&self, out: &mut Writer<'_>) {
        self.len.put(out);
        self.bytes.put(out);
    }

    fn get(input: &mut Reader<'_>) -> Self {
        Self { len: Field::get(input), bytes: Field::get(input) }
    }
}

/// Begins a control period.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ToBoard {
    /// The hand's time, wrapping.
    pub now_us: u32,
    /// Joint angles.
    pub position_rad: [f32; JOINT_COUNT],
    /// Strain gauges.
    pub joint_torque_nm: [f32; JOINT_COUNT],
    /// Force, then moment, on each fingertip, N and N m.
    pub tip_wrench: [[f32; 6]; FINGER_COUNT],
    /// What the bus brings.
    pub bus: BusBytes,
}

impl ToBoard {
    /// Bytes of the frame.
    pub const LEN: usize =
        u32::LEN + 2 * <[f32; JOINT_COUNT]>::LEN + <[[f32; 6]; FINGER_COUNT]>::LEN + BusBytes::LEN;

    /// Writes the frame.
    pub fn encode(&self, bytes: &mut [u8; Self::LEN]) {
        let mut out = Writer(bytes);
        self.now_us.put(&mut out);
        self.position_rad.put(&mut out);
        self.joint_torque_nm.put(&mut out);
        self.tip_wrench.put(&mut out);
        self.bus.put(&mut out);
        debug_assert!(out.0.is_empty());
    }

    /// Reads the frame.
    #[must_use]
    pub fn decode(bytes: &[u8; Self::LEN]) -> Self {
        let mut input = Reader(bytes);
        Self {
            now_us: Field::get(&mut input),
            position_rad: Field::get(&mut input),
            joint_torque_nm: Field::get(&mut input),
            tip_wrench: Field::get(&mut input),
            bus: BusBytes::get(&mut input),
        }
    }
}

/// Ends a control period.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FromBoard {
    /// Joint torques.
    pub torque_nm: [f32; JOINT_COUNT],
    /// Where the thumb's rotation is to go; counts while the thumb has torque.
    pub thumb_rotation_rad: f32,
    /// Fingers with torque, one bit each.
    pub enabled: u8,
    /// Whether the watchdog was fed.
    pub watchdog_fed: bool,
    /// What goes onto the bus.
    pub bus: BusBytes,
}

impl FromBoard {
    /// Bytes of the frame.
    pub const LEN: usize = <[f32; JOINT_COUNT]>::LEN + f32::LEN + u8::LEN + u8::LEN + BusBytes::LEN;

    /// Writes the frame.
    pub fn encode(&self, bytes: &mut [u8; Self::LEN]) {
        let mut out = Writer(bytes);
        self.torque_nm.put(&mut out);
        self.thumb_rotation_rad.put(&mut out);
        self.enabled.put(&mut out);
        u8::from(self.watchdog_fed).put(&mut out);
        self.bus.put(&mut out);
        debug_assert!(out.0.is_empty());
    }

    /// Reads the frame.
    #[must_use]
    pub fn decode(bytes: &[u8; Self::LEN]) -> Self {
        let mut input = Reader(bytes);
        Self {
            torque_nm: Field::get(&mut input),
            thumb_rotation_rad: Field::get(&mut input),
            enabled: Field::get(&mut input),
            watchdog_fed: <u8 as Field>::get(&mut input) != 0,
            bus: BusBytes::get(&mut input),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_survive_the_round_trip() {
        let bus = BusBytes::new(&[7; BUS_MAX]).expect("just fits");
        assert_eq!(BusBytes::new(&[7; BUS_MAX + 1]), None);
        let to = ToBoard {
            now_us: 1,
            position_rad: core::array::from_fn(|i| i as f32),
            joint_torque_nm: core::array::from_fn(|i| -(i as f32)),
            tip_wrench: core::array::from_fn(|f| core::array::from_fn(|i| (10 * f + i) as f32)),
            bus,
        };
        let mut bytes = [0; ToBoard::LEN];
        to.encode(&mut bytes);
        assert_eq!(ToBoard::decode(&bytes), to);
        let from = FromBoard {
            torque_nm: core::array::from_fn(|i| i as f32),
            thumb_rotation_rad: 0.25,
            enabled: 5,
            watchdog_fed: true,
            bus: BusBytes::filled(|room| {
                room[..2].copy_from_slice(&[8, 9]);
                2
            }),
        };
        assert_eq!(from.bus.as_slice(), [8, 9]);
        let mut bytes = [0; FromBoard::LEN];
        from.encode(&mut bytes);
        assert_eq!(FromBoard::decode(&bytes), from);
    }

    #[test]
    fn a_length_beyond_the_frame_is_cut() {
        let mut bytes = [0xff; FromBoard::LEN];
        bytes[..52].fill(0);
        assert_eq!(FromBoard::decode(&bytes).bus.as_slice().len(), BUS_MAX);
    }
}
