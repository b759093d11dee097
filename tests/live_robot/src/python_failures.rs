//! A behavior in Python that fails on request, and the time until its restart.

use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::{Duration, Instant};

use yamabico_core::message::{FailureHeader, Proposal};
use yamabico_core::time::Time;
use yamabico_host::bus::Subscriber;
use yamabico_host::topics;

use crate::robot::{LiveRobot, signal};

/// Name of the behavior and of its program.
pub const FRAGILE: &str = "fragile";
/// Number of plugins of the task: behaviors and simulator.
pub const PLUGINS: usize = 3;
/// Deadline that keeps a busy machine from restarting the simulator.
const SIM_DEADLINE: &str = "robot.devices.sim.deadline_ms=20000";
/// Timeout for the restart.
const RESTART_TIMEOUT: Duration = Duration::from_secs(20);

/// A failure of the behavior.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Raises an exception.
    Raise,
    /// Exits at once.
    Exit,
    /// Never returns from a call.
    Loop,
    /// Is killed.
    Kill,
    /// Uses a frame after the call that it was lent for.
    Keep,
    /// Saves a state that crashes its successors.
    Poison,
}

impl Failure {
    /// All failures that cost at most one process.
    pub const ALL: [Failure; 5] =
        [Failure::Raise, Failure::Exit, Failure::Loop, Failure::Kill, Failure::Keep];

    fn order(self) -> Option<&'static str> {
        match self {
            Failure::Raise => Some("raise"),
            Failure::Exit => Some("exit"),
            Failure::Loop => Some("loop"),
            Failure::Keep => Some("keep"),
            Failure::Poison => Some("poison"),
            Failure::Kill => None,
        }
    }
}

/// A robot in the corridor, driven by a behavior in Python that fails on request.
pub struct FragileRobot {
    /// The robot.
    pub robot: LiveRobot,
    proposals: Subscriber<Proposal>,
    failures: Subscriber<FailureHeader>,
    orders: PathBuf,
    /// Texts of its reported failures.
    pub failure_texts: Vec<String>,
    /// Its latest proposal.
    pub proposal: Option<Proposal>,
}

impl FragileRobot {
    /// Starts `program` with `python`, as the robot `name`.
    pub fn start(program: &Path, python: &Path, name: &str) -> FragileRobot {
        let orders = std::env::temp_dir().join(format!("yamabico-{name}.orders"));
        let script = crate::venv::package().join("tests/fragile.py");
        let task =
            std::fs::read_to_string(yamabico_testkit::config("corridor-python.toml")).expect("the task");
        let task = task.replace("[behaviors.wall-follower]", &format!("[behaviors.{FRAGILE}]"));
        let robots = yamabico_testkit::config("robots").canonicalize().expect("the folder");
        let task = task.replace("robot = \"robots", &format!("robot = \"{}", robots.display()));
        let file = std::env::temp_dir().join(format!("yamabico-{name}.toml"));
        std::fs::write(&file, task).expect("a writable temporary folder");
        let exec = format!("behaviors.{FRAGILE}.exec=[\"{}\", \"{}\"]", python.display(), script.display());
        let orders_are = format!("behaviors.{FRAGILE}.orders=\"{}\"", orders.display());
        let set = [&exec, &orders_are, "run.goal.y_m=15", "run.duration_s=100000", SIM_DEADLINE];
        let robot = LiveRobot::start(program, file.to_str().expect("a name"), name, PLUGINS, &set);
        let _ = std::fs::remove_file(file);
        let proposals = robot.bus().subscriber(&topics::proposal(FRAGILE)).expect("a free subscriber slot");
        let failures = robot.bus().subscriber(topics::FAILURES).expect("a free subscriber slot");
        FragileRobot { robot, proposals, failures, orders, failure_texts: Vec::new(), proposal: None }
    }

    /// Provokes a failure; returns the time to the next proposal, or `None` after the timeout.
    pub fn provoke(&mut self, fall: Failure) -> Option<Duration> {
        match fall.order() {
            None => signal(self.robot.process_of(FRAGILE)?, "KILL"),
            Some(order) => {
                // Renamed when complete, so that the behavior never reads a part.
                let whole = self.orders.with_extension("new");
                std::fs::write(&whole, order).ok()?;
                std::fs::rename(&whole, &self.orders).ok()?;
                let orders = self.orders.clone();
                self.robot.wait_until(RESTART_TIMEOUT, |_| !orders.exists()).then_some(())?;
            }
        }
        // Proposals from before the failure do not count.
        let fell = Time::monotonic_now();
        let delay = match fall {
            Failure::Keep | Failure::Poison => Duration::from_millis(150),
            _ => Duration::ZERO,
        };
        let back = self.proposal_after(fell + delay)?;
        Some(Time(back.stamp_ns).since(fell))
    }

    /// Waits for a proposal made after `time`; returns `None` after the timeout.
    pub fn proposal_after(&mut self, time: Time) -> Option<Proposal> {
        let begun = Instant::now();
        while begun.elapsed() < RESTART_TIMEOUT {
            self.robot.observe(Duration::from_millis(1));
            self.receive();
            if let Some(newest) = self.proposal.filter(|newest| newest.stamp_ns > time.0) {
                return Some(newest);
            }
        }
        None
    }

    /// Interrupts the run like Ctrl-C and waits for its end.
    pub fn interrupt(self) -> Output {
        let _ = std::fs::remove_file(&self.orders);
        self.robot.interrupt()
    }

    /// Receives its proposals and failures.
    pub fn receive(&mut self) {
        while let Ok(Some(proposal)) = self.proposals.receive() {
            self.proposal = Some(*proposal.header());
        }
        while let Ok(Some(failure)) = self.failures.receive() {
            self.failure_texts.push(String::from_utf8_lossy(failure.items()).into_owned());
        }
    }
}
