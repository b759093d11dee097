//! Clean-up after dead processes, on a thread of its own, because it may block.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use yamabico_core::time::Time;
use yamabico_host::HostError;
use yamabico_host::bus::{Bus, CleanUpReport};

/// Delay of a second clean-up: after a second, remains that the transport has lost track of can be distinguished from files in use.
const SECOND_CLEAN_UP: Duration = Duration::from_millis(1500);

/// Period of clean-ups without a known death: killed client programs leave ports behind that the supervisor does not see.
const PERIOD: Duration = Duration::from_secs(10);

/// Number of a requested clean-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CleanUpTicket(u64);

/// Requests clean-ups and receives their completion.
pub(super) struct CleanUp {
    requested: CleanUpTicket,
    done: CleanUpTicket,
    requests: Sender<CleanUpTicket>,
    answers: Receiver<CleanUpTicket>,
    second_at: Option<Time>,
    next_at: Time,
}

impl CleanUp {
    /// Starts the thread on the supervisor's bus.
    pub fn start(bus: &Bus) -> Result<CleanUp, HostError> {
        let mut cleaner = bus.cleaner()?;
        let (requests, inbox) = channel::<CleanUpTicket>();
        let (answer, answers) = channel();
        let body = move || {
            while let Ok(first) = inbox.recv() {
                // One clean-up serves every request made before it begins.
                let newest = inbox.try_iter().last().unwrap_or(first);
                let begun = Instant::now();
                let CleanUpReport { nodes, failed, overlooked } = cleaner.clean();
                tracing::debug!(nodes, failed, overlooked, took = ?begun.elapsed(), "cleaned up");
                if answer.send(newest).is_err() {
                    break;
                }
            }
        };
        let started = std::thread::Builder::new().name("clean-up".into()).spawn(body);
        started.map_err(|source| HostError::Thread { name: "clean-up".into(), source })?;
        Ok(CleanUp {
            requested: CleanUpTicket(0),
            done: CleanUpTicket(0),
            requests,
            answers,
            second_at: None,
            next_at: Time::ZERO,
        })
    }

    /// Requests a clean-up after a process that has died and been waited for.
    pub fn request(&mut self, now: Time) -> CleanUpTicket {
        self.second_at = Some(now + SECOND_CLEAN_UP);
        self.send()
    }

    /// Returns true if that clean-up is done.
    pub fn is_done(&self, ticket: CleanUpTicket) -> bool {
        self.done >= ticket
    }

    /// Receives completed clean-ups, and requests those that are due.
    pub fn step(&mut self, now: Time) {
        if let Some(newest) = self.answers.try_iter().last() {
            self.done = newest;
        }
        if self.second_at.is_some_and(|at| at <= now) {
            self.second_at = None;
            self.send();
        }
        if self.next_at <= now {
            self.next_at = now + PERIOD;
            self.send();
        }
    }

    fn send(&mut self) -> CleanUpTicket {
        self.requested = CleanUpTicket(self.requested.0 + 1);
        // Fails only if the thread has panicked; every wait for a clean-up has a timeout.
        let _ = self.requests.send(self.requested);
        self.requested
    }
}
