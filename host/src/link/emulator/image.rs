//! Builds a board's image.

use std::env;
use std::io;
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};

use thiserror::Error;

/// What a board is flashed with.
const PROFILE: &str = "firmware";
/// The target of a board.
fn target(board: &str) -> &'static str {
    match board {
        "stm32h563" => "thumbv8m.main-none-eabihf",
        _ => "thumbv7em-none-eabihf",
    }
}

/// Why there is no image.
#[derive(Debug, Error)]
pub enum ImageError {
    /// Cargo did not start.
    #[error("cannot start {}: {source}", .program.display())]
    Cargo {
        /// What was called.
        program: PathBuf,
        /// Why it did not start.
        source: io::Error,
    },
    /// The build failed.
    #[error("building the {board} image: {status} (is the {} target installed?)\n{messages}", target(.board))]
    Build {
        /// Feature and binary of the board.
        board: String,
        /// How cargo ended.
        status: ExitStatus,
        /// What cargo printed.
        messages: String,
    },
    /// Cargo built but named no executable.
    #[error("cargo named no executable for {board}")]
    NoExecutable {
        /// Feature and binary of the board.
        board: String,
    },
}

/// Builds the image of `board`, which names both the firmware's feature and its binary, and returns the path of the ELF.
///
/// Calls cargo on the workspace with the target directory in use. Cargo holds no lock while tests run, so this neither
/// waits for the outer call nor compiles anything twice.
///
/// # Errors
///
/// Cargo does not start, fails, or names no executable.
pub fn build(board: &str) -> Result<PathBuf, ImageError> {
    let program = env::var_os("CARGO").map_or_else(|| PathBuf::from("cargo"), PathBuf::from);
    let output = Command::new(&program)
        .args([
            "build",
            "--package",
            "firmware",
            "--profile",
            PROFILE,
            "--target",
            target(board),
            "--message-format",
            "json-render-diagnostics",
        ])
        .args(["--bin", board, "--features", board])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        // Flags for the host, such as those of a coverage run, do not fit a bare target.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .stdin(Stdio::null())
        .output()
        .map_err(|source| ImageError::Cargo { program: program.clone(), source })?;
    if !output.status.success() {
        let messages = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(ImageError::Build { board: board.to_owned(), status: output.status, messages });
    }
    executable(&String::from_utf8_lossy(&output.stdout))
        .ok_or_else(|| ImageError::NoExecutable { board: board.to_owned() })
}

/// The executable in cargo's messages, one JSON object a line.
fn executable(messages: &str) -> Option<PathBuf> {
    messages.lines().find_map(|line| {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        message.get("executable")?.as_str().map(PathBuf::from)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_executable_is_found_among_messages() {
        let messages = concat!(
            "{\"reason\":\"compiler-artifact\",\"executable\":null}\n",
            "not json\n",
            "{\"reason\":\"compiler-artifact\",\"executable\":\"/there/is it\"}\n",
            "{\"reason\":\"build-finished\",\"success\":true}\n",
        );
        assert_eq!(executable(messages), Some(PathBuf::from("/there/is it")));
        assert_eq!(executable("{\"reason\":\"build-finished\"}"), None);
    }

    #[test]
    fn a_board_that_does_not_exist_is_named() {
        let error = build("abacus").expect_err("there is no such board").to_string();
        assert!(error.starts_with("building the abacus image") && error.contains("feature"), "{error}");
    }
}
