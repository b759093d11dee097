//! `yamabico goto`: goals for a running robot, and what it refuses.

use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

use yamabico_testkit::config;

use crate::program::{TIMEOUT, TestFolder, assert_exit, yamabico};

/// A live run, killed when dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill().and_then(|()| self.0.wait());
    }
}

fn goto(robot: &str, file: &Path, arguments: &[&str]) -> Output {
    yamabico().arg("goto").arg(file).args(["--robot", robot]).args(arguments).output().unwrap()
}

fn start(folder: &TestFolder, task: &str, robot: &str, set: &[&str]) -> Running {
    let mut command = yamabico();
    command.arg("run").arg(config(task)).arg("--out").arg(folder.path()).arg("--live");
    command.args(["--set", &format!("robot.name={robot}")]);
    for set in set {
        command.args(["--set", set]);
    }
    Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
}

/// Repeats `request` until it ends with `code`.
fn await_exit(code: i32, request: impl Fn() -> Output) -> Output {
    let begun = Instant::now();
    loop {
        let output = request();
        if output.status.code() == Some(code) || begun.elapsed() > TIMEOUT {
            return output;
        }
        std::thread::sleep(Duration::from_millis(200));
    }
}

#[test]
fn a_file_of_goals_sends_a_live_robot_from_one_to_the_next() {
    let folder = TestFolder::new("goto");
    let robot = format!("goto-{}", std::process::id());
    let goals = folder.file("goals.toml");
    let text = "[[goal]]\nx_m = 0.4\ny_m = 0.0\n[[goal]]\nx_m = 0.8\ny_m = 0.1\ntolerance_m = 0.2\n";
    std::fs::write(&goals, text).unwrap();
    assert_exit(&goto(&robot, &goals, &[]), 2, &[&robot]);

    let set = [
        "run.goal.y_m=15",
        "behaviors.map-localizer.route=[[0.3, 0.0]]",
        "robot.devices.sim.clutter=\"none\"",
    ];
    let _running = start(&folder, "hallway.toml", &robot, &set);
    let output = await_exit(0, || goto(&robot, &goals, &[]));
    assert_exit(&output, 0, &["arrived at (0.4, 0), (0.8, 0.1)"]);

    let wrong = goto(&robot, &goals, &["--behavior", "map-locelizer"]);
    assert_exit(&wrong, 2, &["did you mean `map-localizer`?"]);
    std::fs::write(&goals, "[[goal]]\nx_m = 0.4\nz_m = 0.0\n").unwrap();
    assert_exit(&goto(&robot, &goals, &[]), 2, &["goals.toml", "z_m"]);
    std::fs::write(&goals, "[[goal]]\nx_m = \"\u{1b}[2J\"\n").unwrap();
    let output = goto(&robot, &goals, &[]);
    assert_exit(&output, 2, &[]);
    assert!(!output.stderr.contains(&0x1b), "an escape sequence reaches the terminal");
}

#[test]
fn a_robot_without_a_planner_is_refused() {
    let folder = TestFolder::new("goto-no-planner");
    let robot = format!("goto-no-planner-{}", std::process::id());
    let _running = start(&folder, "office.toml", &robot, &[]);
    let output = await_exit(2, || goto(&robot, &folder.file("goals.toml"), &[]));
    assert_exit(&output, 2, &["goals.toml"]);
    let to_a_point = || yamabico().args(["goto", "1", "0", "--robot", &robot]).output().unwrap();
    let begun = Instant::now();
    while !String::from_utf8_lossy(&to_a_point().stderr).contains("such as `map-localizer`") {
        assert!(begun.elapsed() < TIMEOUT, "{}", crate::program::text(&to_a_point()));
        std::thread::sleep(Duration::from_millis(200));
    }
}
