//! A robot's processes share its bus, and only one process runs it. The child processes are this test, started again.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::{Command as MotorCommand, FrameHeader, Odometry};
use yamabico_host::bus::{Bell, Bus, BusError, Spec};

const PIXELS: usize = 640 * 480;
const ROUNDS: u64 = 50;
const PATIENCE: Duration = Duration::from_secs(20);

/// Does what it is told where this test was started as a child, nothing otherwise.
#[test]
fn child() {
    let (Ok(role), Ok(robot)) = (std::env::var("BUS_TEST_ROLE"), std::env::var("BUS_TEST_ROBOT")) else {
        return;
    };
    match role.as_str() {
        "echo" => echo(&robot),
        "supervise" => {
            let bus = Bus::ipc(&robot).unwrap();
            bus.create::<Odometry>("odometry", &Spec::default()).unwrap();
            let _publisher = bus.publisher::<Odometry>("odometry").unwrap();
            eprintln!("ready");
            std::thread::sleep(PATIENCE * 3);
        }
        _ => panic!("no role {role}"),
    }
}

/// Answers every frame with an odometry that carries its sequence and the sum of its pixels.
fn echo(robot: &str) {
    let bus = Bus::join(robot).unwrap();
    let second = bus.publisher::<MotorCommand>("command").err().unwrap();
    assert!(matches!(second, BusError::TooManyPublishers { most: 1, .. }), "{second}");
    let frames = bus.subscriber::<FrameHeader>("camera").unwrap();
    let answers = bus.publisher::<Odometry>("odometry").unwrap();
    let mut waiter = bus.waiter(&["camera"]).unwrap();
    eprintln!("ready");
    let mut last = 0;
    while last < ROUNDS {
        waiter.wait(Duration::from_secs(1)).unwrap();
        while let Some(frame) = frames.receive().unwrap() {
            last = frame.header().sequence;
            let sum = frame.items().iter().map(|&p| f64::from(p)).sum();
            answers.publish(&Odometry { sequence: last, x: sum, ..Default::default() }, &[]).unwrap();
        }
    }
    // A publisher's messages go with it: wait until the parent has read the last one.
    std::thread::sleep(Duration::from_millis(500));
}

fn start(role: &str, robot: &str) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["child", "--exact", "--nocapture"])
        .env("BUS_TEST_ROLE", role)
        .env("BUS_TEST_ROBOT", robot)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.ends_with("ready\n") {
        assert_ne!(errors.read_line(&mut said).unwrap(), 0, "{said}");
    }
    std::thread::spawn(move || errors.read_to_string(&mut String::new()));
    child
}

fn robot(name: &str) -> String {
    format!("{name}-{}", std::process::id())
}

#[test]
fn a_supervisor_may_open_as_many_files_as_the_system_allows() {
    let _bus = Bus::ipc(&robot("files")).unwrap();
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap();
    let line = limits.lines().find(|line| line.starts_with("Max open files")).unwrap();
    let [soft, hard] = [3, 4].map(|column| line.split_whitespace().nth(column).unwrap());
    assert_eq!(soft, hard);
}

fn folder(robot: &str) -> PathBuf {
    match std::env::var_os("XDG_RUNTIME_DIR") {
        Some(runtime) => PathBuf::from(runtime).join("yamabico").join(robot),
        None => {
            let user = std::fs::metadata("/proc/self").unwrap().uid();
            PathBuf::from(format!("/dev/shm/yamabico-{user}")).join(robot)
        }
    }
}

#[test]
fn frames_and_answers_cross_between_processes() {
    let robot = robot("echo");
    let bus = Bus::ipc(&robot).unwrap();
    let spec = Spec { bell: Bell::Rings, ..Spec::default() };
    bus.create::<FrameHeader>("camera", &Spec { list_bytes: PIXELS, ..spec }).unwrap();
    bus.create::<Odometry>("odometry", &spec).unwrap();
    bus.create::<MotorCommand>("command", &spec).unwrap();
    let _only = bus.publisher::<MotorCommand>("command").unwrap();
    let answers = bus.subscriber::<Odometry>("odometry").unwrap();
    let mut waiter = bus.waiter(&["odometry"]).unwrap();
    let camera = bus.publisher::<FrameHeader>("camera").unwrap();
    let mut child = start("echo", &robot);
    for sequence in 1..=ROUNDS {
        let header = FrameHeader { sequence, width: 640, height: 480, ..Default::default() };
        camera.publish_in_place(&header, PIXELS, |pixels| pixels.fill(sequence as u8)).unwrap();
        let begun = Instant::now();
        let answer = loop {
            waiter.wait(Duration::from_millis(100)).unwrap();
            if let Some(answer) = answers.receive().unwrap() {
                break *answer.header();
            }
            assert!(begun.elapsed() < PATIENCE, "no answer to {sequence}");
        };
        assert_eq!((answer.sequence, answer.x), (sequence, (sequence * PIXELS as u64) as f64));
    }
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_robot_that_runs_is_not_run_again() {
    let robot = robot("twice");
    assert!(matches!(Bus::join(&robot), Err(BusError::NotRunning { .. })));
    let mut child = start("supervise", &robot);
    let refused = Bus::ipc(&robot).err().unwrap();
    assert!(matches!(&refused, BusError::AlreadyRunning { pid, .. } if *pid == child.id()), "{refused}");
    assert!(refused.to_string().contains(&format!("process {}", child.id())), "{refused}");
    assert!(Bus::join(&robot).unwrap().subscriber::<Odometry>("odometry").is_ok());
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(matches!(Bus::join(&robot), Err(BusError::NotRunning { .. })));
    drop(Bus::ipc(&robot).unwrap());
}

#[test]
fn a_killed_supervisor_leaves_nothing_to_its_successor() {
    let robot = robot("killed");
    let mut child = start("supervise", &robot);
    child.kill().unwrap();
    child.wait().unwrap();
    let services = folder(&robot).join("services");
    assert_ne!(std::fs::read_dir(&services).unwrap().count(), 0);
    let bus = Bus::ipc(&robot).unwrap();
    assert_eq!(std::fs::read_dir(&services).map_or(0, Iterator::count), 0);
    bus.create::<MotorCommand>("odometry", &Spec::default()).unwrap();
    bus.publisher::<MotorCommand>("odometry").unwrap();
    drop(bus);
    assert!(!folder(&robot).exists() && !folder(&robot).with_extension("lock").exists());
}

#[test]
fn two_robots_run_side_by_side() {
    let (left, right) = (Bus::ipc(&robot("left")).unwrap(), Bus::ipc(&robot("right")).unwrap());
    assert!(matches!(Bus::ipc(&robot("left")), Err(BusError::AlreadyRunning { .. })));
    for bus in [&left, &right] {
        bus.create::<Odometry>("odometry", &Spec::default()).unwrap();
    }
    let heard = right.subscriber::<Odometry>("odometry").unwrap();
    left.publisher::<Odometry>("odometry").unwrap().publish(&Odometry::default(), &[]).unwrap();
    assert!(heard.receive().unwrap().is_none());
    right.publisher::<Odometry>("odometry").unwrap().publish(&Odometry::default(), &[]).unwrap();
    drop(left);
    right.publisher::<Odometry>("odometry").unwrap().publish(&Odometry::default(), &[]).unwrap();
}

#[test]
fn a_bad_name_is_refused() {
    for name in ["", "a/b", "..", "with space", &"long".repeat(30)] {
        assert!(matches!(Bus::ipc(name), Err(BusError::BadName { .. })), "{name}");
    }
}
