//! Live runs that are recorded: with kills, with requests, on a busy machine.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use yamabico_host::Scheduling;
use yamabico_live_robot::load::Load;
use yamabico_live_robot::robot::{LiveRobot, signal};

/// Timeout for a restart.
const RESTART: Duration = Duration::from_secs(20);
/// Settings by which neither goal nor time ends a run, and a busy machine is no hang.
const ENDLESS: [&str; 3] =
    ["run.goal.y_m=15", "run.duration_s=100000", "robot.devices.sim.deadline_ms=20000"];

/// A live run.
#[derive(Clone, Copy)]
pub struct LiveRun {
    /// Name, which differs from that of the others.
    pub name: &'static str,
    /// Set if a plugin is a program in Python.
    pub needs_python: bool,
    task: &'static str,
    /// Plugins: devices and behaviors.
    plugins: usize,
    /// Behaviors that are killed, in turns.
    victims: &'static [&'static str],
    kills: usize,
    requests: Requests,
    is_busy: bool,
}

/// Requests of an operator during the run.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Requests {
    None,
    /// A parameter is set, a behavior disabled and enabled.
    InTurn,
    /// A parameter is set while the behavior is being killed.
    DuringKills,
}

const HALLWAY: LiveRun = LiveRun {
    name: "",
    needs_python: false,
    task: "hallway.toml",
    plugins: 6,
    victims: &["map-localizer", "wall-follower", "sonar-halt", "stationary-obstacle-avoider"],
    kills: 0,
    requests: Requests::None,
    is_busy: false,
};
const IN_PYTHON: LiveRun = LiveRun {
    needs_python: true,
    task: "corridor-python.toml",
    plugins: 4,
    victims: &["wall-follower", "sonar-halt"],
    ..HALLWAY
};

impl LiveRun {
    /// Every live run, with this number of kills where there are any.
    pub fn all(kills: usize) -> [LiveRun; 15] {
        let hallway = |name| LiveRun { name, ..HALLWAY };
        let python = |name| LiveRun { name, ..IN_PYTHON };
        let killed = |run: LiveRun| LiveRun { kills, ..run };
        let asked = |run: LiveRun| LiveRun { requests: Requests::InTurn, ..run };
        let busy = |run: LiveRun| LiveRun { is_busy: true, ..run };
        [
            killed(hallway("live hallway, kills 1")),
            killed(hallway("live hallway, kills 2")),
            killed(hallway("live hallway, kills 3")),
            asked(hallway("live hallway, requests 1")),
            asked(hallway("live hallway, requests 2")),
            asked(hallway("live hallway, requests 3")),
            busy(hallway("live hallway, busy 1")),
            busy(hallway("live hallway, busy 2")),
            killed(busy(hallway("live hallway, busy, kills"))),
            LiveRun { requests: Requests::DuringKills, ..killed(hallway("live hallway, set during kills")) },
            python("live corridor in Python"),
            killed(python("live corridor in Python, kills")),
            asked(python("live corridor in Python, requests")),
            LiveRun {
                requests: Requests::DuringKills,
                ..killed(python("live corridor in Python, set during kills"))
            },
            LiveRun { task: "flat-world.toml", ..python("live flat world, driver's clock") },
        ]
    }

    /// Makes the run and moves its recording to `file`; returns what happened, for people.
    pub fn record(&self, program: &Path, python: Option<&Path>, seconds: f64, file: &Path) -> String {
        let name = format!("replayed-{}", std::process::id());
        let mut set: Vec<String> = ENDLESS.map(str::to_owned).to_vec();
        if self.task == "flat-world.toml" {
            set.pop();
        }
        if let Some(python) = python.filter(|_| self.needs_python) {
            let python = python.display();
            match self.task {
                "flat-world.toml" => {
                    set.push(format!(
                        "robot.devices.world.exec=[\"{python}\", \"-m\", \"yamabico.examples.flat_world\"]"
                    ));
                    set.push("robot.devices.world.deadline_ms=20000".to_owned());
                }
                _ => set.push(format!(
                    "behaviors.wall-follower.exec=[\"{python}\", \"-m\", \"yamabico.examples.wall_follower\"]"
                )),
            }
        }
        if self.is_busy {
            set.extend(self.victims.iter().map(|victim| format!("behaviors.{victim}.deadline_ms=20000")));
        }
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let load = Load::start(if self.is_busy { 4 } else { 0 }, Scheduling::default());
        let mut robot = LiveRobot::start(program, self.task, &name, self.plugins, &set);
        robot.keep = true;
        let folder = robot.folder.clone();
        robot.observe(Duration::from_secs_f64(seconds / 2.0));
        let mut killed = 0;
        for kill in 0..self.kills {
            let victim = self.victims[kill % self.victims.len()];
            let asking = (self.requests == Requests::DuringKills).then(|| {
                let speed = [0.2, 0.3][kill / self.victims.len() % 2];
                let assignment = format!("wall-follower.speed_mps={speed}");
                Command::new(program)
                    .args(["set", "--robot", &name, &assignment])
                    .spawn()
                    .expect("the program starts")
            });
            if asking.is_some() {
                robot.observe(Duration::from_millis(5 * kill as u64));
            }
            killed += usize::from(kill_once(&mut robot, victim));
            asking.into_iter().for_each(|mut asking| drop(asking.wait()));
            robot.observe(Duration::from_millis(200));
        }
        if self.requests == Requests::InTurn {
            for request in [
                &["set", "wall-follower.speed_mps=0.3"][..],
                &["disable", "wall-follower"],
                &["enable", "wall-follower"],
                &["estop"],
                &["reset"],
                &["set", "wall-follower.speed_mps=0.2"],
            ] {
                let asked = Command::new(program).args(request).args(["--robot", &name]).output();
                assert!(asked.expect("the program starts").status.success(), "{request:?}");
                robot.observe(Duration::from_millis(400));
            }
        }
        robot.observe(Duration::from_secs_f64(seconds / 2.0));
        robot.interrupt();
        drop(load);
        let _ = std::fs::rename(folder.join("run.mcap"), file);
        let _ = std::fs::remove_dir_all(folder);
        let kills = if self.kills > 0 { format!(", {killed} kills") } else { String::new() };
        let requests = match self.requests {
            Requests::None => "",
            Requests::InTurn => ", set, disable, enable, estop, reset",
            Requests::DuringKills => ", set during each kill",
        };
        format!("live{kills}{requests}{}", if self.is_busy { ", four busy loops beside it" } else { "" })
    }
}

/// Kills the process of a plugin and waits for the next one; returns false if there was none.
fn kill_once(robot: &mut LiveRobot, victim: &str) -> bool {
    let Some(pid) = robot.process_of(victim) else { return false };
    let before = robot.heartbeats[victim].restarts;
    signal(pid, "KILL");
    assert!(
        robot.wait_until(RESTART, |robot| robot.heartbeats[victim].restarts > before),
        "{victim} is not restarted"
    );
    true
}

/// Search path with `folder` first.
pub fn path_with(folder: &Path) -> OsString {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(std::iter::once(folder.to_owned()).chain(std::env::split_paths(&folders)))
        .expect("a path")
}
