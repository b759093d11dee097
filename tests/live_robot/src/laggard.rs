//! A behavior that computes for long, and hangs on request.

use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::Duration;

use yamabico_core::message::{Process, ProcessesHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::Subscriber;
use yamabico_host::topics;

use crate::robot::LiveRobot;

/// Name of the behavior.
pub const LAGGARD: &str = "laggard";
/// Number of plugins of the task: the behavior and the simulator.
const PLUGINS: usize = 2;
/// Timeout for the restart.
const RESTART_TIMEOUT: Duration = Duration::from_secs(60);

/// Kind of a hang.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hang {
    /// Sleeps for ever.
    Sleep,
    /// Computes for ever.
    Loop,
}

/// End of a process that hung.
#[derive(Clone, Debug)]
pub struct HangEnd {
    /// Time from its last heartbeat to its end.
    pub silent: Duration,
    /// Cause in the words of the supervisor.
    pub cause: String,
}

/// A robot with the behavior.
pub struct LaggardRobot {
    /// The robot.
    pub robot: LiveRobot,
    processes: Subscriber<ProcessesHeader>,
    orders: PathBuf,
}

impl LaggardRobot {
    /// Starts `program` as the robot `name`, with the behavior as the program `laggard` and with `keys`, lines of its table.
    pub fn start(program: &Path, laggard: &Path, name: &str, keys: &str) -> LaggardRobot {
        let orders = std::env::temp_dir().join(format!("yamabico-{name}.orders"));
        let task = write_task(laggard, name, &format!("orders = \"{}\"\n{keys}", orders.display()));
        let robot = LiveRobot::start(program, task.to_str().expect("a name"), name, PLUGINS, &[]);
        let _ = std::fs::remove_file(task);
        let processes = robot.bus().subscriber(topics::PROCESSES).expect("a free subscriber slot");
        LaggardRobot { robot, processes, orders }
    }

    /// Makes the behavior hang, and waits for its restart; `None` after the timeout.
    pub fn hang(&mut self, hang: Hang) -> Option<HangEnd> {
        let order = match hang {
            Hang::Sleep => "sleep",
            Hang::Loop => "loop",
        };
        let restarts = self.robot.heartbeats.get(LAGGARD)?.restarts;
        // Renamed when complete, so that the behavior never reads a part.
        let whole = self.orders.with_extension("new");
        std::fs::write(&whole, order).ok()?;
        std::fs::rename(&whole, &self.orders).ok()?;
        let mut last = Time::ZERO;
        let is_back = |robot: &LiveRobot| {
            let newest = &robot.heartbeats[LAGGARD];
            if newest.restarts == restarts {
                last = Time(newest.stamp_ns);
            }
            newest.restarts > restarts
        };
        self.robot.wait_until(RESTART_TIMEOUT, is_back).then_some(())?;
        let process = self.process()?;
        Some(HangEnd { silent: Time(process.ended_ns).since(last), cause: process.ended.as_str().to_owned() })
    }

    /// Newest report on the process of the behavior; `None` if there is none.
    pub fn process(&mut self) -> Option<Process> {
        let newest = self.processes.newest().ok()??;
        newest.items().iter().find(|process| process.plugin.as_str() == LAGGARD).copied()
    }

    /// Interrupts the run like Ctrl-C and waits for its end.
    pub fn interrupt(self) -> Output {
        let _ = std::fs::remove_file(&self.orders);
        self.robot.interrupt()
    }
}

/// Writes a task with the behavior as the program `laggard` and with `keys`, lines of its table, in the simulated corridor; returns its
/// path. `name` is part of it.
pub fn write_task(laggard: &Path, name: &str, keys: &str) -> PathBuf {
    let robot = yamabico_testkit::config("robots/sim-corridor.toml").canonicalize().expect("the robot file");
    let text = format!(
        "robot = \"{}\"\n[behaviors.{LAGGARD}]\npriority = 1\nexec = [\"{}\"]\n{keys}\n",
        robot.display(),
        laggard.display()
    );
    let task = std::env::temp_dir().join(format!("yamabico-{name}.toml"));
    std::fs::write(&task, text).expect("a writable temporary folder");
    task
}
