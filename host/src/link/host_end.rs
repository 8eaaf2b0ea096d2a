//! A host's end of the bus, as small as it can be.

use protocol::command::Setpoint;
use protocol::frame::{Deframer, FRAME_MAX, Framer, MESSAGE_MAX};
use protocol::message::MessageKind;
use protocol::service::{Call, LogRecord, Reply, Request};
use protocol::telemetry::HandState;

/// What the hand said.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    /// Its state.
    State(Box<HandState>),
    /// A reply; [`Reply::decode`] reads it.
    Reply(Vec<u8>),
    /// An event.
    Log(LogRecord),
    /// Something that the host does not understand.
    Unknown(Vec<u8>),
}

/// A host's end of the bus.
#[derive(Debug, Default)]
pub struct HostEnd {
    framer: Framer,
    deframer: Deframer,
    seq: u16,
    id: u16,
}

impl HostEnd {
    /// The bytes of a new set-point; its `seq` is put in here.
    pub fn setpoint(&mut self, setpoint: &Setpoint) -> Vec<u8> {
        self.seq = self.seq.wrapping_add(1);
        self.setpoint_again(setpoint)
    }

    /// The bytes of a set-point that says nothing new.
    pub fn setpoint_again(&mut self, setpoint: &Setpoint) -> Vec<u8> {
        let mut bytes = [0; Setpoint::LEN];
        Setpoint { seq: self.seq, ..*setpoint }.encode(&mut bytes);
        self.framed(&bytes)
    }

    /// The bytes of a request, and its id.
    pub fn request(&mut self, call: Call) -> (u16, Vec<u8>) {
        self.id = self.id.wrapping_add(1);
        let mut buffer = [0; MESSAGE_MAX];
        let message = Request { id: self.id, call }.encode(&mut buffer).map(<[u8]>::to_vec);
        // No call is as long as a frame.
        (self.id, self.framed(&message.unwrap_or_default()))
    }

    /// The bytes of any message in a good frame; none if it has no legal length.
    pub fn framed(&mut self, message: &[u8]) -> Vec<u8> {
        self.framer.frame(message, &mut [0; FRAME_MAX]).map(<[u8]>::to_vec).unwrap_or_default()
    }

    /// What these bytes of the hand say.
    pub fn receive(&mut self, mut bytes: &[u8]) -> Vec<Heard> {
        let mut heard = Vec::new();
        while let Some(frame) = self.deframer.receive(&mut bytes) {
            heard.push(understand(frame.message));
        }
        heard
    }

    /// What the hand's frames met with on their way.
    #[must_use]
    pub fn counters(&self) -> &protocol::frame::Counters {
        self.deframer.counters()
    }
}

fn understand(message: &[u8]) -> Heard {
    let kind = message.first().copied().and_then(MessageKind::from_byte);
    let understood = match kind {
        Some(MessageKind::HandState) => message
            .try_into()
            .ok()
            .and_then(|bytes| HandState::decode(bytes).ok())
            .map(Box::new)
            .map(Heard::State),
        Some(MessageKind::Reply) => Reply::decode(message).ok().map(|_| Heard::Reply(message.to_vec())),
        Some(MessageKind::Log) => LogRecord::decode(message).ok().map(Heard::Log),
        _ => None,
    };
    understood.unwrap_or_else(|| Heard::Unknown(message.to_vec()))
}
