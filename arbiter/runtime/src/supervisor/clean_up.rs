//! Cleaning up after dead processes, on a thread of its own, because it may block.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use yamabico_core::time::Time;
use yamabico_host::SeatError;
use yamabico_host::bus::{Bus, CleanedUp};

/// What the transport forgets of the dead can be told from what it is still at work with only after a second.
const SECOND_LOOK: Duration = Duration::from_millis(1500);

/// Programs of operators that were killed leave their places behind, and nobody says so.
const ROUND: Duration = Duration::from_secs(10);

/// A clean-up that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Ticket(u64);

/// Asks for clean-ups and hears of them.
pub(super) struct CleanUp {
    asked: Ticket,
    done: Ticket,
    requests: Sender<Ticket>,
    answers: Receiver<Ticket>,
    again_at: Option<Time>,
    round_at: Time,
}

impl CleanUp {
    /// Starts the thread on the supervisor's bus.
    pub fn start(bus: &Bus) -> Result<CleanUp, SeatError> {
        let mut cleaner = bus.cleaner()?;
        let (requests, inbox) = channel::<Ticket>();
        let (answer, answers) = channel();
        let work = move || {
            while let Ok(first) = inbox.recv() {
                // One round does for everybody who died before it began.
                let newest = inbox.try_iter().last().unwrap_or(first);
                let begun = Instant::now();
                let CleanedUp { nodes, failed, forgotten } = cleaner.clean();
                tracing::debug!(nodes, failed, forgotten, took = ?begun.elapsed(), "cleaned up");
                if answer.send(newest).is_err() {
                    break;
                }
            }
        };
        let started = std::thread::Builder::new().name("clean-up".into()).spawn(work);
        started.map_err(|source| SeatError::Thread { name: "clean-up".into(), source })?;
        Ok(CleanUp {
            asked: Ticket(0),
            done: Ticket(0),
            requests,
            answers,
            again_at: None,
            round_at: Time::ZERO,
        })
    }

    /// Asks for a clean-up after a process that has died and been waited for.
    pub fn request(&mut self, now: Time) -> Ticket {
        self.again_at = Some(now + SECOND_LOOK);
        self.ask()
    }

    /// Whether that clean-up has been done.
    pub fn is_done(&self, ticket: Ticket) -> bool {
        self.done >= ticket
    }

    /// Hears of what has been done.
    pub fn step(&mut self, now: Time) {
        if let Some(newest) = self.answers.try_iter().last() {
            self.done = newest;
        }
        if self.again_at.is_some_and(|at| at <= now) {
            self.again_at = None;
            self.ask();
        }
        if self.round_at <= now {
            self.round_at = now + ROUND;
            self.ask();
        }
    }

    fn ask(&mut self) -> Ticket {
        self.asked = Ticket(self.asked.0 + 1);
        // A thread that has panicked answers no more: whoever waits does so with a limit.
        let _ = self.requests.send(self.asked);
        self.asked
    }
}
