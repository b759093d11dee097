//! Newest sonar scan, as input of the state machine; a silent, lost or malformed scan counts as an echo.

use yamabico_core::behavior::{Inputs, Slot};
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::odometry_track::FUTURE_TOLERANCE_S;
use yamabico_core::time::Time;

/// Maximum number of beams; a scan with more counts as an echo.
const MAX_BEAMS: usize = 64;

/// Newest sonar scan. Without ranges it counts as an echo.
#[derive(Clone, Debug)]
pub struct SonarWatch {
    ranges_m: Vec<Option<f64>>,
    beams: Vec<Beam>,
    newest: Option<Time>,
}

impl Default for SonarWatch {
    fn default() -> Self {
        Self { ranges_m: Vec::with_capacity(MAX_BEAMS), beams: Vec::with_capacity(MAX_BEAMS), newest: None }
    }
}

impl SonarWatch {
    /// Reads the new scans. Returns true if the state machine must take a step: after a new scan, a lost one, or a
    /// silence longer than `stale_s`.
    pub fn update(&mut self, inputs: &Inputs<'_>, slot: &Slot<RangeScanHeader>, stale_s: f64) -> bool {
        let mut must_step = false;
        let now = inputs.now();
        for scan in inputs.fresh(slot) {
            let stamp = Time(scan.header.stamp_ns);
            let is_newer = self.newest.is_none_or(|last| stamp > last);
            if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
                continue;
            }
            must_step = true;
            self.newest = Some(stamp);
            self.ranges_m.clear();
            self.beams.clear();
            if scan.items.len() <= MAX_BEAMS {
                self.ranges_m.extend(scan.items.iter().map(Beam::echo_m));
                self.beams.extend_from_slice(scan.items);
            }
        }
        let is_silent = self.newest.is_none_or(|newest| now.seconds_after(newest) > stale_s);
        if is_silent || inputs.lost(slot) > 0 {
            self.ranges_m.clear();
            self.beams.clear();
            must_step = true;
        }
        must_step
    }

    /// Returns the ranges of the newest scan, m; an empty slice if the sonar is silent.
    #[must_use]
    pub fn ranges_m(&self) -> &[Option<f64>] {
        &self.ranges_m
    }

    /// Returns the beams of the newest scan.
    #[must_use]
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// Returns the stamp of the newest scan.
    #[must_use]
    pub fn newest(&self) -> Option<Time> {
        self.newest
    }
}
