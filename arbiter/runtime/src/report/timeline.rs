//! What happened in a run, in the order of time: control of each axis, hand-overs, speeds, ends of processes.

use std::collections::BTreeMap;

use bytemuck::Pod;
use yamabico_core::message::{
    Axis, Command, DecisionHeader, FailureHeader, Kind, Message, MessageType, Mode, OverlayHeader, Process,
    ProcessesHeader, Proposal, Reason, Verdict,
};
use yamabico_core::time::Time;

use crate::record::Tap;

/// Number of speeds above which every second one is dropped.
const MAX_SPEEDS: usize = 4000;
/// Maximum number of events that are kept.
const MAX_EVENTS: usize = 2000;
/// Width of a bucket of latencies, ms.
pub(super) const BUCKET_MS: f64 = 2.0;
/// Number of buckets of latencies; the last one holds all longer ones.
const BUCKETS: usize = 500;

/// A time during which one behavior drove an axis, or a halt or nobody did.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Span {
    /// Begin.
    pub begin: Time,
    /// End.
    pub end: Time,
    /// Who had control.
    pub holder: Holder,
}

/// Holder of an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Holder {
    /// Behavior that drives it.
    Behavior(String),
    /// Stopped by this behavior, or by the mode.
    Halt(String),
    /// Nobody drives it.
    Nobody,
}

/// Speeds of one decision: wanted by the behaviors, allowed by halts and limits, commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Speeds {
    /// Time of the decision.
    pub at: Time,
    /// Forward speeds, m/s.
    pub linear: [f64; 3],
    /// Turn rates, rad/s.
    pub angular: [f64; 3],
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Event {
    /// Time.
    pub at: Time,
    /// Kind.
    pub kind: EventKind,
    /// Sentence without its time.
    pub text: String,
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EventKind {
    /// Another behavior took control.
    HandOver,
    /// A process ended, or a plugin failed.
    Failure,
}

/// Collects the time line of a run from its messages.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    first: Option<Time>,
    last: Time,
    axes: [Vec<Span>; 3],
    has_axis: [bool; 3],
    speeds: Vec<Speeds>,
    stride: usize,
    decisions: usize,
    events: Vec<Event>,
    omitted: u64,
    proposals: BTreeMap<String, Proposal>,
    drivers: Option<[String; 3]>,
    ended: BTreeMap<String, u64>,
    latencies: Vec<u32>,
    latency_count: u64,
}

impl Default for Timeline {
    fn default() -> Self {
        Timeline {
            first: None,
            last: Time::ZERO,
            axes: Default::default(),
            has_axis: [false; 3],
            speeds: Vec::new(),
            stride: 1,
            decisions: 0,
            events: Vec::new(),
            omitted: 0,
            proposals: BTreeMap::new(),
            drivers: None,
            ended: BTreeMap::new(),
            latencies: vec![0; BUCKETS],
            latency_count: 0,
        }
    }
}

impl Timeline {
    /// Time of the first message.
    pub fn first(&self) -> Time {
        self.first.unwrap_or_default()
    }

    /// Time of the last message.
    pub fn last(&self) -> Time {
        self.last
    }

    /// Axes of the drive with who had control of each, in the order of time.
    pub fn axes(&self) -> impl Iterator<Item = (Axis, &[Span])> {
        let all = Axis::ALL.into_iter().zip(&self.axes).zip(self.has_axis);
        all.filter(|(_, is_there)| *is_there).map(|((axis, spans), _)| (axis, spans.as_slice()))
    }

    /// Speeds, thinned.
    pub fn speeds(&self) -> &[Speeds] {
        &self.speeds
    }

    /// Events in the order of time, and the number of those that found no room.
    pub fn events(&self) -> (&[Event], u64) {
        (&self.events, self.omitted)
    }

    /// Number of commands by latency from capture to command, in buckets of [`BUCKET_MS`].
    pub fn latencies(&self) -> &[u32] {
        &self.latencies
    }

    /// Adds an event.
    pub fn add(&mut self, at: Time, kind: EventKind, text: String) {
        if self.events.len() < MAX_EVENTS {
            self.events.push(Event { at, kind, text });
        } else {
            self.omitted += 1;
        }
    }

    fn decision(&mut self, header: &DecisionHeader, verdicts: &[Verdict]) {
        let at = Time(header.stamp_ns);
        for axis in Axis::ALL {
            let index = axis as usize;
            self.has_axis[index] |= header.axes.contains(axis);
            let holder = holder(header, axis);
            match self.axes[index].last_mut() {
                Some(span) if span.holder == holder => span.end = at,
                last => {
                    if let Some(span) = last {
                        span.end = at;
                    }
                    self.axes[index].push(Span { begin: at, end: at, holder });
                }
            }
        }
        if self.decisions.is_multiple_of(self.stride) {
            let three = |pick: fn(&yamabico_core::message::Twist) -> f64| {
                [header.wanted, header.allowed, header.commanded].map(|twist| pick(&twist))
            };
            let (linear, angular) = (three(|twist| twist.linear), three(|twist| twist.angular));
            self.speeds.push(Speeds { at, linear, angular });
            if self.speeds.len() > MAX_SPEEDS {
                self.stride *= 2;
                let mut keep = false;
                self.speeds.retain(|_| {
                    keep = !keep;
                    keep
                });
            }
        }
        self.decisions += 1;
        self.note_hand_over(at, header, verdicts);
    }

    /// Notes a change of the behaviors that drive; a halt changes nothing.
    fn note_hand_over(&mut self, at: Time, header: &DecisionHeader, verdicts: &[Verdict]) {
        let drivers = header.source.map(|name| name.as_str().to_owned());
        if drivers.iter().all(String::is_empty) || self.drivers.as_ref() == Some(&drivers) {
            return;
        }
        let before = self.drivers.replace(drivers.clone()).unwrap_or_default();
        for (index, taker) in drivers.iter().enumerate() {
            // One event for each behavior that takes axes, at its first axis.
            let is_taken = |axis: usize| drivers[axis] == *taker && before[axis] != *taker;
            if taker.is_empty() || !is_taken(index) || (0..index).any(is_taken) {
                continue;
            }
            let axes = Axis::ALL.into_iter().filter(|axis| is_taken(*axis as usize));
            let axes: Vec<_> = axes.map(Axis::as_str).collect();
            let loser = &before[index];
            let from = if loser.is_empty() { String::new() } else { format!(" from {loser}") };
            let why = self.why(taker, loser, verdicts);
            self.add(at, EventKind::HandOver, format!("{taker} took {}{from}{why}", axes.join(" and ")));
        }
    }

    /// Explains a hand-over by the proposals of both behaviors.
    fn why(&self, taker: &str, loser: &str, verdicts: &[Verdict]) -> String {
        let priority = |name: &str| {
            let verdict = verdicts.iter().find(|verdict| verdict.behavior.as_str() == name)?;
            Some(verdict.priority)
        };
        let outranks = !loser.is_empty() && priority(taker) > priority(loser);
        let gave_up = self.proposals.get(loser).filter(|proposal| proposal.kind() == Some(Kind::Abstain));
        let cause = if outranks { None } else { gave_up.map(|proposal| (loser, proposal)) };
        let cause = cause.or_else(|| Some((taker, self.proposals.get(taker)?)));
        cause.map_or_else(String::new, |(name, proposal)| match because(proposal) {
            text if text.is_empty() => String::new(),
            text if name == loser => format!(": {loser} abstains, {text}"),
            text => format!(": {text}"),
        })
    }

    fn processes(&mut self, at: Time, processes: &[Process]) {
        for process in processes {
            let name = process.plugin.as_str();
            if process.ended_ns == 0 || self.ended.get(name) == Some(&process.ended_ns) {
                continue;
            }
            self.ended.insert(name.to_owned(), process.ended_ns);
            let at = Time(process.ended_ns).min(at);
            let failure = process.failure.as_str();
            let failure = if failure.is_empty() { String::new() } else { format!(" ({failure})") };
            let ended = if process.ended.is_empty() { "it ended" } else { process.ended.as_str() };
            self.add(at, EventKind::Failure, format!("process of {name}: {ended}{failure}; restarted"));
        }
    }

    fn command(&mut self, command: &Command) {
        if command.received_ns == 0 {
            return;
        }
        let latency_ms = Time(command.sent_ns).seconds_after(Time(command.evidence_ns)) * 1e3;
        let bucket = (latency_ms / BUCKET_MS).clamp(0.0, (BUCKETS - 1) as f64) as usize;
        self.latencies[bucket] = self.latencies[bucket].saturating_add(1);
        self.latency_count += 1;
    }
}

impl Tap for Timeline {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if message.name == OverlayHeader::NAME {
            return;
        }
        self.first.get_or_insert(time);
        self.last = self.last.max(time);
        match message.name {
            Proposal::NAME => {
                if let Some(proposal) = read::<Proposal>(header) {
                    self.proposals.insert(proposal.behavior.as_str().to_owned(), proposal);
                }
            }
            DecisionHeader::NAME => {
                if let Some(decision) = read::<DecisionHeader>(header) {
                    self.decision(&decision, &list(items));
                }
            }
            Command::NAME => {
                if let Some(command) = read::<Command>(header) {
                    self.command(&command);
                }
            }
            ProcessesHeader::NAME => self.processes(time, &list(items)),
            FailureHeader::NAME => {
                if let Some(failure) = read::<FailureHeader>(header) {
                    let text = String::from_utf8_lossy(items);
                    let text = format!("{} failed: {}", failure.plugin, text.trim_end_matches('\0'));
                    self.add(time, EventKind::Failure, text);
                }
            }
            _ => {}
        }
    }
}

/// Reason and note of a proposal; empty if it has neither.
pub(super) fn because(proposal: &Proposal) -> String {
    let reason = proposal.reason().filter(|reason| ![Reason::None, Reason::Nominal].contains(reason));
    let (reason, note) = (reason.map_or("", Reason::as_str), proposal.note.as_str());
    match (reason, note) {
        ("", note) => note.to_owned(),
        (reason, "") => reason.to_owned(),
        (reason, note) if note.starts_with(reason) => note.to_owned(),
        (reason, note) => format!("{reason}, {note}"),
    }
}

fn holder(header: &DecisionHeader, axis: Axis) -> Holder {
    let name = |names: &[yamabico_core::message::Name; 3]| names[axis as usize].as_str().to_owned();
    let stops = [Mode::CriticalSilent, Mode::EmergencyStop];
    match header.mode() {
        Some(mode) if stops.contains(&mode) => Holder::Halt(mode.as_str().to_owned()),
        _ if header.halted.contains(axis) => Holder::Halt(name(&header.halter)),
        _ => match name(&header.source) {
            source if source.is_empty() => Holder::Nobody,
            source => Holder::Behavior(source),
        },
    }
}

fn read<T: Pod>(bytes: &[u8]) -> Option<T> {
    bytemuck::try_pod_read_unaligned(bytes).ok()
}

fn list<T: Pod>(items: &[u8]) -> Vec<T> {
    items.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
}
