//! A robot that runs live, controlled and looked at from other terminals.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Longest wait for a run that was started to get going.
const PATIENCE: Duration = Duration::from_secs(60);

/// A robot that drives down an empty hallway for ever; nothing of it is left behind.
struct Robot {
    name: String,
    folder: PathBuf,
    run: Child,
}

impl Robot {
    fn start(test: &str, arguments: &[&str]) -> Robot {
        let name = format!("control-{test}-{}", std::process::id());
        let folder = std::env::temp_dir().join(format!("yamabico-{name}"));
        let task = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hallway.toml");
        let mut command = yamabico(&["run", "--live"]);
        command.arg(task).arg("--out").arg(&folder).arg("--set").arg(format!("robot.name={name}"));
        for set in ["run.goal.x_m=1000", "run.duration_s=600", "robot.devices.sim.clutter=\"none\""] {
            command.args(["--set", set]);
        }
        // Nobody hangs here, whatever else the machine has to do.
        for plugin in ["robot.devices.sim", "behaviors.map-localizer", "behaviors.wall-follower"] {
            command.args(["--set", &format!("{plugin}.deadline_ms=20000")]);
        }
        let run = command.args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let robot = Robot { name, folder, run };
        let begun = Instant::now();
        while robot.ask(&["reset"]).status.code() != Some(0) {
            assert!(begun.elapsed() < PATIENCE, "{} does not come up", robot.name);
            std::thread::sleep(Duration::from_millis(200));
        }
        robot
    }

    fn ask(&self, arguments: &[&str]) -> Output {
        yamabico(arguments).args(["--robot", &self.name]).output().unwrap()
    }

    /// What a command prints that succeeds.
    fn told(&self, arguments: &[&str]) -> String {
        let ended = self.ask(arguments);
        let said = said(&ended);
        assert_eq!(ended.status.code(), Some(0), "{arguments:?}: {said}");
        said
    }

    /// Asks until `words` are told.
    fn await_words(&self, arguments: &[&str], words: &str) -> String {
        let begun = Instant::now();
        loop {
            let told = self.told(arguments);
            if told.contains(words) {
                return told;
            }
            assert!(begun.elapsed() < PATIENCE, "no `{words}` in {told}");
        }
    }

    /// Waits until a plugin has a process that was started again at least so often; its number, and how often it was.
    fn await_start(&self, plugin: &str, restarts: u64) -> (u64, u64) {
        let begun = Instant::now();
        loop {
            let plugins = self.json(&["ps"]);
            let told = plugins.as_array().unwrap().iter().find(|told| told["name"] == plugin).unwrap();
            match (told["pid"].as_u64(), told["restarts"].as_u64()) {
                (Some(pid), Some(times)) if times >= restarts => return (pid, times),
                _ => assert!(begun.elapsed() < PATIENCE, "{plugin} is not started again"),
            }
        }
    }

    /// Kills a plugin's process; how often it had been started again.
    fn kill(&self, plugin: &str) -> u64 {
        let (pid, restarts) = self.await_start(plugin, 0);
        assert!(Command::new("kill").args(["-KILL", &pid.to_string()]).status().unwrap().success());
        restarts
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let told = self.told(&[arguments, &["--json"]].concat());
        serde_json::from_str(&told).unwrap_or_else(|error| panic!("{error}: {told}"))
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = Command::new("kill").args(["-INT", &self.run.id().to_string()]).status();
        let _ = self.run.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn yamabico(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yamabico"));
    command.args(arguments).env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

fn said(ended: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&ended.stdout), String::from_utf8_lossy(&ended.stderr))
}

#[test]
fn behaviors_are_switched_and_the_robot_is_stopped() {
    let robot = Robot::start("switch", &[]);
    let wrong = robot.ask(&["disable", "wall-follwer"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(said(&wrong).contains("did you mean `wall-follower`?"), "{}", said(&wrong));

    assert!(robot.told(&["disable", "wall-follower"]).contains("wall-follower is disabled"));
    assert!(robot.told(&["disable", "wall-follower"]).contains("was already disabled"));
    let json = robot.json(&["enable", "wall-follower"]);
    assert_eq!((json["state"].as_str(), json["changed"].as_bool()), (Some("enabled"), Some(true)), "{json}");

    // Without a critical behavior the robot stops, and says so.
    assert!(robot.told(&["disable", "sonar-halt"]).contains("sonar-halt is silent"));
    robot.told(&["enable", "sonar-halt"]);

    assert!(robot.told(&["estop"]).contains("emergency stop latched"));
    assert!(robot.told(&["estop"]).contains("it stood already"));
    assert!(robot.told(&["reset"]).contains("emergency stop released"));
    assert!(robot.told(&["reset"]).contains("no emergency stop was latched"));
}

#[test]
fn a_robot_tells_why_who_and_what() {
    let robot = Robot::start("why", &[]);
    robot.await_words(&["why"], ": driving\n");
    let told = robot.await_words(&["why"], "map-localizer asks for");
    assert!(told.contains("wall-follower (10)"), "{told}");
    let json = robot.json(&["why"]);
    assert_eq!(json["explanation"]["behaviors"].as_array().unwrap().len(), 4, "{json}");
    robot.told(&["estop"]);
    assert!(robot.told(&["why"]).contains("emergency stop: latched until `yamabico reset`"));
    robot.told(&["reset"]);

    let plugins = robot.json(&["ps"]);
    assert_eq!(plugins.as_array().unwrap().len(), 5, "{plugins}");
    let restarts = robot.kill("wall-follower");
    let told = robot.await_words(&["ps"], "wall-follower: its last process was killed by signal 9");
    assert!(told.contains("in the last decision"), "{told}");
    robot.await_words(&["why"], "its process was killed by signal 9");
    robot.await_start("wall-follower", restarts + 1);

    let list = robot.told(&["topic", "list"]);
    assert!(list.contains("sensors/sonar") && list.contains("yamabico.RangeScanHeader.v1"), "{list}");
    let hz = robot.json(&["topic", "hz", "sensors/wheels", "--for", "1.5", "--every", "1.5"]);
    let interval_s = hz["interval_s"]["p50"].as_f64().unwrap();
    assert!((0.015..0.03).contains(&interval_s) && hz["rate_hz"].as_f64() > Some(0.0), "{hz}");
    let age = robot.json(&["topic", "latency", "command", "--for", "1", "--every", "1"]);
    assert!((1e-3..1.0).contains(&age["age_s"]["p50"].as_f64().unwrap()), "{age}");
    assert!(robot.told(&["topic", "echo", "sensors/sonar", "--once"]).contains("range_m"));
    assert!(robot.told(&["topic", "echo", "roster", "--once"]).contains("map-localizer"));
    let wrong = robot.ask(&["topic", "echo", "comand", "--once"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(said(&wrong).contains("did you mean `command`?"));
}

/// Meters that map-localizer says are to go.
fn to_go_m(why: &str) -> Option<f64> {
    why.split_once(" m to go")?.0.rsplit(' ').next()?.parse().ok()
}

#[test]
fn parameters_are_changed_all_or_none_and_outlive_a_crash() {
    let robot = Robot::start("set", &[]);
    let before = robot.await_words(&["why"], "m to go");
    let before_m = to_go_m(&before).unwrap();
    assert!(robot.told(&["set", "map-localizer.speed_mps=0.2"]).contains("in force"));
    let after = robot.await_words(&["why"], "map-localizer asks for 0.20");
    let after_m = to_go_m(&after).unwrap();
    assert!(after_m < before_m + 0.3, "it forgot how far it came: {before_m} m to go, then {after_m}");

    for (assignments, words) in [
        (&["map-localizer.speed_mps=0.3", "wall-follower.speed_mps=9"][..], "wall-follower: `speed_mps` = 9"),
        (&["map-localizer.speed_mps=0.3", "sonar-halt.gate_m=4.9"], "`gate_m`: sonar-halt: 4.9 m is beyond"),
        (&["map-localizer.sped_mps=0.3"], "did you mean `speed_mps`?"),
        (&["map-localizer.speed_mps=0.3"], "did you mean `map-localizer`?"),
        (&["map-localizer.speed_mps"], "no `=`"),
    ] {
        let ended = robot.ask(&[&["set"], assignments].concat());
        assert_eq!(ended.status.code(), Some(2), "{}", said(&ended));
        assert!(said(&ended).contains(words), "no `{words}` in {}", said(&ended));
    }
    robot.told(&["set", "sonar-halt.gate_m=0.4", "wall-follower.speed_mps=0.1"]);
    assert!(!robot.await_words(&["why"], "wall-follower (10)").contains("asks for 0.30"));

    let restarts = robot.kill("wall-follower");
    robot.await_start("wall-follower", restarts + 1);
    let why = robot.await_words(&["why"], "by map-localizer (20): asks for 0.1");
    assert!(why.contains("map-localizer asks for 0.20"), "{why}");

    // What was asked, and what became of it, is in the recording.
    let recording = robot.folder.join("run.mcap");
    assert!(Command::new("kill").args(["-INT", &robot.run.id().to_string()]).status().unwrap().success());
    let begun = Instant::now();
    while Command::new("kill").args(["-0", &robot.run.id().to_string()]).status().unwrap().success() {
        assert!(begun.elapsed() < PATIENCE, "it does not end");
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
fn a_hand_needs_a_behavior_that_obeys_it_and_a_terminal() {
    let robot = Robot::start("hand", &[]);
    let ended = robot.ask(&["teleop"]);
    assert_eq!(ended.status.code(), Some(2));
    assert!(said(&ended).contains("has no behavior that obeys a stick"), "{}", said(&ended));
}

#[test]
fn a_robot_that_does_not_run_is_told() {
    for command in [
        &["estop"][..],
        &["reset"],
        &["enable", "wall-follower"],
        &["set", "a.b=1"],
        &["why"],
        &["ps"],
        &["topic", "list"],
    ] {
        let ended = yamabico(command).args(["--robot", "no-such-robot"]).output().unwrap();
        assert_eq!(ended.status.code(), Some(2), "{}", said(&ended));
        assert!(said(&ended).contains("no robot `no-such-robot` is running"), "{}", said(&ended));
    }
}
