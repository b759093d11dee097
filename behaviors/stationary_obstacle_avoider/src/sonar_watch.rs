//! The newest scan of the sonars, as the state machine takes it: a silent, lost or broken one is an echo.

use yamabico_core::behavior::{Inputs, Slot};
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::odometry_track::FUTURE_TOLERANCE_S;
use yamabico_core::time::Time;

/// Most beams that are looked at; more are taken for an echo.
const MOST: usize = 64;

/// What the sonars say.
#[derive(Clone, Debug)]
pub struct SonarWatch {
    ranges_m: Vec<Option<f64>>,
    beams: Vec<Beam>,
    newest: Option<Time>,
}

impl Default for SonarWatch {
    fn default() -> Self {
        Self { ranges_m: Vec::with_capacity(MOST), beams: Vec::with_capacity(MOST), newest: None }
    }
}

impl SonarWatch {
    /// Takes the scans that arrived; whether there is something to tell the state machine: a scan, or a silence longer than
    /// `stale_s`.
    pub fn take(&mut self, inputs: &Inputs<'_>, slot: &Slot<RangeScanHeader>, stale_s: f64) -> bool {
        let mut is_news = false;
        let now = inputs.now();
        for scan in inputs.fresh(slot) {
            let stamp = Time(scan.header.stamp_ns);
            let is_newer = self.newest.is_none_or(|last| stamp > last);
            if !is_newer || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
                continue;
            }
            is_news = true;
            self.newest = Some(stamp);
            self.ranges_m.clear();
            self.beams.clear();
            if scan.items.len() <= MOST {
                self.ranges_m.extend(scan.items.iter().map(Beam::echo_m));
                self.beams.extend_from_slice(scan.items);
            }
        }
        let is_silent = self.newest.is_none_or(|newest| now.seconds_after(newest) > stale_s);
        if is_silent || inputs.lost(slot) > 0 {
            self.ranges_m.clear();
            self.beams.clear();
            is_news = true;
        }
        is_news
    }

    /// The ranges of the newest scan, meters; none at all where the sonars are silent.
    #[must_use]
    pub fn ranges_m(&self) -> &[Option<f64>] {
        &self.ranges_m
    }

    /// The beams of the newest scan.
    #[must_use]
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// When the newest scan was taken.
    #[must_use]
    pub fn newest(&self) -> Option<Time> {
        self.newest
    }
}
