//! Events of a run in the order of time: control of each axis, hand-overs, speeds, ends of processes.

mod event;
mod hand_over;
mod span;
mod speeds;

pub(super) use event::{Event, EventKind};
pub(super) use hand_over::because;
pub(super) use span::{Holder, Span};
pub(super) use speeds::Speeds;

use std::collections::BTreeMap;

use bytemuck::Pod;
use yamabico_core::message::{
    Axis, Command, DecisionHeader, FailureHeader, Message, MessageType, OverlayHeader, Process,
    ProcessesHeader, Proposal, Verdict,
};
use yamabico_core::time::Time;

use self::event::Events;
use self::hand_over::HandOvers;
use self::speeds::ThinnedSpeeds;
use crate::record::Tap;

/// Width of a bucket of latencies, ms.
pub(super) const BUCKET_MS: f64 = 2.0;
/// Number of buckets of latencies; the last one holds all longer ones.
const BUCKETS: usize = 500;

/// Collects the time line of a run from its messages.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    first: Option<Time>,
    last: Time,
    axes: [Vec<Span>; 3],
    has_axis: [bool; 3],
    speeds: ThinnedSpeeds,
    events: Events,
    hand_overs: HandOvers,
    /// Time at which the process of each plugin ended last, ns.
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
            speeds: ThinnedSpeeds::default(),
            events: Events::default(),
            hand_overs: HandOvers::default(),
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
        self.speeds.kept()
    }

    /// Events in the order of time, and the number of those that found no room.
    pub fn events(&self) -> (&[Event], u64) {
        self.events.kept()
    }

    /// Number of commands by latency from capture to command, in buckets of [`BUCKET_MS`].
    pub fn latencies(&self) -> &[u32] {
        &self.latencies
    }

    fn decision(&mut self, header: &DecisionHeader, verdicts: &[Verdict]) {
        let at = Time(header.stamp_ns);
        for axis in Axis::ALL {
            let index = axis as usize;
            self.has_axis[index] |= header.axes.contains(axis);
            span::extend(&mut self.axes[index], at, Holder::of(header, axis));
        }
        self.speeds.take(header);
        for sentence in self.hand_overs.decision(header, verdicts) {
            self.events.add(at, EventKind::HandOver, sentence);
        }
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
            let text = format!("the process of {name} {ended}{failure}; it was restarted");
            self.events.add(at, EventKind::Failure, text);
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
                    self.hand_overs.proposal(proposal);
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
                    self.events.add(time, EventKind::Failure, text);
                }
            }
            _ => {}
        }
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
    use yamabico_core::message::{Axes, Name, Outcome, Reason, Twist};

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
        assert!(timeline.speeds().len() <= speeds::MAX_SPEEDS);
        let (events, omitted) = timeline.events();
        assert_eq!(events.len() as u64 + omitted, 40_000);
        assert!(timeline.axes().all(|(_, spans)| spans.len() <= span::MAX_SPANS), "spans");
    }
}
