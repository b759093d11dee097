//! One plugin under supervision.

use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use yamabico_core::message::{Heartbeat, Name, Note, Process, ProcessState};
use yamabico_core::time::Time;
use yamabico_host::Scheduling;
use yamabico_host::process::{Begin, Charge, OnDeath, Part};

use super::back_off::BackOff;
use super::clean_up::{CleanUp, Ticket};
use super::health::Health;
use super::program::Program;
use super::spawn::{spawn, tell};

/// A successor waits so long for its predecessor's places to be cleared, and then tries its luck.
const CLEANING: Duration = Duration::from_millis(500);

/// A plugin that is to run in a process of its own.
#[derive(Clone, Debug)]
pub struct WardPlan {
    /// What it is told.
    pub charge: Charge,
    /// What the supervisor's death is for it.
    pub on_death: OnDeath,
    /// It may show no sign of life for so long.
    pub patience: Duration,
    /// What is asked of the system's scheduler for it.
    pub scheduling: Scheduling,
    /// The program that it is, and its arguments; empty where it is a part of the supervisor's.
    pub exec: Vec<String>,
}

/// How far the run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Everybody opens.
    Opening,
    /// Everybody is at work.
    Begun,
}

/// A plugin and its process.
pub(super) struct Ward {
    plan: WardPlan,
    state: State,
    back_off: BackOff,
    starts: u32,
    /// How its last process ended, and when.
    ended: Option<(Note, Time)>,
    /// What it last said went wrong, and when.
    said: Option<(Note, Time)>,
    /// Its process is killed because it hangs.
    hangs: bool,
}

enum State {
    /// To be started.
    Due { at: Time, clean: Option<Ticket> },
    /// Coming up beside the clean-up after its predecessor, told nothing yet.
    Coming { child: Child, started: Time, clean: Option<Ticket> },
    /// Running.
    Up { child: Child, started: Time, health: Health },
    /// Over.
    Ended,
}

impl Ward {
    pub fn new(plan: WardPlan) -> Ward {
        let state = State::Due { at: Time::ZERO, clean: None };
        Ward { plan, state, back_off: BackOff::default(), starts: 0, ended: None, said: None, hangs: false }
    }

    pub fn name(&self) -> &str {
        &self.plan.charge.name
    }

    /// Lets it have these parameters when it is started again, where it is a behavior.
    pub fn retune(&mut self, table: toml::Table) {
        if let Part::Behavior(part) = &mut self.plan.charge.part {
            part.parameters = table;
        }
    }

    /// How its process is.
    pub fn process(&self) -> Process {
        let (state, pid, due) = match &self.state {
            State::Due { at, .. } => (ProcessState::Due, 0, at.0.max(1)),
            State::Coming { child, .. } => (ProcessState::ComingUp, child.id(), 0),
            State::Up { child, health, .. } if health.is_up() => (ProcessState::Up, child.id(), 0),
            State::Up { child, .. } => (ProcessState::ComingUp, child.id(), 0),
            State::Ended => (ProcessState::Ended, 0, 0),
        };
        let (ended, ended_at) = self.ended.unwrap_or_default();
        let (said, said_at) = self.said.unwrap_or_default();
        Process {
            plugin: Name::new(self.name()),
            ended,
            said,
            ended_ns: ended_at.0,
            said_ns: said_at.0,
            due_ns: due,
            pid,
            state: state.code(),
            restarts: self.starts.saturating_sub(1),
            reserved: 0,
        }
    }

    /// Hears a sign of life.
    pub fn hear(&mut self, beat: &Heartbeat, now: Time) {
        if let State::Up { health, started, .. } = &mut self.state
            && beat.restarts + 1 == self.starts
        {
            if !health.is_up() {
                let took = now.since(*started);
                tracing::info!("`{}` is up, {took:?} after its start", self.plan.charge.name);
            }
            health.hear(now);
        }
    }

    /// Hears what went wrong in it.
    pub fn hear_failure(&mut self, words: &[u8], now: Time) {
        self.said = Some((Note::new(&String::from_utf8_lossy(words)), now));
    }

    /// Keeps what its successor is to be told.
    pub fn keep(&mut self, memory: &[u8]) {
        self.plan.charge.memory = String::from_utf8_lossy(memory).into_owned();
    }

    /// Does not count so much of the time that has passed.
    pub fn excuse(&mut self, time: Duration) {
        if let State::Up { health, .. } = &mut self.state {
            health.excuse(time);
        }
    }

    /// Buries, kills or starts it, where it is time to.
    pub fn step(&mut self, now: Time, phase: Phase, program: &Program, clean_up: &mut CleanUp) {
        match &mut self.state {
            State::Due { at, clean } => {
                if *at <= now {
                    let clean = *clean;
                    self.start(now, clean, program);
                }
            }
            State::Coming { child, started, .. } | State::Up { child, started, .. } => match child.try_wait()
            {
                Ok(Some(status)) => {
                    let took = now.since(*started);
                    // However long a start takes, who dies of it has not lived.
                    let lived = match &self.state {
                        State::Up { health, .. } => health.lived(now),
                        _ => Duration::ZERO,
                    };
                    let clean = Some(clean_up.request(now));
                    let by_others = status.signal() == Some(Signal::KILL.as_raw()) && !self.hangs;
                    self.bury(&in_words(status), took, lived, clean, now);
                    if self.back_off.loops() && !by_others {
                        // What it remembers may be what it cannot bear.
                        self.plan.charge.memory.clear();
                    }
                }
                Ok(None) => self.tend(now, phase, clean_up),
                Err(error) => tracing::error!("`{}` cannot be waited for: {error}", self.plan.charge.name),
            },
            State::Ended => {}
        }
    }

    /// Charges a process that has come up, where its predecessor's places are free, and kills one that hangs.
    fn tend(&mut self, now: Time, phase: Phase, clean_up: &CleanUp) {
        match &mut self.state {
            State::Coming { started, clean, .. } => {
                if clean.is_none_or(|ticket| clean_up.is_done(ticket)) || now.since(*started) > CLEANING {
                    self.charge(now, phase);
                }
            }
            State::Up { child, health, .. } => {
                if let Some(silent) = health.hangs(now) {
                    let name = &self.plan.charge.name;
                    tracing::warn!("`{name}` hangs: no sign of life for {silent:?}; it is killed");
                    let _ = child.kill();
                    self.hangs = true;
                    // It is waited for before it can be found to hang again.
                    health.hear(now);
                }
            }
            State::Due { .. } | State::Ended => {}
        }
    }

    fn start(&mut self, now: Time, clean: Option<Ticket>, program: &Program) {
        match spawn(program, &self.plan) {
            Ok(child) => self.state = State::Coming { child, started: now, clean },
            Err(error) => self.bury(
                &format!("could not be started: {error}"),
                Duration::ZERO,
                Duration::ZERO,
                clean,
                now,
            ),
        }
    }

    /// Tells the process that has come up what it is.
    fn charge(&mut self, now: Time, phase: Phase) {
        let State::Coming { mut child, started, .. } = std::mem::replace(&mut self.state, State::Ended)
        else {
            return;
        };
        let charge = &mut self.plan.charge;
        charge.restarts = self.starts;
        charge.begin = match phase {
            Phase::Opening => Begin::WithTheFirstCommand,
            Phase::Begun => Begin::AtOnce,
        };
        self.starts += 1;
        self.hangs = false;
        if let Err(error) = tell(&mut child, charge) {
            // It is buried when it is next looked at.
            tracing::error!("`{}` cannot be told what it is: {error}", charge.name);
            let _ = child.kill();
        }
        self.state = State::Up { child, started, health: Health::new(self.plan.patience, now) };
    }

    /// It ended `took` after its start, and had been up for `lived`.
    fn bury(&mut self, how: &str, took: Duration, lived: Duration, clean: Option<Ticket>, now: Time) {
        let wait = self.back_off.died(lived);
        self.ended = Some((Note::new(how), now));
        let name = &self.plan.charge.name;
        let after = format!("`{name}` {how} after {took:.3?}");
        if self.back_off.loops() {
            tracing::error!("{after}, again and again; it is started again in {wait:?}");
        } else {
            tracing::warn!("{after}; it is started again");
        }
        self.state = State::Due { at: now + wait, clean };
    }

    /// Tells its process to end, for good.
    pub fn ask_to_end(&mut self) {
        match &self.state {
            State::Coming { child, .. } | State::Up { child, .. } => {
                let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
                let _ = pid.map(|pid| kill_process(pid, Signal::TERM));
            }
            State::Due { .. } | State::Ended => self.state = State::Ended,
        }
    }

    /// Whether its process still runs; one that has ended is waited for.
    pub fn is_up(&mut self) -> bool {
        if let State::Coming { child, .. } | State::Up { child, .. } = &mut self.state
            && !matches!(child.try_wait(), Ok(None))
        {
            self.state = State::Ended;
        }
        matches!(self.state, State::Coming { .. } | State::Up { .. })
    }

    /// Ends its process, for good.
    pub fn kill(&mut self) {
        if let State::Coming { child, .. } | State::Up { child, .. } = &mut self.state {
            tracing::warn!("`{}` does not end and is killed", self.plan.charge.name);
            let _ = child.kill().and_then(|()| child.wait());
        }
        self.state = State::Ended;
    }
}

fn in_words(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("was killed by signal {signal}"),
        (None, Some(code)) => format!("ended with exit code {code}"),
        (None, None) => "ended".to_owned(),
    }
}
