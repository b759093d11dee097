//! Supervisor of the plugins' processes: starts, watches and restarts them.
//!
//! One thread does it, never for more than a few milliseconds at a time. The clean-up after a dead process may block, so it has
//! a thread of its own; a new process waits for it for at most half a second. The supervisor is independent of the arbiter.
//!
//! A process that sends no heartbeat for too long is killed and restarted. A process that computes has longer, and time for which it
//! waits for a processor does not count: a busy machine must not kill the processes that it slows down. `liveness` states the rule.
//! Where that is permitted, an overdue process that lacks a processor is given precedence until its next heartbeat.
//! Safety does not depend on it: proposals of a silent behavior expire by their age, and a silent device stops its drive.

mod back_off;
mod clean_up;
mod janitor;
mod liveness;
mod precedence;
mod process_reporter;
mod program;
mod silence;
mod spawn;
mod supervised_process;
mod thread_times;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use yamabico_core::message::{FailureHeader, Heartbeat, Name, SavedStateHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Subscriber};
use yamabico_host::{HostError, topics};

use clean_up::CleanUp;
use janitor::JanitorThread;
use process_reporter::ProcessReporter;
pub use program::Program;
pub(crate) use spawn::launch;
pub use supervised_process::ProcessPlan;
use supervised_process::{RunPhase, SupervisedProcess};

/// Period of the supervisor: the delay with which it notices a death.
const PERIOD: Duration = Duration::from_millis(2);
/// Delay of the supervisor above which the machine stood still: the processes did, too. It is hardly ever as late on a busy one.
const STANDSTILL: Duration = Duration::from_millis(20);
/// Time within which plugins end on request; after that they are killed.
const ENDING_TIMEOUT: Duration = Duration::from_secs(1);

/// Supervisor of a running robot's processes. They end with it.
pub struct Supervisor {
    requests: Arc<Requests>,
    thread: Option<JoinHandle<()>>,
}

/// Requests to the supervisor's thread, and what it answers.
#[derive(Default)]
struct Requests {
    /// Plugins that start from now on begin at once.
    begun: AtomicBool,
    /// End every process.
    end: AtomicBool,
    /// Parameters that behaviors get when they restart.
    parameters: Mutex<Vec<(String, toml::Table, u64)>>,
    /// Longest time for which a process that starts has waited for a processor so far, ns.
    start_delay_ns: AtomicU64,
}

impl Supervisor {
    /// Starts a process of `program` for each plan. `bus` is the robot's, with its topics created.
    ///
    /// # Errors
    /// A thread does not start, or the bus fails.
    pub fn start(bus: &Bus, plans: Vec<ProcessPlan>, program: Program) -> Result<Supervisor, HostError> {
        let requests = Arc::new(Requests::default());
        let supervision = Supervision {
            heartbeats: bus.subscriber(topics::HEARTBEATS)?,
            saved_states: bus.subscriber(topics::SAVED_STATES)?,
            failures: bus.subscriber(topics::FAILURES)?,
            reporter: ProcessReporter::open(bus)?,
            clean_up: CleanUp::start(bus)?,
            _janitor: JanitorThread::start(bus)?,
            processes: plans.into_iter().map(SupervisedProcess::new).collect(),
            program,
            requests: Arc::clone(&requests),
        };
        let thread = std::thread::Builder::new().name("supervisor".into()).spawn(move || supervision.run());
        let thread = thread.map_err(|source| HostError::Thread { name: "supervisor".into(), source })?;
        Ok(Supervisor { requests, thread: Some(thread) })
    }

    /// Reports the begin of the run: plugins that start from now on begin at once.
    pub fn begin(&self) {
        self.requests.begun.store(true, Ordering::Relaxed);
    }

    /// Longest time for which a process that starts has waited for a processor so far.
    pub fn start_delay(&self) -> Duration {
        Duration::from_nanos(self.requests.start_delay_ns.load(Ordering::Relaxed))
    }

    /// Sets the parameters that the behavior `name` gets when it restarts, and the request that changed them.
    pub fn set_parameters(&self, name: &str, table: toml::Table, request: u64) {
        let mut parameters = self.requests.parameters.lock().unwrap_or_else(PoisonError::into_inner);
        parameters.push((name.to_owned(), table, request));
    }

    /// Asks every process to end.
    pub fn end(&self) {
        self.requests.end.store(true, Ordering::Relaxed);
    }

    /// Returns true if every process has ended; a second after [`Supervisor::end`], the remaining ones are killed.
    pub fn is_done(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Supervisor {
    /// Waits until every process has ended.
    fn drop(&mut self) {
        self.end();
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            tracing::error!("the supervisor panicked; its processes died with it");
        }
    }
}

/// State of the supervisor's thread.
struct Supervision {
    heartbeats: Subscriber<Heartbeat>,
    saved_states: Subscriber<SavedStateHeader>,
    failures: Subscriber<FailureHeader>,
    reporter: ProcessReporter,
    processes: Vec<SupervisedProcess>,
    clean_up: CleanUp,
    program: Program,
    requests: Arc<Requests>,
    _janitor: JanitorThread,
}

impl Supervision {
    fn run(mut self) {
        let mut last = Time::monotonic_now();
        while !self.requests.end.load(Ordering::Relaxed) {
            let now = Time::monotonic_now();
            let passed = now.since(last);
            if passed > STANDSTILL {
                self.processes.iter_mut().for_each(|process| process.excuse(passed));
            }
            last = now;
            if let Err(error) = self.receive(now) {
                tracing::error!("receiving heartbeats failed: {error}");
            }
            self.clean_up.step(now);
            self.pass_parameters();
            let phase = match self.requests.begun.load(Ordering::Relaxed) {
                true => RunPhase::Running,
                false => RunPhase::Opening,
            };
            for process in &mut self.processes {
                process.step(now, phase, &self.program, &mut self.clean_up);
            }
            let delays = self.processes.iter().map(SupervisedProcess::start_delay);
            let delay_ns =
                delays.max().map_or(0, |delay| u64::try_from(delay.as_nanos()).unwrap_or(u64::MAX));
            self.requests.start_delay_ns.fetch_max(delay_ns, Ordering::Relaxed);
            let reports = self.processes.iter().map(SupervisedProcess::report);
            if let Err(error) = self.reporter.report(reports, now) {
                tracing::error!("could not publish the state of processes: {error}");
            }
            std::thread::sleep(PERIOD);
        }
        self.end();
    }

    fn pass_parameters(&mut self) {
        let mut parameters = self.requests.parameters.lock().unwrap_or_else(PoisonError::into_inner);
        for (name, table, request) in parameters.drain(..) {
            if let Some(process) = self.processes.iter_mut().find(|process| process.name() == name) {
                process.set_parameters(table, request);
            }
        }
    }

    fn receive(&mut self, now: Time) -> Result<(), BusError> {
        while let Some(beat) = self.heartbeats.receive()? {
            if let Some(process) = find(&mut self.processes, &beat.header().plugin) {
                // The silence begins after the heartbeat, which may have come since the round began.
                process.beat(beat.header(), Time::monotonic_now());
            }
        }
        while let Some(state) = self.saved_states.receive()? {
            if let Some(process) = find(&mut self.processes, &state.header().plugin) {
                process.save_state(state.items());
            }
        }
        while let Some(failure) = self.failures.receive()? {
            if let Some(process) = find(&mut self.processes, &failure.header().plugin) {
                process.set_failure(failure.items(), now);
            }
        }
        Ok(())
    }

    fn end(mut self) {
        self.processes.iter_mut().for_each(SupervisedProcess::ask_to_end);
        let asked = Time::monotonic_now();
        while self.processes.iter_mut().any(SupervisedProcess::is_running)
            && Time::monotonic_now().since(asked) < ENDING_TIMEOUT
        {
            std::thread::sleep(PERIOD);
        }
        self.processes.iter_mut().for_each(SupervisedProcess::kill);
    }
}

fn find<'a>(processes: &'a mut [SupervisedProcess], name: &Name) -> Option<&'a mut SupervisedProcess> {
    processes.iter_mut().find(|process| process.name() == name.as_str())
}
