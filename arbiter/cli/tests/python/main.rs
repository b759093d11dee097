//! Behaviours in Python: their package's own tests, a drive, failures that are survived. Where there is no Python, or no network
//! to fetch the transport's package from, they are skipped, and say so.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod falls;
#[path = "../chaos/robot.rs"]
#[allow(dead_code, reason = "not all that share this file ask for everything")]
mod robot;
mod venv;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use falls::{FRAGILE, Fall, FragileRobot};
use serde_json::Value;

fn program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_yamabico"))
}

/// Runs `yamabico` with the interpreter's folder first among those of programs.
fn yamabico(python: &Path, arguments: &[&str]) -> Output {
    let folder = python.parent().unwrap().to_owned();
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(folder).chain(std::env::split_paths(&folders))).unwrap();
    let mut command = Command::new(program());
    command.args(arguments).env("PATH", path).env("NO_COLOR", "1").stdin(Stdio::null()).output().unwrap()
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn corridor() -> String {
    robot::config("corridor-python.toml").to_str().unwrap().to_owned()
}

#[test]
fn the_packages_own_tests_pass() {
    let Some(python) = venv::interpreter(program()) else { return };
    let mut tests = Command::new(&python);
    let tests =
        tests.args(["-m", "unittest", "discover", "-s", "tests"]).current_dir(venv::package()).output();
    let tests = tests.unwrap();
    let words = said(&tests);
    assert!(tests.status.success(), "{words}");
    let run =
        words.lines().find_map(|line| line.strip_prefix("Ran ")?.split(' ').next()?.parse::<u32>().ok());
    assert!(run > Some(10), "{words}");
}

#[test]
fn check_asks_the_program_and_refuses_what_does_not_fit() {
    let Some(python) = venv::interpreter(program()) else { return };
    let checked = yamabico(&python, &["check", &corridor()]);
    assert!(checked.status.success(), "{}", said(&checked));
    assert!(said(&checked).contains("starts wall-follower (python3 -m yamabico.examples.wall_follower)"));
    for (set, words) in [
        ("behaviors.wall-follower.speed_mps=20", "speed_mps"),
        ("behaviors.wall-follower.sped_mps=0.2", "did you mean `speed_mps`"),
        ("behaviors.wall-follower.inputs.camera=sonar", "yamabico.FrameHeader.v1"),
    ] {
        let checked = yamabico(&python, &["check", &corridor(), "--set", set]);
        assert_eq!(checked.status.code(), Some(2), "{set}");
        assert!(said(&checked).contains(words), "{set}: {}", said(&checked));
    }
}

#[test]
fn a_package_of_another_version_is_refused_and_both_are_named() {
    let Some(python) = venv::interpreter(program()) else { return };
    let other = "import yamabico.messages as m; m.FrameHeader.NAME = 'yamabico.FrameHeader.v9'; \
                 from yamabico.examples.wall_follower import *; main(WallFollower)";
    let exec = format!("behaviors.wall-follower.exec=[\"python3\", \"-c\", \"{other}\"]");
    let checked = yamabico(&python, &["check", &corridor(), "--set", &exec]);
    assert_eq!(checked.status.code(), Some(2), "{}", said(&checked));
    let words = said(&checked);
    assert!(words.contains("FrameHeader.v9") && words.contains("FrameHeader.v1"), "{words}");
}

#[test]
fn it_drives_down_half_the_corridor() {
    let Some(python) = venv::interpreter(program()) else { return };
    let name = format!("robot.name=python-drives-{}", std::process::id());
    let out = std::env::temp_dir().join(format!("yamabico-python-drives-{}", std::process::id()));
    let arguments = ["run", &corridor(), "--live", "--json", "--set", &name, "--out", out.to_str().unwrap()];
    let ran = yamabico(&python, &arguments);
    let _ = std::fs::remove_dir_all(&out);
    assert!(ran.status.success(), "{}", said(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert_eq!((report["end"].as_str(), report["contacts"].as_u64()), (Some("arrived"), Some(0)), "{report}");
    assert!(report["distance_m"].as_f64() > Some(11.8), "{report}");
    assert!(report["behaviours"]["wall-follower"]["calls"].as_u64() > Some(100), "{report}");
    assert_eq!(report["unseen"].as_u64(), Some(0), "{report}");
}

#[test]
fn whatever_becomes_of_it_it_is_back_and_the_robot_touches_nothing() {
    let Some(python) = venv::interpreter(program()) else { return };
    let name = format!("python-falls-{}", std::process::id());
    let mut fragile = FragileRobot::start(program(), &python, &name);
    fragile.robot.watch(Duration::from_millis(1500));
    for fall in Fall::ALL {
        let back = fragile.fall(fall);
        // A deadline of 0.4 s, and start-up on a machine that others keep busy.
        assert!(back < Some(Duration::from_secs(3)) && back.is_some(), "{fall:?}: back after {back:?}");
        fragile.robot.watch(Duration::from_millis(700));
    }
    let told = fragile.told.join("\n");
    assert!(told.contains("RuntimeError: as it was told (propose, line"), "{told}");
    assert!(told.contains("ReleasedError: the picture of `camera` was lent for one call"), "{told}");
    assert!(fragile.robot.newest[FRAGILE].restarts >= 3, "exit, loop and kill each cost a process");
    let ended = fragile.interrupt();
    let report: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(report["contacts"].as_u64(), Some(0), "{report}");
    assert!(report["behaviours"][FRAGILE]["panics"].as_u64() >= Some(1), "{report}");
}
