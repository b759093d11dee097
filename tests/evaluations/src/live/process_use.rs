//! Memory and computing time of a process.

use std::path::PathBuf;
use std::time::Instant;

/// Unit of computing time of the kernel, s.
const JIFFY_S: f64 = 0.01;

/// Resources of one process at one time.
#[derive(Clone, Copy, Debug)]
pub struct ProcessUse {
    /// Time of the reading.
    pub at: Instant,
    /// Private memory, without shared segments and mapped files, KiB.
    pub private_kib: f64,
    /// Resident memory, KiB.
    pub resident_kib: f64,
    /// Number of file descriptors.
    pub descriptors: usize,
    /// Number of threads.
    pub threads: usize,
    /// Computing time, s.
    pub computed_s: f64,
}

impl ProcessUse {
    /// Reads the resources of a process; `None` if it does not exist.
    pub fn read(pid: u32) -> Option<ProcessUse> {
        let folder = PathBuf::from(format!("/proc/{pid}"));
        let status = std::fs::read_to_string(folder.join("status")).ok()?;
        let number = |key: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(key))?;
            line.split_whitespace().next()?.parse::<f64>().ok()
        };
        let stat = std::fs::read_to_string(folder.join("stat")).ok()?;
        let fields: Vec<&str> = stat[stat.rfind(')')? + 2..].split_whitespace().collect();
        let jiffies = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
        Some(ProcessUse {
            at: Instant::now(),
            private_kib: number("RssAnon:")?,
            resident_kib: number("VmRSS:")?,
            descriptors: std::fs::read_dir(folder.join("fd")).ok()?.count(),
            threads: number("Threads:")? as usize,
            computed_s: (jiffies(14)? + jiffies(15)?) * JIFFY_S,
        })
    }
}
