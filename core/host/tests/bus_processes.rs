//! The processes of a robot share its bus, and only one process runs a robot. The child processes run this test again.

use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::{Command as MotorCommand, FrameHeader, Odometry};
use yamabico_host::bus::{Bus, BusError, Notification, TopicSpec};

const PIXELS: usize = 640 * 480;
const ROUNDS: u64 = 50;
const TIMEOUT: Duration = Duration::from_secs(20);

/// Plays the role given in the environment of a child process; passes at once otherwise.
#[test]
fn child() {
    let (Ok(role), Ok(robot)) = (std::env::var("BUS_TEST_ROLE"), std::env::var("BUS_TEST_ROBOT")) else {
        return;
    };
    match role.as_str() {
        "echo" => echo(&robot),
        "supervise" => {
            let bus = Bus::ipc(&robot).unwrap();
            bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
            let _publisher = bus.publisher::<Odometry>("odometry").unwrap();
            eprintln!("ready");
            std::thread::sleep(TIMEOUT * 3);
        }
        _ => panic!("no role {role}"),
    }
}

/// Answers every frame with an odometry message that contains its sequence number and the sum of its pixels.
fn echo(robot: &str) {
    let bus = Bus::join(robot).unwrap();
    let second = bus.publisher::<MotorCommand>("command").err().unwrap();
    assert!(matches!(second, BusError::TooManyPublishers { max: 1, .. }), "{second}");
    let frames = bus.subscriber::<FrameHeader>("camera").unwrap();
    let answers = bus.publisher::<Odometry>("odometry").unwrap();
    let mut wait_set = bus.wait_set(&["camera"]).unwrap();
    eprintln!("ready");
    let mut last = 0;
    while last < ROUNDS {
        wait_set.wait(Duration::from_secs(1)).unwrap();
        while let Some(frame) = frames.receive().unwrap() {
            last = frame.header().sequence;
            let sum = frame.items().iter().map(|&p| f64::from(p)).sum();
            answers.publish(&Odometry { sequence: last, x: sum, ..Default::default() }, &[]).unwrap();
        }
    }
    // Messages are lost with their publisher: wait until the parent has received the last one.
    std::thread::sleep(Duration::from_millis(500));
}

fn start(role: &str, robot: &str) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["bus_processes::child", "--exact", "--nocapture"])
        .env("BUS_TEST_ROLE", role)
        .env("BUS_TEST_ROBOT", robot)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    let mut text = String::new();
    while !text.ends_with("ready\n") {
        assert_ne!(errors.read_line(&mut text).unwrap(), 0, "{text}");
    }
    std::thread::spawn(move || errors.read_to_string(&mut String::new()));
    child
}

fn robot(name: &str) -> String {
    format!("{name}-{}", std::process::id())
}

#[test]
fn a_supervisor_raises_its_limit_of_open_files() {
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
    let spec = TopicSpec { notification: Notification::On, ..TopicSpec::default() };
    bus.create::<FrameHeader>("camera", &TopicSpec { list_bytes: PIXELS, ..spec }).unwrap();
    bus.create::<Odometry>("odometry", &spec).unwrap();
    bus.create::<MotorCommand>("command", &spec).unwrap();
    let _only = bus.publisher::<MotorCommand>("command").unwrap();
    let answers = bus.subscriber::<Odometry>("odometry").unwrap();
    let mut wait_set = bus.wait_set(&["odometry"]).unwrap();
    let camera = bus.publisher::<FrameHeader>("camera").unwrap();
    let mut child = start("echo", &robot);
    for sequence in 1..=ROUNDS {
        let header = FrameHeader { sequence, width: 640, height: 480, ..Default::default() };
        camera.publish_in_place(&header, PIXELS, |pixels| pixels.fill(sequence as u8)).unwrap();
        let begun = Instant::now();
        let answer = loop {
            wait_set.wait(Duration::from_millis(100)).unwrap();
            if let Some(answer) = answers.receive().unwrap() {
                break *answer.header();
            }
            assert!(begun.elapsed() < TIMEOUT, "no answer to {sequence}");
        };
        assert_eq!((answer.sequence, answer.x), (sequence, (sequence * PIXELS as u64) as f64));
    }
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_running_robot_cannot_be_started_again() {
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
fn a_start_after_a_killed_supervisor_removes_its_files() {
    let robot = robot("killed");
    let mut child = start("supervise", &robot);
    child.kill().unwrap();
    child.wait().unwrap();
    let services = folder(&robot).join("services");
    assert_ne!(std::fs::read_dir(&services).unwrap().count(), 0);
    let bus = Bus::ipc(&robot).unwrap();
    assert_eq!(std::fs::read_dir(&services).map_or(0, Iterator::count), 0);
    bus.create::<MotorCommand>("odometry", &TopicSpec::default()).unwrap();
    bus.publisher::<MotorCommand>("odometry").unwrap();
    drop(bus);
    assert!(!folder(&robot).exists() && !folder(&robot).with_extension("lock").exists());
}

#[test]
fn two_robots_run_side_by_side() {
    let (left, right) = (Bus::ipc(&robot("left")).unwrap(), Bus::ipc(&robot("right")).unwrap());
    assert!(matches!(Bus::ipc(&robot("left")), Err(BusError::AlreadyRunning { .. })));
    for bus in [&left, &right] {
        bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
    }
    let subscriber = right.subscriber::<Odometry>("odometry").unwrap();
    left.publisher::<Odometry>("odometry").unwrap().publish(&Odometry::default(), &[]).unwrap();
    assert!(subscriber.receive().unwrap().is_none());
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
