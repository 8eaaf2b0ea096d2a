//! An image in QEMU, one control period at a time.
//!
//! Two named pipes carry [`protocol::bench`] frames; the image opens them by semihosting and waits in the read, during
//! which its time stands still. A UART of QEMU's would take a hundred times as long and let time race on.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::symlink;
use std::path::{self, Path};
use std::process::{Command, ExitStatus};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use protocol::bench::{FromBoard, ToBoard};
use tempfile::TempDir;
use thiserror::Error;

use super::qemu::{Qemu, Running, drain};

/// For a machine that is busy with other things; a period takes less than a millisecond.
const TIMEOUT: Duration = Duration::from_secs(60);
/// How often one looks whether the emulator is still there.
const LOOK: Duration = Duration::from_millis(100);

/// Why the lock-step ended.
#[derive(Debug, Error)]
pub enum LockstepError {
    /// A pipe or a process could not be made or broke.
    #[error("{what}: {source}")]
    Io {
        /// What was being done.
        what: &'static str,
        /// What went wrong.
        source: io::Error,
    },
    /// The image gave no answer.
    #[error("the image gave no answer; the emulator {}{}", ended(*.status), said(.stderr))]
    Silent {
        /// How the emulator ended, if it did.
        status: Option<ExitStatus>,
        /// What it complained of.
        stderr: String,
    },
}

/// A board in an emulator.
#[derive(Debug)]
pub struct Lockstep {
    running: Running,
    to_board: Option<File>,
    from_board: Receiver<io::Result<Box<[u8; FromBoard::LEN]>>>,
    stderr: Receiver<io::Result<String>>,
    /// Holds the pipes until the end.
    _pipes: TempDir,
}

fn ended(status: Option<ExitStatus>) -> String {
    status.map_or_else(|| "runs".to_owned(), |status| format!("ended with {status}"))
}

fn said(stderr: &str) -> String {
    if stderr.is_empty() { String::new() } else { format!(", and it said: {stderr}") }
}

fn failed(what: &'static str) -> impl FnOnce(io::Error) -> LockstepError {
    move |source| LockstepError::Io { what, source }
}

impl Lockstep {
    /// Starts the image `elf` on QEMU's mps2-an386, with a flash that is empty.
    ///
    /// # Errors
    ///
    /// The pipes cannot be made, the emulator does not start.
    pub fn start(elf: &Path) -> Result<Self, LockstepError> {
        Self::start_with_flash(elf, None)
    }

    /// The same with the flash of a run before, in the file `flash`, which is made if it is not there.
    ///
    /// # Errors
    ///
    /// Those of [`Self::start`].
    pub fn start_with_flash(elf: &Path, flash: Option<&Path>) -> Result<Self, LockstepError> {
        let elf = &path::absolute(elf).map_err(failed("finding the image"))?;
        let folder = TempDir::new().map_err(failed("making a folder for pipes"))?;
        if let Some(flash) = flash {
            let flash = path::absolute(flash).map_err(failed("finding the flash"))?;
            symlink(flash, folder.path().join("flash")).map_err(failed("linking the flash"))?;
        }
        let pipe = |name: &str| -> io::Result<File> {
            let path = folder.path().join(name);
            let made = Command::new("mkfifo").arg(&path).status()?;
            if !made.success() {
                return Err(io::Error::other(format!("mkfifo {}: {made}", path.display())));
            }
            // For both ways: then it opens at once, whether or not the emulator ever gets there.
            OpenOptions::new().read(true).write(true).open(&path)
        };
        let to_board = pipe("to_board").map_err(failed("making a pipe"))?;
        let mut pipe_from_board = pipe("from_board").map_err(failed("making a pipe"))?;
        let mut child = Qemu::new("mps2-an386", elf)
            .word("lock-step")
            .command()
            .current_dir(folder.path())
            .spawn()
            .map_err(failed(
                "starting qemu-system-arm (on Debian and Ubuntu: apt-get install qemu-system-arm)",
            ))?;
        let stderr = drain(child.stderr.take());
        // The emulator blocks if nobody reads what it prints.
        drop(drain(child.stdout.take()));
        let (sender, from_board) = mpsc::channel();
        thread::spawn(move || {
            loop {
                let mut bytes = Box::new([0; FromBoard::LEN]);
                let read = pipe_from_board.read_exact(&mut bytes[..]).map(|()| bytes);
                let broken = read.is_err();
                if sender.send(read).is_err() || broken {
                    return;
                }
            }
        });
        Ok(Self { running: Running(child), to_board: Some(to_board), from_board, stderr, _pipes: folder })
    }

    /// One control period.
    ///
    /// # Errors
    ///
    /// The image does not answer.
    pub fn tick(&mut self, frame: &ToBoard) -> Result<FromBoard, LockstepError> {
        let mut bytes = [0; ToBoard::LEN];
        frame.encode(&mut bytes);
        if let Some(pipe) = &mut self.to_board {
            pipe.write_all(&bytes).map_err(failed("writing to the image"))?;
        }
        let end = Instant::now() + TIMEOUT;
        loop {
            match self.from_board.recv_timeout(LOOK) {
                Ok(Ok(bytes)) => return Ok(FromBoard::decode(&bytes)),
                Ok(Err(source)) => return Err(LockstepError::Io { what: "reading from the image", source }),
                Err(_) => {
                    let status = self.running.0.try_wait().ok().flatten();
                    if status.is_some() || Instant::now() >= end {
                        return Err(self.silent(status));
                    }
                }
            }
        }
    }

    /// Ends the emulator at once, as a crash or the loss of its power would; the next period gives no answer.
    pub fn kill(&mut self) {
        // Fails only when it has ended already.
        let _ = self.running.0.kill();
    }

    fn silent(&mut self, status: Option<ExitStatus>) -> LockstepError {
        // Ends the emulator, so that its complaints end too.
        let _ = self.running.0.kill();
        let stderr = self.stderr.recv_timeout(TIMEOUT).ok().and_then(Result::ok).unwrap_or_default();
        // An emulator that gives up prints all its registers below what happened.
        let first = stderr.trim().lines().next().unwrap_or_default();
        LockstepError::Silent { status, stderr: first.to_owned() }
    }

    /// Closes the pipe, at which the image ends by itself.
    ///
    /// # Errors
    ///
    /// The emulator cannot be waited for.
    pub fn finish(mut self) -> Result<ExitStatus, LockstepError> {
        self.to_board = None;
        self.running.0.wait().map_err(failed("waiting for qemu-system-arm"))
    }
}
