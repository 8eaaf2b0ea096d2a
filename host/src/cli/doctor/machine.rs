//! Processor, memory, terminal.

use std::fs;
use std::thread;

use super::{Finding, Lack, Purpose};
use crate::cli::colour;

/// Memory under which no demo runs, MiB: it takes 180, the system something too.
const MIN_MEMORY_MIB: u64 = 512;

pub(super) fn findings() -> Vec<Finding> {
    let cores = thread::available_parallelism()
        .map(|cores| format!("{cores} in use for planning; --threads of experiment takes fewer"))
        .map_err(|error| Lack::new(error.to_string(), "one is assumed"));
    vec![
        Finding::new("processor cores", &[], cores),
        Finding::new("memory", &[Purpose::Plan], memory(fs::read_to_string("/proc/meminfo").ok().as_deref())),
        Finding::new("colours", &[], Ok(colour::on_stdout_in_words().to_owned())),
    ]
}

/// The whole memory, by the text of Linux's /proc/meminfo; other systems do not have one.
fn memory(meminfo: Option<&str>) -> Result<String, Lack> {
    let total_kib = meminfo.and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
        line.split_whitespace().next()?.parse::<u64>().ok()
    });
    match total_kib.map(|kib| kib >> 10) {
        Some(mib) if mib < MIN_MEMORY_MIB => Err(Lack::new(
            format!("{mib} MiB"),
            format!(
                "a plan wants {MIN_MEMORY_MIB} MiB: use a larger machine, or --cell for coarser surfaces"
            ),
        )),
        Some(mib) => Ok(format!("{:.1} GiB", mib as f64 / 1024.0)),
        None => Ok(format!("not told by this system; {MIN_MEMORY_MIB} MiB will do")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_kib_and_too_little_is_said() {
        assert_eq!(memory(Some("MemTotal:       16777216 kB\nMemFree: 1 kB\n")), Ok("16.0 GiB".to_owned()));
        let little = memory(Some("MemFree: 99999999 kB\nMemTotal: 262144 kB\n")).unwrap_err();
        assert_eq!(little.found, "256 MiB");
        for odd in [None, Some(""), Some("MemTotal:"), Some("MemTotal: much kB")] {
            assert!(memory(odd).is_ok_and(|text| text.starts_with("not told")), "{odd:?}");
        }
    }
}
