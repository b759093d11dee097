//! Latencies from a measurement to the command that rests on it.

use std::time::Duration;

use serde::Serialize;
use yamabico_core::message::Proposal;
use yamabico_core::time::Time;
use yamabico_host::DurationHistogram;

/// Latencies of one behavior's proposals, as histograms. Adding one does not allocate.
#[derive(Clone, Debug, Default)]
pub struct Latency {
    waiting: DurationHistogram,
    proposing: DurationHistogram,
    delivery: DurationHistogram,
    deciding: DurationHistogram,
    whole: DurationHistogram,
    late: u64,
}

impl Latency {
    /// Adds a proposal that the arbiter received at `accepted` and that the command sent at `sent` is the first to use. Stages that
    /// the author does not stamp are left out.
    pub fn add(&mut self, proposal: &Proposal, accepted: Time, sent: Time) {
        let [evidence, received, proposed] =
            [proposal.evidence_ns, proposal.received_ns, proposal.proposed_ns].map(Time);
        if received != Time::ZERO && proposed != Time::ZERO {
            self.waiting.add(received.since(evidence));
            self.proposing.add(proposed.since(received));
            self.delivery.add(accepted.since(proposed));
        }
        self.deciding.add(sent.since(accepted));
        self.whole.add(sent.since(evidence));
    }

    /// Counts a command that rested on data older than the latency budget.
    pub fn add_late(&mut self) {
        self.late += 1;
    }

    /// Figures of the latencies; `budget` is the behavior's latency budget.
    pub fn figures(&self, budget: Option<Duration>) -> LatencyFigures {
        LatencyFigures {
            captured_to_received: Spread::of(&self.waiting),
            received_to_proposed: Spread::of(&self.proposing),
            proposed_to_accepted: Spread::of(&self.delivery),
            accepted_to_commanded: Spread::of(&self.deciding),
            captured_to_commanded: Spread::of(&self.whole),
            budget_ms: budget.map(|budget| budget.as_secs_f64() * 1e3),
            late_commands: self.late,
        }
    }
}

/// Latencies of a behavior's proposals: from the capture of the oldest sensor data in them to the first command that uses them.
/// On the clock of the run, so that computing takes no time in lockstep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LatencyFigures {
    /// From capture until the behavior received the data.
    pub captured_to_received: Spread,
    /// From then until its proposal was sent.
    pub received_to_proposed: Spread,
    /// From then until the arbiter received the proposal.
    pub proposed_to_accepted: Spread,
    /// From then until the command was sent.
    pub accepted_to_commanded: Spread,
    /// All stages together.
    pub captured_to_commanded: Spread,
    /// Latency budget of the behavior, ms, if it has one.
    pub budget_ms: Option<f64>,
    /// Number of commands that rested on older data.
    pub late_commands: u64,
}

/// Percentiles of durations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Number of durations.
    pub count: u64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Maximum, ms.
    pub max_ms: f64,
}

impl Spread {
    /// Percentiles of `durations`; zeros if there are none.
    pub fn of(durations: &DurationHistogram) -> Spread {
        let milliseconds = |duration: Duration| duration.as_secs_f64() * 1e3;
        Spread {
            count: durations.count(),
            p50_ms: milliseconds(durations.quantile(0.5)),
            p99_ms: milliseconds(durations.quantile(0.99)),
            max_ms: milliseconds(durations.max()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_add_up_to_the_whole() {
        let at = |millis: u64| Time(millis * 1_000_000);
        let proposal = Proposal {
            evidence_ns: at(100).0,
            received_ns: at(103).0,
            proposed_ns: at(110).0,
            ..Proposal::default()
        };
        let mut latency = Latency::default();
        latency.add(&proposal, at(111), at(115));
        let figures = latency.figures(Some(Duration::from_millis(150)));
        let stages = [
            figures.captured_to_received,
            figures.received_to_proposed,
            figures.proposed_to_accepted,
            figures.accepted_to_commanded,
        ];
        assert_eq!(stages.map(|stage| stage.max_ms), [3.0, 7.0, 1.0, 4.0]);
        assert_eq!((figures.captured_to_commanded.max_ms, figures.budget_ms), (15.0, Some(150.0)));
    }

    #[test]
    fn stages_that_the_author_does_not_stamp_are_left_out() {
        let mut latency = Latency::default();
        latency.add(&Proposal { evidence_ns: 5, ..Proposal::default() }, Time(7), Time(9));
        let figures = latency.figures(None);
        assert_eq!((figures.received_to_proposed.count, figures.captured_to_commanded.count), (0, 1));
    }
}
