//! The behaviors of a lockstep run, on one thread or on several.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::bus::BusError;

use yamabico_host::{BehaviorRecord, BehaviorSeat, SeatError};

/// Behaviors that collect together and propose together.
pub struct Crew {
    /// On the caller's own thread.
    here: Vec<BehaviorSeat>,
    workers: Vec<Worker>,
}

struct Worker {
    orders: Sender<Order>,
    done: Receiver<Result<(), BusError>>,
    thread: JoinHandle<Vec<BehaviorSeat>>,
}

#[derive(Clone, Copy)]
enum Order {
    Collect,
    Propose(Time),
}

fn carry_out(seats: &mut [BehaviorSeat], order: Order) -> Result<(), BusError> {
    seats.iter_mut().try_for_each(|seat| match order {
        Order::Collect => seat.collect(),
        Order::Propose(now) => seat.propose(now),
    })
}

impl Crew {
    /// Deals the seats out to `threads` threads, the caller's own among them.
    ///
    /// # Errors
    /// A thread that does not start.
    pub fn new(seats: Vec<BehaviorSeat>, threads: usize) -> Result<Crew, SeatError> {
        let threads = threads.clamp(1, seats.len().max(1));
        let mut hands: Vec<Vec<BehaviorSeat>> = (0..threads).map(|_| Vec::new()).collect();
        for (i, seat) in seats.into_iter().enumerate() {
            hands[i % threads].push(seat);
        }
        let here = hands.swap_remove(0);
        Ok(Crew { here, workers: hands.into_iter().map(Worker::start).collect::<Result<_, _>>()? })
    }

    /// Every behavior takes in what has arrived.
    ///
    /// # Errors
    /// The bus failed, or a thread died.
    pub fn collect(&mut self) -> Result<(), DeviceError> {
        self.order(Order::Collect)
    }

    /// Every behavior that is due proposes. Call after [`Crew::collect`]: since all have collected by then, nobody sees
    /// what another publishes in this step, and the number of threads cannot matter.
    ///
    /// # Errors
    /// The bus refused a proposal, or a thread died.
    pub fn propose(&mut self, now: Time) -> Result<(), DeviceError> {
        self.order(Order::Propose(now))
    }

    fn order(&mut self, order: Order) -> Result<(), DeviceError> {
        for worker in &self.workers {
            // Of a worker that died, the missing answer below tells.
            let _ = worker.orders.send(order);
        }
        let bus_failed = |error| DeviceError::failed("bus", error);
        let mut outcome = carry_out(&mut self.here, order).map_err(bus_failed);
        for worker in &self.workers {
            let died = |_| DeviceError::failed("crew", "a thread of behaviors died");
            let answer = worker.done.recv().map_err(died).and_then(|answer| answer.map_err(bus_failed));
            outcome = outcome.and(answer);
        }
        outcome
    }

    /// Ends the threads; how each behavior fared.
    pub fn finish(self) -> Vec<(String, BehaviorRecord)> {
        let mut seats = self.here;
        for Worker { orders, done, thread } in self.workers {
            drop((orders, done));
            seats.extend(thread.join().unwrap_or_default());
        }
        seats.iter().map(|seat| (seat.name().to_owned(), seat.record().clone())).collect()
    }
}

impl Worker {
    fn start(mut seats: Vec<BehaviorSeat>) -> Result<Worker, SeatError> {
        let (orders, inbox) = channel();
        let (answer, done) = channel();
        let thread = std::thread::Builder::new().name("crew".into()).spawn(move || {
            while let Ok(order) = inbox.recv() {
                if answer.send(carry_out(&mut seats, order)).is_err() {
                    break;
                }
            }
            seats
        });
        let thread = thread.map_err(|source| SeatError::Thread { name: "crew".into(), source })?;
        Ok(Worker { orders, done, thread })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_died_is_an_error() {
        let worker = Worker::start(Vec::new()).unwrap();
        let mut crew = Crew { here: Vec::new(), workers: vec![worker] };
        crew.collect().unwrap();
        let (_, dead) = channel();
        crew.workers[0].done = dead;
        assert!(crew.propose(Time::ZERO).unwrap_err().to_string().contains("died"));
    }
}
