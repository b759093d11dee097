//! Speeds of the decisions of a run.

use yamabico_core::message::{DecisionHeader, Twist};
use yamabico_core::time::Time;

/// Number of speeds above which every second one is dropped.
pub(super) const MAX_SPEEDS: usize = 4000;

/// Speeds of one decision: wanted by the behaviors, allowed by halts and limits, commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Speeds {
    /// Time of the decision.
    pub at: Time,
    /// Forward speeds, m/s.
    pub linear: [f64; 3],
    /// Turn rates, rad/s.
    pub angular: [f64; 3],
}

/// Speeds in the order of time, thinned as the run gets longer.
#[derive(Clone, Debug)]
pub(super) struct ThinnedSpeeds {
    kept: Vec<Speeds>,
    stride: usize,
    decisions: usize,
}

impl Default for ThinnedSpeeds {
    fn default() -> Self {
        ThinnedSpeeds { kept: Vec::new(), stride: 1, decisions: 0 }
    }
}

impl ThinnedSpeeds {
    /// Takes in the next decision.
    pub fn take(&mut self, header: &DecisionHeader) {
        if self.decisions.is_multiple_of(self.stride) {
            let three = |pick: fn(&Twist) -> f64| {
                [header.wanted, header.allowed, header.commanded].map(|twist| pick(&twist))
            };
            let (linear, angular) = (three(|twist| twist.linear), three(|twist| twist.angular));
            self.kept.push(Speeds { at: Time(header.stamp_ns), linear, angular });
            if self.kept.len() > MAX_SPEEDS {
                self.stride *= 2;
                let mut keep = false;
                self.kept.retain(|_| {
                    keep = !keep;
                    keep
                });
            }
        }
        self.decisions += 1;
    }

    /// Kept speeds.
    pub fn kept(&self) -> &[Speeds] {
        &self.kept
    }
}
