//! Hand to host: the cyclic state.
//!
//! ```text
//! byte   0  kind, 0x81
//!        1  seq             u16
//!        3  t_us            u32
//!        7  echoed_seq      u16
//!        9  command_age_us  u16
//!       11  status.drive    u8
//!       12  status.fingers   4 x u8
//!       16  status.bus      u8
//!       17  status.fault    u8
//!       18  status.slipping u8, bit i = FingerId i
//!       19  status.limited  u16, bit i = JointId i
//!       21  status.limits   u32, bit i = Limit 96 + i
//!       25  refused         u16
//!       27  position        13 x AngleQ
//!       53  velocity        13 x VelocityQ
//!       79  torque          13 x TorqueQ
//!      105  tip_wrench       4 x (3 x ForceQ, 3 x TipTorqueQ)
//!      153
//! ```
//!
//! All integers are little-endian, without padding. Arrays of joints are in the order of [`JointId::ALL`], arrays of
//! fingers in that of [`FingerId::ALL`].

use crate::bytes::{Field, Reader, Writer};
use crate::fault::{Code, LimitSet};
use crate::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};
use crate::message::{DecodeError, MessageKind};
use crate::units::{AngleQ, ForceQ, TipTorqueQ, TorqueQ, VelocityQ};

/// State of the drives, after CiA 402. Only [`Self::OperationEnabled`] and [`Self::QuickStopActive`] give torque on
/// command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum DriveState {
    /// Starting; no torque.
    #[default]
    NotReadyToSwitchOn = 0,
    /// Initialised; no torque.
    SwitchOnDisabled = 1,
    /// Power may be switched on; no torque.
    ReadyToSwitchOn = 2,
    /// Power on; no torque.
    SwitchedOn = 3,
    /// Set-points are followed.
    OperationEnabled = 4,
    /// Coming to a stop with torque.
    QuickStopActive = 5,
    /// A fault was found and is being answered.
    FaultReactionActive = 6,
    /// Torque is off until the fault is reset.
    Fault = 7,
}

impl DriveState {
    /// All states by their numbers.
    pub const ALL: [Self; 8] = [
        Self::NotReadyToSwitchOn,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReactionActive,
        Self::Fault,
    ];

    /// The state with this number.
    ///
    /// # Errors
    ///
    /// [`DecodeError::DriveState`] if there is none.
    pub fn from_byte(found: u8) -> Result<Self, DecodeError> {
        Self::ALL.get(usize::from(found)).copied().ok_or(DecodeError::DriveState { found })
    }
}

/// How long the hand has been without a new set-point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum BusTier {
    /// Set-points come in time.
    #[default]
    Fresh = 0,
    /// Some have been missed.
    Late = 1,
    /// So many that the last target is held still.
    Hold = 2,
    /// The hand has stopped and stays stopped until it is told otherwise.
    Stop = 3,
}

impl BusTier {
    const ALL: [Self; 4] = [Self::Fresh, Self::Late, Self::Hold, Self::Stop];

    /// The tier with this number.
    ///
    /// # Errors
    ///
    /// [`DecodeError::BusTier`] if there is none.
    pub fn from_byte(found: u8) -> Result<Self, DecodeError> {
        Self::ALL.get(usize::from(found)).copied().ok_or(DecodeError::BusTier { found })
    }
}

/// A set of fingers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FingerSet(u8);

impl FingerSet {
    /// Every finger.
    pub const ALL: Self = Self((1 << FINGER_COUNT) - 1);

    /// The fingers that this is true of.
    #[must_use]
    pub const fn of(fingers: [bool; FINGER_COUNT]) -> Self {
        let [thumb, index, middle, ring] = fingers;
        Self(thumb as u8 | (index as u8) << 1 | (middle as u8) << 2 | (ring as u8) << 3)
    }

    /// One bit for each finger.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The fingers in the low bits of a byte.
    pub(crate) const fn truncated(bits: u8) -> Self {
        Self(bits & Self::ALL.0)
    }

    /// With this finger added.
    #[must_use]
    pub const fn with(self, finger: FingerId) -> Self {
        Self(self.0 | 1 << finger.index())
    }

    /// Whether the finger is in the set.
    #[must_use]
    pub const fn contains(self, finger: FingerId) -> bool {
        self.0 >> finger.index() & 1 == 1
    }

    const fn from_byte(found: u8) -> Result<Self, DecodeError> {
        if found >> FINGER_COUNT == 0 { Ok(Self(found)) } else { Err(DecodeError::FingerSet { found }) }
    }
}

/// A set of joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct JointSet(u16);

impl JointSet {
    /// One bit for each joint.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// With this joint added.
    #[must_use]
    pub const fn with(self, joint: JointId) -> Self {
        Self(self.0 | 1 << joint.index())
    }

    /// Whether the joint is in the set.
    #[must_use]
    pub const fn contains(self, joint: JointId) -> bool {
        self.0 >> joint.index() & 1 == 1
    }

    /// The set with these bits.
    ///
    /// # Errors
    ///
    /// [`DecodeError::JointSet`] if one stands for no joint.
    pub const fn from_bits(found: u16) -> Result<Self, DecodeError> {
        if found >> JOINT_COUNT == 0 { Ok(Self(found)) } else { Err(DecodeError::JointSet { found }) }
    }
}

/// How the hand is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Status {
    /// State of the hand as a whole.
    pub drive: DriveState,
    /// State of every finger; it has torque only while the hand has.
    pub fingers: [DriveState; FINGER_COUNT],
    /// How long set-points have been missing.
    pub bus: BusTier,
    /// The first fault since the last reset.
    pub fault: Code,
    /// Fingers whose contact slips.
    pub slipping: FingerSet,
    /// Joints held back by a limit.
    pub limited: JointSet,
    /// Which limits those are.
    pub limits: LimitSet,
}

impl Status {
    const LEN: usize =
        u8::LEN + <[u8; FINGER_COUNT]>::LEN + u8::LEN + u8::LEN + u8::LEN + u16::LEN + u32::LEN;

    fn put(&self, out: &mut Writer<'_>) {
        (self.drive as u8).put(out);
        self.fingers.map(|state| state as u8).put(out);
        (self.bus as u8).put(out);
        self.fault.0.put(out);
        self.slipping.0.put(out);
        self.limited.0.put(out);
        self.limits.0.put(out);
    }

    fn get(input: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let drive = DriveState::from_byte(Field::get(input))?;
        let mut fingers = [DriveState::default(); FINGER_COUNT];
        for finger in &mut fingers {
            *finger = DriveState::from_byte(Field::get(input))?;
        }
        Ok(Self {
            drive,
            fingers,
            bus: BusTier::from_byte(Field::get(input))?,
            fault: Code(Field::get(input)),
            slipping: FingerSet::from_byte(Field::get(input))?,
            limited: JointSet::from_bits(Field::get(input))?,
            limits: LimitSet(Field::get(input)),
        })
    }
}

/// Force and torque that the world puts on a fingertip, at the centre of its sphere, along the axes of the distal link.
/// Force before torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TipWrench {
    /// Force by x, y, z.
    pub force: [ForceQ; 3],
    /// Torque about x, y, z.
    pub torque: [TipTorqueQ; 3],
}

impl Field for TipWrench {
    const LEN: usize = <[ForceQ; 3]>::LEN + <[TipTorqueQ; 3]>::LEN;

    fn put(self, out: &mut Writer<'_>) {
        self.force.put(out);
        self.torque.put(out);
    }

    fn get(input: &mut Reader<'_>) -> Self {
        Self { force: Field::get(input), torque: Field::get(input) }
    }
}

/// What the hand measures, once a bus cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HandState {
    /// Counts states up, wrapping.
    pub seq: u16,
    /// When the sensors were read, in the hand's time, microseconds, wrapping after 71 minutes.
    pub t_us: u32,
    /// `seq` of the set-point in effect.
    pub echoed_seq: u16,
    /// How long before `t_us` that set-point came, microseconds; the largest value stands for longer too.
    pub command_age_us: u16,
    /// How the hand is.
    pub status: Status,
    /// Frames that the hand has refused since it started, wrapping. The service channel tells why.
    pub refused: u16,
    /// Measured joint angles.
    pub position: [AngleQ; JOINT_COUNT],
    /// Estimated joint velocities.
    pub velocity: [VelocityQ; JOINT_COUNT],
    /// Measured joint torques.
    pub torque: [TorqueQ; JOINT_COUNT],
    /// Measured fingertip wrenches.
    pub tip_wrench: [TipWrench; FINGER_COUNT],
}

impl HandState {
    /// Bytes of the message.
    pub const LEN: usize = u8::LEN
        + u16::LEN
        + u32::LEN
        + u16::LEN
        + u16::LEN
        + Status::LEN
        + u16::LEN
        + <[AngleQ; JOINT_COUNT]>::LEN
        + <[VelocityQ; JOINT_COUNT]>::LEN
        + <[TorqueQ; JOINT_COUNT]>::LEN
        + <[TipWrench; FINGER_COUNT]>::LEN;

    /// Writes the message.
    pub fn encode(&self, bytes: &mut [u8; Self::LEN]) {
        let mut out = Writer(bytes);
        (MessageKind::HandState as u8).put(&mut out);
        self.seq.put(&mut out);
        self.t_us.put(&mut out);
        self.echoed_seq.put(&mut out);
        self.command_age_us.put(&mut out);
        self.status.put(&mut out);
        self.refused.put(&mut out);
        self.position.put(&mut out);
        self.velocity.put(&mut out);
        self.torque.put(&mut out);
        self.tip_wrench.put(&mut out);
        debug_assert!(out.0.is_empty());
    }

    /// Reads the message.
    ///
    /// # Errors
    ///
    /// Another kind, a drive state or a bus tier that has no meaning, a finger or a joint that does not exist. A fault or
    /// a limit that is not known is none: a newer hand may have more of them.
    pub fn decode(bytes: &[u8; Self::LEN]) -> Result<Self, DecodeError> {
        let mut input = Reader(bytes);
        MessageKind::HandState.expect(Field::get(&mut input))?;
        let state = Self {
            seq: Field::get(&mut input),
            t_us: Field::get(&mut input),
            echoed_seq: Field::get(&mut input),
            command_age_us: Field::get(&mut input),
            status: Status::get(&mut input)?,
            refused: Field::get(&mut input),
            position: Field::get(&mut input),
            velocity: Field::get(&mut input),
            torque: Field::get(&mut input),
            tip_wrench: Field::get(&mut input),
        };
        debug_assert!(input.0.is_empty());
        Ok(state)
    }
}

const _: () = assert!(HandState::LEN == 153);
