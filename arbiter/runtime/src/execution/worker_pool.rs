//! Worker threads for the behaviors of a lockstep run.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::bus::BusError;

use yamabico_host::{BehaviorHost, CallStats, HostError};

/// Behaviors on one or several threads that receive together and propose together.
pub(super) struct WorkerPool {
    /// Behaviors on the calling thread.
    here: Vec<BehaviorHost>,
    workers: Vec<Worker>,
}

struct Worker {
    jobs: Sender<Job>,
    done: Receiver<Result<(), BusError>>,
    thread: JoinHandle<Vec<BehaviorHost>>,
}

#[derive(Clone, Copy)]
enum Job {
    Collect,
    Propose(Time),
}

fn run_job(hosts: &mut [BehaviorHost], job: Job) -> Result<(), BusError> {
    hosts.iter_mut().try_for_each(|host| match job {
        Job::Collect => host.collect(),
        Job::Propose(now) => host.propose(now),
    })
}

impl WorkerPool {
    /// Distributes the behaviors over `threads` threads, the calling thread included.
    ///
    /// # Errors
    /// A thread does not start.
    pub fn new(hosts: Vec<BehaviorHost>, threads: usize) -> Result<WorkerPool, HostError> {
        let threads = threads.clamp(1, hosts.len().max(1));
        let mut shares: Vec<Vec<BehaviorHost>> = (0..threads).map(|_| Vec::new()).collect();
        for (i, host) in hosts.into_iter().enumerate() {
            shares[i % threads].push(host);
        }
        let here = shares.swap_remove(0);
        Ok(WorkerPool { here, workers: shares.into_iter().map(Worker::start).collect::<Result<_, _>>()? })
    }

    /// Lets every behavior receive its inputs.
    ///
    /// # Errors
    /// The bus failed, or a thread died.
    pub fn collect(&mut self) -> Result<(), DeviceError> {
        self.run_all(Job::Collect)
    }

    /// Lets every behavior that is due propose. Call it after [`WorkerPool::collect`]: since all behaviors have received by then,
    /// none receives what another publishes in this step, and the number of threads has no influence on the result.
    ///
    /// # Errors
    /// The bus refused a proposal, or a thread died.
    pub fn propose(&mut self, now: Time) -> Result<(), DeviceError> {
        self.run_all(Job::Propose(now))
    }

    fn run_all(&mut self, job: Job) -> Result<(), DeviceError> {
        for worker in &self.workers {
            // If a worker died, its missing answer below is the error.
            let _ = worker.jobs.send(job);
        }
        let bus_failed = |error| DeviceError::failed("bus", error);
        let mut outcome = run_job(&mut self.here, job).map_err(bus_failed);
        for worker in &self.workers {
            let died = |_| DeviceError::failed("worker pool", "a thread of behaviors died");
            let answer = worker.done.recv().map_err(died).and_then(|answer| answer.map_err(bus_failed));
            outcome = outcome.and(answer);
        }
        outcome
    }

    /// Ends the threads; returns the call statistics of each behavior.
    pub fn finish(self) -> Vec<(String, CallStats)> {
        let mut hosts = self.here;
        for Worker { jobs, done, thread } in self.workers {
            drop((jobs, done));
            hosts.extend(thread.join().unwrap_or_default());
        }
        hosts.iter().map(|host| (host.name().to_owned(), host.stats().clone())).collect()
    }
}

impl Worker {
    fn start(mut hosts: Vec<BehaviorHost>) -> Result<Worker, HostError> {
        let (jobs, inbox) = channel();
        let (answer, done) = channel();
        let thread = std::thread::Builder::new().name("behaviors".into()).spawn(move || {
            while let Ok(job) = inbox.recv() {
                if answer.send(run_job(&mut hosts, job)).is_err() {
                    break;
                }
            }
            hosts
        });
        let thread = thread.map_err(|source| HostError::Thread { name: "behaviors".into(), source })?;
        Ok(Worker { jobs, done, thread })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_died_is_an_error() {
        let worker = Worker::start(Vec::new()).unwrap();
        let mut pool = WorkerPool { here: Vec::new(), workers: vec![worker] };
        pool.collect().unwrap();
        let (_, dead) = channel();
        pool.workers[0].done = dead;
        assert!(pool.propose(Time::ZERO).unwrap_err().to_string().contains("died"));
    }
}
