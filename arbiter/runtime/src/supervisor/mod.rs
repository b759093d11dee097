//! Plugins in processes of their own: started, watched, buried, and started again.
//!
//! One thread does it all and never more than a few milliseconds of anything at a time; cleaning up after the dead, which
//! may block, has a thread of its own that nobody waits for longer than half a second. Neither knows the arbiter.

mod back_off;
mod bulletin;
mod clean_up;
mod health;
mod janitor;
mod program;
mod spawn;
mod ward;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use yamabico_core::message::{FailureHeader, Heartbeat, MemoryHeader, Name};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Subscriber};
use yamabico_host::{SeatError, topics};

use bulletin::Bulletin;
use clean_up::CleanUp;
use janitor::JanitorThread;
pub use program::Program;
pub use ward::WardPlan;
use ward::{Phase, Ward};

/// How often the supervisor looks: how late it notices a death.
const LOOK: Duration = Duration::from_millis(2);
/// Plugins that have not ended so long after they were told to are killed.
const FAREWELL: Duration = Duration::from_secs(1);

/// The supervisor of a running robot's processes. They end with it.
pub struct Supervisor {
    orders: Arc<Orders>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Orders {
    /// Plugins that start from now on begin at once.
    begun: AtomicBool,
    /// End every process.
    end: AtomicBool,
    /// Parameters that behaviors get when they are started again.
    retunes: Mutex<Vec<(String, toml::Table)>>,
}

impl Supervisor {
    /// Starts a process of `program` for each ward, on the supervisor's `bus`, whose topics exist.
    ///
    /// # Errors
    /// Its threads do not start, or the bus refuses.
    pub fn start(bus: &Bus, wards: Vec<WardPlan>, program: Program) -> Result<Supervisor, SeatError> {
        let orders = Arc::new(Orders::default());
        let watch = Watch {
            heartbeats: bus.subscriber(topics::HEARTBEATS)?,
            memories: bus.subscriber(topics::MEMORIES)?,
            failures: bus.subscriber(topics::FAILURES)?,
            bulletin: Bulletin::open(bus)?,
            clean_up: CleanUp::start(bus)?,
            _janitor: JanitorThread::start(bus)?,
            wards: wards.into_iter().map(Ward::new).collect(),
            program,
            orders: Arc::clone(&orders),
        };
        let thread = std::thread::Builder::new().name("supervisor".into()).spawn(move || watch.run());
        let thread = thread.map_err(|source| SeatError::Thread { name: "supervisor".into(), source })?;
        Ok(Supervisor { orders, thread: Some(thread) })
    }

    /// Tells that the run has begun: plugins that start from now on begin at once.
    pub fn begin(&self) {
        self.orders.begun.store(true, Ordering::Relaxed);
    }

    /// Lets the behavior `name` have these parameters when it is started again.
    pub fn retune(&self, name: &str, table: toml::Table) {
        self.orders.retunes.lock().unwrap_or_else(PoisonError::into_inner).push((name.to_owned(), table));
    }

    /// Tells every process to end.
    pub fn dismiss(&self) {
        self.orders.end.store(true, Ordering::Relaxed);
    }

    /// Whether every process has ended; those that hang are killed after a second.
    pub fn is_done(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Supervisor {
    /// Waits until every process has ended.
    fn drop(&mut self) {
        self.dismiss();
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            tracing::error!("the supervisor panicked; its processes died with it");
        }
    }
}

/// What the supervisor's thread has.
struct Watch {
    heartbeats: Subscriber<Heartbeat>,
    memories: Subscriber<MemoryHeader>,
    failures: Subscriber<FailureHeader>,
    bulletin: Bulletin,
    wards: Vec<Ward>,
    clean_up: CleanUp,
    program: Program,
    orders: Arc<Orders>,
    _janitor: JanitorThread,
}

impl Watch {
    fn run(mut self) {
        let mut looked = Time::monotonic_now();
        while !self.orders.end.load(Ordering::Relaxed) {
            let now = Time::monotonic_now();
            // What the supervisor did not get to see is not held against anybody.
            let late = now.since(looked).saturating_sub(2 * LOOK);
            looked = now;
            if let Err(error) = self.listen(now) {
                tracing::error!("signs of life are not heard: {error}");
            }
            self.clean_up.step(now);
            self.retune();
            let phase = match self.orders.begun.load(Ordering::Relaxed) {
                true => Phase::Begun,
                false => Phase::Opening,
            };
            for ward in &mut self.wards {
                ward.excuse(late);
                ward.step(now, phase, &self.program, &mut self.clean_up);
            }
            if let Err(error) = self.bulletin.tell(self.wards.iter().map(Ward::process), now) {
                tracing::error!("nobody is told of processes: {error}");
            }
            std::thread::sleep(LOOK);
        }
        self.end();
    }

    fn retune(&mut self) {
        for (name, table) in self.orders.retunes.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
            if let Some(ward) = self.wards.iter_mut().find(|ward| ward.name() == name) {
                ward.retune(table);
            }
        }
    }

    fn listen(&mut self, now: Time) -> Result<(), BusError> {
        while let Some(beat) = self.heartbeats.receive()? {
            if let Some(ward) = find(&mut self.wards, &beat.header().plugin) {
                ward.hear(beat.header(), now);
            }
        }
        while let Some(memory) = self.memories.receive()? {
            if let Some(ward) = find(&mut self.wards, &memory.header().plugin) {
                ward.keep(memory.items());
            }
        }
        while let Some(failure) = self.failures.receive()? {
            if let Some(ward) = find(&mut self.wards, &failure.header().plugin) {
                ward.hear_failure(failure.items(), now);
            }
        }
        Ok(())
    }

    fn end(mut self) {
        self.wards.iter_mut().for_each(Ward::ask_to_end);
        let told = Time::monotonic_now();
        while self.wards.iter_mut().any(Ward::is_up) && Time::monotonic_now().since(told) < FAREWELL {
            std::thread::sleep(LOOK);
        }
        self.wards.iter_mut().for_each(Ward::kill);
    }
}

fn find<'a>(wards: &'a mut [Ward], name: &Name) -> Option<&'a mut Ward> {
    wards.iter_mut().find(|ward| ward.name() == name.as_str())
}
