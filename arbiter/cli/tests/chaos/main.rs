//! Processes of a live robot that are killed, that hang, and whose supervisor dies: the others go on, nothing stays behind.
//!
//! `cargo run --release --example chaos` does the same five hundred times and prints figures.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod campaign;
mod robot;

use std::path::Path;
use std::time::{Duration, Instant};

use campaign::{Chance, Figures, PERIOD, VICTIMS, quantile};
use robot::{BareTimer, PATIENCE, Robot, processes, signal};
use serde_json::Value;
use yamabico_core::time::Time;
use yamabico_host::bus::Bus;

/// Behaviors and the simulator.
const PLUGINS: usize = VICTIMS.len() + 1;
/// Farther than the hallway is long, and longer than any test.
const NEVER: [&str; 2] = ["run.goal.x_m=1000", "run.duration_s=100000"];

fn start(test: &str, set: &[&str]) -> Robot {
    let name = format!("{test}-{}", std::process::id());
    let set = [&NEVER, set].concat();
    Robot::start(Path::new(env!("CARGO_BIN_EXE_yamabico")), "hallway.toml", &name, PLUGINS, &set)
}

/// Nothing of a robot that has ended is left: no process, no segment, no file.
fn assert_gone(supervisor: u32, (root, prefix): &(std::path::PathBuf, String)) {
    let begun = Instant::now();
    let is_left = || {
        let children = processes().into_iter().filter(|process| {
            process.arguments.windows(2).any(|pair| pair == ["--guardian", &supervisor.to_string()])
        });
        let names: Vec<String> = children.map(|process| process.arguments.join(" ")).collect();
        let segments = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let segments =
            segments.filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix)).count();
        (!names.is_empty() || segments > 0 || root.exists()).then_some((names, segments, root.exists()))
    };
    while let Some(left) = is_left() {
        assert!(begun.elapsed() < Duration::from_secs(10), "left: {left:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Ended by Ctrl-C at rest and without a contact; its report.
fn assert_ended_well(robot: Robot) -> Value {
    let (supervisor, files) = (robot.supervisor(), robot.files());
    let ended = robot.interrupt();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(1), "{said}");
    let report: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(
        (report["end"].as_str(), report["contacts"].as_u64()),
        (Some("interrupted"), Some(0)),
        "{said}"
    );
    assert_gone(supervisor, &files);
    report
}

#[test]
fn behaviors_that_are_killed_come_back_and_the_arbiter_misses_nothing() {
    let mut robot = start("killed", &[]);
    let mut figures = Figures::default();
    let before = figures.kill_each_once(&mut robot);
    figures.kill(&mut robot, 16, &mut Chance(0x5eed));
    assert_eq!((figures.kills, figures.lost.as_slice()), (20, [].as_slice()), "{figures:?}");
    // One command late with every death would be twenty.
    assert!(figures.late.often <= figures.late_bare.often + figures.kills / 4, "{figures:?}");
    // Starting takes milliseconds of computing time, which a busy machine gives late.
    assert!(quantile(&figures.back_of(|_| true), 0.5) < Duration::from_secs(1), "{figures:?}");
    let mut after = before;
    robot.watch_until(PATIENCE, |robot| {
        after = robot.holdings();
        after == before
    });
    assert_eq!(after, before, "what the dead held is not given back");
    let report = assert_ended_well(robot);
    let calls = |name: &str| report["behaviors"][name]["calls"].as_u64();
    assert!(calls("wall-follower") > Some(0) && calls("sonar-halt") > Some(0), "{report}");
}

#[test]
fn a_behavior_that_hangs_is_noticed_and_replaced() {
    let mut robot = start("hung", &["behaviors.wall-follower.deadline_ms=400"]);
    robot.watch(Duration::from_millis(500));
    let timer = BareTimer::start(PERIOD);
    let mut figures = Figures::default();
    let lived = figures.hang(&mut robot, "wall-follower");
    let late = timer.stop().most;
    assert_eq!(figures.lost, [""; 0], "{figures:?}");
    // Given up an eighth before its deadline, so that it is dead by then.
    assert!(lived >= Duration::from_millis(350), "killed {lived:?} after its last sign of life");
    // Its last sign of life came a quarter of the deadline before it hung, or less. How late is left to the machine: the
    // campaign tells.
    let noticed = figures.noticed[0];
    assert!(noticed < Duration::from_secs(1) + 4 * late, "{noticed:?}, a bare timer was {late:?} late");
    assert_ended_well(robot);
}

#[test]
fn the_death_of_the_supervisor_stops_the_robot_and_leaves_nothing() {
    let mut robot = start("orphaned", &["robot.devices.sim.truth_period_ms=5"]);
    let fast = robot.watch_until(PATIENCE, |robot| robot.truth.last().is_some_and(|truth| truth.vx > 0.3));
    assert!(fast, "it does not get going");
    let (supervisor, files) = (robot.supervisor(), robot.files());
    let speed = robot.truth.last().unwrap().vx;
    let timer = BareTimer::start(PERIOD);
    let killed = Time::monotonic_now();
    signal(supervisor, "KILL");
    let is_at_rest = |robot: &Robot| {
        let newest = robot.truth.last().unwrap();
        newest.stamp_ns > killed.0 && newest.vx.abs() < 0.01
    };
    assert!(robot.watch_until(PATIENCE, is_at_rest), "it was left moving");
    let late = timer.stop().most;
    let mut after = robot.truth.iter().filter(|truth| truth.stamp_ns > killed.0);
    let braked = after.find(|truth| truth.vx < speed - 0.02).unwrap();
    let began = Time(braked.stamp_ns).since(killed);
    assert!(
        began < Duration::from_millis(100) + late,
        "it braked {began:?} later; a bare timer was {late:?} late"
    );
    robot.wait();
    assert_gone(supervisor, &files);
}

#[test]
fn a_supervisor_that_is_killed_while_it_starts_leaves_no_process() {
    for pause_ms in [20, 60, 150] {
        let name = format!("early-{pause_ms}-{}", std::process::id());
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_yamabico"));
        command.arg("run").arg(robot::config("hallway.toml")).arg("--live");
        command.args(["--set", &format!("robot.name={name}"), "--out"]).arg(std::env::temp_dir().join(&name));
        let mut run = command.stdout(std::process::Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(pause_ms));
        run.kill().unwrap();
        run.wait().unwrap();
        let begun = Instant::now();
        let guardian = run.id().to_string();
        while processes().iter().any(|process| process.arguments.contains(&guardian)) {
            assert!(begun.elapsed() < Duration::from_secs(10), "a process outlives its supervisor");
            std::thread::sleep(Duration::from_millis(20));
        }
        // Files may be left where no device was there to bury it; they go with the next start. A child that was just being
        // started holds the name until it has begun to be a program of its own.
        while !Bus::bury(&name).unwrap() {
            assert!(begun.elapsed() < Duration::from_secs(10), "the name is still taken");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
