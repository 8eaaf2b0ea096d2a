//! A conversation with a hand: asks and waits for the answer, asks again when none comes.

use std::time::Duration;

use protocol::blackbox::Record;
use protocol::command::Setpoint;
use protocol::fault::Code;
use protocol::schema::FINGERPRINT;
use protocol::service::{Answer, BlackBox, Call, LogRecord, ParameterInfo, Reply, Value};
use protocol::telemetry::{HandState, JointSet};
use thiserror::Error;

use super::host_end::{Heard, HostEnd};
use super::port::{Port, PortError};

/// How long an answer may take. On the line it takes less than a millisecond.
const WAIT: Duration = Duration::from_millis(200);
/// How often a request is sent.
const TRIES: usize = 3;

/// Why a hand did not do what it was asked.
#[derive(Debug, Error)]
pub enum ClientError {
    /// The line broke.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Nothing came that could be understood.
    #[error("the hand does not answer ({refused} broken frames came)")]
    Silent {
        /// Frames that were refused.
        refused: u32,
    },
    /// The hand said no.
    #[error("the hand refuses: {} (number {})", .0.text().unwrap_or("a reason of a newer version"), .0.0)]
    Refused(Code),
    /// The answer is not one to the question.
    #[error("the hand answers something else than it was asked: {0}")]
    OtherAnswer(String),
}

/// Who the hand is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HandInfo {
    /// Version of the firmware.
    pub firmware: String,
    /// Version of the protocol.
    pub protocol: u8,
    /// Name of the board.
    pub board: String,
    /// Fingerprint of what the hand speaks.
    pub schema: u64,
    /// How many parameters there are.
    pub parameters: u16,
}

impl HandInfo {
    /// Whether hand and host know the same messages. Where they do not, one of them knows more, and both go on.
    #[must_use]
    pub fn is_same_schema(&self) -> bool {
        self.schema == FINGERPRINT
    }
}

/// A parameter and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Index on the wire.
    pub index: u16,
    /// Name.
    pub name: String,
    /// Unit; empty for none.
    pub unit: String,
    /// Value now.
    pub value: Value,
    /// Value after flashing.
    pub default: Value,
    /// Smallest and largest value.
    pub range: [Value; 2],
}

/// A hand at the end of a line.
#[derive(Debug)]
pub struct HandClient {
    port: Box<dyn Port>,
    end: HostEnd,
    events: Vec<LogRecord>,
}

impl HandClient {
    /// A conversation over this line.
    #[must_use]
    pub fn new(port: Box<dyn Port>) -> Self {
        Self { port, end: HostEnd::default(), events: Vec::new() }
    }

    /// Asks, and has the answer read.
    ///
    /// # Errors
    /// The line breaks, no answer comes, the hand refuses, or `read` does not know the answer.
    pub fn call<T>(&mut self, call: Call, read: impl Fn(&Answer<'_>) -> Option<T>) -> Result<T, ClientError> {
        let mut ids = Vec::with_capacity(TRIES);
        for _ in 0..TRIES {
            let (id, bytes) = self.end.request(call);
            ids.push(id);
            self.port.send(&bytes)?;
            while let Some(heard) = self.hear()? {
                for heard in heard {
                    let Heard::Reply(bytes) = heard else { continue };
                    // An answer to an earlier try says the same, for asking twice does nothing more.
                    let Ok(Reply { answer, id: of }) = Reply::decode(&bytes) else { continue };
                    if !ids.contains(&of) {
                        continue;
                    }
                    return match answer {
                        Answer::Refused(code) => Err(ClientError::Refused(code)),
                        answer => {
                            read(&answer).ok_or_else(|| ClientError::OtherAnswer(format!("{answer:?}")))
                        }
                    };
                }
            }
        }
        Err(ClientError::Silent { refused: self.end.counters().refused() })
    }

    /// Sends a set-point, whose `seq` is put in here, and waits for the state that answers it.
    ///
    /// # Errors
    /// The line breaks, or no state comes.
    pub fn cycle(&mut self, setpoint: &Setpoint) -> Result<HandState, ClientError> {
        for _ in 0..TRIES {
            let bytes = self.end.setpoint(setpoint);
            self.port.send(&bytes)?;
            while let Some(heard) = self.hear()? {
                let state = heard.into_iter().find_map(|heard| match heard {
                    Heard::State(state) => Some(*state),
                    _ => None,
                });
                if let Some(state) = state {
                    return Ok(state);
                }
            }
        }
        Err(ClientError::Silent { refused: self.end.counters().refused() })
    }

    /// What comes next; `None` if nothing does in time.
    fn hear(&mut self) -> Result<Option<Vec<Heard>>, ClientError> {
        let bytes = self.port.receive(WAIT)?;
        if bytes.is_empty() {
            return Ok(None);
        }
        let heard = self.end.receive(&bytes);
        let events = heard.iter().filter_map(|heard| match heard {
            Heard::Log(record) => Some(*record),
            _ => None,
        });
        self.events.extend(events);
        Ok(Some(heard))
    }

    /// Events that have come since the last call.
    pub fn take_events(&mut self) -> Vec<LogRecord> {
        std::mem::take(&mut self.events)
    }

    /// Who the hand is.
    ///
    /// # Errors
    /// Those of [`Self::call`].
    pub fn info(&mut self) -> Result<HandInfo, ClientError> {
        self.call(Call::Hello, |answer| match answer {
            Answer::Hello(hello) => Some(HandInfo {
                firmware: hello.firmware.to_owned(),
                protocol: hello.protocol,
                board: hello.board.to_owned(),
                schema: hello.schema,
                parameters: hello.parameters,
            }),
            _ => None,
        })
    }

    /// All parameters.
    ///
    /// # Errors
    /// Those of [`Self::call`].
    pub fn parameters(&mut self) -> Result<Vec<Parameter>, ClientError> {
        (0..self.info()?.parameters).map(|index| self.parameter(index)).collect()
    }

    fn parameter(&mut self, index: u16) -> Result<Parameter, ClientError> {
        let value = self.call(Call::ParameterGet { index }, read_value)?;
        self.call(Call::ParameterInfo { index }, |answer| match *answer {
            Answer::ParameterInfo(ParameterInfo { name, unit, default, min, max }) => Some(Parameter {
                index,
                name: name.to_owned(),
                unit: unit.to_owned(),
                value,
                default,
                range: [min, max],
            }),
            _ => None,
        })
    }

    /// Changes a parameter; returns the value from now on.
    ///
    /// # Errors
    /// Those of [`Self::call`]: the hand refuses while a drive has torque, and what is out of range.
    pub fn set_parameter(&mut self, index: u16, value: Value) -> Result<Value, ClientError> {
        self.call(Call::ParameterSet { index, value }, read_value)
    }

    /// Keeps the parameters as they are beyond the power supply.
    ///
    /// # Errors
    /// Those of [`Self::call`]: the hand refuses while a drive has torque, and where the board has no flash for it.
    pub fn save_parameters(&mut self) -> Result<(), ClientError> {
        self.call(Call::ParameterSave, read_done)
    }

    /// Puts all parameters to their defaults; what is kept stays.
    ///
    /// # Errors
    /// Those of [`Self::call`]: the hand refuses while a drive has torque.
    pub fn default_parameters(&mut self) -> Result<(), ClientError> {
        self.call(Call::ParameterDefaults, read_done)
    }

    /// Takes the present readings of these joints' strain gauges as zero.
    ///
    /// # Errors
    /// Those of [`Self::call`]: the hand refuses while a drive has torque, and what is a load.
    pub fn zero(&mut self, joints: JointSet) -> Result<(), ClientError> {
        self.call(Call::SensorZero { joints: joints.bits() }, read_done)
    }

    /// What is in the black box.
    ///
    /// # Errors
    /// Those of [`Self::call`].
    pub fn black_box(&mut self) -> Result<BlackBox, ClientError> {
        self.call(Call::BlackBox, |answer| match answer {
            Answer::BlackBox(black_box) => Some(*black_box),
            _ => None,
        })
    }

    /// A moment from the black box, by its index: full rate first, oldest first.
    ///
    /// # Errors
    /// Those of [`Self::call`]: there may be no such record.
    pub fn record(&mut self, index: u16) -> Result<Record, ClientError> {
        self.call(Call::BlackBoxRead { index }, |answer| match answer {
            Answer::Record(bytes) => Record::decode((*bytes).try_into().ok()?).ok(),
            _ => None,
        })
    }
}

fn read_done(answer: &Answer<'_>) -> Option<()> {
    matches!(answer, Answer::Done).then_some(())
}

fn read_value(answer: &Answer<'_>) -> Option<Value> {
    match answer {
        Answer::Parameter(value) => Some(*value),
        _ => None,
    }
}
