//! One plugin under supervision.

use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use yamabico_core::message::{Heartbeat, Name, Note, Process, ProcessState};
use yamabico_core::time::Time;
use yamabico_host::process::{LaunchConfig, OnParentDeath, Role, Start};
use yamabico_host::{Deadline, Scheduling};

use super::back_off::BackOff;
use super::clean_up::{CleanUp, CleanUpTicket};
use super::liveness::{Hang, Liveness};
use super::precedence::Precedence;
use super::program::Program;
use super::spawn::{send_launch_config, spawn};
use super::thread_times::ThreadTimes;

/// Time for which a new process waits for the clean-up after its predecessor; after that it tries to open its ports anyway.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_millis(500);

/// Plan of a plugin's process.
#[derive(Clone, Debug)]
pub struct ProcessPlan {
    /// Launch configuration.
    pub launch: LaunchConfig,
    /// Reaction of the process to the supervisor's death.
    pub on_parent_death: OnParentDeath,
    /// Longest tolerated silence.
    pub deadline: Deadline,
    /// Request to the operating system's scheduler.
    pub scheduling: Scheduling,
    /// External program and its arguments; empty for a plugin that is built in.
    pub exec: Vec<String>,
}

/// Phase of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RunPhase {
    /// Plugins open their parts.
    Opening,
    /// Plugins are running.
    Running,
}

/// A plugin and its process.
pub(super) struct SupervisedProcess {
    plan: ProcessPlan,
    state: State,
    back_off: BackOff,
    starts: u32,
    /// End of its last process, and the time of it.
    ended: Option<(Note, Time)>,
    /// Failure that it reported last, and the time of it.
    failure: Option<(Note, Time)>,
    /// Finding for which its process is being killed.
    hang: Option<Hang>,
    /// Precedence of its process while it is overdue.
    precedence: Precedence,
    /// Set once a process of it was late, but not killed.
    was_late: bool,
}

enum State {
    /// To be started.
    Due { at: Time, clean_up: Option<CleanUpTicket> },
    /// Started during the clean-up after its predecessor; waits for its launch configuration.
    Starting { child: Child, started: Time, clean_up: Option<CleanUpTicket> },
    /// Launched.
    Up { child: Child, started: Time, liveness: Liveness },
    /// Ended for good.
    Ended,
}

/// A process that has ended.
struct End {
    /// Cause, such as `was killed by signal 9`.
    cause: String,
    /// Time since its start.
    age: Duration,
    /// Time since its first heartbeat.
    lived: Duration,
}

impl SupervisedProcess {
    pub fn new(plan: ProcessPlan) -> SupervisedProcess {
        SupervisedProcess {
            plan,
            state: State::Due { at: Time::ZERO, clean_up: None },
            back_off: BackOff::default(),
            starts: 0,
            ended: None,
            failure: None,
            hang: None,
            precedence: Precedence::default(),
            was_late: false,
        }
    }

    pub fn name(&self) -> &str {
        &self.plan.launch.name
    }

    /// Sets the parameters of a behavior for its next start, and the request that changed them.
    pub fn set_parameters(&mut self, table: toml::Table, request: u64) {
        if let Role::Behavior(part) = &mut self.plan.launch.role {
            part.parameters = table;
            self.plan.launch.request = request;
        }
    }

    /// Report on the process.
    pub fn report(&self) -> Process {
        let (state, pid, due) = match &self.state {
            State::Due { at, .. } => (ProcessState::Waiting, 0, at.0.max(1)),
            State::Starting { child, .. } => (ProcessState::Starting, child.id(), 0),
            State::Up { child, liveness, .. } if liveness.is_up() => (ProcessState::Running, child.id(), 0),
            State::Up { child, .. } => (ProcessState::Starting, child.id(), 0),
            State::Ended => (ProcessState::Ended, 0, 0),
        };
        let (ended, ended_at) = self.ended.unwrap_or_default();
        let (failure, failed_at) = self.failure.unwrap_or_default();
        Process {
            plugin: Name::new(self.name()),
            ended,
            failure,
            ended_ns: ended_at.0,
            failed_ns: failed_at.0,
            due_ns: due,
            pid,
            state: state.code(),
            restarts: self.starts.saturating_sub(1),
            reserved: 0,
        }
    }

    /// Records a heartbeat of the current process.
    pub fn beat(&mut self, beat: &Heartbeat, now: Time) {
        if let State::Up { liveness, started, child } = &mut self.state
            && beat.restarts + 1 == self.starts
        {
            if !liveness.is_up() {
                let took = now.since(*started);
                tracing::info!("`{}` is running, {took:?} after its start", self.plan.launch.name);
            }
            liveness.beat(now);
            self.precedence.restore(child.id());
        }
    }

    /// Records a failure that the plugin reported.
    pub fn set_failure(&mut self, text: &[u8], now: Time) {
        self.failure = Some((Note::new(&String::from_utf8_lossy(text)), now));
    }

    /// Stores the plugin's state for its next start.
    pub fn save_state(&mut self, state: &[u8]) {
        self.plan.launch.saved_state = String::from_utf8_lossy(state).into_owned();
    }

    /// Excludes a span of time that the supervisor missed itself.
    pub fn excuse(&mut self, time: Duration) {
        if let State::Up { liveness, .. } = &mut self.state {
            liveness.excuse(time);
        }
    }

    /// Time for which a process that starts has waited for a processor since its launch.
    pub fn start_delay(&self) -> Duration {
        match &self.state {
            State::Up { liveness, .. } if !liveness.is_up() => liveness.waited(),
            _ => Duration::ZERO,
        }
    }

    /// Starts, launches, kills or restarts the process, whatever is due.
    pub fn step(&mut self, now: Time, phase: RunPhase, program: &Program, clean_up: &mut CleanUp) {
        match &mut self.state {
            State::Due { at, clean_up } => {
                if *at <= now {
                    let clean_up = *clean_up;
                    self.start(now, clean_up, program);
                }
            }
            State::Starting { child, started, .. } | State::Up { child, started, .. } => {
                match child.try_wait() {
                    Ok(Some(status)) => {
                        let age = now.since(*started);
                        self.handle_end(status, age, now, clean_up);
                    }
                    Ok(None) => self.tend(now, phase, clean_up),
                    Err(error) => {
                        tracing::error!("waiting for the process of `{}` failed: {error}", self.name());
                    }
                }
            }
            State::Ended => {}
        }
    }

    /// Cleans up after the process and schedules its restart.
    fn handle_end(&mut self, status: ExitStatus, age: Duration, now: Time, clean_up: &mut CleanUp) {
        // A process that dies while starting has not lived, however long the start took.
        let lived = match &self.state {
            State::Up { liveness, .. } => liveness.lived(now),
            _ => Duration::ZERO,
        };
        let ticket = Some(clean_up.request(now));
        let cause = match self.hang {
            Some(hang) => format!("was killed after {hang}"),
            None => describe(status),
        };
        let killed_from_outside = status.signal() == Some(Signal::KILL.as_raw()) && self.hang.is_none();
        self.schedule_restart(&End { cause, age, lived }, ticket, now);
        if self.back_off.is_crash_loop() && !killed_from_outside {
            // Saved state may be causing the crash: discard it.
            self.plan.launch.saved_state.clear();
        }
    }

    /// Launches a started process once its predecessor's ports are free, and kills a hung one.
    fn tend(&mut self, now: Time, phase: RunPhase, clean_up: &CleanUp) {
        match &mut self.state {
            State::Starting { started, clean_up: ticket, .. } => {
                let is_clean = ticket.is_none_or(|ticket| clean_up.is_done(ticket));
                if is_clean || now.since(*started) > CLEAN_UP_TIMEOUT {
                    self.launch(now, phase);
                }
            }
            State::Up { child, liveness, .. } if self.hang.is_none() => {
                if liveness.is_reading_due(now)
                    && let Some(threads) = ThreadTimes::of_process(child.id())
                {
                    liveness.read(&threads, now);
                    // A plugin whose scheduling was chosen keeps it.
                    if liveness.lacks_processor() && self.plan.scheduling == Scheduling::default() {
                        self.precedence.raise(child.id(), &threads);
                    }
                }
                self.hang = liveness.hang(now);
                if self.hang.is_some() {
                    // Reported when the process has ended.
                    let _ = child.kill();
                } else if liveness.is_late(now) && !std::mem::replace(&mut self.was_late, true) {
                    tracing::warn!(
                        "`{}` is late, but not killed yet: it computes or waits for a processor. This machine is slow or \
                         busy; `yamabico check --measure` proposes deadlines for it",
                        self.plan.launch.name
                    );
                }
            }
            State::Up { .. } | State::Due { .. } | State::Ended => {}
        }
    }

    fn start(&mut self, now: Time, clean_up: Option<CleanUpTicket>, program: &Program) {
        match spawn(program, &self.plan) {
            Ok(child) => self.state = State::Starting { child, started: now, clean_up },
            Err(error) => {
                let cause = format!("could not be started: {error}");
                let end = End { cause, age: Duration::ZERO, lived: Duration::ZERO };
                self.schedule_restart(&end, clean_up, now);
            }
        }
    }

    /// Sends the started process its launch configuration.
    fn launch(&mut self, now: Time, phase: RunPhase) {
        let State::Starting { mut child, started, .. } = std::mem::replace(&mut self.state, State::Ended)
        else {
            return;
        };
        let launch = &mut self.plan.launch;
        launch.restarts = self.starts;
        launch.start = match phase {
            RunPhase::Opening => Start::OnFirstCommand,
            RunPhase::Running => Start::Immediately,
        };
        self.starts += 1;
        self.hang = None;
        self.precedence = Precedence::default();
        if let Err(error) = send_launch_config(&mut child, launch) {
            tracing::error!("could not launch `{}`: {error}", launch.name);
            let _ = child.kill();
        }
        let liveness = Liveness::new(self.plan.deadline, now);
        self.state = State::Up { child, started, liveness };
    }

    fn schedule_restart(&mut self, end: &End, clean_up: Option<CleanUpTicket>, now: Time) {
        let delay = self.back_off.died(end.lived);
        self.ended = Some((Note::new(&end.cause), now));
        let event = format!("`{}` {}, {:.3?} after its start", self.name(), end.cause, end.age);
        if self.back_off.is_crash_loop() {
            tracing::error!("{event}; it keeps crashing and restarts in {delay:?}");
        } else {
            tracing::warn!("{event}; it restarts");
        }
        self.state = State::Due { at: now + delay, clean_up };
    }

    /// Asks the process to end for good.
    pub fn ask_to_end(&mut self) {
        match &self.state {
            State::Starting { child, .. } | State::Up { child, .. } => {
                let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
                let _ = pid.map(|pid| kill_process(pid, Signal::TERM));
            }
            State::Due { .. } | State::Ended => self.state = State::Ended,
        }
    }

    /// Returns true if the process is still running; waits for one that has ended.
    pub fn is_running(&mut self) -> bool {
        if let State::Starting { child, .. } | State::Up { child, .. } = &mut self.state
            && !matches!(child.try_wait(), Ok(None))
        {
            self.state = State::Ended;
        }
        matches!(self.state, State::Starting { .. } | State::Up { .. })
    }

    /// Kills the process for good.
    pub fn kill(&mut self) {
        if let State::Starting { child, .. } | State::Up { child, .. } = &mut self.state {
            tracing::warn!("`{}` did not end in time and was killed", self.plan.launch.name);
            let _ = child.kill().and_then(|()| child.wait());
        }
        self.state = State::Ended;
    }
}

fn describe(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("was killed by signal {signal}"),
        (None, Some(code)) => format!("ended with exit code {code}"),
        (None, None) => "ended".to_owned(),
    }
}
