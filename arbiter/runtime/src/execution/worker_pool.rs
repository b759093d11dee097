//! Worker threads for the behaviors of a lockstep run.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::{CallStats, HostError};

use super::hosted_behavior::HostedBehavior;
use super::lockstep::Life;

/// Behaviors on one or several threads that receive together and propose together.
pub(super) struct WorkerPool {
    /// Behaviors on the calling thread.
    here: Vec<Member>,
    workers: Vec<Worker>,
}

struct Worker {
    jobs: Sender<Job>,
    done: Receiver<Result<(), DeviceError>>,
    thread: JoinHandle<Vec<Member>>,
}

#[derive(Clone)]
enum Job {
    Collect,
    Propose(Time),
    /// Continue the lives of these behaviors, by name.
    Resume(BTreeMap<String, Life>),
}

/// A behavior of the pool.
struct Member {
    behavior: HostedBehavior,
    /// Set once it takes part; until then its inputs wait for it.
    is_awake: bool,
}

/// Does the job with every behavior, even if one fails; returns the first failure.
fn run_job(members: &mut [Member], job: Job) -> Result<(), DeviceError> {
    let for_each = |members: &mut [Member], work: &dyn Fn(&mut HostedBehavior) -> Result<(), DeviceError>| {
        let mut outcome = Ok(());
        for member in members.iter_mut().filter(|member| member.is_awake) {
            outcome = outcome.and(work(&mut member.behavior));
        }
        outcome
    };
    match job {
        Job::Collect => for_each(members, &HostedBehavior::collect),
        Job::Propose(now) => {
            let prepared = for_each(members, &|behavior| behavior.prepare(now));
            prepared.and(for_each(members, &|behavior| behavior.propose(now)))
        }
        Job::Resume(lives) => {
            for member in members {
                if let Some(life) = lives.get(member.behavior.name()) {
                    member.behavior.resume(life.sequence);
                    member.is_awake = true;
                }
            }
            Ok(())
        }
    }
}

impl WorkerPool {
    /// Distributes the behaviors over `threads` threads, the calling thread included. Unless they are awake, each takes part
    /// once it is resumed.
    ///
    /// # Errors
    /// A thread does not start.
    pub fn new(
        behaviors: Vec<HostedBehavior>,
        threads: usize,
        is_awake: bool,
    ) -> Result<WorkerPool, HostError> {
        let threads = threads.clamp(1, behaviors.len().max(1));
        let mut shares: Vec<Vec<Member>> = (0..threads).map(|_| Vec::new()).collect();
        for (i, behavior) in behaviors.into_iter().enumerate() {
            shares[i % threads].push(Member { behavior, is_awake });
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

    /// Wakes the behaviors with these names, which continue their lives.
    ///
    /// # Errors
    /// A thread died.
    pub fn resume(&mut self, lives: BTreeMap<String, Life>) -> Result<(), DeviceError> {
        self.run_all(Job::Resume(lives))
    }

    fn run_all(&mut self, job: Job) -> Result<(), DeviceError> {
        for worker in &self.workers {
            // If a worker died, its missing answer below is the error.
            let _ = worker.jobs.send(job.clone());
        }
        let mut outcome = run_job(&mut self.here, job);
        for worker in &self.workers {
            let died = |_| DeviceError::failed("worker pool", "a thread of behaviors died");
            outcome = outcome.and(worker.done.recv().map_err(died).flatten());
        }
        outcome
    }

    /// Pool without behaviors.
    pub fn empty() -> WorkerPool {
        WorkerPool { here: Vec::new(), workers: Vec::new() }
    }

    /// Ends the threads; returns the call statistics of each behavior.
    pub fn finish(self) -> Vec<(String, CallStats)> {
        let mut hosts = self.here;
        for Worker { jobs, done, thread } in self.workers {
            drop((jobs, done));
            hosts.extend(thread.join().unwrap_or_default());
        }
        let behaviors = hosts.iter().map(|member| &member.behavior);
        behaviors.map(|behavior| (behavior.name().to_owned(), behavior.stats().clone())).collect()
    }
}

impl Worker {
    fn start(mut hosts: Vec<Member>) -> Result<Worker, HostError> {
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
