//! How every plugin of a running robot fares.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;
use yamabico_core::message::{CallsHeader, Heartbeat, Note, Outcome, Process, ProcessState, Verdict};
use yamabico_core::time::Time;
use yamabico_host::Durations;
use yamabico_host::bus::{Bus, BusError, Subscriber};

use super::lookout::{LookError, Lookout};
use crate::execution::{Enrolled, Roster, topics};
use yamabico_arbiter::decide::Told;

/// Longest time to listen: somewhat more than the half second after which behaviors tell of their calls again.
const LISTENING: Duration = Duration::from_millis(1200);
const PAUSE: Duration = Duration::from_millis(5);

/// A plugin of a running robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mustered {
    /// Its name.
    pub name: String,
    /// `behavior` or `device`.
    pub kind: &'static str,
    /// Which behavior or driver it is.
    pub plugin: String,
    /// How it fares.
    pub state: String,
    /// Its process; that of the robot where it is a thread.
    pub pid: Option<u32>,
    /// Whether it has a process of its own.
    pub own_process: bool,
    /// Times that it was started again.
    pub restarts: u32,
    /// Age of its last sign of life, seconds; `None` where none was heard.
    pub beat_age_s: Option<f64>,
    /// How its calls went, where it is a behavior that has told.
    pub calls: Option<Calls>,
    /// Its priority, where it is a behavior.
    pub priority: Option<i32>,
    /// What became of its newest proposal.
    pub outcome: Option<&'static str>,
    /// Who beat, inhibited, suppressed or halted it.
    pub by: Option<String>,
    /// How its last process ended, where one has.
    pub last_end: Option<Word>,
    /// What it last said went wrong, the beginning.
    pub said: Option<Word>,
}

/// The calls of a behavior since it was started.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calls {
    /// How many.
    pub count: u64,
    /// Half of them were shorter, microseconds.
    pub p50_us: f64,
    /// The longest, microseconds.
    pub max_us: f64,
    /// Longer than the budget.
    pub overruns: u64,
    /// Ended in a panic.
    pub panics: u32,
}

/// Something that was told.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Word {
    /// In words.
    pub words: String,
    /// Seconds since.
    pub ago_s: f64,
}

/// Listens to a running robot until every plugin has told how it fares, or long enough.
///
/// # Errors
/// No such robot runs, or it does not say who works on it.
pub fn muster(robot: &str) -> Result<Vec<Mustered>, LookError> {
    let bus = Bus::join(robot)?;
    let beats = bus.subscriber::<Heartbeat>(topics::HEARTBEATS)?;
    let calls = bus.subscriber::<CallsHeader>(topics::CALLS)?;
    let mut lookout = Lookout::join(robot)?;
    let mut heard = Heard::default();
    let began = Instant::now();
    while began.elapsed() < LISTENING && !heard.is_complete(lookout.roster()) {
        heard.listen(&beats, &calls)?;
        heard.told = lookout.look(PAUSE)?.or(heard.told);
    }
    let now = Time::monotonic_now();
    let roster = lookout.roster();
    let process = |name: &str| lookout.scene().processes.iter().find(|p| p.plugin.as_str() == name);
    Ok(roster
        .plugins
        .iter()
        .map(|plugin| heard.mustered(plugin, process(&plugin.name), roster.pid, now))
        .collect())
}

/// What was heard of plugins, by name.
#[derive(Default)]
struct Heard {
    beats: BTreeMap<String, Heartbeat>,
    calls: BTreeMap<String, Calls>,
    told: Option<Told>,
}

impl Heard {
    fn is_complete(&self, roster: &Roster) -> bool {
        let has_told = |plugin: &Enrolled| {
            self.beats.contains_key(&plugin.name)
                && (plugin.behavior.is_none() || self.calls.contains_key(&plugin.name))
        };
        self.told.is_some() && roster.plugins.iter().all(has_told)
    }

    fn listen(
        &mut self,
        beats: &Subscriber<Heartbeat>,
        calls: &Subscriber<CallsHeader>,
    ) -> Result<(), BusError> {
        while let Some(beat) = beats.receive()? {
            self.beats.insert(beat.header().plugin.as_str().to_owned(), *beat.header());
        }
        while let Some(told) = calls.receive()? {
            let header = told.header();
            let mut durations = Durations::default();
            for bucket in told.items() {
                durations.add_bucket(bucket.index as usize, u64::from(bucket.calls));
            }
            durations.raise_max(Duration::from_nanos(header.longest_ns));
            let micros = |duration: Duration| duration.as_secs_f64() * 1e6;
            let calls = Calls {
                count: durations.count(),
                p50_us: micros(durations.quantile(0.5)),
                max_us: micros(durations.max()),
                overruns: header.overruns,
                panics: header.panics,
            };
            self.calls.insert(header.plugin.as_str().to_owned(), calls);
        }
        Ok(())
    }

    fn mustered(&self, plugin: &Enrolled, process: Option<&Process>, robot_pid: u32, now: Time) -> Mustered {
        let beat = self.beats.get(&plugin.name);
        let verdict = self.told.as_ref().and_then(|told| told.verdict(&plugin.name));
        let age_s = |stamp_ns: u64| now.since(Time(stamp_ns)).as_secs_f64();
        let word = |note: &Note, stamp_ns: u64| {
            let words = note.as_str().to_owned();
            (!words.is_empty()).then(|| Word { words, ago_s: age_s(stamp_ns) })
        };
        let pid = process.map_or_else(|| (!plugin.own_process).then_some(robot_pid), |p| Some(p.pid));
        Mustered {
            name: plugin.name.clone(),
            kind: if plugin.behavior.is_some() { "behavior" } else { "device" },
            plugin: plugin.plugin.clone(),
            state: state(beat, process),
            pid: pid.filter(|pid| *pid != 0),
            own_process: plugin.own_process,
            restarts: process.map_or(beat.map_or(0, |beat| beat.restarts), |process| process.restarts),
            beat_age_s: beat.map(|beat| age_s(beat.stamp_ns)),
            calls: self.calls.get(&plugin.name).copied(),
            priority: plugin.behavior.map(|duties| duties.priority),
            outcome: verdict.and_then(Verdict::outcome).map(Outcome::as_str),
            by: verdict.map(|verdict| verdict.by.as_str().to_owned()).filter(|by| !by.is_empty()),
            last_end: process.and_then(|process| word(&process.ended, process.ended_ns)),
            said: process.and_then(|process| word(&process.said, process.said_ns)),
        }
    }
}

/// What the supervisor says of it, or else it itself.
fn state(beat: Option<&Heartbeat>, process: Option<&Process>) -> String {
    match (process.and_then(Process::state), beat.and_then(Heartbeat::state)) {
        (Some(state), _) if state != ProcessState::Up => state.as_str(),
        (_, Some(state)) => state.as_str(),
        (Some(_), None) => ProcessState::Up.as_str(),
        (None, None) => "silent",
    }
    .to_owned()
}
