//! Commands for a running robot: `why`, `ps`, `topic`, `enable`, `disable`, `set`, `teleop`, `estop` and `reset`.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use yamabico_testkit::config;

use crate::program::{TIMEOUT, TestFolder, assert_exit, text, yamabico};

/// A robot that drives down an empty hallway without ever arriving; stopped when dropped.
pub struct Robot {
    name: String,
    folder: TestFolder,
    run: Child,
}

impl Robot {
    /// Starts the robot and waits until it decides.
    pub fn start(test: &str, arguments: &[&str]) -> Robot {
        Robot::start_task(test, &config("hallway.toml"), arguments)
    }

    /// Starts the robot with a task like that of the hallway, and waits until it decides.
    pub fn start_task(test: &str, task: &Path, arguments: &[&str]) -> Robot {
        let name = format!("control-{test}-{}", std::process::id());
        let folder = TestFolder::new(&format!("control-{test}"));
        let mut command = yamabico();
        command.args(["run", "--live"]).arg(task).arg("--out").arg(folder.path());
        command.args(["--set", &format!("robot.name={name}")]);
        for set in ["run.goal.y_m=15", "run.duration_s=600", "robot.devices.sim.clutter=\"none\""] {
            command.args(["--set", set]);
        }
        // A busy machine must not look like a hanging plugin.
        for plugin in ["robot.devices.sim", "behaviors.map-localizer", "behaviors.wall-follower"] {
            command.args(["--set", &format!("{plugin}.deadline_ms=20000")]);
        }
        let run = command.args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let robot = Robot { name, folder, run };
        let begun = Instant::now();
        while robot.call(&["reset"]).status.code() != Some(0) {
            assert!(begun.elapsed() < TIMEOUT, "{} does not start", robot.name);
            std::thread::sleep(Duration::from_millis(200));
        }
        robot
    }

    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Calls a command for this robot.
    fn call(&self, arguments: &[&str]) -> Output {
        yamabico().args(arguments).args(["--robot", &self.name]).output().unwrap()
    }

    /// The output of a command that succeeds.
    fn print(&self, arguments: &[&str]) -> String {
        let output = self.call(arguments);
        assert_exit(&output, 0, &[]);
        text(&output)
    }

    /// Repeats a command until its output contains `part`.
    fn await_text(&self, arguments: &[&str], part: &str) -> String {
        let begun = Instant::now();
        loop {
            let text = self.print(arguments);
            if text.contains(part) {
                return text;
            }
            assert!(begun.elapsed() < TIMEOUT, "`{part}` is missing in {text}");
        }
    }

    /// Waits until a plugin was restarted at least `restarts` times; returns its process id and the number of restarts.
    fn await_start(&self, plugin: &str, restarts: u64) -> (u64, u64) {
        let begun = Instant::now();
        loop {
            let plugins = self.json(&["ps"]);
            let status = plugins.as_array().unwrap().iter().find(|status| status["name"] == plugin).unwrap();
            match (status["pid"].as_u64(), status["restarts"].as_u64()) {
                (Some(pid), Some(number)) if number >= restarts => return (pid, number),
                _ => assert!(begun.elapsed() < TIMEOUT, "{plugin} is not restarted"),
            }
        }
    }

    /// Kills a plugin's process; returns the number of its restarts before.
    fn kill(&self, plugin: &str) -> u64 {
        let (pid, restarts) = self.await_start(plugin, 0);
        assert!(Command::new("kill").args(["-KILL", &pid.to_string()]).status().unwrap().success());
        restarts
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let text = self.print(&[arguments, &["--json"]].concat());
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = Command::new("kill").args(["-INT", &self.run.id().to_string()]).status();
        let _ = self.run.wait();
    }
}

#[test]
fn behaviors_are_switched_and_the_robot_is_stopped() {
    let robot = Robot::start("switch", &[]);
    assert_exit(&robot.call(&["disable", "wall-follwer"]), 2, &["did you mean `wall-follower`?"]);

    assert!(robot.print(&["disable", "wall-follower"]).contains("wall-follower is disabled"));
    assert!(robot.print(&["disable", "wall-follower"]).contains("was already disabled"));
    let json = robot.json(&["enable", "wall-follower"]);
    assert_eq!((json["state"].as_str(), json["changed"].as_bool()), (Some("enabled"), Some(true)), "{json}");

    // Without a critical behavior the robot stops, and names it.
    assert!(robot.print(&["disable", "sonar-halt"]).contains("sonar-halt is silent"));
    robot.print(&["enable", "sonar-halt"]);

    assert!(robot.print(&["estop"]).contains("emergency stop latched"));
    assert!(robot.print(&["estop"]).contains("no motion was commanded before"));
    assert!(robot.print(&["reset"]).contains("emergency stop released"));
    assert!(robot.print(&["reset"]).contains("no emergency stop was latched"));
}

#[test]
fn decisions_plugins_and_topics_are_shown() {
    let robot = Robot::start("why", &[]);
    robot.await_text(&["why"], ": driving\n");
    let text = robot.await_text(&["why"], "map-localizer asks for");
    assert!(text.contains("wall-follower (10)"), "{text}");
    let json = robot.json(&["why"]);
    assert_eq!(json["explanation"]["behaviors"].as_array().unwrap().len(), 5, "{json}");
    robot.print(&["estop"]);
    assert!(robot.print(&["why"]).contains("emergency stop: latched until `yamabico reset`"));
    robot.print(&["reset"]);

    let plugins = robot.json(&["ps"]);
    assert_eq!(plugins.as_array().unwrap().len(), 6, "{plugins}");
    let restarts = robot.kill("wall-follower");
    let text = robot.await_text(&["ps"], "wall-follower: its last process was killed by signal 9");
    assert!(text.contains("last decision"), "{text}");
    robot.await_text(&["why"], "its process was killed by signal 9");
    robot.await_start("wall-follower", restarts + 1);

    let list = robot.print(&["topic", "list"]);
    assert!(list.contains("sensors/sonar") && list.contains("yamabico.RangeScanHeader.v1"), "{list}");
    let hz = robot.json(&["topic", "hz", "sensors/wheels", "--for", "1.5", "--every", "1.5"]);
    // A busy machine delivers in bursts, which moves the median of the intervals but not their mean.
    let interval_s = hz["interval_s"]["mean"].as_f64().unwrap();
    assert!((0.015..0.03).contains(&interval_s) && hz["rate_hz"].as_f64() > Some(0.0), "{hz}");
    let age = robot.json(&["topic", "latency", "command", "--for", "1", "--every", "1"]);
    assert!((1e-3..1.0).contains(&age["age_s"]["p50"].as_f64().unwrap()), "{age}");
    assert!(robot.print(&["topic", "echo", "sensors/sonar", "--once"]).contains("range_m"));
    assert!(robot.print(&["topic", "echo", "roster", "--once"]).contains("map-localizer"));
    assert_exit(&robot.call(&["topic", "echo", "comand", "--once"]), 2, &["did you mean `command`?"]);
}

/// Remaining distance in the note of map-localizer, m.
fn to_go_m(why: &str) -> Option<f64> {
    why.split_once(" m to go")?.0.rsplit(' ').next()?.parse().ok()
}

#[test]
fn parameters_are_changed_all_or_none_and_survive_a_crash() {
    let robot = Robot::start("set", &[]);
    let before = robot.await_text(&["why"], "m to go");
    let before_m = to_go_m(&before).unwrap();
    assert!(robot.print(&["set", "map-localizer.speed_mps=0.2"]).contains("in effect"));
    let after = robot.await_text(&["why"], "map-localizer asks for 0.20");
    let after_m = to_go_m(&after).unwrap();
    assert!(after_m < before_m + 0.3, "it lost its progress: {before_m} m to go, then {after_m} m");

    for (assignments, part) in [
        (&["map-localizer.speed_mps=0.3", "wall-follower.speed_mps=9"][..], "wall-follower: `speed_mps` = 9"),
        (&["map-localizer.speed_mps=0.3", "sonar-halt.gate_m=4.9"], "`gate_m`"),
        (&["map-localizer.sped_mps=0.3"], "did you mean `speed_mps`?"),
        (&["map-locelizer.speed_mps=0.3"], "did you mean `map-localizer`?"),
        (&["map-localizer.speed_mps"], "no `=`"),
    ] {
        assert_exit(&robot.call(&[&["set"], assignments].concat()), 2, &[part]);
    }
    robot.print(&["set", "sonar-halt.gate_m=0.4", "wall-follower.speed_mps=0.1"]);
    assert!(!robot.await_text(&["why"], "wall-follower (10)").contains("asks for 0.30"));

    let restarts = robot.kill("wall-follower");
    robot.await_start("wall-follower", restarts + 1);
    robot.await_text(&["why"], "by map-localizer (20): asks for 0.1");
    // It asks for half as long as it coasts, which it may on a busy machine.
    robot.await_text(&["why"], "map-localizer asks for 0.20");

    // The requests are in the recording.
    let recording = robot.folder.file("run.mcap");
    assert!(Command::new("kill").args(["-INT", &robot.run.id().to_string()]).status().unwrap().success());
    let begun = Instant::now();
    while Command::new("kill").args(["-0", &robot.run.id().to_string()]).status().unwrap().success() {
        assert!(begun.elapsed() < TIMEOUT, "the run does not end");
        std::thread::sleep(Duration::from_millis(100));
        if std::fs::read(&recording).is_ok_and(|bytes| mcap::Summary::read(&bytes).is_ok_and(|s| s.is_some()))
        {
            break;
        }
    }
    let bytes = std::fs::read(&recording).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let texts: Vec<String> = messages
        .filter(|message| message.channel.topic == "control")
        .map(|message| serde_json::from_slice::<Value>(&message.data).unwrap()["text"].to_string())
        .collect();
    assert!(texts.iter().any(|text| text.contains("gate_m = 0.4")), "{texts:?}");
}

#[test]
fn teleop_needs_a_teleop_behavior() {
    let robot = Robot::start("teleop", &[]);
    assert_exit(&robot.call(&["teleop"]), 2, &["has no teleop behavior", "[behaviors.teleop]"]);
}

#[test]
fn of_several_robots_one_is_chosen_by_name() {
    let (one, other) = (Robot::start("one", &[]), Robot::start("other", &[]));
    let output = yamabico().arg("why").output().unwrap();
    assert_exit(&output, 2, &["several robots are running", "--robot", &one.name, &other.name]);
    assert!(one.print(&["why"]).starts_with(&one.name));
}

#[test]
fn a_robot_that_is_not_running_is_reported() {
    for command in [
        &["estop"][..],
        &["reset"],
        &["enable", "wall-follower"],
        &["set", "a.b=1"],
        &["why"],
        &["ps"],
        &["goto", "1", "0"],
        &["topic", "list"],
    ] {
        let output = yamabico().args(command).args(["--robot", "no-such-robot"]).output().unwrap();
        assert_exit(&output, 2, &["no robot `no-such-robot` is running"]);
    }
}
