//! A line that carries bytes to a hand and back: a serial port, a socket, or an emulator.

use std::fmt;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serial2::SerialPort;
use thiserror::Error;

/// Bytes that are taken off a line at once; the longest frame has 256.
const CHUNK: usize = 4096;

/// Why a line is no line.
#[derive(Debug, Error)]
pub enum PortError {
    /// It could not be opened.
    #[error("{name}: {source}")]
    Open {
        /// The device or the address.
        name: String,
        /// What went wrong.
        source: io::Error,
    },
    /// It broke.
    #[error("the line broke: {0}")]
    Lost(#[source] io::Error),
}

/// A line to a hand.
pub trait Port: fmt::Debug + Send {
    /// Sends all of these bytes.
    ///
    /// # Errors
    /// The line broke.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// What has come, or the first that comes within `wait`; nothing if nothing does.
    ///
    /// # Errors
    /// The line broke.
    fn receive(&mut self, wait: Duration) -> Result<Vec<u8>, PortError>;
}

/// A serial device, pseudo-terminals among them: 8 bits, no parity, one stop bit, no flow control.
#[derive(Debug)]
pub struct SerialLine(SerialPort);

impl SerialLine {
    /// Opens a device.
    ///
    /// # Errors
    /// There is none, it is not ours, or it does not know the speed.
    pub fn open(device: &str, baud: u32) -> Result<Self, PortError> {
        let port = SerialPort::open(device, baud);
        port.map(Self).map_err(|source| PortError::Open { name: device.to_owned(), source })
    }
}

impl Port for SerialLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write_all(bytes).and_then(|()| self.0.flush()).map_err(PortError::Lost)
    }

    fn receive(&mut self, wait: Duration) -> Result<Vec<u8>, PortError> {
        self.0.set_read_timeout(wait).map_err(PortError::Lost)?;
        read(wait, |bytes| self.0.read(bytes))
    }
}

/// A socket, as of a bridge between network and line.
#[derive(Debug)]
pub struct TcpLine(TcpStream);

impl TcpLine {
    /// Connects to `HOST:PORT`.
    ///
    /// # Errors
    /// Nobody answers there.
    pub fn connect(address: &str) -> Result<Self, PortError> {
        let open = |source| PortError::Open { name: address.to_owned(), source };
        let stream = TcpStream::connect(address).map_err(open)?;
        // A set-point that waits for another one to share its packet comes too late.
        stream.set_nodelay(true).map_err(open)?;
        Ok(Self(stream))
    }
}

impl Port for TcpLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write_all(bytes).map_err(PortError::Lost)
    }

    fn receive(&mut self, wait: Duration) -> Result<Vec<u8>, PortError> {
        // A time of zero would mean for ever.
        let wait = wait.max(Duration::from_millis(1));
        self.0.set_read_timeout(Some(wait)).map_err(PortError::Lost)?;
        read(wait, |bytes| match self.0.read(bytes) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the other end has closed it")),
            other => other,
        })
    }
}

/// One piece of what comes within `wait`.
fn read(wait: Duration, mut piece: impl FnMut(&mut [u8]) -> io::Result<usize>) -> Result<Vec<u8>, PortError> {
    let end = Instant::now() + wait;
    let mut bytes = vec![0; CHUNK];
    loop {
        match piece(&mut bytes) {
            Ok(len) if len > 0 => {
                bytes.truncate(len);
                return Ok(bytes);
            }
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {
                return Ok(Vec::new());
            }
            Err(error) => return Err(PortError::Lost(error)),
        }
        if Instant::now() >= end {
            return Ok(Vec::new());
        }
    }
}
