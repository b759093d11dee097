//! Events of a run in the order of time: control of each axis, hand-overs, speeds, ends of processes.

use std::collections::BTreeMap;

use bytemuck::Pod;
use yamabico_core::message::{
    Axis, Command, DecisionHeader, FailureHeader, Kind, Message, MessageType, Mode, Outcome, OverlayHeader,
    Process, ProcessesHeader, Proposal, Reason, Verdict,
};
use yamabico_core::time::Time;

use crate::record::Tap;

/// Number of speeds above which every second one is dropped.
const MAX_SPEEDS: usize = 4000;
/// Number of spans of an axis above which every second one is joined to the one before.
const MAX_SPANS: usize = 4000;
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
    /// Holder of the control.
    pub holder: Holder,
}

/// Holder of an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Holder {
    /// Behavior that drives it.
    Behavior(String),
    /// Stopped by this behavior, or by the mode.
    Halt(String),
    /// No behavior drives it.
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
                    if self.axes[index].len() > MAX_SPANS {
                        thin(&mut self.axes[index]);
                    }
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

    /// Notes a change of the behaviors that drive. A halt changes nothing: who would drive without it does not drive.
    fn note_hand_over(&mut self, at: Time, header: &DecisionHeader, verdicts: &[Verdict]) {
        let drivers = Axis::ALL.map(|axis| match (holder(header, axis), &self.drivers) {
            (Holder::Halt(_), Some(before)) => before[axis as usize].clone(),
            (Holder::Halt(_), None) => String::new(),
            _ => header.source[axis as usize].as_str().to_owned(),
        });
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
        let verdict = |name: &str| verdicts.iter().find(|verdict| verdict.behavior.as_str() == name);
        let priority = |name: &str| verdict(name).map(|verdict| verdict.priority);
        let outranks = !loser.is_empty() && priority(taker) > priority(loser);
        if !outranks && let Some(fault) = verdict(loser).and_then(Verdict::outcome).filter(is_fault) {
            return format!(": {loser} is {fault}");
        }
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
            let ended = if process.ended.is_empty() { "ended" } else { process.ended.as_str() };
            self.add(
                at,
                EventKind::Failure,
                format!("the process of {name} {ended}{failure}; it was restarted"),
            );
        }
    }

    fn command(&mut self, command: &Command) {
        if command.received_ns == 0 {
            return;
        }
        let latency_ms = Time(command.sent_ns).seconds_after(Time(command.evidence_ns)) * 1e3;
        let bucket = (latency_ms / BUCKET_MS).clamp(0.0, (BUCKETS - 1) as f64) as usize;
        self.latencies[bucket] = self.latencies[bucket].saturating_add(1);
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

/// True if a behavior with this outcome has a proposal that does not count.
fn is_fault(outcome: &Outcome) -> bool {
    use Outcome::{Disabled, FromTheFuture, Inhibited, Malformed, Silent, Stale, StaleEvidence, Suppressed};
    let faults = [Silent, Disabled, Stale, StaleEvidence, FromTheFuture, Malformed, Inhibited, Suppressed];
    faults.contains(outcome)
}

/// Joins every second span to the one before it.
fn thin(spans: &mut Vec<Span>) {
    let mut index = 0;
    let ends: Vec<Time> = spans.iter().map(|span| span.end).collect();
    spans.retain_mut(|span| {
        let is_kept = index % 2 == 0;
        if let Some(end) = ends.get(index + 1).filter(|_| is_kept) {
            span.end = *end;
        }
        index += 1;
        is_kept
    });
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

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, Name, Twist};

    fn send<M: Message>(timeline: &mut Timeline, seconds: f64, header: &M, items: &[M::Item]) {
        let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        timeline.message("t", &MessageType::of::<M>(), Time::from_secs_f64(seconds), header, items);
    }

    fn proposal(name: &str, proposal: Proposal) -> Proposal {
        Proposal { behavior: Name::new(name), ..proposal }
    }

    fn decision(seconds: f64, driver: &str, halter: &str) -> DecisionHeader {
        let of = |name| [Name::new(name), Name::default(), Name::new(name)];
        DecisionHeader {
            stamp_ns: Time::from_secs_f64(seconds).0,
            axes: Axes::PLANAR,
            halted: if halter.is_empty() { Axes::NONE } else { Axes::ALL },
            source: of(driver),
            halter: of(halter),
            wanted: Twist::planar(0.4, 0.0),
            ..DecisionHeader::default()
        }
    }

    /// A localizer drives, an avoider with a higher priority takes over and gives back; a halt lies between.
    fn run() -> Timeline {
        let mut timeline = Timeline::default();
        let drive = Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.0));
        let verdicts = [("avoider", 60), ("localizer", 20)];
        let verdicts = verdicts.map(|(name, priority)| Verdict {
            behavior: Name::new(name),
            priority,
            outcome: Outcome::Won.code(),
            ..Verdict::default()
        });
        send(&mut timeline, 0.0, &proposal("localizer", drive), &[]);
        send(&mut timeline, 0.0, &decision(0.0, "localizer", ""), &verdicts);
        let evades = drive.with_note(format_args!("obstacle at 1.6 m"));
        send(&mut timeline, 1.0, &proposal("avoider", evades), &[]);
        send(&mut timeline, 1.0, &decision(1.0, "avoider", ""), &verdicts);
        // The localizer would drive, but for the halt.
        send(&mut timeline, 2.0, &decision(2.0, "localizer", "sonar-halt"), &verdicts);
        send(&mut timeline, 2.5, &decision(2.5, "avoider", "sonar-halt"), &verdicts);
        send(&mut timeline, 3.0, &proposal("avoider", Proposal::abstain(Reason::Clear)), &[]);
        send(&mut timeline, 3.0, &decision(3.0, "localizer", ""), &verdicts);
        timeline
    }

    #[test]
    fn hand_overs_say_who_took_what_and_why() {
        let mut timeline = run();
        let outcome = Outcome::Stale.code();
        let verdict = Verdict { behavior: Name::new("localizer"), outcome, ..Verdict::default() };
        send(&mut timeline, 4.0, &decision(4.0, "wall-follower", ""), &[verdict]);
        let texts: Vec<&str> = timeline.events().0.iter().map(|event| event.text.as_str()).collect();
        let expected = [
            "localizer took linear and angular",
            "avoider took linear and angular from localizer: obstacle at 1.6 m",
            "localizer took linear and angular from avoider: avoider abstains, clear",
            "wall-follower took linear and angular from localizer: localizer is stale",
        ];
        assert_eq!(texts, expected);
    }

    #[test]
    fn spans_cover_the_run_without_gaps() {
        let timeline = run();
        let axes: Vec<_> = timeline.axes().collect();
        assert_eq!(axes.iter().map(|(axis, _)| *axis).collect::<Vec<_>>(), [Axis::Linear, Axis::Angular]);
        let spans = axes[0].1;
        assert_eq!(spans[2].holder, Holder::Halt("sonar-halt".to_owned()));
        assert!(spans.windows(2).all(|pair| pair[0].end == pair[1].begin), "{spans:?}");
        assert_eq!((timeline.first(), timeline.last()), (Time::ZERO, Time::from_secs_f64(3.0)));
    }

    #[test]
    fn an_ended_process_is_one_event() {
        let mut timeline = run();
        let process = Process {
            plugin: Name::new("localizer"),
            ended: "was killed by signal 9".into(),
            ended_ns: Time::from_secs_f64(2.5).0,
            ..Process::default()
        };
        for seconds in [2.6, 2.7] {
            send(&mut timeline, seconds, &ProcessesHeader::default(), &[process]);
        }
        let events = timeline.events().0;
        assert_eq!((events.len(), events[3].kind), (4, EventKind::Failure));
        assert_eq!(events[3].text, "the process of localizer was killed by signal 9; it was restarted");
        assert_eq!(events[3].at, Time::from_secs_f64(2.5));
    }

    #[test]
    fn memory_is_bounded_in_a_long_run() {
        let mut timeline = Timeline::default();
        for step in 0..40_000_u32 {
            let driver = if step % 2 == 0 { "a" } else { "b" };
            let seconds = 0.02 * f64::from(step);
            send(&mut timeline, seconds, &decision(seconds, driver, ""), &[]);
        }
        assert!(timeline.speeds().len() <= MAX_SPEEDS);
        let (events, omitted) = timeline.events();
        assert_eq!(events.len() as u64 + omitted, 40_000);
        assert!(timeline.axes().all(|(_, spans)| spans.len() <= MAX_SPANS), "spans");
    }
}
