//! The bus between the hand's board and the four finger boards: one exchange of [`LEN`] bytes each way with every finger in
//! every control period. Bytes and judgement alone; clocks, pins and DMA are the board's. `docs/hardware.md` has the timing.
//!
//! ```text
//!          0     1     2 3 4 5 6 7     8 9      10 .. 13  14 .. 31
//!         +-----+-----+-------------+----------+---------+---------+
//! command |count| mode| 3 torques   | rotation | CRC-32C | 0       |
//!         +-----+-----+-------------+----------+---------+---------+
//!          0     1     2 3 4 5 6 7     8 9      10 .. 15    16 .. 27                 28 .. 31
//!         +-----+-----+-------------+----------+-----------+------------------------+---------+
//! reply   |echo |state| 3 angles    | rotation | 3 torques | force 3, moment 3      | CRC-32C |
//!         +-----+-----+-------------+----------+-----------+------------------------+---------+
//! ```
//!
//! Numbers are little-endian, joints in the order abduction, flexion, middle, units those of [`protocol::units`].

mod fingers;
mod frame;

pub use fingers::{Counters, FingerBus, MISSED_MAX};
pub use frame::{Command, LEN, Reply, ReplyError};
