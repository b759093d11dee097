//! How the parts of a run fared.

use std::collections::BTreeMap;

use yamabico_host::{BehaviorRecord, Durations};

use crate::report::LatencyFigures;

/// How the parts of a run fared. It never enters a decision.
#[derive(Clone, Debug, Default)]
pub struct Fared {
    /// The calls of each behavior, by name.
    pub behaviors: Vec<(String, BehaviorRecord)>,
    /// The stages of each behavior's proposals, by name.
    pub latencies: BTreeMap<String, LatencyFigures>,
    /// Live: how late the arbiter woke at its ticks.
    pub lateness: Durations,
    /// Live: how often each plugin was started again, by name.
    pub restarts: BTreeMap<String, u32>,
}
