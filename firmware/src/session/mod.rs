//! The hand's end of the bus: bytes in, messages out; messages in, bytes out. Over any pipe, without waiting for it.
//!
//! The hand speaks when it is spoken to: a state for every new set-point, a reply for every request, and, behind a state,
//! one event of the log. So it never talks into the host's frame on a line that both share.

mod log;

pub use log::Log;

use protocol::command::Setpoint;
use protocol::fault::{Code, Refusal};
use protocol::frame::{Counters, Deframer, Framer, MESSAGE_MAX};
use protocol::message::MessageKind;
use protocol::service::{Answer, Event, Reply, Request, ServiceError};
use protocol::telemetry::HandState;

/// Bytes that may wait for the line: a state, a reply and an event, twice.
const OUTBOX: usize = 1024;

/// Bytes that wait for the line.
#[derive(Debug, Clone)]
struct Outbox {
    bytes: [u8; OUTBOX],
    len: usize,
    /// Frames for which there was no room.
    dropped: u32,
}

impl Outbox {
    /// Frames a message of `len` bytes, which `write` puts into its place, behind what waits.
    fn push(&mut self, framer: &mut Framer, len: usize, write: impl FnOnce(&mut [u8])) {
        let room = self.bytes.get_mut(self.len..).unwrap_or(&mut []);
        match framer.frame_in_place(len, room, write) {
            Some(frame) => self.len += frame.len(),
            None => self.dropped = self.dropped.saturating_add(1),
        }
    }

    fn take(&mut self, out: &mut [u8]) -> usize {
        let waiting = self.bytes.get_mut(..self.len).unwrap_or(&mut []);
        let len = waiting.len().min(out.len());
        let (taken, left) = waiting.split_at_mut(len);
        if let Some(out) = out.get_mut(..len) {
            out.copy_from_slice(taken);
        }
        self.len = left.len();
        // What did not fit moves up; usually all has.
        if !left.is_empty() {
            waiting.copy_within(len.., 0);
        }
        len
    }
}

/// The hand's end of the bus.
#[derive(Debug, Clone)]
pub struct Session {
    deframer: Deframer,
    framer: Framer,
    outbox: Outbox,
    /// The last one, and whether it has been seen.
    setpoint: Setpoint,
    has_setpoint: bool,
    request: Option<Request>,
    frames: u32,
    log: Log,
}

impl Default for Session {
    fn default() -> Self {
        Self {
            deframer: Deframer::default(),
            framer: Framer::default(),
            outbox: Outbox { bytes: [0; OUTBOX], len: 0, dropped: 0 },
            setpoint: Setpoint::default(),
            has_setpoint: false,
            request: None,
            frames: 0,
            log: Log::default(),
        }
    }
}

impl Session {
    /// Takes whatever the line has brought. Of several set-points the last counts.
    pub fn receive(&mut self, mut bytes: &[u8], now_us: u32) {
        while let Some(frame) = self.deframer.receive(&mut bytes) {
            let kind = frame.message.first().copied().and_then(MessageKind::from_byte);
            let refusal = match kind {
                Some(MessageKind::Setpoint) => match frame.message.try_into().map(Setpoint::decode) {
                    Ok(Ok(setpoint)) => {
                        (self.setpoint, self.has_setpoint) = (setpoint, true);
                        continue;
                    }
                    Ok(Err(_)) => Refusal::Malformed,
                    Err(_) => Refusal::WrongLength,
                },
                Some(MessageKind::Request) => match Request::decode(frame.message) {
                    Ok(request) if self.request.is_none() => {
                        self.request = Some(request);
                        continue;
                    }
                    Ok(Request { id, .. }) => {
                        self.reply(&Reply { id, answer: Answer::Refused(Refusal::Busy.into()) });
                        continue;
                    }
                    Err(error) => error.refusal(),
                },
                _ => Refusal::UnknownKind,
            };
            self.log.push(now_us, Event::Refused(Code::from(refusal)));
        }
    }

    /// The last set-point since the last call.
    pub fn take_setpoint(&mut self) -> Option<&Setpoint> {
        core::mem::take(&mut self.has_setpoint).then_some(&self.setpoint)
    }

    /// The last set-point there was.
    #[must_use]
    pub const fn last_setpoint(&self) -> &Setpoint {
        &self.setpoint
    }

    /// The request that waits for its reply.
    pub fn take_request(&mut self) -> Option<Request> {
        self.request.take()
    }

    /// Whether any whole frame has come since the last call, a repeated one too.
    pub fn take_frames(&mut self) -> bool {
        let counters = self.deframer.counters();
        let frames = counters.good.wrapping_add(counters.repeated);
        core::mem::replace(&mut self.frames, frames) != frames
    }

    /// Queues a reply; one that does not fit into a frame becomes a refusal.
    pub fn reply(&mut self, reply: &Reply<'_>) {
        let mut buffer = [0; MESSAGE_MAX];
        match reply.encode(&mut buffer) {
            Ok(message) => self.queue(message),
            Err(error) => self.refuse(reply.id, error),
        }
    }

    fn refuse(&mut self, id: u16, error: ServiceError) {
        let mut buffer = [0; MESSAGE_MAX];
        // A refusal is a few bytes; if even that did not fit, the host asks again.
        if let Ok(message) =
            (Reply { id, answer: Answer::Refused(error.refusal().into()) }).encode(&mut buffer)
        {
            self.queue(message);
        }
    }

    /// Queues a state and, if there is one, the oldest event.
    pub fn report(&mut self, state: &HandState) {
        self.outbox.push(&mut self.framer, HandState::LEN, |place| {
            if let Ok(place) = place.try_into() {
                state.encode(place);
            }
        });
        let mut buffer = [0; MESSAGE_MAX];
        if let Some(Ok(message)) = self.log.pop().map(|record| record.encode(&mut buffer)) {
            self.queue(message);
        }
    }

    fn queue(&mut self, message: &[u8]) {
        self.outbox.push(&mut self.framer, message.len(), |place| place.copy_from_slice(message));
    }

    /// Bytes for the line, as many as there are or as fit; returns how many.
    pub fn transmit(&mut self, out: &mut [u8]) -> usize {
        self.outbox.take(out)
    }

    /// What has been received and refused.
    #[must_use]
    pub const fn counters(&self) -> &Counters {
        self.deframer.counters()
    }

    /// The log.
    pub fn log(&mut self) -> &mut Log {
        &mut self.log
    }
}
