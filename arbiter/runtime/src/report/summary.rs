//! Summary of a run.

use std::collections::BTreeMap;

use bytemuck::Pod;
use serde::Serialize;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    DecisionHeader, Kind, Message, MessageType, Odometry, Proposal, Reason, Truth, Verdict,
};
use yamabico_core::time::Time;

use super::encounter::is_standing;
use super::{ControlLog, Encounter, Encounters, Halt, LatencyFigures, Spread};
use crate::record::{Digest, Tap};

/// Line that a robot should follow: a point on it and a direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReferenceLine {
    /// X of a point on it, map frame, m.
    pub x: f64,
    /// Y of a point on it, map frame, m.
    pub y: f64,
    /// Direction, map frame, rad.
    pub theta: f64,
}

impl Default for ReferenceLine {
    /// X axis of the map.
    fn default() -> Self {
        ReferenceLine { x: 0.0, y: 0.0, theta: 0.0 }
    }
}

impl ReferenceLine {
    /// Signed distance of a point from the line, m, positive on the left.
    pub fn offset_m(&self, x: f64, y: f64) -> f64 {
        let (sin, cos) = self.theta.sin_cos();
        (y - self.y) * cos - (x - self.x) * sin
    }
}

/// Facts of a run that its messages do not contain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunFacts {
    /// Set if the robot reached its goal.
    pub arrived: bool,
    /// Wall-clock duration of the run, s.
    pub wall_s: f64,
    /// Wall-clock figures of each behavior, by name.
    pub timings: BTreeMap<String, Timing>,
    /// Latencies of each behavior's proposals, by name.
    pub latencies: BTreeMap<String, LatencyFigures>,
    /// Delay with which the arbiter woke at its ticks in a live run.
    pub tick_lateness: Spread,
    /// Number of restarts of each plugin in a live run, by name.
    pub restarts: BTreeMap<String, u32>,
}

/// Wall-clock figures of one behavior.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Number of calls of `propose`.
    pub calls: u64,
    /// Median duration of a call, us.
    pub p50_us: f64,
    /// 99th percentile of the durations, us.
    pub p99_us: f64,
    /// Number of calls that exceeded the budget.
    pub overruns: u64,
    /// Number of calls that panicked.
    pub panics: u32,
}

/// Summary of one behavior in a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BehaviorSummary {
    /// Wall-clock figures.
    #[serde(flatten)]
    pub timing: Timing,
    /// Number of proposals.
    pub proposals: u64,
    /// Number of abstentions among them.
    pub abstentions: u64,
    /// Number of abstentions by reason.
    pub reasons: BTreeMap<&'static str, u64>,
    /// Latencies of its proposals, if the arbiter received one.
    pub latency: Option<LatencyFigures>,
}

/// Summary of a run. Figures that need a simulator's ground truth are `None` without one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunSummary {
    /// Set if the robot reached its goal.
    pub arrived: bool,
    /// Path length by ground truth or else by odometry, m.
    pub distance_m: f64,
    /// Time of the first message on the clock of the run, s.
    pub began_s: f64,
    /// Time from the first message to the last, s.
    pub time_s: f64,
    /// Number of contacts caused by the robot's motion.
    pub contacts: Option<u32>,
    /// Number of times that a person walked into the standing robot.
    pub struck: Option<u32>,
    /// Smallest distance from the footprint to an object, m.
    pub smallest_clearance_m: Option<f64>,
    /// Smallest distance from the footprint to a person while the robot stood, m; `None` if there was none.
    pub smallest_person_standing_m: Option<f64>,
    /// Smallest distance from the footprint to a person while the robot moved, m; `None` if there was none.
    pub smallest_person_moving_m: Option<f64>,
    /// Root mean square of the distance from the reference line, weighted by path length, m.
    pub rms_offset_m: Option<f64>,
    /// Encounters with people.
    pub encounters: Vec<Encounter>,
    /// Halts after the first readings.
    pub halts: Vec<Halt>,
    /// Time for which each behavior, or a stop that no behavior asked for, was in control, s.
    pub control_s: BTreeMap<String, f64>,
    /// Time in which no behavior was in control, s.
    pub idle_s: f64,
    /// Time at the start in which critical behaviors and sensors waited for their first readings, s.
    pub waiting_s: f64,
    /// Summary of each behavior, by name.
    pub behaviors: BTreeMap<String, BehaviorSummary>,
    /// Delay with which the arbiter woke at its ticks in a live run.
    pub tick_lateness: Spread,
    /// Number of restarts of each plugin in a live run, by name.
    pub restarts: BTreeMap<String, u32>,
    /// Number of messages on each topic.
    pub topics: BTreeMap<String, u64>,
    /// SHA-256 over all messages in order.
    pub digest: String,
    /// Wall-clock duration of the run, s.
    pub wall_s: f64,
    /// Ratio of the duration of the run to its wall-clock duration.
    pub real_time_factor: f64,
}

/// Builds a [`RunSummary`] from the messages of a run.
#[derive(Clone, Debug)]
pub struct SummaryTap {
    line: ReferenceLine,
    digest: Digest,
    control: ControlLog,
    encounters: Encounters,
    behaviors: BTreeMap<String, BehaviorSummary>,
    truth: Option<Truth>,
    odometry: Option<Pose2>,
    odometry_m: f64,
    clearance_m: f64,
    person_standing_m: f64,
    person_moving_m: f64,
    offset_square: Mean,
    first: Option<Time>,
    last: Time,
    verdicts: Vec<Verdict>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    weight: f64,
}

impl SummaryTap {
    /// A summary of a run that should follow `line`.
    pub fn new(line: ReferenceLine) -> SummaryTap {
        SummaryTap {
            line,
            digest: Digest::new(),
            control: ControlLog::default(),
            encounters: Encounters::default(),
            behaviors: BTreeMap::new(),
            truth: None,
            odometry: None,
            odometry_m: 0.0,
            clearance_m: f64::INFINITY,
            person_standing_m: f64::INFINITY,
            person_moving_m: f64::INFINITY,
            offset_square: Mean::default(),
            first: None,
            last: Time::ZERO,
            verdicts: Vec::new(),
        }
    }

    /// Digest of the messages so far.
    pub fn digest(&self) -> &Digest {
        &self.digest
    }

    /// Summary of the run, with the facts that its messages do not contain.
    pub fn finish(mut self, facts: RunFacts) -> RunSummary {
        for (name, timing) in facts.timings {
            self.behaviors.entry(name).or_default().timing = timing;
        }
        for (name, latency) in facts.latencies {
            if latency.captured_to_commanded.count > 0 {
                self.behaviors.entry(name).or_default().latency = Some(latency);
            }
        }
        let time_s = self.first.map_or(0.0, |first| self.last.since(first).as_secs_f64());
        let finite = |value: f64| value.is_finite().then_some(value);
        let control = self.control.time().clone();
        RunSummary {
            arrived: facts.arrived,
            distance_m: self.truth.map_or(self.odometry_m, |truth| truth.distance_m),
            began_s: self.first.unwrap_or_default().as_secs_f64(),
            time_s,
            contacts: self.truth.map(|truth| truth.contacts),
            struck: self.truth.map(|truth| truth.struck),
            smallest_clearance_m: finite(self.clearance_m),
            smallest_person_standing_m: finite(self.person_standing_m),
            smallest_person_moving_m: finite(self.person_moving_m),
            rms_offset_m: finite((self.offset_square.sum / self.offset_square.weight).sqrt()),
            encounters: self.encounters.list(),
            halts: self.control.halts(),
            control_s: control.by_owner_s,
            idle_s: control.idle_s,
            waiting_s: control.waiting_s,
            behaviors: self.behaviors,
            tick_lateness: facts.tick_lateness,
            restarts: facts.restarts,
            topics: self.digest.counts().clone(),
            digest: self.digest.hex(),
            wall_s: facts.wall_s,
            real_time_factor: if facts.wall_s > 0.0 { time_s / facts.wall_s } else { 0.0 },
        }
    }

    fn add_truth(&mut self, truth: Truth) {
        self.clearance_m = self.clearance_m.min(truth.clearance_m);
        let person =
            if is_standing(&truth) { &mut self.person_standing_m } else { &mut self.person_moving_m };
        *person = person.min(truth.person_m);
        if let Some(before) = self.truth {
            let moved = truth.distance_m - before.distance_m;
            let square = self.line.offset_m(truth.x, truth.y).powi(2);
            if moved > 0.0 && square.is_finite() {
                self.offset_square.sum += moved * square;
                self.offset_square.weight += moved;
            }
        }
        self.encounters.truth(&truth);
        self.truth = Some(truth);
    }

    fn add_odometry(&mut self, odometry: &Odometry) {
        let pose = Pose2 { x: odometry.x, y: odometry.y, theta: odometry.theta };
        if pose.is_finite() {
            self.odometry_m += self.odometry.map_or(0.0, |before| before.distance(&pose));
            self.odometry = Some(pose);
        }
    }

    fn add_proposal(&mut self, proposal: &Proposal) {
        let name = proposal.behavior.as_str();
        if !self.behaviors.contains_key(name) {
            self.behaviors.insert(name.to_owned(), BehaviorSummary::default());
        }
        let Some(behavior) = self.behaviors.get_mut(name) else { return };
        behavior.proposals += 1;
        if proposal.kind() == Some(Kind::Abstain) {
            behavior.abstentions += 1;
            let reason = proposal.reason().map_or("unknown", Reason::as_str);
            *behavior.reasons.entry(reason).or_default() += 1;
        }
    }
}

impl Tap for SummaryTap {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        self.digest.message(topic, message, time, header, items);
        self.first.get_or_insert(time);
        self.last = self.last.max(time);
        match message.name {
            Truth::NAME => {
                if let Some(truth) = read(header) {
                    self.add_truth(truth);
                }
            }
            Odometry::NAME => {
                if let Some(odometry) = read(header) {
                    self.add_odometry(&odometry);
                }
            }
            Proposal::NAME => {
                if let Some(proposal) = read(header) {
                    self.add_proposal(&proposal);
                }
            }
            DecisionHeader::NAME => {
                if let Some(decision) = read::<DecisionHeader>(header) {
                    let verdicts = items.chunks_exact(size_of::<Verdict>());
                    self.verdicts.clear();
                    self.verdicts.extend(verdicts.map(bytemuck::pod_read_unaligned::<Verdict>));
                    self.control.decision(&decision, &self.verdicts);
                }
            }
            _ => {}
        }
    }
}

fn read<T: Pod>(bytes: &[u8]) -> Option<T> {
    bytemuck::try_pod_read_unaligned(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, Mode, Name, Outcome, Twist};

    fn send<M: Message>(tap: &mut SummaryTap, topic: &str, seconds: f64, header: &M, items: &[M::Item]) {
        let time = Time::from_secs_f64(seconds);
        let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        tap.message(topic, &MessageType::of::<M>(), time, header, items);
    }

    fn truth(x: f64, y: f64, vx: f64) -> Truth {
        Truth {
            x,
            y,
            vx,
            distance_m: x,
            clearance_m: 0.8 - y.abs(),
            person_m: f64::INFINITY,
            ..Truth::default()
        }
    }

    #[test]
    fn a_drive_beside_the_line_with_a_stop() {
        let mut tap = SummaryTap::new(ReferenceLine::default());
        for step in 0..=100 {
            let x = 0.1 * f64::from(step);
            let y = if step <= 50 { 0.03 } else { -0.04 };
            send(&mut tap, "truth", 0.25 * f64::from(step), &truth(x, y, 0.4), &[]);
        }
        for step in 101..=200 {
            let standing = Truth { person_m: 0.3, contacts: 0, struck: 2, ..truth(10.0, -0.5, 0.0) };
            send(&mut tap, "truth", 0.25 * f64::from(step), &standing, &[]);
        }
        let timings = BTreeMap::from([("wall".to_owned(), Timing { calls: 5, ..Timing::default() })]);
        let summary = tap.finish(RunFacts { arrived: true, wall_s: 5.0, timings, ..RunFacts::default() });
        assert_eq!((summary.distance_m, summary.time_s, summary.real_time_factor), (10.0, 50.0, 10.0));
        let rms = ((0.03_f64.powi(2) + 0.04_f64.powi(2)) / 2.0).sqrt();
        assert!((summary.rms_offset_m.unwrap() - rms).abs() < 1e-12, "standing has no weight");
        assert!((summary.smallest_clearance_m.unwrap() - 0.3).abs() < 1e-12);
        assert_eq!(summary.smallest_person_standing_m, Some(0.3));
        assert_eq!(summary.smallest_person_moving_m, None);
        assert_eq!((summary.contacts, summary.struck), (Some(0), Some(2)));
        assert_eq!((summary.encounters.len(), summary.topics["truth"]), (1, 201));
        assert_eq!((summary.behaviors["wall"].timing.calls, summary.digest.len()), (5, 64));
    }

    #[test]
    fn without_ground_truth_the_distance_comes_from_odometry() {
        let mut tap = SummaryTap::new(ReferenceLine::default());
        for (x, y) in [(0.0, 0.0), (3.0, 4.0), (f64::NAN, 0.0), (3.0, 5.0)] {
            send(&mut tap, "odometry", 0.0, &Odometry { x, y, ..Odometry::default() }, &[]);
        }
        let summary = tap.finish(RunFacts::default());
        assert_eq!((summary.distance_m, summary.contacts, summary.rms_offset_m), (6.0, None, None));
        assert!(serde_json::to_string(&summary).unwrap().contains("\"rms_offset_m\":null"));
    }

    #[test]
    fn abstentions_halts_and_control_are_counted() {
        let mut tap = SummaryTap::new(ReferenceLine::default());
        let named = |proposal| Proposal { behavior: Name::new("wall"), ..proposal };
        let drive = named(Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.0)));
        send(&mut tap, "proposal/wall", 0.0, &drive, &[]);
        for _ in 0..3 {
            send(&mut tap, "proposal/wall", 0.1, &named(Proposal::abstain(Reason::NoWall)), &[]);
        }
        let verdict =
            Verdict { behavior: Name::new("wall"), outcome: Outcome::Won.code(), ..Default::default() };
        for (seconds, mode, halted) in [
            (0.0, Mode::Driving, Axes::NONE),
            (2.0, Mode::Halted, Axes::ALL),
            (3.0, Mode::Driving, Axes::NONE),
        ] {
            let stamp_ns = Time::from_secs_f64(seconds).0;
            let decision = DecisionHeader { stamp_ns, mode: mode.code(), halted, ..Default::default() };
            send(&mut tap, "decision", seconds, &decision, &[verdict]);
        }
        let summary = tap.finish(RunFacts::default());
        let wall = &summary.behaviors["wall"];
        assert_eq!((wall.proposals, wall.abstentions, wall.reasons["no wall"]), (4, 3, 3));
        assert_eq!((summary.halts.len(), summary.halts[0].duration_s), (1, 1.0));
        assert_eq!(summary.control_s["wall"], 2.0);
    }

    #[test]
    fn the_line_may_have_any_direction() {
        let line = ReferenceLine { x: 1.0, y: 1.0, theta: std::f64::consts::FRAC_PI_2 };
        assert!((line.offset_m(0.5, 7.0) - 0.5).abs() < 1e-12, "left of a line that points to the left");
    }

    #[test]
    fn a_message_of_the_wrong_size_changes_nothing_but_the_digest() {
        let mut tap = SummaryTap::new(ReferenceLine::default());
        tap.message("truth", &MessageType::of::<Truth>(), Time::ZERO, &[1, 2, 3], &[]);
        assert_eq!(tap.finish(RunFacts::default()).topics["truth"], 1);
    }
}
