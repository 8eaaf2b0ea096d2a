//! `prehend hand info|params|zero|log|monitor` against the firmware's own controller, over a pseudo-terminal and a socket.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use firmware::app::{Controller, Identity};
use firmware::control::Sensors;
use protocol::ids::{FINGER_COUNT, JOINT_COUNT};
use serial2::SerialPort;

use tempfile::TempDir;

use super::prehend;

/// A hand at rest on a thread of its own, a control period for every look at the line.
struct Hand {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Hand {
    /// `exchange` sends the bytes that it is given and returns those that have come; `None` ends the hand.
    fn start(mut exchange: impl FnMut(&[u8]) -> Option<Vec<u8>> + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let mut hand = Controller::new(Identity { board: "test", period_us: 1000, has_storage: true });
            let mut sensors = Sensors {
                position_rad: [0.2; JOINT_COUNT],
                joint_torque_nm: [0.05; JOINT_COUNT],
                tip_wrench: [[0.0; 6]; FINGER_COUNT],
            };
            // An angle that can be none, so that there is something in the log.
            sensors.position_rad[7] = f32::NAN;
            let mut now_us = 0_u32;
            let mut room = [0; 1024];
            while !stopped.load(Ordering::Relaxed) {
                let len = hand.transmit(&mut room);
                let Some(bytes) = exchange(&room[..len]) else { return };
                hand.receive(&bytes);
                now_us = now_us.wrapping_add(1000);
                hand.tick(now_us, &sensors);
                hand.serve();
                if hand.take_save().is_some() {
                    hand.saved(true);
                }
            }
        });
        Self { stop, thread: Some(thread) }
    }

    /// At the other end of a pseudo-terminal, and the terminal's path.
    fn on_terminal() -> (Self, String) {
        let (mut near, far) = SerialPort::pair().unwrap();
        let path = std::fs::read_link(format!("/proc/self/fd/{}", far.as_raw_fd())).unwrap();
        near.set_read_timeout(Duration::from_millis(1)).unwrap();
        let hand = Self::start(move |bytes| {
            // Open for as long as the hand lives: the terminal would hang up between two commands.
            let _open = &far;
            near.write_all(bytes).ok()?;
            Some(take(|buffer| near.read(buffer)))
        });
        (hand, format!("serial:{}@115200", path.display()))
    }

    /// Behind a socket that takes one caller after the other.
    fn on_socket() -> (Self, String) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        listener.set_nonblocking(true).unwrap();
        let mut caller = None;
        let hand = Self::start(move |bytes| {
            if let Ok((stream, _)) = listener.accept() {
                stream.set_nonblocking(false).unwrap();
                stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
                caller = Some(stream);
            }
            let Some(stream) = &mut caller else {
                thread::sleep(Duration::from_millis(1));
                return Some(Vec::new());
            };
            // A caller who has gone leaves bytes that nobody takes.
            let _ = stream.write_all(bytes);
            Some(take(|buffer| stream.read(buffer)))
        });
        (hand, format!("tcp:{address}"))
    }
}

impl Drop for Hand {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn take(mut read: impl FnMut(&mut [u8]) -> std::io::Result<usize>) -> Vec<u8> {
    let mut buffer = [0; 512];
    match read(&mut buffer) {
        Ok(len) => buffer[..len].to_vec(),
        Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => Vec::new(),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn a_hand_says_who_it_is_over_a_terminal_and_over_a_socket() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    for (_hand, link) in [Hand::on_terminal(), Hand::on_socket()] {
        let info = prehend(folder, &format!("hand info --link {link} --json")).ends_with(0).json();
        assert_eq!(info["board"], "test", "{link}");
        assert_eq!(info["firmware"], env!("CARGO_PKG_VERSION"));
        assert_eq!(info["protocol"], protocol::frame::VERSION);
        assert_eq!(info["schema"], format!("{:016x}", protocol::schema::FINGERPRINT));
        assert_eq!(info["same_schema"], true);
        let said = prehend(folder, &format!("hand info --link {link}")).ends_with(0);
        assert!(String::from_utf8_lossy(&said.stdout).starts_with("board test, firmware"));
    }
}

#[test]
fn parameters_are_shown_changed_and_refused() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let (_hand, link) = Hand::on_socket();
    let call = |words: &str| prehend(folder, &format!("hand params {words} --link {link} --json"));
    let value = |document: &serde_json::Value, name: &str| {
        let list = document["parameters"].as_array().unwrap();
        list.iter().find(|parameter| parameter["name"] == name).map(|parameter| parameter["value"].clone())
    };
    let all = call("").ends_with(0).json();
    assert!(all["parameters"].as_array().unwrap().len() > 20);
    assert_eq!(value(&all, "torque.gain"), Some(0.5.into()));
    let changed = call("torque.gain=0.4 bus.hold=12000").ends_with(0).json();
    assert_eq!(changed["parameters"].as_array().unwrap().len(), 2);
    assert_eq!(value(&changed, "torque.gain"), Some(0.4.into()));
    assert_eq!(value(&changed, "bus.hold"), Some(12_000.into()));
    assert_eq!(value(&call("bus.hold").ends_with(0).json(), "bus.hold"), Some(12_000.into()), "it stays");
    call("--save").ends_with(0);
    let defaults = call("bus.hold --defaults").ends_with(0).json();
    assert_eq!(value(&defaults, "bus.hold"), Some(10_000.into()));
    for (words, says) in [
        ("torque.gain=9", "torque.gain: the hand refuses: the value is out of range (number 7)"),
        ("torque.gain=soft", "torque.gain: \"soft\" is no number"),
        ("torque.gian", "no parameter \"torque.gian\""),
        ("bus.hold=-1", "bus.hold: \"-1\" is no count"),
    ] {
        let ran = call(words).ends_with(2);
        assert_eq!(ran.stderr, format!("error: {says}\n"));
    }
}

#[test]
fn gauges_are_zeroed_states_and_events_come_and_the_black_box_is_written() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let (_hand, link) = Hand::on_terminal();
    let state = |of: &str| {
        let ran = prehend(folder, &format!("hand monitor --count 2 --rate 500 --link {link} --json"));
        let ran = ran.ends_with(0);
        let text = String::from_utf8_lossy(&ran.stdout).into_owned();
        assert_eq!(text.lines().count(), 2, "{text}");
        let last: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
        last[of].clone()
    };
    assert!(
        state("torque_nm").as_array().unwrap().iter().all(|nm| (nm.as_f64().unwrap() - 0.05).abs() < 1e-3)
    );
    let zeroed = prehend(folder, &format!("hand zero --link {link} --json")).ends_with(0).json();
    assert_eq!(zeroed["zeroed"].as_array().unwrap().len(), JOINT_COUNT);
    assert!(state("torque_nm").as_array().unwrap().iter().all(|nm| nm.as_f64().unwrap() == 0.0));
    assert_eq!((state("drive"), state("fault")), ("not-ready-to-switch-on".into(), 36.into()));

    let csv = folder.join("box.csv");
    let log = prehend(folder, &format!("hand log --black-box box.csv --link {link} --json"));
    let log = log.ends_with(0).json();
    assert_eq!(log["black_box"]["first_fault"]["number"], 36);
    let table = std::fs::read_to_string(csv).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows.len() as u64, 1 + log["black_box"]["records"].as_u64().unwrap());
    assert!(rows.iter().all(|row| row.split(',').count() == 5 + 4 * JOINT_COUNT));
    let wrong = prehend(folder, &format!("hand zero toe --link {link}")).ends_with(2);
    assert_eq!(wrong.stderr, "error: no joint \"toe\"\n");
}

#[test]
fn nobody_there_is_one_line() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let (near, far) = SerialPort::pair().unwrap();
    let path = std::fs::read_link(format!("/proc/self/fd/{}", far.as_raw_fd())).unwrap();
    let silent = format!("serial:{}@115200", path.display());
    for (link, says) in [
        ("serial:/dev/none@9600", "error: /dev/none: "),
        ("tcp:127.0.0.1:1", "error: 127.0.0.1:1: "),
        ("usb:1", "error: invalid value 'usb:1' for '--link <LINK>': \"usb:1\" is no link; there are "),
        ("qemu:none.elf", "error: none.elf: No such file"),
        (&silent, "error: the hand does not answer"),
    ] {
        let ran = prehend(folder, &format!("hand info --link {link}")).ends_with(2);
        assert!(ran.stderr.starts_with(says), "{}", ran.stderr);
    }
    drop((near, far));
}
