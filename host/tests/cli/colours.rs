//! Colours and progress: on terminals that have them, and nowhere else.

use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::process::Stdio;
use std::time::Duration;

use serial2::SerialPort;

use crate::command;

/// The byte that begins every colour and every motion of the cursor.
const ESCAPE: char = '\u{1b}';

/// What a call prints at a terminal: standard output and error, in one.
fn at_terminal(call: &str, environment: &[(&str, &str)]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let (mut near, far) = SerialPort::pair().unwrap();
    near.set_read_timeout(Duration::from_millis(200)).unwrap();
    let end = || Stdio::from(far.as_fd().try_clone_to_owned().unwrap());
    let mut command = command(folder.path(), &call.split_whitespace().collect::<Vec<_>>());
    command.stdout(end()).stderr(end()).env("TERM", "xterm").envs(environment.iter().copied());
    let mut child = command.spawn().unwrap();
    let mut bytes = Vec::new();
    let mut buffer = [0; 4096];
    loop {
        // Asked before it is read: what was printed until the end is there then.
        let has_ended = child.try_wait().unwrap().is_some();
        match near.read(&mut buffer) {
            Ok(len) => bytes.extend(&buffer[..len]),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                if has_ended {
                    return String::from_utf8(bytes).unwrap();
                }
            }
            Err(error) => panic!("{call}: {error}"),
        }
    }
}

#[test]
fn a_terminal_has_colours_unless_somebody_says_no() {
    for (call, word) in [("plan", "error:"), ("--help", "Usage:"), ("doctor", "ok")] {
        let plain = at_terminal(call, &[("NO_COLOR", "1")]);
        assert!(plain.contains(word) && !plain.contains(ESCAPE), "{call}: {plain}");
        assert!(!at_terminal(call, &[("TERM", "dumb")]).contains(ESCAPE), "{call}");
        let coloured = at_terminal(call, &[]);
        assert!(coloured.contains(ESCAPE), "{call}: {coloured}");
        // Nothing but the colours differs; doctor tells of the difference.
        if call != "doctor" {
            assert_eq!(without_styles(&coloured), plain);
        }
    }
}

fn without_styles(text: &str) -> String {
    let mut parts = text.split(ESCAPE);
    let first = parts.next().unwrap_or_default().to_owned();
    first + &parts.map(|part| part.split_once('m').unwrap().1).collect::<String>()
}

#[test]
fn a_pipe_has_no_colours_unless_they_are_forced() {
    let folder = tempfile::tempdir().unwrap();
    for call in ["plan", "--help", "doctor"] {
        let printed = |name: &str, value: &str| {
            let output = command(folder.path(), &[call]).env(name, value).output().unwrap();
            String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
        };
        assert!(!printed("TERM", "xterm").contains(ESCAPE), "{call}");
        assert!(printed("CLICOLOR_FORCE", "1").contains(ESCAPE), "{call}");
    }
}

#[test]
fn progress_is_drawn_where_the_cursor_moves() {
    let call = "plan cube --strategy paper -o plan.json";
    assert!(at_terminal(call, &[]).contains(ESCAPE));
    assert!(!at_terminal(call, &[("TERM", "dumb")]).contains(ESCAPE));
}
