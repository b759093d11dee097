//! Status of every plugin of a running robot.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;
use yamabico_arbiter::decide::DecisionMessage;
use yamabico_core::message::{CallsHeader, Heartbeat, Note, Outcome, Process, ProcessState, Verdict};
use yamabico_core::time::Time;
use yamabico_host::DurationHistogram;
use yamabico_host::bus::{BusError, Subscriber};

use super::{ClientError, PAUSE, RobotClient};
use crate::execution::{PluginEntry, RobotManifest, topics};

/// Maximum time to collect reports: somewhat more than the half second after which behaviors report their calls again.
const COLLECTING: Duration = Duration::from_millis(1200);

/// Status of one plugin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PluginStatus {
    /// Name in the task or robot file.
    pub name: String,
    /// `behavior` or `device`.
    pub kind: &'static str,
    /// Type of the behavior or driver.
    pub plugin: String,
    /// State of the plugin or its process, such as `running`.
    pub state: String,
    /// Its process, or the robot's if it is a thread.
    pub pid: Option<u32>,
    /// Set if it has a process of its own.
    pub own_process: bool,
    /// Number of restarts.
    pub restarts: u32,
    /// Age of its last heartbeat, s; `None` if none was received.
    pub beat_age_s: Option<f64>,
    /// Calls of a behavior that has reported them.
    pub calls: Option<CallSummary>,
    /// Priority of a behavior.
    pub priority: Option<i32>,
    /// Outcome of its newest proposal.
    pub outcome: Option<&'static str>,
    /// Behavior that outranked, inhibited, suppressed or halted it.
    pub by: Option<String>,
    /// End of its last process, if one has ended.
    pub last_end: Option<TimedText>,
    /// Beginning of the failure that it reported last.
    pub failure: Option<TimedText>,
}

/// Calls of a behavior since its start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CallSummary {
    /// Number of calls.
    pub count: u64,
    /// Median duration, us.
    pub p50_us: f64,
    /// Maximum duration, us.
    pub max_us: f64,
    /// Number of calls that exceeded the budget.
    pub overruns: u64,
    /// Number of calls that panicked.
    pub panics: u32,
}

/// A text with its age.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimedText {
    /// Text.
    pub text: String,
    /// Age, s.
    pub ago_s: f64,
}

impl RobotClient {
    /// Collects reports until each plugin has reported, for at most 1.2 s, and returns the status of each plugin.
    ///
    /// # Errors
    /// The robot publishes no manifest, or the bus fails.
    pub fn plugin_statuses(&mut self) -> Result<Vec<PluginStatus>, ClientError> {
        let beats = self.bus.subscriber::<Heartbeat>(topics::HEARTBEATS)?;
        let calls = self.bus.subscriber::<CallsHeader>(topics::CALLS)?;
        let manifest = self.manifest()?.clone();
        let mut reports = Reports::default();
        let began = Instant::now();
        while began.elapsed() < COLLECTING && !reports.are_complete(&manifest) {
            reports.receive(&beats, &calls)?;
            reports.decision = self.latest_decision(PAUSE)?.or(reports.decision);
        }
        let now = Time::monotonic_now();
        let processes = self.context().processes;
        let process = |name: &str| processes.iter().find(|process| process.plugin.as_str() == name);
        let plugins = manifest.plugins.iter();
        Ok(plugins.map(|plugin| reports.status(plugin, process(&plugin.name), manifest.pid, now)).collect())
    }
}

/// Reports received from plugins, by name.
#[derive(Default)]
struct Reports {
    beats: BTreeMap<String, Heartbeat>,
    calls: BTreeMap<String, CallSummary>,
    decision: Option<DecisionMessage>,
}

impl Reports {
    fn are_complete(&self, manifest: &RobotManifest) -> bool {
        let has_reported = |plugin: &PluginEntry| {
            self.beats.contains_key(&plugin.name)
                && (plugin.behavior.is_none() || self.calls.contains_key(&plugin.name))
        };
        self.decision.is_some() && manifest.plugins.iter().all(has_reported)
    }

    fn receive(
        &mut self,
        beats: &Subscriber<Heartbeat>,
        calls: &Subscriber<CallsHeader>,
    ) -> Result<(), BusError> {
        while let Some(beat) = beats.receive()? {
            self.beats.insert(beat.header().plugin.as_str().to_owned(), *beat.header());
        }
        while let Some(report) = calls.receive()? {
            let header = report.header();
            let mut durations = DurationHistogram::default();
            for bucket in report.items() {
                durations.add_bucket(bucket.index as usize, u64::from(bucket.calls));
            }
            durations.raise_max(Duration::from_nanos(header.longest_ns));
            let micros = |duration: Duration| duration.as_secs_f64() * 1e6;
            let summary = CallSummary {
                count: durations.count(),
                p50_us: micros(durations.quantile(0.5)),
                max_us: micros(durations.max()),
                overruns: header.overruns,
                panics: header.panics,
            };
            self.calls.insert(header.plugin.as_str().to_owned(), summary);
        }
        Ok(())
    }

    fn status(
        &self,
        plugin: &PluginEntry,
        process: Option<&Process>,
        robot_pid: u32,
        now: Time,
    ) -> PluginStatus {
        let beat = self.beats.get(&plugin.name);
        let verdict = self.decision.as_ref().and_then(|decision| decision.verdict(&plugin.name));
        let age_s = |stamp_ns: u64| now.since(Time(stamp_ns)).as_secs_f64();
        let timed = |note: &Note, stamp_ns: u64| {
            let text = note.as_str().to_owned();
            (!text.is_empty()).then(|| TimedText { text, ago_s: age_s(stamp_ns) })
        };
        let pid = process.map_or_else(|| (!plugin.own_process).then_some(robot_pid), |p| Some(p.pid));
        PluginStatus {
            name: plugin.name.clone(),
            kind: if plugin.behavior.is_some() { "behavior" } else { "device" },
            plugin: plugin.plugin.clone(),
            state: state(beat, process).to_owned(),
            pid: pid.filter(|pid| *pid != 0),
            own_process: plugin.own_process,
            restarts: process.map_or(beat.map_or(0, |beat| beat.restarts), |process| process.restarts),
            beat_age_s: beat.map(|beat| age_s(beat.stamp_ns)),
            calls: self.calls.get(&plugin.name).copied(),
            priority: plugin.behavior.map(|behavior| behavior.priority),
            outcome: verdict.and_then(Verdict::outcome).map(Outcome::as_str),
            by: verdict.map(|verdict| verdict.by.as_str().to_owned()).filter(|by| !by.is_empty()),
            last_end: process.and_then(|process| timed(&process.ended, process.ended_ns)),
            failure: process.and_then(|process| timed(&process.failure, process.failed_ns)),
        }
    }
}

/// State from the supervisor if the process is not running, else from the plugin itself.
fn state(beat: Option<&Heartbeat>, process: Option<&Process>) -> &'static str {
    match (process.and_then(Process::state), beat.and_then(Heartbeat::state)) {
        (Some(state), _) if state != ProcessState::Running => state.as_str(),
        (_, Some(state)) => state.as_str(),
        (Some(_), None) => ProcessState::Running.as_str(),
        (None, None) => "silent",
    }
}
