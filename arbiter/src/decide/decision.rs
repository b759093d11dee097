//! What was decided and why, by index; and as it travels.

use std::fmt::Write;
use std::time::Duration;

use yamabico_core::message::{
    Axes, Command, DecisionHeader, Kind, Mode, Note, Outcome, Reason, Twist, Verdict,
};
use yamabico_core::time::Time;

use crate::policy::Policy;
use crate::safety::Stop;

/// One decision. Made once for a policy and overwritten by every call of [`decide`](super::decide).
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// When it was decided.
    pub stamp: Time,
    /// Oldest sensor data behind the winners; the stamp where nobody won.
    pub evidence: Time,
    /// The winner whose sensor data that is.
    pub evidence_of: Option<u16>,
    /// The winner whose data is older than its budget, and what comes of it.
    pub late: Option<Late>,
    /// Counts up by one a decision.
    pub sequence: u64,
    /// What the winners asked for, before limits and ramps.
    pub wanted: Twist,
    /// What the robot's largest speeds and its drive leave of it.
    pub feasible: Twist,
    /// After limits, halts and stops, before ramps.
    pub allowed: Twist,
    /// What the motors get.
    pub commanded: Twist,
    /// Axes that a halt stops.
    pub halted: Axes,
    /// The state of things.
    pub mode: Mode,
    /// What stops the whole robot.
    pub stop: Option<Stop>,
    /// Whether some axis brakes with the emergency deceleration.
    pub emergency: bool,
    /// Who won each axis: index of the behavior.
    pub source: [Option<u16>; 3],
    /// Who halts each axis.
    pub halted_by: [Option<u16>; 3],
    /// Whose limit binds each axis, and to what, m/s, m/s, rad/s.
    pub limited_by: [Option<(u16, f64)>; 3],
    /// What became of each behavior, by its index.
    pub rulings: Vec<Ruling>,
}

/// A winner whose sensor data is older than its latency budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Late {
    /// The winner.
    pub behavior: u16,
    /// Age of the oldest data in its proposal.
    pub age: Duration,
    /// What is left of the robot's largest speeds, above 0 and at most 1; 1 where lateness is only counted.
    pub factor: f64,
}

/// What became of one behavior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ruling {
    /// The outcome.
    pub outcome: Outcome,
    /// What is wrong with the proposal, also where its halt or limit counts nevertheless.
    pub fault: Option<Outcome>,
    /// Who beat, inhibited, suppressed or halted it.
    pub by: Option<u16>,
    /// A [`Kind`] code: as received, or that of the halt or limit that is held.
    pub kind: u32,
    /// A [`Reason`] code, as received.
    pub reason: u32,
    /// Claimed, limited or halted.
    pub claimed: Axes,
    /// Driven by it in the end.
    pub won: Axes,
    /// Age in seconds, the limit, or zero.
    pub number: f64,
    /// How long the outcome still lasts without a word from anybody.
    pub lasts: Lasting,
}

/// How long an outcome still lasts without a word from anybody.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lasting {
    /// This decision.
    #[default]
    Now,
    /// So long.
    For(Duration),
    /// Until its author is back.
    UntilBack,
}

impl Lasting {
    /// From `now` until an instant; [`Time::MAX`] is for ever.
    pub(super) fn until(end: Time, now: Time) -> Lasting {
        if end == Time::MAX { Lasting::UntilBack } else { Lasting::For(end.since(now)) }
    }

    fn left_s(self) -> f64 {
        match self {
            Lasting::Now => 0.0,
            Lasting::For(left) => left.as_secs_f64(),
            Lasting::UntilBack => -1.0,
        }
    }
}

impl Ruling {
    /// Nothing has been heard.
    pub const SILENT: Ruling = Ruling {
        outcome: Outcome::Silent,
        fault: None,
        by: None,
        kind: Kind::Abstain.code(),
        reason: Reason::None.code(),
        claimed: Axes::NONE,
        won: Axes::NONE,
        number: 0.0,
        lasts: Lasting::Now,
    };
}

impl Decision {
    /// An empty one, with room for every behavior of `policy`.
    pub fn new(policy: &Policy) -> Decision {
        Decision {
            stamp: Time::ZERO,
            evidence: Time::ZERO,
            evidence_of: None,
            late: None,
            sequence: 0,
            wanted: Twist::ZERO,
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
            rulings: vec![Ruling::SILENT; policy.behaviors.len()],
        }
    }

    /// Clears everything but the rulings, each of which is written in turn.
    pub(super) fn begin(&mut self, policy: &Policy, now: Time, sequence: u64) {
        let mut rulings = std::mem::take(&mut self.rulings);
        if rulings.len() != policy.behaviors.len() {
            rulings.resize(policy.behaviors.len(), Ruling::SILENT);
        }
        *self = Decision {
            stamp: now,
            evidence: now,
            evidence_of: None,
            late: None,
            sequence,
            wanted: Twist::ZERO,
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
        };
    }

    /// The command as it travels, without its stages.
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

    /// The decision as it travels, without its verdicts.
    pub fn header(&self, policy: &Policy) -> DecisionHeader {
        DecisionHeader {
            stamp_ns: self.stamp.0,
            evidence_ns: self.evidence.0,
            sequence: self.sequence,
            wanted: self.wanted,
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

    /// Writes one verdict a behavior, in the order of the policy, to the front of `verdicts`, as many as fit; returns how
    /// many were written.
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
                left_s: ruling.lasts.left_s(),
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

    /// Why the mode is what it is, in words; empty where the mode says it all.
    pub fn note(&self, policy: &Policy) -> Note {
        let mut note = Note::default();
        // Writing to a `Text` cuts and never fails.
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
