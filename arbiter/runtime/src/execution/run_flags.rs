//! Flags by which a live run ends its threads.

use std::sync::atomic::{AtomicBool, Ordering};

use super::driver_clock::DriverTime;

/// Flags for the threads.
#[derive(Default)]
pub(super) struct RunFlags {
    /// Bring the robot to a standstill.
    pub stop: AtomicBool,
    /// End.
    pub end: AtomicBool,
    /// Time of a clock that a driver owns.
    pub time: DriverTime,
}

impl RunFlags {
    /// True if the threads end.
    pub fn is_over(&self) -> bool {
        self.end.load(Ordering::Relaxed)
    }
}
