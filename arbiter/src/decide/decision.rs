//! A decision and its reasons, by index, and its conversion to messages.

use std::fmt::Write;
use std::time::Duration;

use yamabico_core::message::{
    Axes, Command, DecisionHeader, Kind, Mode, Note, Outcome, Reason, Twist, Verdict,
};
use yamabico_core::time::Time;

use crate::policy::Policy;
use crate::safety::Stop;

/// A decision. Created once for a policy and overwritten by every call of [`decide`](super::decide).
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// Time of the decision.
    pub stamp: Time,
    /// Oldest sensor data behind the winners; equal to `stamp` if there is no winner.
    pub evidence: Time,
    /// Winner that rests on this data.
    pub evidence_of: Option<u16>,
    /// Winner whose sensor data is older than its latency budget.
    pub late: Option<LateData>,
    /// Number of the decision, increasing by one.
    pub sequence: u64,
    /// Twist that the winners ask for, before limits and ramps.
    pub wanted: Twist,
    /// Twist of the highest-priority drive that gave up only because a halt stops one of its axes.
    pub held_back: Option<Twist>,
    /// `wanted` cut to the robot's maximum speeds and to its drive.
    pub feasible: Twist,
    /// `feasible` after limits, halts and stops, before ramps.
    pub allowed: Twist,
    /// Twist that the drive gets.
    pub commanded: Twist,
    /// Halted axes.
    pub halted: Axes,
    /// Mode of the robot.
    pub mode: Mode,
    /// Cause of a stop of the whole robot.
    pub stop: Option<Stop>,
    /// Set if an axis brakes with the emergency deceleration.
    pub emergency: bool,
    /// Winner of each axis.
    pub source: [Option<u16>; 3],
    /// Behavior that halts each axis.
    pub halted_by: [Option<u16>; 3],
    /// Behavior whose limit binds each axis, and the limit, m/s, m/s, rad/s.
    pub limited_by: [Option<(u16, f64)>; 3],
    /// Ruling on each behavior, by its index.
    pub rulings: Vec<Ruling>,
}

/// A winner whose sensor data is older than its latency budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateData {
    /// Index of the winner.
    pub behavior: u16,
    /// Age of the oldest data in its proposal.
    pub age: Duration,
    /// Remaining share of the robot's maximum speeds, above 0 and at most 1; 1 if late data is only counted.
    pub factor: f64,
}

/// Result of a decision for one behavior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ruling {
    /// Outcome.
    pub outcome: Outcome,
    /// Fault of the proposal, also if its halt or limit counts nevertheless.
    pub fault: Option<Outcome>,
    /// Behavior that outranked, inhibited, suppressed or halted it.
    pub by: Option<u16>,
    /// A [`Kind`] code: as received, or that of the held halt or limit.
    pub kind: u32,
    /// A [`Reason`] code, as received.
    pub reason: u32,
    /// Axes that it claims, limits or halts.
    pub claimed: Axes,
    /// Axes that it drives in the end.
    pub won: Axes,
    /// Age in s, the limit, or zero.
    pub number: f64,
    /// Time for which the outcome lasts without a new proposal.
    pub remaining: Remaining,
}

/// Time for which an outcome lasts without a new proposal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Remaining {
    /// This decision only.
    #[default]
    Now,
    /// This duration.
    For(Duration),
    /// Until the author proposes again.
    UntilAuthorReturns,
}

impl Remaining {
    /// Time from `now` until `end`; [`Time::MAX`] is forever.
    pub(super) fn until(end: Time, now: Time) -> Remaining {
        if end == Time::MAX { Remaining::UntilAuthorReturns } else { Remaining::For(end.since(now)) }
    }

    fn left_s(self) -> f64 {
        match self {
            Remaining::Now => 0.0,
            Remaining::For(left) => left.as_secs_f64(),
            Remaining::UntilAuthorReturns => -1.0,
        }
    }
}

impl Ruling {
    /// Ruling on a behavior that has not proposed yet.
    pub const SILENT: Ruling = Ruling {
        outcome: Outcome::Silent,
        fault: None,
        by: None,
        kind: Kind::Abstain.code(),
        reason: Reason::None.code(),
        claimed: Axes::NONE,
        won: Axes::NONE,
        number: 0.0,
        remaining: Remaining::Now,
    };
}

impl Decision {
    /// An empty decision with room for every behavior of `policy`.
    pub fn new(policy: &Policy) -> Decision {
        Decision::empty(Time::ZERO, 0, vec![Ruling::SILENT; policy.behaviors.len()])
    }

    fn empty(stamp: Time, sequence: u64, rulings: Vec<Ruling>) -> Decision {
        Decision {
            stamp,
            evidence: stamp,
            evidence_of: None,
            late: None,
            sequence,
            wanted: Twist::ZERO,
            held_back: None,
            feasible: Twist::ZERO,
            allowed: Twist::ZERO,
            commanded: Twist::ZERO,
            halted: Axes::NONE,
            mode: Mode::Idle,
            stop: None,
            emergency: false,
            source: [None; 3],
            halted_by: [None; 3],
            limited_by: [None; 3],
            rulings,
        }
    }

    /// Clears everything but the rulings, each of which is overwritten in turn.
    pub(super) fn begin(&mut self, policy: &Policy, now: Time, sequence: u64) {
        let mut rulings = std::mem::take(&mut self.rulings);
        rulings.resize(policy.behaviors.len(), Ruling::SILENT);
        *self = Decision::empty(now, sequence, rulings);
    }

    /// Command message, without the times of its stages.
    pub fn command(&self, policy: &Policy) -> Command {
        Command {
            stamp_ns: self.stamp.0,
            evidence_ns: self.evidence.0,
            sequence: self.sequence,
            twist: self.commanded,
            emergency: u32::from(self.emergency),
            source: self.source.map(|index| policy.name(index)),
            ..Command::default()
        }
    }

    /// Decision message, without its verdicts.
    pub fn header(&self, policy: &Policy) -> DecisionHeader {
        DecisionHeader {
            stamp_ns: self.stamp.0,
            evidence_ns: self.evidence.0,
            sequence: self.sequence,
            wanted: self.wanted,
            wished: self.held_back.unwrap_or(self.wanted),
            feasible: self.feasible,
            limit: self.limit(),
            allowed: self.allowed,
            commanded: self.commanded,
            halted: self.halted,
            axes: policy.axes(),
            mode: self.mode.code(),
            emergency: u32::from(self.emergency),
            source: self.source.map(|index| policy.name(index)),
            limiter: self.limited_by.map(|limited| policy.name(limited.map(|(index, _)| index))),
            halter: self.halted_by.map(|index| policy.name(index)),
            note: self.note(policy),
        }
    }

    /// Writes one verdict for each behavior, in the order of the policy, to the front of `verdicts`, as many as fit; returns
    /// their number.
    pub fn write_verdicts(&self, policy: &Policy, verdicts: &mut [Verdict]) -> usize {
        for ((verdict, ruling), behavior) in verdicts.iter_mut().zip(&self.rulings).zip(&policy.behaviors) {
            *verdict = Verdict {
                behavior: behavior.name,
                by: policy.name(ruling.by),
                priority: behavior.priority,
                outcome: ruling.outcome.code(),
                claimed: ruling.claimed,
                won: ruling.won,
                number: ruling.number,
                reason: ruling.reason,
                kind: ruling.kind,
                left_s: ruling.remaining.left_s(),
                fault: ruling.fault.map_or(0, Outcome::code),
                reserved: 0,
            };
        }
        verdicts.len().min(self.rulings.len())
    }

    fn limit(&self) -> Twist {
        let [linear, lateral, angular] =
            self.limited_by.map(|limited| limited.map_or(0.0, |(_, limit)| limit));
        Twist { linear, lateral, angular }
    }

    /// Cause of the mode; empty if the mode needs none.
    pub fn note(&self, policy: &Policy) -> Note {
        let mut note = Note::default();
        // Writing to a `Text` truncates and never fails.
        let _ = match self.stop {
            Some(Stop::Behavior(index)) => write!(note, "{} is silent", policy.name(Some(index))),
            Some(Stop::Sensor(index)) => match policy.sensors.get(usize::from(index)) {
                Some(sensor) => write!(note, "{} is silent", sensor.name),
                None => Ok(()),
            },
            Some(Stop::Clock) => write!(note, "time ran backwards"),
            Some(Stop::EmergencyStop) => write!(note, "latched until reset"),
            Some(Stop::ShuttingDown) => write!(note, "the run ends"),
            None => match self.halted_by.iter().flatten().next() {
                Some(&index) => write!(note, "{} halts {}", policy.name(Some(index)), self.halted),
                None => match self.late.filter(|late| late.factor < 1.0) {
                    Some(late) => {
                        let (age_ms, of) = (late.age.as_secs_f64() * 1e3, policy.name(Some(late.behavior)));
                        write!(note, "slowed: data of {of} is {age_ms:.0} ms old")
                    }
                    None => Ok(()),
                },
            },
        };
        note
    }
}
