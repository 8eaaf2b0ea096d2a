//! Serial devices, and whether this user may open them. None is opened: that would move its control lines, by which
//! some boards are reset.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Finding, Lack, Purpose};

/// How the names of USB's serial devices begin in /dev: Linux, Linux, macOS.
const PREFIXES: [&str; 3] = ["ttyUSB", "ttyACM", "cu.usb"];

/// Whether a device may be opened.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Access {
    Granted,
    /// For members of this group only.
    ForGroup(String),
    Denied,
    NotThere,
    NoDevice,
}

/// Looks at the devices that are named, or at those that are found.
pub(super) fn finding(named: &[PathBuf]) -> Finding {
    let paths = if named.is_empty() { present() } else { named.to_vec() };
    let devices: Vec<(PathBuf, Access)> = paths
        .into_iter()
        .map(|path| {
            let access = access(&path);
            (path, access)
        })
        .collect();
    Finding::new("serial devices", &[Purpose::Hand], judge(&devices, !named.is_empty()))
}

/// Every device that is named must open; of those that were found, one is enough.
fn judge(devices: &[(PathBuf, Access)], are_named: bool) -> Result<String, Lack> {
    let Some(first) = devices.iter().find(|(_, access)| *access != Access::Granted).or(devices.first())
    else {
        return Err(Lack::new(
            "none is plugged in",
            "plug in the hand's adapter, or name its device by --device; a hand at tcp: needs none",
        ));
    };
    let words: Vec<String> =
        devices.iter().map(|(path, access)| format!("{} {}", path.display(), in_words(access))).collect();
    let granted = devices.iter().filter(|(_, access)| *access == Access::Granted).count();
    if granted == devices.len() || (granted > 0 && !are_named) {
        return Ok(words.join(", "));
    }
    Err(Lack::new(words.join(", "), next(&first.0, &first.1)))
}

fn in_words(access: &Access) -> String {
    match access {
        Access::Granted => "may be opened".to_owned(),
        Access::ForGroup(group) => format!("is for the group {group}, and you are not in it"),
        Access::Denied => "may not be opened".to_owned(),
        Access::NotThere => "is not there".to_owned(),
        Access::NoDevice => "is no serial device".to_owned(),
    }
}

fn next(path: &Path, access: &Access) -> String {
    let path = path.display();
    match access {
        Access::Granted => String::new(),
        Access::ForGroup(group) => format!("sudo usermod -aG {group} $USER, then log in again"),
        Access::Denied => format!("sudo chmod a+rw {path} until it is unplugged, or a udev rule for good"),
        Access::NotThere => "plug it in; dmesg tells the name that it gets".to_owned(),
        Access::NoDevice => "name a device such as /dev/ttyUSB0".to_owned(),
    }
}

/// The serial devices that are plugged in, in the order of their names.
fn present() -> Vec<PathBuf> {
    if cfg!(windows) {
        return serial2::SerialPort::available_ports().unwrap_or_default();
    }
    let mut found: Vec<PathBuf> = fs::read_dir("/dev")
        .map(|entries| entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect())
        .unwrap_or_default();
    found.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        PREFIXES.iter().any(|prefix| name.starts_with(prefix))
    });
    found.sort();
    found
}

#[cfg(unix)]
fn access(path: &Path) -> Access {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};

    let Ok(metadata) = fs::metadata(path) else { return Access::NotThere };
    if !metadata.file_type().is_char_device() {
        return Access::NoDevice;
    }
    if rustix::fs::access(path, rustix::fs::Access::READ_OK | rustix::fs::Access::WRITE_OK).is_ok() {
        return Access::Granted;
    }
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    denied(metadata.mode(), metadata.gid(), &groups)
}

#[cfg(not(unix))]
fn access(_path: &Path) -> Access {
    // Windows has no permissions on serial ports.
    Access::Granted
}

/// Who may open a device that we may not: a group, if it may read and write and is not root's.
#[cfg(unix)]
fn denied(mode: u32, gid: u32, groups: &str) -> Access {
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(gid)).then(|| name.to_owned())
    });
    match name {
        Some(name) if mode & 0o060 == 0o060 && gid != 0 => Access::ForGroup(name),
        _ => Access::Denied,
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_group_that_may_is_named_and_root_is_not_advised() {
        let groups = "root:x:0:\ndialout:x:20:somebody\nnonsense\nuucp:x:986:\n";
        assert_eq!(denied(0o020_660, 20, groups), Access::ForGroup("dialout".to_owned()));
        assert_eq!(denied(0o020_660, 986, groups), Access::ForGroup("uucp".to_owned()));
        for (mode, gid) in [(0o020_600, 20), (0o020_660, 0), (0o020_660, 77), (0o020_640, 20)] {
            assert_eq!(denied(mode, gid, groups), Access::Denied, "{mode:o} {gid}");
        }
    }

    #[test]
    fn one_found_device_is_enough_but_every_named_one_must_open() {
        let fine = || (PathBuf::from("/dev/ttyUSB0"), Access::Granted);
        let closed = || (PathBuf::from("/dev/ttyACM0"), Access::ForGroup("dialout".to_owned()));
        assert!(judge(&[closed(), fine()], false).is_ok());
        let lack = judge(&[fine(), closed()], true).unwrap_err();
        assert_eq!(lack.next, "sudo usermod -aG dialout $USER, then log in again");
        assert!(lack.found.contains("/dev/ttyACM0 is for the group dialout"), "{}", lack.found);
        assert!(judge(&[closed()], false).is_err());
        assert_eq!(judge(&[], false).unwrap_err().found, "none is plugged in");
    }

    #[test]
    fn what_is_no_device_is_told_apart() {
        assert_eq!(access(Path::new("/dev/none")), Access::NotThere);
        assert_eq!(access(Path::new("/dev")), Access::NoDevice);
        assert_eq!(access(Path::new("/dev/null")), Access::Granted);
    }
}
