//! Behaviors and devices: state, restarts, calls, rates and ages.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use yamabico_core::message::{
    CallBucket, CallsHeader, Heartbeat, Kind, Message, MessageType, PluginState, Process, ProcessState,
    ProcessesHeader, Proposal,
};
use yamabico_core::time::Time;
use yamabico_host::DurationHistogram;

use super::rate::Rate;
use super::read::{header, items};

/// Maximum number of plugins and sensors that are followed.
const MAX_PLUGINS: usize = 256;

/// Motion that a behavior proposes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Forward speed, m/s.
    pub linear: f64,
    /// Speed to the left, m/s.
    pub lateral: f64,
    /// Turn rate, rad/s.
    pub angular: f64,
}

/// Duration of the calls of a behavior.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CallFigures {
    /// Number of calls.
    pub count: u64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Maximum, ms.
    pub max_ms: f64,
    /// Number of calls that exceeded the budget.
    pub overruns: u64,
    /// Number of calls that panicked.
    pub panics: u32,
}

/// A behavior in the newest decision.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BehaviorView {
    /// Name.
    pub name: String,
    /// Priority.
    pub priority: i32,
    /// Outcome of its newest proposal, such as `won`.
    pub outcome: &'static str,
    /// Outcome as a sentence, in the words of `yamabico why`.
    pub why: String,
    /// Reason or note of the behavior itself.
    pub because: String,
    /// Recent end or restart of its process; empty if there was none.
    pub process: String,
    /// Set if it controls an axis now.
    pub drives: bool,
    /// Set if it is enabled.
    pub enabled: bool,
    /// Kind of its newest proposal; empty before the first.
    pub kind: &'static str,
    /// Motion that it proposes, if its newest proposal is a drive.
    pub motion: Option<Motion>,
    /// Share of the last two minutes in which it had control.
    pub control_share: f64,
    /// State of its plugin, such as `running`; empty if it is not known.
    pub state: String,
    /// Number of restarts.
    pub restarts: u32,
    /// Proposals per second.
    pub rate_hz: f64,
    /// Age of its newest proposal, s.
    pub age_s: Option<f64>,
    /// Maximum of this age, s, if it is known.
    pub max_age_s: Option<f64>,
    /// Age of the oldest sensor data in it, s.
    pub evidence_age_s: Option<f64>,
    /// Maximum of this age, s, if it is known.
    pub max_evidence_age_s: Option<f64>,
    /// Calls, if it reports them.
    pub calls: Option<CallFigures>,
    /// Budget of one call, ms, if it has one.
    pub budget_ms: Option<f64>,
}

/// A sensor, or another topic with measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorView {
    /// Topic.
    pub topic: String,
    /// Message type without its prefix and version, such as `FrameHeader`.
    pub kind: String,
    /// Messages per second.
    pub rate_hz: f64,
    /// Age of the newest message, s.
    pub age_s: f64,
}

/// Newest reports of plugins and sensors.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plugins {
    pub proposals: BTreeMap<String, Proposal>,
    pub processes: BTreeMap<String, Process>,
    beats: BTreeMap<String, Heartbeat>,
    calls: BTreeMap<String, CallFigures>,
    rates: BTreeMap<String, Rate>,
    sensors: BTreeMap<String, Sensor>,
}

#[derive(Clone, Debug)]
struct Sensor {
    message: &'static str,
    newest: Time,
    rate: Rate,
}

impl Plugins {
    /// Takes in a message.
    pub fn message(&mut self, topic: &str, message: &MessageType, bytes: &[u8], list: &[u8]) {
        match message.name {
            Proposal::NAME => {
                let Some(proposal) = header::<Proposal>(bytes) else { return };
                let name = proposal.behavior.as_str();
                if let Some(rate) = entry(&mut self.rates, name) {
                    rate.add(Time(proposal.proposed_ns.max(proposal.stamp_ns)));
                }
                put(&mut self.proposals, name, proposal);
            }
            Heartbeat::NAME => {
                let Some(beat) = header::<Heartbeat>(bytes) else { return };
                put(&mut self.beats, beat.plugin.as_str(), beat);
            }
            CallsHeader::NAME => {
                let Some(calls) = header::<CallsHeader>(bytes) else { return };
                put(&mut self.calls, calls.plugin.as_str(), figures(&calls, items(list)));
            }
            ProcessesHeader::NAME => {
                for process in items::<Process>(list) {
                    put(&mut self.processes, process.plugin.as_str(), process);
                }
            }
            _ if topic.starts_with("sensors/") => {
                let (stamp, _) = (message.stamps)(bytes);
                let is_known = self.sensors.contains_key(topic);
                if !is_known && self.sensors.len() < MAX_PLUGINS {
                    let sensor = Sensor { message: message.name, newest: stamp, rate: Rate::default() };
                    self.sensors.insert(topic.to_owned(), sensor);
                }
                if let Some(sensor) = self.sensors.get_mut(topic) {
                    sensor.newest = stamp;
                    sensor.rate.add(stamp);
                }
            }
            _ => {}
        }
    }

    /// Sensors at `now`.
    pub fn sensors(&self, now: Time) -> Vec<SensorView> {
        let view = |(topic, sensor): (&String, &Sensor)| SensorView {
            topic: topic.clone(),
            kind: sensor
                .message
                .split('.')
                .nth(1)
                .unwrap_or(sensor.message)
                .trim_end_matches("Header")
                .to_owned(),
            rate_hz: sensor.rate.hz(now),
            age_s: now.seconds_after(sensor.newest),
        };
        self.sensors.iter().map(view).collect()
    }

    /// Fills in everything about a behavior that does not come from a decision.
    pub fn complete(&self, view: &mut BehaviorView, now: Time) {
        let name = view.name.as_str();
        if let Some(proposal) = self.proposals.get(name) {
            view.kind = proposal.kind().map_or("", Kind::as_str);
            let twist = &proposal.twist;
            let moves = proposal.kind() == Some(Kind::Drive) && twist.is_finite();
            let motion = Motion { linear: twist.linear, lateral: twist.lateral, angular: twist.angular };
            view.motion = moves.then_some(motion);
            view.age_s = Some(now.seconds_after(Time(proposal.stamp_ns)));
            view.evidence_age_s = Some(now.seconds_after(Time(proposal.evidence_ns)));
        }
        view.rate_hz = self.rates.get(name).map_or(0.0, |rate| rate.hz(now));
        view.calls = self.calls.get(name).copied();
        let (beat, process) = (self.beats.get(name), self.processes.get(name));
        view.restarts = process.map_or(beat.map_or(0, |beat| beat.restarts), |process| process.restarts);
        view.state = match (process.and_then(Process::state), beat.and_then(Heartbeat::state)) {
            (Some(state), _) if state != ProcessState::Running => state.as_str(),
            (_, Some(state)) => PluginState::as_str(state),
            _ => "",
        }
        .to_owned();
    }
}

fn figures(header: &CallsHeader, buckets: impl Iterator<Item = CallBucket>) -> CallFigures {
    let mut durations = DurationHistogram::default();
    for bucket in buckets {
        durations.add_bucket(bucket.index as usize, u64::from(bucket.calls));
    }
    durations.raise_max(Duration::from_nanos(header.longest_ns));
    let millis = |duration: Duration| duration.as_secs_f64() * 1e3;
    CallFigures {
        count: durations.count(),
        p50_ms: millis(durations.quantile(0.5)),
        p99_ms: millis(durations.quantile(0.99)),
        max_ms: millis(durations.max()),
        overruns: header.overruns,
        panics: header.panics,
    }
}

/// Value of `name`, new if there is room for it.
fn entry<'a, T: Default>(map: &'a mut BTreeMap<String, T>, name: &str) -> Option<&'a mut T> {
    if !map.contains_key(name) && map.len() < MAX_PLUGINS {
        map.insert(name.to_owned(), T::default());
    }
    map.get_mut(name)
}

fn put<T: Default>(map: &mut BTreeMap<String, T>, name: &str, value: T) {
    if let Some(entry) = entry(map, name) {
        *entry = value;
    }
}
