//! Where the time goes between a measurement and the command that rests on it.

use std::time::Duration;

use serde::Serialize;
use yamabico_core::message::Proposal;
use yamabico_core::time::Time;
use yamabico_host::Durations;

/// The stages of one behavior's proposals, counted by duration. Taking one in does not allocate.
#[derive(Clone, Debug, Default)]
pub struct Latency {
    waiting: Durations,
    proposing: Durations,
    delivery: Durations,
    deciding: Durations,
    whole: Durations,
    late: u64,
}

impl Latency {
    /// Takes in a proposal that was heard at `heard` and taken into account by a command that was sent at `sent`. What its
    /// author does not tell is left out.
    pub fn add(&mut self, proposal: &Proposal, heard: Time, sent: Time) {
        let [evidence, received, proposed] =
            [proposal.evidence_ns, proposal.received_ns, proposal.proposed_ns].map(Time);
        if received != Time::ZERO && proposed != Time::ZERO {
            self.waiting.add(received.since(evidence));
            self.proposing.add(proposed.since(received));
            self.delivery.add(heard.since(proposed));
        }
        self.deciding.add(sent.since(heard));
        self.whole.add(sent.since(evidence));
    }

    /// Counts a command that rested on data older than the behavior's budget.
    pub fn add_late(&mut self) {
        self.late += 1;
    }

    /// In numbers; `budget` is that of the behavior.
    pub fn figures(&self, budget: Option<Duration>) -> LatencyFigures {
        LatencyFigures {
            captured_to_received: Spread::of(&self.waiting),
            received_to_proposed: Spread::of(&self.proposing),
            proposed_to_heard: Spread::of(&self.delivery),
            heard_to_commanded: Spread::of(&self.deciding),
            captured_to_commanded: Spread::of(&self.whole),
            budget_ms: budget.map(|budget| budget.as_secs_f64() * 1e3),
            late_commands: self.late,
        }
    }
}

/// How long each stage of a behavior's proposals took: from the capture of the oldest sensor data in them to the first command
/// that took them into account. On the clock of the run: in lockstep, computing takes no time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LatencyFigures {
    /// Until the behavior was handed the data.
    pub captured_to_received: Spread,
    /// Until its proposal was sent.
    pub received_to_proposed: Spread,
    /// Until the arbiter took it in.
    pub proposed_to_heard: Spread,
    /// Until the command was sent.
    pub heard_to_commanded: Spread,
    /// All stages together.
    pub captured_to_commanded: Spread,
    /// The behavior's latency budget, where it has one.
    pub budget_ms: Option<f64>,
    /// Commands of it that rested on older data.
    pub late_commands: u64,
}

/// How durations are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// How many.
    pub count: u64,
    /// Half of them took at most this, milliseconds.
    pub p50_ms: f64,
    /// 99 of 100 took at most this, milliseconds.
    pub p99_ms: f64,
    /// The longest, milliseconds.
    pub max_ms: f64,
}

impl Spread {
    /// That of `durations`; zeros where there are none.
    pub fn of(durations: &Durations) -> Spread {
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
            figures.proposed_to_heard,
            figures.heard_to_commanded,
        ];
        assert_eq!(stages.map(|stage| stage.max_ms), [3.0, 7.0, 1.0, 4.0]);
        assert_eq!((figures.captured_to_commanded.max_ms, figures.budget_ms), (15.0, Some(150.0)));
    }

    #[test]
    fn what_the_author_does_not_tell_is_left_out() {
        let mut latency = Latency::default();
        latency.add(&Proposal { evidence_ns: 5, ..Proposal::default() }, Time(7), Time(9));
        let figures = latency.figures(None);
        assert_eq!((figures.received_to_proposed.count, figures.captured_to_commanded.count), (0, 1));
    }
}
