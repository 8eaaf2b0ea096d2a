//! Where a hand is: `serial:DEVICE[@BAUD]`, `tcp:HOST:PORT`, `qemu[:ELF]`.

use std::path::PathBuf;
use std::str::FromStr;

use thiserror::Error;

use super::emulator::{EmulatorError, EmulatorPort};
use super::port::{Port, PortError, SerialLine, TcpLine};

/// Speed of the STM32G474's line, 170 MHz / 8.
const BAUD: u32 = 21_250_000;

/// Where a hand is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinkAddress {
    /// A serial device, or a pseudo-terminal.
    Serial {
        /// Path of the device.
        device: String,
        /// Bits per second.
        baud: u32,
    },
    /// A socket.
    Tcp(String),
    /// The firmware's image in QEMU; the project's own is built when none is named.
    Qemu(Option<PathBuf>),
}

/// A text that is no address.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{text:?} is no link; there are serial:DEVICE[@BAUD], tcp:HOST:PORT and qemu[:ELF]")]
pub struct NoAddress {
    /// What was given.
    pub text: String,
}

/// Why a link cannot be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// The line.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The emulator.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
}

impl FromStr for LinkAddress {
    type Err = NoAddress;

    fn from_str(text: &str) -> Result<Self, NoAddress> {
        let none = || NoAddress { text: text.to_owned() };
        let (kind, rest) = text.split_once(':').map_or((text, None), |(kind, rest)| (kind, Some(rest)));
        match (kind, rest.filter(|rest| !rest.is_empty())) {
            ("serial" | "pty", Some(rest)) => {
                let (device, baud) = match rest.rsplit_once('@') {
                    Some((device, baud)) => (device, baud.parse().map_err(|_| none())?),
                    None => (rest, BAUD),
                };
                let baud = Some(baud).filter(|&baud| baud > 0 && !device.is_empty()).ok_or_else(none)?;
                Ok(Self::Serial { device: device.to_owned(), baud })
            }
            ("tcp", Some(address)) if address.contains(':') => Ok(Self::Tcp(address.to_owned())),
            ("qemu", elf) if rest.is_none() || elf.is_some() => Ok(Self::Qemu(elf.map(PathBuf::from))),
            _ => Err(none()),
        }
    }
}

impl LinkAddress {
    /// Opens the line.
    ///
    /// # Errors
    /// Nobody is there.
    pub fn open(&self) -> Result<Box<dyn Port>, OpenError> {
        Ok(match self {
            Self::Serial { device, baud } => Box::new(SerialLine::open(device, *baud)?),
            Self::Tcp(address) => Box::new(TcpLine::connect(address)?),
            Self::Qemu(elf) => Box::new(EmulatorPort::start(elf.as_deref())?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_nonsense_is_named() {
        let serial = |device: &str, baud| Ok(LinkAddress::Serial { device: device.to_owned(), baud });
        assert_eq!("serial:/dev/ttyUSB0".parse(), serial("/dev/ttyUSB0", BAUD));
        assert_eq!("serial:COM7@12000000".parse(), serial("COM7", 12_000_000));
        assert_eq!("pty:/dev/pts/3".parse(), serial("/dev/pts/3", BAUD));
        assert_eq!("tcp:hand.local:5000".parse(), Ok(LinkAddress::Tcp("hand.local:5000".to_owned())));
        assert_eq!("tcp:[::1]:5000".parse(), Ok(LinkAddress::Tcp("[::1]:5000".to_owned())));
        assert_eq!("qemu".parse(), Ok(LinkAddress::Qemu(None)));
        assert_eq!("qemu:a.elf".parse(), Ok(LinkAddress::Qemu(Some("a.elf".into()))));
        for text in [
            "",
            "serial",
            "serial:",
            "serial:x@fast",
            "serial:x@0",
            "serial:@9600",
            "tcp:host",
            "qemu:",
            "usb:1",
        ] {
            assert_eq!(text.parse::<LinkAddress>(), Err(NoAddress { text: text.to_owned() }));
        }
    }
}
