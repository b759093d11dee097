//! Latency of the commands by stage: from the measurement to the drive.

use serde::Serialize;
use yamabico_core::message::Command;
use yamabico_core::time::Time;
use yamabico_runtime::client::RollingWindow;

/// Number of newest commands that the figures are computed from.
const WINDOW: usize = 256;
/// Names of the stages.
pub const STAGES: [&str; 4] =
    ["captured to received", "received to proposed", "proposed to accepted", "accepted to sent"];

/// Latency of one stage, or of all together, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StageLatency {
    /// Median.
    pub p50_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
}

/// Latencies of the newest commands.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LatencySummary {
    /// Stages, in the order of [`STAGES`].
    pub stages: [StageLatency; 4],
    /// All stages.
    pub whole: StageLatency,
}

/// Stages of the newest commands that a behavior drives.
#[derive(Clone, Debug)]
pub(crate) struct Latency {
    stages: [RollingWindow; 4],
    whole: RollingWindow,
}

impl Default for Latency {
    fn default() -> Self {
        let window = || RollingWindow::new(WINDOW);
        Latency { stages: [window(), window(), window(), window()], whole: window() }
    }
}

impl Latency {
    /// Takes in a command; one that no behavior drives has no latency.
    pub fn add(&mut self, command: &Command) {
        let Command { evidence_ns, received_ns, proposed_ns, accepted_ns, sent_ns, .. } = *command;
        if received_ns == 0 {
            return;
        }
        let instants = [evidence_ns, received_ns, proposed_ns, accepted_ns, sent_ns].map(Time);
        for (window, pair) in self.stages.iter_mut().zip(instants.windows(2)) {
            window.add(pair[1].seconds_after(pair[0]) * 1e3);
        }
        self.whole.add(instants[4].seconds_after(instants[0]) * 1e3);
    }

    /// Figures; `None` before the first command of a behavior.
    pub fn summary(&self) -> Option<LatencySummary> {
        let figures = |window: &RollingWindow| {
            let statistics = window.statistics()?;
            Some(StageLatency { p50_ms: statistics.p50, p99_ms: statistics.p99 })
        };
        let mut stages = [StageLatency::default(); 4];
        for (stage, window) in stages.iter_mut().zip(&self.stages) {
            *stage = figures(window)?;
        }
        Some(LatencySummary { stages, whole: figures(&self.whole)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_add_up_and_an_idle_command_has_none() {
        let mut latency = Latency::default();
        latency.add(&Command { sent_ns: 7, ..Command::default() });
        assert_eq!(latency.summary(), None);
        let at = |millis: u64| millis * 1_000_000;
        latency.add(&Command {
            evidence_ns: at(100),
            received_ns: at(103),
            proposed_ns: at(110),
            accepted_ns: at(111),
            sent_ns: at(115),
            ..Command::default()
        });
        let summary = latency.summary().unwrap();
        assert_eq!(summary.stages.map(|stage| stage.p50_ms), [3.0, 7.0, 1.0, 4.0]);
        assert!((summary.whole.p99_ms - 15.0).abs() < 1e-9, "{summary:?}");
    }
}
