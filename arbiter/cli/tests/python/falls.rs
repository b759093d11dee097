//! Ways in which a behavior in Python fails, and how soon it is back.

use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::{Duration, Instant};

use yamabico_core::message::{FailureHeader, Proposal};
use yamabico_core::time::Time;
use yamabico_host::bus::Subscriber;
use yamabico_host::topics;

use crate::robot::{Robot, signal};

/// Who fails: named after its program.
pub const FRAGILE: &str = "fragile";
/// Behaviors and the simulator of the task.
pub const PLUGINS: usize = 3;
/// The simulator does not hang, whatever else the machine has to do.
const SIM_IS_SOUND: &str = "robot.devices.sim.deadline_ms=20000";
/// Longest wait for its return.
const BACK: Duration = Duration::from_secs(20);

/// How it fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fall {
    /// It raises an exception.
    Raise,
    /// It ends its process on the spot.
    Exit,
    /// It calls for ever.
    Loop,
    /// It is killed.
    Kill,
    /// It uses a picture longer than it was lent.
    Keep,
    /// It remembers what its successors die of.
    Poison,
}

impl Fall {
    /// Every way that costs one process at most.
    pub const ALL: [Fall; 5] = [Fall::Raise, Fall::Exit, Fall::Loop, Fall::Kill, Fall::Keep];

    fn order(self) -> Option<&'static str> {
        match self {
            Fall::Raise => Some("raise"),
            Fall::Exit => Some("exit"),
            Fall::Loop => Some("loop"),
            Fall::Keep => Some("keep"),
            Fall::Poison => Some("poison"),
            Fall::Kill => None,
        }
    }
}

/// A robot in the corridor that a behavior in Python drives, which fails when it is told to.
pub struct FragileRobot {
    /// The robot.
    pub robot: Robot,
    proposals: Subscriber<Proposal>,
    failures: Subscriber<FailureHeader>,
    orders: PathBuf,
    /// What it told of its failures.
    pub told: Vec<String>,
    /// Its newest proposal.
    pub newest: Option<Proposal>,
}

impl FragileRobot {
    /// Starts `program` with `python`, as the robot `name`.
    pub fn start(program: &Path, python: &Path, name: &str) -> FragileRobot {
        let orders = std::env::temp_dir().join(format!("yamabico-{name}.orders"));
        let script = crate::venv::package().join("tests/fragile.py");
        let task = std::fs::read_to_string(crate::robot::config("corridor-python.toml")).expect("the task");
        let task = task.replace("[behaviors.wall-follower]", &format!("[behaviors.{FRAGILE}]"));
        let robots = crate::robot::config("robots").canonicalize().expect("the folder");
        let task = task.replace("robot = \"robots", &format!("robot = \"{}", robots.display()));
        let file = std::env::temp_dir().join(format!("yamabico-{name}.toml"));
        std::fs::write(&file, task).expect("a place for the task");
        let exec = format!("behaviors.{FRAGILE}.exec=[\"{}\", \"{}\"]", python.display(), script.display());
        let orders_are = format!("behaviors.{FRAGILE}.orders=\"{}\"", orders.display());
        let set = [&exec, &orders_are, "run.goal.x_m=1000", "run.duration_s=100000", SIM_IS_SOUND];
        let robot = Robot::start(program, file.to_str().expect("a name"), name, PLUGINS, &set);
        let _ = std::fs::remove_file(file);
        let proposals = robot.bus().subscriber(&topics::proposal(FRAGILE)).expect("a place for a reader");
        let failures = robot.bus().subscriber(topics::FAILURES).expect("a place for a reader");
        FragileRobot { robot, proposals, failures, orders, told: Vec::new(), newest: None }
    }

    /// Lets it fail; from then to its next proposal. `None` where there was none for long.
    pub fn fall(&mut self, fall: Fall) -> Option<Duration> {
        match fall.order() {
            None => signal(self.robot.process_of(FRAGILE)?, "KILL"),
            Some(order) => {
                // Complete when it is seen.
                let whole = self.orders.with_extension("new");
                std::fs::write(&whole, order).ok()?;
                std::fs::rename(&whole, &self.orders).ok()?;
                let orders = self.orders.clone();
                self.robot.watch_until(BACK, |_| !orders.exists()).then_some(())?;
            }
        }
        // What it proposed right before, or with what it kept, is none of its return.
        let fell = Time::monotonic_now();
        let least = match fall {
            Fall::Keep | Fall::Poison => Duration::from_millis(150),
            _ => Duration::ZERO,
        };
        let back = self.proposal_after(fell + least)?;
        Some(Time(back.stamp_ns).since(fell))
    }

    /// A proposal made after `time`; `None` where there is none for long.
    pub fn proposal_after(&mut self, time: Time) -> Option<Proposal> {
        let begun = Instant::now();
        while begun.elapsed() < BACK {
            self.robot.watch(Duration::from_millis(1));
            self.listen();
            if let Some(newest) = self.newest.filter(|newest| newest.stamp_ns > time.0) {
                return Some(newest);
            }
        }
        None
    }

    /// Presses Ctrl-C and waits for the end.
    pub fn interrupt(self) -> Output {
        let _ = std::fs::remove_file(&self.orders);
        self.robot.interrupt()
    }

    /// Takes in what it proposed and told since.
    pub fn listen(&mut self) {
        while let Ok(Some(proposal)) = self.proposals.receive() {
            self.newest = Some(*proposal.header());
        }
        while let Ok(Some(failure)) = self.failures.receive() {
            self.told.push(String::from_utf8_lossy(failure.items()).into_owned());
        }
    }
}
