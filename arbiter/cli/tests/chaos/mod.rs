//! Faults of a live robot: processes that are killed or hang, and the death of the supervisor. The others go on, and no resource
//! leaks.
//!
//! `cargo run --release -p yamabico-evaluations -- chaos` does the same five hundred times and prints statistics.

use std::time::{Duration, Instant};

use serde_json::Value;
use yamabico_core::time::Time;
use yamabico_host::bus::Bus;
use yamabico_live_robot::campaign::{Campaign, PERIOD, Random, VICTIMS, quantile};
use yamabico_live_robot::robot::{BareTimer, LiveRobot, TIMEOUT, processes, signal};

use crate::program::binary;

/// Number of plugins: the behaviors and the simulator.
const PLUGINS: usize = VICTIMS.len() + 1;
/// A goal behind the wall of the hallway, and more time than any test takes: the run never ends by itself.
const NEVER: [&str; 2] = ["run.goal.y_m=15", "run.duration_s=100000"];

fn start(test: &str, set: &[&str]) -> LiveRobot {
    let name = format!("{test}-{}", std::process::id());
    let set = [&NEVER, set].concat();
    LiveRobot::start(binary(), "hallway.toml", &name, PLUGINS, &set)
}

/// Asserts that an ended robot leaves no process, no shared memory segment and no file.
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

/// Ends the robot with Ctrl-C and asserts that it stopped without a contact; returns the report.
fn assert_ended_well(robot: LiveRobot) -> Value {
    let (supervisor, files) = (robot.supervisor(), robot.files());
    let ended = robot.interrupt();
    let log = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(1), "{log}");
    let report: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(
        (report["end"].as_str(), report["contacts"].as_u64()),
        (Some("interrupted"), Some(0)),
        "{log}"
    );
    assert_gone(supervisor, &files);
    report
}

#[test]
fn killed_behaviors_are_restarted_and_the_arbiter_misses_no_tick() {
    let mut robot = start("killed", &[]);
    let mut campaign = Campaign::default();
    let before = campaign.kill_each_once(&mut robot);
    campaign.kill(&mut robot, 16, &mut Random(0x5eed));
    assert_eq!((campaign.kills, campaign.not_recovered.as_slice()), (20, [].as_slice()), "{campaign:?}");
    // One late command for each death would be twenty.
    assert!(
        campaign.lateness.missed_periods <= campaign.timer_lateness.missed_periods + campaign.kills / 4,
        "{campaign:?}"
    );
    // A restart takes a few milliseconds of computing time, for which it waits on a busy machine.
    assert!(quantile(&campaign.recovery_times(|_| true), 0.5) < Duration::from_secs(1), "{campaign:?}");
    let mut after = before;
    robot.wait_until(TIMEOUT, |robot| {
        after = robot.resources();
        after == before
    });
    assert_eq!(after, before, "resources of killed processes are not released");
    let report = assert_ended_well(robot);
    let calls = |name: &str| report["behaviors"][name]["calls"].as_u64();
    assert!(calls("wall-follower") > Some(0) && calls("sonar-halt") > Some(0), "{report}");
}

#[test]
fn a_hanging_behavior_is_detected_and_replaced() {
    let mut robot = start("hung", &["behaviors.wall-follower.deadline_ms=400"]);
    robot.observe(Duration::from_millis(500));
    let timer = BareTimer::start(PERIOD);
    let mut campaign = Campaign::default();
    let lived = campaign.hang(&mut robot, "wall-follower");
    let late = timer.stop().max;
    assert_eq!(campaign.not_recovered, [""; 0], "{campaign:?}");
    // It is killed an eighth of the deadline early, so that it is dead at the deadline.
    assert!(lived >= Duration::from_millis(350), "killed {lived:?} after its last heartbeat");
    // Its last heartbeat came at most a quarter of the deadline before it hung. The rest depends on the load of the machine.
    let noticed = campaign.hang_durations[0];
    assert!(noticed < Duration::from_secs(1) + 4 * late, "{noticed:?}, a bare timer was {late:?} late");
    assert_ended_well(robot);
}

#[test]
fn the_death_of_the_supervisor_stops_the_robot_and_leaks_nothing() {
    let mut robot = start("orphaned", &["robot.devices.sim.truth_period_ms=5"]);
    let fast = robot.wait_until(TIMEOUT, |robot| robot.truth.last().is_some_and(|truth| truth.vx > 0.3));
    assert!(fast, "it does not start driving");
    let (supervisor, files) = (robot.supervisor(), robot.files());
    let speed = robot.truth.last().unwrap().vx;
    let timer = BareTimer::start(PERIOD);
    let killed = Time::monotonic_now();
    signal(supervisor, "KILL");
    let is_at_rest = |robot: &LiveRobot| {
        let newest = robot.truth.last().unwrap();
        newest.stamp_ns > killed.0 && newest.vx.abs() < 0.01
    };
    assert!(robot.wait_until(TIMEOUT, is_at_rest), "it keeps moving");
    let late = timer.stop().max;
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
fn a_supervisor_killed_during_startup_leaves_no_process() {
    for pause_ms in [20, 60, 150] {
        let name = format!("early-{pause_ms}-{}", std::process::id());
        let mut command = std::process::Command::new(binary());
        command.arg("run").arg(yamabico_testkit::config("hallway.toml")).arg("--live");
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
        // Files may be left if no device process existed yet to clean up; the next start removes them. A child process holds the
        // name until its exec.
        while !Bus::remove_stale_files(&name).unwrap() {
            assert!(begun.elapsed() < Duration::from_secs(10), "the name is still taken");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
