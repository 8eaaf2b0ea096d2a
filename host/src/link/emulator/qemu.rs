//! Runs an image in QEMU.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use thiserror::Error;

/// Why a run did not end by itself.
#[derive(Debug, Error)]
pub enum QemuError {
    /// The emulator is not installed.
    #[error("{} is not installed; on Debian and Ubuntu: apt-get install qemu-system-arm", .program.display())]
    NotInstalled {
        /// What was called.
        program: PathBuf,
    },
    /// The emulator did not start, or its output could not be read.
    #[error("running {}: {source}", .program.display())]
    Io {
        /// What was called.
        program: PathBuf,
        /// What went wrong.
        source: io::Error,
    },
    /// The image did not end in time. The emulator was killed.
    #[error("the image was still running after {after:?}; it had printed:\n{stdout}")]
    TimedOut {
        /// The time that it had.
        after: Duration,
        /// What the image printed until then.
        stdout: String,
    },
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// The status that the image gave to the emulator.
    pub status: ExitStatus,
    /// What the image printed.
    pub stdout: String,
    /// What the emulator complained of.
    pub stderr: String,
}

/// A run to be started.
///
/// Time inside is virtual: every instruction takes 8 ns, unless said otherwise, and idling costs nothing, so a run gives the same output at the
/// same virtual instants on every machine, however busy.
#[derive(Debug, Clone)]
pub struct Qemu {
    program: PathBuf,
    machine: String,
    image: PathBuf,
    arguments: Vec<String>,
    words: String,
    instruction_shift: u8,
}

/// The emulator, which dies with this value.
#[derive(Debug)]
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Both fail only when the child has ended and been waited for.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Qemu {
    /// A run of the image `elf` on QEMU's `machine`.
    #[must_use]
    pub fn new(machine: &str, elf: &Path) -> Self {
        Self {
            program: PathBuf::from("qemu-system-arm"),
            machine: machine.to_owned(),
            image: elf.to_owned(),
            arguments: Vec::new(),
            words: String::new(),
            instruction_shift: 3,
        }
    }

    /// With another emulator than the `qemu-system-arm` on the search path.
    #[must_use]
    pub fn program(mut self, program: impl Into<PathBuf>) -> Self {
        self.program = program.into();
        self
    }

    /// With one more argument for the emulator.
    #[must_use]
    pub fn argument(mut self, argument: impl Into<String>) -> Self {
        self.arguments.push(argument.into());
        self
    }

    /// With one more word on the image's own command line, behind its name.
    #[must_use]
    pub fn word(mut self, word: &str) -> Self {
        self.words.push_str(",arg=");
        self.words.push_str(word);
        self
    }

    /// With instructions that take 2^`shift` nanoseconds.
    #[must_use]
    pub fn instruction_shift(mut self, shift: u8) -> Self {
        self.instruction_shift = shift;
        self
    }

    /// The command that runs the image.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command
            .args(["-machine", &self.machine, "-display", "none", "-monitor", "none", "-serial", "null"])
            .args(["-icount", &format!("shift={},sleep=off", self.instruction_shift)])
            .args(["-semihosting-config", &format!("enable=on,target=native,arg=image{}", self.words)])
            .args(&self.arguments)
            .arg("-kernel")
            .arg(&self.image)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs until the image ends, for `timeout` at most.
    ///
    /// # Errors
    ///
    /// The emulator is missing, its pipes break, or the image does not end in time.
    pub fn run(&self, timeout: Duration) -> Result<Run, QemuError> {
        let io_error = |source: io::Error| match source.kind() {
            io::ErrorKind::NotFound => QemuError::NotInstalled { program: self.program.clone() },
            _ => QemuError::Io { program: self.program.clone(), source },
        };
        let mut child = self.command().spawn().map_err(io_error)?;
        let stdout = drain(child.stdout.take());
        let stderr = drain(child.stderr.take());
        let mut running = Running(child);

        // The emulator closes its output when it ends, and the image blocks if nobody reads it.
        match stdout.recv_timeout(timeout) {
            Ok(text) => Ok(Run {
                stdout: text.map_err(io_error)?,
                stderr: stderr.recv().unwrap_or_else(|_| Ok(String::new())).map_err(io_error)?,
                status: running.0.wait().map_err(io_error)?,
            }),
            Err(_) => {
                drop(running);
                let text = stdout.recv().unwrap_or_else(|_| Ok(String::new())).map_err(io_error)?;
                Err(QemuError::TimedOut { after: timeout, stdout: text })
            }
        }
    }
}

/// Reads a pipe to its end on a thread of its own and sends the text.
pub(crate) fn drain(pipe: Option<impl Read + Send + 'static>) -> mpsc::Receiver<io::Result<String>> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut bytes = Vec::new();
        let read = pipe.map_or(Ok(0), |mut pipe| pipe.read_to_end(&mut bytes));
        // Nobody listens any more when the run has timed out and returned.
        let _ = sender.send(read.map(|_| String::from_utf8_lossy(&bytes).into_owned()));
    });
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_emulator_is_an_error_that_names_the_package() {
        let qemu = Qemu::new("mps2-an386", Path::new("none.elf")).program("qemu-system-that-is-not-there");
        let error = qemu.run(Duration::from_secs(10)).expect_err("it is not there").to_string();
        assert!(error.contains("qemu-system-that-is-not-there"), "{error}");
        assert!(error.contains("apt-get install qemu-system-arm"), "{error}");
    }

    #[test]
    fn a_missing_image_is_reported_by_the_emulator() {
        let run =
            Qemu::new("mps2-an386", Path::new("none.elf")).run(Duration::from_secs(60)).expect("it ends");
        assert!(!run.status.success());
        assert!(run.stderr.contains("none.elf"), "{}", run.stderr);
    }
}
