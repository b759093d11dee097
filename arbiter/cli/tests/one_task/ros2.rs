//! A robot on ROS 2, played with rclpy in a network namespace of its own.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};

use yamabico_testkit::config;

use super::world::World;
use super::{Reached, TASK, driven_down};
use crate::program::{TestFolder, binary};

/// Brings up the loopback of a new network namespace, and starts the arguments in it.
const IN_OWN_NETWORK: &str =
    "ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo && exec \"$@\"";

/// Returns the Python with rclpy; prints what is missing if the test cannot run.
fn python() -> Option<PathBuf> {
    let skip = |what: &str| {
        println!("skipped turtlebot4-ros2: {what}");
        None
    };
    let Some(python) = std::env::var_os("YAMABICO_RCLPY") else {
        return skip("YAMABICO_RCLPY names no Python with rclpy");
    };
    if !binary().with_file_name("yamabico-ros2").is_file() {
        return skip("the program yamabico-ros2 is not built: cargo build -p yamabico-ros2 --features dds");
    }
    let namespace = Command::new("unshare").args(["-rn", "sh", "-c", IN_OWN_NETWORK, "sh", "true"]).status();
    if !namespace.is_ok_and(|status| status.success()) {
        return skip("network namespaces are not allowed here");
    }
    Some(python.into())
}

/// The robot and the run on it, which end with the test.
struct Robot(Child);

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(python: &Path, keys: &[&str], log: &Path) -> Child {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/one_task/ros2_robot.py");
    let mut robot = Command::new("unshare");
    robot.args(["-rn", "sh", "-c", IN_OWN_NETWORK, "sh"]).arg(python).arg(script).arg(binary());
    robot.args(["run", "--live", "--no-report", "--no-overlays"]).arg(config(TASK));
    robot
        .arg("--robot")
        .arg(config("robots/turtlebot4-ros2.toml"))
        .arg("--out")
        .arg(log.with_extension("out"));
    for key in keys {
        assert!(key.starts_with("robot."), "{key} is of the task");
        robot.args(["--set", key]);
    }
    robot.env("ROS_DOMAIN_ID", "42").env("NO_COLOR", "1");
    let log = std::fs::File::create(log).unwrap();
    robot.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(log).spawn().unwrap()
}

#[test]
fn a_robot_on_ros2_takes_the_task() {
    let Some(python) = python() else { return };
    let folder = TestFolder::new("ros2");
    let size = "{ width = 320, height = 240, fov_deg = 69 }";
    let name = format!("robot.name=\"ros2-{}\"", std::process::id());
    let intrinsics = format!("robot.sensors.front.intrinsics={size}");
    let keys = [
        &*name,
        &*intrinsics,
        "robot.sensors.front.max_age_ms=2000",
        "robot.sensors.sonar.max_age_ms=2000",
        "robot.sensors.wheels.max_age_ms=2000",
        "robot.sensors.bumpers.max_age_ms=2000",
        "robot.devices.base.deadline_ms=20000",
    ];
    let mut child = start(&python, &keys, &folder.file("log"));
    let (mut input, output) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
    let mut robot = Robot(child);
    let commands = Arc::new(Mutex::new(Vec::new()));
    let of_reader = Arc::clone(&commands);
    let reader = std::thread::spawn(move || {
        for line in output.lines().map_while(Result::ok) {
            let numbers: Vec<f64> = line.split(' ').filter_map(|number| number.parse().ok()).collect();
            if let [speed, turn] = numbers[..] {
                of_reader.lock().unwrap().push([speed, turn]);
            }
        }
    });

    let (newest, mut sent) = (Arc::clone(&commands), 0);
    let camera = format!(
        "period_ms = 100\nlatency_ms = 0\nintrinsics = {size}\nmount = {{ x_m = -0.06, z_m = 0.24 }}"
    );
    let world = World::start(&camera, move |sensed, picture| {
        let twist = newest.lock().unwrap().last().copied().unwrap_or_default();
        let (number, picture) = picture.lock().unwrap().clone();
        let is_new = number != sent;
        sent = number;
        let picture = if is_new { picture } else { Vec::new() };
        // JSON has no infinity.
        let range = |(_, range_m): &(f64, f64)| if range_m.is_finite() { *range_m } else { -1.0 };
        let ranges: Vec<f64> = sensed.ranges.iter().filter(|_| is_new).map(range).collect();
        let first_rad = sensed.ranges.first().map_or(0.0, |(azimuth_rad, _)| *azimuth_rad);
        let sensed = serde_json::json!({
            "pose": sensed.pose, "twist": twist, "ranges": ranges, "first_rad": first_rad, "picture": picture.len(),
        });
        // The robot has ended when this fails.
        let _ =
            writeln!(input, "{sensed}").and_then(|()| input.write_all(&picture)).and_then(|()| input.flush());
        twist
    });
    let log = folder.file("log");
    let outcome = driven_down(&world, "turtlebot4-ros2", &mut || {
        let is_running = robot.0.try_wait().unwrap().is_none();
        assert!(is_running, "{}", std::fs::read_to_string(&log).unwrap_or_default());
        is_running
    });
    // The end of its input ends the robot, which interrupts the run before.
    drop(world);
    let status = robot.0.wait().unwrap();
    assert!(status.success(), "{}", std::fs::read_to_string(&log).unwrap_or_default());
    reader.join().unwrap();
    let commands = commands.lock().unwrap().clone();
    assert_eq!(commands.last(), Some(&[0.0; 2]), "the last command");
    Reached::of(&commands).check("turtlebot4-ros2", 0.3, &outcome);
}
