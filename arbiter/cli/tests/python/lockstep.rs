//! Behaviors in Python in lockstep, and in replays.

use std::path::{Path, PathBuf};

use serde_json::Value;
use yamabico_live_robot::python_failures::{FRAGILE, Failure, FragileRobot};
use yamabico_live_robot::venv;

use super::{corridor, yamabico};
use crate::program::{TestFolder, assert_exit, binary, text};

fn json(python: &Path, arguments: &[&str]) -> Value {
    let output = yamabico(python, arguments);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output)))
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_replays() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let folder = TestFolder::new("python-lockstep");
    let run = |name: &str| {
        let out = folder.file(name);
        let set = ["--set", "run.duration_s=6", "--out", out.to_str().unwrap()];
        let report = json(&python, &[&["run", &corridor(), "--json"], &set[..]].concat());
        assert!(report["distance_m"].as_f64() > Some(1.0), "{report}");
        report["digest"].as_str().unwrap().to_owned()
    };
    assert_eq!(run("a"), run("b"));
    let file = folder.file("a/run.mcap");
    let file = file.to_str().unwrap();
    assert_exit(&yamabico(&python, &["replay", file]), 2, &["yamabico.examples.wall_follower", "--programs"]);
    let report = json(&python, &["replay", file, "--programs", "--json"]);
    assert!(report["first"].is_null(), "{report:#}");
    assert!(
        report["topics"]["behaviors/wall-follower/proposal"]["compared"].as_u64() >= Some(55),
        "{report:#}"
    );
    let set = "wall-follower.speed_mps=0.400000001";
    let report = json(&python, &["replay", file, "--programs", "--json", "--set", set]);
    assert_eq!(report["first"]["author"], "wall-follower", "{report:#}");
}

/// Task with the behavior that fails on request.
fn fragile(folder: &TestFolder) -> PathBuf {
    let task = std::fs::read_to_string(corridor()).unwrap();
    let task = task.replace("[behaviors.wall-follower]", &format!("[behaviors.{FRAGILE}]"));
    let robots = yamabico_testkit::config("robots").canonicalize().unwrap();
    let task = task.replace("robot = \"robots", &format!("robot = \"{}", robots.display()));
    let script = venv::package().join("tests/fragile.py");
    let exec = format!(
        "exec = [\"python3\", \"{}\"]\norders = \"{}\"",
        script.display(),
        folder.file("orders").display()
    );
    let task = task.replace("exec = [\"python3\", \"-m\", \"yamabico.examples.wall_follower\"]", &exec);
    let file = folder.file("task.toml");
    std::fs::write(&file, task).unwrap();
    file
}

#[test]
fn an_exception_costs_a_proposal_and_an_end_or_a_hang_ends_the_run() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let folder = TestFolder::new("python-lockstep-fails");
    let (task, out) = (fragile(&folder), folder.file("out"));
    for (order, code, part) in [
        ("raise", 1, "time over"),
        ("exit", 3, "`fragile` has ended"),
        ("loop", 3, "`fragile` has not answered for"),
    ] {
        std::fs::write(folder.file("orders"), order).unwrap();
        let deadline = format!("behaviors.{FRAGILE}.deadline_ms=100");
        let set = ["--set", "run.duration_s=2", "--set", &deadline, "--no-report", "--overwrite"];
        let run = ["run", task.to_str().unwrap(), "--out", out.to_str().unwrap()];
        assert_exit(&yamabico(&python, &[&run[..], &set].concat()), code, &[part]);
    }
}

#[test]
fn a_live_run_with_failures_kills_and_changes_replays_to_the_byte() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let name = format!("python-replays-{}", std::process::id());
    let mut robot = FragileRobot::start(binary(), &python, &name);
    let pause = std::time::Duration::from_millis(700);
    robot.robot.keep = true;
    robot.robot.observe(pause);
    // An exception on request, by a file, would not come again.
    for failure in [Failure::Kill, Failure::Exit, Failure::Kill] {
        assert!(robot.provoke(failure).is_some(), "{failure:?}");
        robot.robot.observe(pause);
        let speed = if failure == Failure::Kill { "0.2" } else { "0.3" };
        let assignment = format!("{FRAGILE}.speed_mps={speed}");
        let set = yamabico(&python, &["set", "--robot", &name, &assignment]);
        assert!(set.status.success(), "{}", text(&set));
        robot.robot.observe(pause);
    }
    let ended = robot.interrupt();
    let result: Value = serde_json::from_slice(&ended.stdout).unwrap();
    let file = result["recording"]["path"].as_str().unwrap().to_owned();
    let report = json(&python, &["replay", &file, "--programs", "--json"]);
    let _ = std::fs::remove_dir_all(Path::new(&file).parent().unwrap());
    assert!(report["first"].is_null(), "{report:#}");
    assert!(report["topics"]["behaviors/fragile/proposal"]["compared"].as_u64() > Some(30), "{report:#}");
}
