//! Statistics of a run.

use std::collections::BTreeMap;

use yamabico_host::{CallStats, DurationHistogram};

use crate::report::LatencyFigures;

/// Statistics of a run's parts, by wall clock. They never enter a decision.
#[derive(Clone, Debug, Default)]
pub struct RunStats {
    /// Calls of each behavior, by name.
    pub behaviors: Vec<(String, CallStats)>,
    /// Latencies of each behavior's proposals, by name.
    pub latencies: BTreeMap<String, LatencyFigures>,
    /// Delay with which the arbiter woke at its ticks; empty in lockstep.
    pub lateness: DurationHistogram,
    /// Number of restarts of each plugin, by name; empty in lockstep.
    pub restarts: BTreeMap<String, u32>,
}
