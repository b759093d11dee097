//! Supervisor of the plugins' processes: starts, watches and restarts them.
//!
//! One thread does it, never for more than a few milliseconds at a time. The clean-up after a dead process may block, so it has
//! a thread of its own; a new process waits for it for at most half a second. The supervisor is independent of the arbiter.

mod back_off;
mod clean_up;
mod janitor;
mod liveness;
mod process_reporter;
mod program;
mod spawn;
mod supervised_process;

use std::sync::atomic::{AtomicBool, Ordering};
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
/// Time within which plugins end on request; after that they are killed.
const ENDING_TIMEOUT: Duration = Duration::from_secs(1);

/// Supervisor of a running robot's processes. They end with it.
pub struct Supervisor {
    requests: Arc<Requests>,
    thread: Option<JoinHandle<()>>,
}

/// Requests to the supervisor's thread.
#[derive(Default)]
struct Requests {
    /// Plugins that start from now on begin at once.
    begun: AtomicBool,
    /// End every process.
    end: AtomicBool,
    /// Parameters that behaviors get when they restart.
    parameters: Mutex<Vec<(String, toml::Table, u64)>>,
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
            // Time that the supervisor itself missed does not make a process hung.
            let missed = now.since(last).saturating_sub(2 * PERIOD);
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
                process.excuse(missed);
                process.step(now, phase, &self.program, &mut self.clean_up);
            }
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
                process.beat(beat.header(), now);
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
