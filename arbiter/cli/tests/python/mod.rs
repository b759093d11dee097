//! Behaviors and drivers in Python: the tests of the package, drives, and failures. Without Python, or without a network to install
//! the package `iceoryx2`, the tests are skipped with a message.

mod lockstep;
mod mujoco;
mod own_messages;
mod worlds;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use yamabico_core::message::{Command as MotorCommand, Twist};
use yamabico_core::time::Time;
use yamabico_live_robot::python_failures::{FRAGILE, Failure, FragileRobot};
use yamabico_live_robot::robot::LiveRobot;
use yamabico_live_robot::venv;

use crate::program::{assert_exit, binary, text};

/// Runs `yamabico` with the folder of the interpreter first in PATH.
fn yamabico(python: &Path, arguments: &[&str]) -> Output {
    let folder = python.parent().unwrap().to_owned();
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(folder).chain(std::env::split_paths(&folders))).unwrap();
    let mut command = Command::new(binary());
    command.args(arguments).env("PATH", path).env("NO_COLOR", "1").stdin(Stdio::null()).output().unwrap()
}

fn corridor() -> String {
    yamabico_testkit::config("corridor-python.toml").to_str().unwrap().to_owned()
}

#[test]
fn the_tests_of_the_package_pass() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let mut tests = Command::new(&python);
    let tests =
        tests.args(["-m", "unittest", "discover", "-s", "tests"]).current_dir(venv::package()).output();
    let tests = tests.unwrap();
    let log = text(&tests);
    assert!(tests.status.success(), "{log}");
    let run = log.lines().find_map(|line| line.strip_prefix("Ran ")?.split(' ').next()?.parse::<u32>().ok());
    assert!(run > Some(10), "{log}");
}

#[test]
fn check_refuses_what_does_not_fit_the_description_of_the_program() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let checked = yamabico(&python, &["check", &corridor()]);
    assert!(checked.status.success(), "{}", text(&checked));
    assert!(text(&checked).contains("wall-follower (python3 -m yamabico.examples.wall_follower)"));
    for (set, part) in [
        ("behaviors.wall-follower.speed_mps=20", "speed_mps"),
        ("behaviors.wall-follower.sped_mps=0.2", "did you mean `speed_mps`"),
        ("behaviors.wall-follower.inputs.camera=sonar", "yamabico.FrameHeader.v1"),
    ] {
        let checked = yamabico(&python, &["check", &corridor(), "--set", set]);
        assert_eq!(checked.status.code(), Some(2), "{set}");
        assert!(text(&checked).contains(part), "{set}: {}", text(&checked));
    }
}

#[test]
fn a_package_of_another_version_is_refused_and_both_versions_are_named() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let other = "import yamabico.messages as m; m.FrameHeader.NAME = 'yamabico.FrameHeader.v9'; \
                 from yamabico.examples.wall_follower import *; main(WallFollower)";
    let exec = format!("behaviors.wall-follower.exec=[\"python3\", \"-c\", \"{other}\"]");
    let checked = yamabico(&python, &["check", &corridor(), "--set", &exec]);
    assert_exit(&checked, 2, &["FrameHeader.v9", "FrameHeader.v1"]);
}

#[test]
fn a_new_driver_in_python_passes_its_tests_and_is_checked() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let place = std::env::temp_dir().join(format!("yamabico-python-driver-{}", std::process::id()));
    std::fs::create_dir_all(&place).unwrap();
    let mut begin = Command::new(binary());
    let begin = begin
        .args(["new", "driver", "wheels", "--python", "--repository"])
        .arg(yamabico_testkit::workspace());
    let begun = begin.current_dir(&place).output().unwrap();
    assert!(begun.status.success(), "{}", text(&begun));
    let folder = place.join("wheels");
    let tests = Command::new(&python).args(["-m", "unittest"]).current_dir(&folder).output().unwrap();
    assert!(tests.status.success() && text(&tests).contains("Ran 2 tests"), "{}", text(&tests));
    let robot = folder.join("robot.toml");
    let toml = std::fs::read_to_string(&robot).unwrap();
    std::fs::write(&robot, toml.replace("venv/bin/python", python.to_str().unwrap())).unwrap();
    let checked = yamabico(&python, &["check", folder.join("task.toml").to_str().unwrap()]);
    let _ = std::fs::remove_dir_all(&place);
    assert_exit(&checked, 0, &["base ("]);
}

#[test]
fn a_new_behavior_in_python_passes_its_tests_and_drives() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let name = format!("python-new-{}", std::process::id());
    let place = std::env::temp_dir().join(format!("yamabico-{name}"));
    std::fs::create_dir_all(&place).unwrap();
    let repository = yamabico_testkit::workspace();
    let mut begin = Command::new(binary());
    let begin = begin.args(["new", "behavior", "creeper", "--python", "--repository"]).arg(repository);
    let begun = begin.current_dir(&place).output().unwrap();
    assert!(begun.status.success(), "{}", text(&begun));
    let folder = place.join("creeper");
    let tests = Command::new(&python).args(["-m", "unittest"]).current_dir(&folder).output().unwrap();
    assert!(tests.status.success() && text(&tests).contains("Ran 2 tests"), "{}", text(&tests));
    let task = folder.join("task.toml");
    let toml = std::fs::read_to_string(&task).unwrap();
    assert!(toml.contains("\"venv/bin/python\""), "{toml}");
    std::fs::write(&task, toml.replace("venv/bin/python", python.to_str().unwrap())).unwrap();
    let set = ["--set", &format!("robot.name={name}"), "--set", "run.duration_s=4"];
    let out = folder.join("out");
    let run = ["run", task.to_str().unwrap(), "--live", "--json", "--out", out.to_str().unwrap()];
    let ran = yamabico(&python, &[&run[..], &set].concat());
    let _ = std::fs::remove_dir_all(&place);
    assert!(ran.status.success(), "{}", text(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert!(report["distance_m"].as_f64() > Some(0.3), "{report}");
}

#[test]
fn it_drives_down_half_the_corridor() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let name = format!("robot.name=python-drives-{}", std::process::id());
    let out = std::env::temp_dir().join(format!("yamabico-python-drives-{}", std::process::id()));
    // It takes 35 s of simulated time; a busy machine may need longer.
    let patient = "robot.devices.sim.deadline_ms=20000";
    let set = ["--set", &name, "--set", "run.duration_s=300", "--set", patient];
    let run = ["run", &corridor(), "--live", "--json", "--out", out.to_str().unwrap()];
    let ran = yamabico(&python, &[&run[..], &set].concat());
    let _ = std::fs::remove_dir_all(&out);
    assert!(ran.status.success(), "{}", text(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert_eq!((report["end"].as_str(), report["contacts"].as_u64()), (Some("arrived"), Some(0)), "{report}");
    assert!(report["distance_m"].as_f64() > Some(11.8), "{report}");
    assert!(report["behaviors"]["wall-follower"]["calls"].as_u64() > Some(100), "{report}");
}

#[test]
fn after_any_failure_it_is_restarted_and_the_robot_touches_nothing() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let name = format!("python-falls-{}", std::process::id());
    let mut fragile = FragileRobot::start(binary(), &python, &name);
    fragile.robot.observe(Duration::from_millis(1500));
    for fall in Failure::ALL {
        let back = fragile.provoke(fall);
        println!("{fall:?}: back after {back:?}");
        assert!(back.is_some(), "{fall:?}: it is not restarted");
        fragile.robot.observe(Duration::from_millis(700));
    }
    let failures = fragile.failure_texts.join("\n");
    assert!(failures.contains("RuntimeError: as requested (propose, line"), "{failures}");
    assert!(
        failures.contains("ReleasedError: the pixels of `camera` are valid during one call"),
        "{failures}"
    );
    assert!(fragile.robot.heartbeats[FRAGILE].restarts >= 3, "exit, loop and kill each end a process");
    let ended = fragile.interrupt();
    let report: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(report["contacts"].as_u64(), Some(0), "{report}");
    assert!(report["behaviors"][FRAGILE]["panics"].as_u64() >= Some(1), "{report}");
}

#[test]
fn its_parameters_change_while_it_runs_and_a_restart_keeps_them() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let name = format!("python-set-{}", std::process::id());
    let mut fragile = FragileRobot::start(binary(), &python, &name);
    let set = |speed: &str| {
        let assignment = format!("{FRAGILE}.speed_mps={speed}");
        yamabico(&python, &["set", "--robot", &name, &assignment])
    };
    // The number of calls in its saved state, which the note of its proposals reports.
    let calls = |fragile: &mut FragileRobot| {
        fragile.robot.observe(Duration::from_millis(1000));
        let newest = fragile.proposal_after(Time::monotonic_now()).unwrap();
        (newest.note.as_str().strip_prefix("call ").unwrap().parse::<u32>().unwrap(), newest.twist.linear)
    };
    let (first, speed) = calls(&mut fragile);
    assert!(speed > 0.3, "{speed}");
    let changed = set("0.2");
    assert!(changed.status.success() && text(&changed).contains("in effect"), "{}", text(&changed));
    let (second, speed) = calls(&mut fragile);
    assert!(second > first && speed <= 0.2, "{second} after {first} calls, {speed} m/s");
    for (speed, part) in [("20", "speed_mps"), ("1.0", "must be below 1 m/s")] {
        let refused = set(speed);
        assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
        assert!(text(&refused).contains(part), "{}", text(&refused));
    }
    for fall in [Failure::Kill, Failure::Raise] {
        assert!(fragile.provoke(fall).is_some(), "it is not restarted");
        let (after, speed) = calls(&mut fragile);
        assert!(after > second && speed <= 0.2, "{fall:?}: {after} after {second} calls, {speed} m/s");
    }
    // Saved state that crashes every successor is discarded in the end.
    let starts = fragile.robot.heartbeats[FRAGILE].restarts;
    assert!(fragile.provoke(Failure::Poison).is_some(), "it is not restarted");
    let (after, _) = calls(&mut fragile);
    assert!(after < second, "{after} calls in the saved state");
    assert!(fragile.robot.heartbeats[FRAGILE].restarts >= starts + 6);
    fragile.interrupt();
}

/// Simulated time to compare; a whole drive takes 35 s.
fn simulated() -> Duration {
    let seconds = std::env::var("YAMABICO_SECONDS").ok().and_then(|seconds| seconds.parse().ok());
    Duration::from_secs_f64(seconds.unwrap_or(3.0))
}

#[test]
fn a_simulator_with_its_own_clock_gives_the_same_commands_at_any_pace() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let commands = [0.2, 5.0].map(|pace| {
        let name = format!("python-pace-{}-{}", (pace * 10.0) as u32, std::process::id());
        let begun = Instant::now();
        let commands = worlds::commands(binary(), &python, &name, pace, simulated());
        let took = begun.elapsed().as_secs_f64();
        println!("pace {pace}: {} commands, {:.1} s including startup", commands.len(), took);
        commands
    });
    // The first command, at time zero, is published before the test subscribes.
    let watched = |commands: &[MotorCommand]| commands.iter().position(|command| command.stamp_ns > 0);
    let steps = commands.each_ref().map(|commands| &commands[watched(commands).unwrap()..]);
    let min = simulated().as_secs_f64() * 50.0 - 2.0;
    assert!(steps[0].len() as f64 >= min, "{} commands", steps[0].len());
    assert!(steps[0].last().unwrap().twist.linear > 0.3, "it drives");
    assert!(steps[0].iter().any(|command| command.twist.angular.abs() > 0.05), "it steers");
    assert_eq!(bytemuck::cast_slice::<_, u8>(steps[0]), bytemuck::cast_slice::<_, u8>(steps[1]));
}

#[test]
fn the_robot_stops_when_the_simulator_dies() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let mut robot =
        worlds::start(binary(), &python, &format!("python-dies-{}", std::process::id()), 1.0, &[]);
    let drives = |robot: &LiveRobot| robot.commands.last().is_some_and(|command| command.twist.linear > 0.3);
    assert!(robot.wait_until(yamabico_live_robot::robot::TIMEOUT, drives), "it does not start driving");
    let (killed, before) = (Instant::now(), robot.commands.len());
    yamabico_live_robot::robot::signal(robot.process_of("flat-world").unwrap(), "KILL");
    let stands = |robot: &LiveRobot| {
        robot.commands.len() > before
            && robot.commands.last().is_some_and(|command| command.twist == Twist::ZERO)
    };
    assert!(robot.wait_until(yamabico_live_robot::robot::TIMEOUT, stands), "no stop is commanded");
    println!("stop commanded {:?} after the death of the simulator", killed.elapsed());
    let ended = robot.interrupt();
    assert_eq!(ended.status.code(), Some(3), "{}", text(&ended));
    assert!(text(&ended).contains("clock"), "{}", text(&ended));
}

#[test]
fn the_driver_of_the_tutorial_runs_as_it_stands_there() {
    const TUTORIAL: &str = include_str!("../../../../core/python/docs/own-robot.md");
    let Some(python) = venv::interpreter(binary()) else { return };
    let folder = std::env::temp_dir().join(format!("yamabico-tutorial-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    // The first line of each block names its file.
    for block in TUTORIAL.split("```").skip(1).step_by(2) {
        let (_, content) = block.split_once('\n').unwrap();
        let name = content.lines().next().unwrap().trim_start_matches("# ");
        std::fs::write(folder.join(name), content).unwrap();
    }
    let (task, out) = (folder.join("task.toml"), folder.join("out"));
    let name = format!("robot.name=tutorial-{}", std::process::id());
    let set = ["--set", &name, "--set", "run.duration_s=3"];
    let run = ["run", task.to_str().unwrap(), "--live", "--json", "--out", out.to_str().unwrap()];
    let ran = yamabico(&python, &[&run[..], &set].concat());
    let _ = std::fs::remove_dir_all(&folder);
    assert!(ran.stdout.starts_with(b"{"), "{}", text(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    let messages = |topic: &str| report["recording"]["messages"][topic].as_u64();
    assert!(messages("sensors/wheels") > Some(20) && messages("sensors/sonar") > Some(10), "{report}");
}
