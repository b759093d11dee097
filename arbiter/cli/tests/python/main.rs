//! Behaviors in Python: their package's own tests, a drive, failures that are survived. Where there is no Python, or no network
//! to fetch the transport's package from, they are skipped, and say so.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod falls;
#[path = "../chaos/robot.rs"]
#[allow(dead_code, reason = "not all that share this file ask for everything")]
mod robot;
mod venv;
mod worlds;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use falls::{FRAGILE, Fall, FragileRobot};
use robot::Robot;
use serde_json::Value;
use yamabico_core::message::{Command as MotorCommand, Twist};
use yamabico_core::time::Time;

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
fn what_is_begun_in_python_passes_its_test_and_drives() {
    let Some(python) = venv::interpreter(program()) else { return };
    let name = format!("python-new-{}", std::process::id());
    let place = std::env::temp_dir().join(format!("yamabico-{name}"));
    std::fs::create_dir_all(&place).unwrap();
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut begin = Command::new(program());
    let begin = begin.args(["new", "behavior", "creeper", "--python", "--repository"]).arg(repository);
    let begun = begin.current_dir(&place).output().unwrap();
    assert!(begun.status.success(), "{}", said(&begun));
    let folder = place.join("creeper");
    let tests = Command::new(&python).args(["-m", "unittest"]).current_dir(&folder).output().unwrap();
    assert!(tests.status.success() && said(&tests).contains("Ran 2 tests"), "{}", said(&tests));
    let task = folder.join("task.toml");
    let text = std::fs::read_to_string(&task).unwrap();
    assert!(text.contains("\"venv/bin/python\""), "{text}");
    std::fs::write(&task, text.replace("venv/bin/python", python.to_str().unwrap())).unwrap();
    let set = ["--set", &format!("robot.name={name}"), "--set", "run.duration_s=4"];
    let out = folder.join("out");
    let run = ["run", task.to_str().unwrap(), "--live", "--json", "--out", out.to_str().unwrap()];
    let ran = yamabico(&python, &[&run[..], &set].concat());
    let _ = std::fs::remove_dir_all(&place);
    assert!(ran.status.success(), "{}", said(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert!(report["distance_m"].as_f64() > Some(0.3), "{report}");
}

#[test]
fn it_drives_down_half_the_corridor() {
    let Some(python) = venv::interpreter(program()) else { return };
    let name = format!("robot.name=python-drives-{}", std::process::id());
    let out = std::env::temp_dir().join(format!("yamabico-python-drives-{}", std::process::id()));
    // It takes 35 s; how much longer where the machine stands still now and then is not what is asked here.
    let patient = "robot.devices.sim.deadline_ms=20000";
    let set = ["--set", &name, "--set", "run.duration_s=300", "--set", patient];
    let run = ["run", &corridor(), "--live", "--json", "--out", out.to_str().unwrap()];
    let ran = yamabico(&python, &[&run[..], &set].concat());
    let _ = std::fs::remove_dir_all(&out);
    assert!(ran.status.success(), "{}", said(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert_eq!((report["end"].as_str(), report["contacts"].as_u64()), (Some("arrived"), Some(0)), "{report}");
    assert!(report["distance_m"].as_f64() > Some(11.8), "{report}");
    assert!(report["behaviors"]["wall-follower"]["calls"].as_u64() > Some(100), "{report}");
}

#[test]
fn whatever_becomes_of_it_it_is_back_and_the_robot_touches_nothing() {
    let Some(python) = venv::interpreter(program()) else { return };
    let name = format!("python-falls-{}", std::process::id());
    let mut fragile = FragileRobot::start(program(), &python, &name);
    fragile.robot.watch(Duration::from_millis(1500));
    for fall in Fall::ALL {
        let back = fragile.fall(fall);
        println!("{fall:?}: back after {back:?}");
        assert!(back.is_some(), "{fall:?}: it is not back");
        fragile.robot.watch(Duration::from_millis(700));
    }
    let told = fragile.told.join("\n");
    assert!(told.contains("RuntimeError: as it was told (propose, line"), "{told}");
    assert!(told.contains("ReleasedError: the picture of `camera` was lent for one call"), "{told}");
    assert!(fragile.robot.newest[FRAGILE].restarts >= 3, "exit, loop and kill each cost a process");
    let ended = fragile.interrupt();
    let report: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(report["contacts"].as_u64(), Some(0), "{report}");
    assert!(report["behaviors"][FRAGILE]["panics"].as_u64() >= Some(1), "{report}");
}

#[test]
fn its_parameters_are_changed_while_it_runs_and_its_successor_goes_on() {
    let Some(python) = venv::interpreter(program()) else { return };
    let name = format!("python-set-{}", std::process::id());
    let mut fragile = FragileRobot::start(program(), &python, &name);
    let set = |speed: &str| {
        let assignment = format!("{FRAGILE}.speed_mps={speed}");
        yamabico(&python, &["set", "--robot", &name, &assignment])
    };
    // So many calls were remembered, by the note of its proposals.
    let calls = |fragile: &mut FragileRobot| {
        fragile.robot.watch(Duration::from_millis(1000));
        let newest = fragile.proposal_after(Time::monotonic_now()).unwrap();
        (newest.note.as_str().strip_prefix("call ").unwrap().parse::<u32>().unwrap(), newest.twist.linear)
    };
    let (first, speed) = calls(&mut fragile);
    assert!(speed > 0.3, "{speed}");
    let changed = set("0.2");
    assert!(changed.status.success() && said(&changed).contains("in force"), "{}", said(&changed));
    let (second, speed) = calls(&mut fragile);
    assert!(second > first && speed <= 0.2, "{second} after {first} calls, {speed} m/s");
    for (speed, words) in [("20", "speed_mps"), ("1.0", "too fast for one so fragile")] {
        let refused = set(speed);
        assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
        assert!(said(&refused).contains(words), "{}", said(&refused));
    }
    for fall in [Fall::Kill, Fall::Raise] {
        assert!(fragile.fall(fall).is_some(), "it is not back");
        let (after, speed) = calls(&mut fragile);
        assert!(after > second && speed <= 0.2, "{fall:?}: {after} after {second} calls, {speed} m/s");
    }
    // Successors that die of what they are told begin without it in the end.
    let starts = fragile.robot.newest[FRAGILE].restarts;
    assert!(fragile.fall(Fall::Poison).is_some(), "it is not back");
    let (after, _) = calls(&mut fragile);
    assert!(after < second, "{after} calls remembered");
    assert!(fragile.robot.newest[FRAGILE].restarts >= starts + 6);
    fragile.interrupt();
}

/// Simulated seconds to compare; a whole drive takes 35.
fn simulated() -> Duration {
    let told = std::env::var("YAMABICO_SECONDS").ok().and_then(|seconds| seconds.parse().ok());
    Duration::from_secs_f64(told.unwrap_or(3.0))
}

#[test]
fn a_world_with_its_own_clock_gives_the_same_commands_at_any_pace() {
    let Some(python) = venv::interpreter(program()) else { return };
    let told = [0.2, 5.0].map(|pace| {
        let name = format!("python-pace-{}-{}", (pace * 10.0) as u32, std::process::id());
        let begun = Instant::now();
        let told = worlds::commands(program(), &python, &name, pace, simulated());
        let took = begun.elapsed().as_secs_f64();
        println!("pace {pace}: {} commands, {:.1} s with coming up", told.len(), took);
        told
    });
    // The first command, which lets everybody begin, comes before there is anybody to watch.
    let watched = |told: &[MotorCommand]| told.iter().position(|command| command.stamp_ns > 0);
    let steps = told.each_ref().map(|told| &told[watched(told).unwrap()..]);
    let least = simulated().as_secs_f64() * 50.0 - 2.0;
    assert!(steps[0].len() as f64 >= least, "{} commands", steps[0].len());
    assert!(steps[0].last().unwrap().twist.linear > 0.3, "it drives");
    assert!(steps[0].iter().any(|command| command.twist.angular.abs() > 0.05), "it steers");
    assert_eq!(bytemuck::cast_slice::<_, u8>(steps[0]), bytemuck::cast_slice::<_, u8>(steps[1]));
}

#[test]
fn a_world_that_dies_leaves_a_robot_that_is_told_to_stop() {
    let Some(python) = venv::interpreter(program()) else { return };
    let mut robot =
        worlds::start(program(), &python, &format!("python-dies-{}", std::process::id()), 1.0, &[]);
    let drives = |robot: &Robot| robot.told.last().is_some_and(|command| command.twist.linear > 0.3);
    assert!(robot.watch_until(robot::PATIENCE, drives), "it does not get going");
    let (killed, before) = (Instant::now(), robot.told.len());
    robot::signal(robot.process_of("flat-world").unwrap(), "KILL");
    let stands = |robot: &Robot| {
        robot.told.len() > before && robot.told.last().is_some_and(|command| command.twist == Twist::ZERO)
    };
    assert!(robot.watch_until(robot::PATIENCE, stands), "nobody tells it to stop");
    println!("told to stand {:?} after the world's death", killed.elapsed());
    let ended = robot.interrupt();
    assert_eq!(ended.status.code(), Some(3), "{}", said(&ended));
    assert!(said(&ended).contains("clock"), "{}", said(&ended));
}
