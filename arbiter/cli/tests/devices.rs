//! Tasks on the robots with real devices: every task is checked, and one is driven live, with the reference firmware as the base
//! and a program as the camera.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use yamabico_core::message::Stick;
use yamabico_core::time::Time;
use yamabico_runtime::client::RobotClient;
use yamabico_testkit::{config, config_text, workspace};

use crate::program::{TIMEOUT, TestFolder, assert_exit, binary, text, yamabico};

const ROBOTS: [&str; 5] = ["create2", "pi-cart", "turtlebot3", "turtlebot4-ros2", "usb-cart"];

/// Checks a task of this repository on a robot file.
fn check(task: &str, robot: &Path) -> Output {
    let task = config(&format!("{task}.toml"));
    yamabico().arg("check").arg(task).arg("--robot").arg(robot).output().unwrap()
}

#[test]
fn every_robot_takes_the_tasks_as_they_are() {
    let has_ros2 = binary().with_file_name("yamabico-ros2").is_file();
    for robot in ROBOTS {
        if robot.ends_with("ros2") && !has_ros2 {
            println!("skipped {robot}: the program yamabico-ros2 is not built");
            continue;
        }
        for task in ["corridor", "hallway", "office", "teleop"] {
            let checked = check(task, &config(&format!("robots/{robot}.toml")));
            assert!(checked.status.success(), "{task} {robot}: {}", text(&checked));
        }
    }
}

#[test]
fn sensors_of_other_names_are_connected_by_their_kind_and_noted() {
    let folder = TestFolder::new("other-names");
    let robot = folder.file("robot.toml");
    let names = [("front", "eye"), ("wheels", "odometer"), ("sonar", "scanner")];
    let renamed = |text: String, (from, to): (&str, &str)| {
        text.replace(&format!("[sensors.{from}]"), &format!("[sensors.{to}]"))
    };
    std::fs::write(&robot, names.into_iter().fold(config_text("robots/create2.toml"), renamed)).unwrap();
    let notes = ["input `camera` takes `eye`", "input `odometry` takes `odometer`"];
    assert_exit(&check("hallway", &robot), 0, &notes);
    let listed = text(&check("corridor", &robot));
    assert!(!listed.contains("scanner`"), "an input without a name needs no note: {listed}");
}

#[test]
fn a_robot_without_a_required_sensor_is_refused_with_its_file_and_what_it_has() {
    let refused = check("corridor", &config("robots/photo-camera.toml"));
    assert_exit(&refused, 2, &["photo-camera.toml has `front` (Frame)", "add a sensor", "RangeScan"]);
}

#[test]
fn a_missing_port_and_lockstep_are_refused_with_the_remedy() {
    let folder = TestFolder::new("no-port");
    let call = |set: &str| {
        let mut run = yamabico();
        run.arg("run").arg(config("teleop.toml")).arg("--robot").arg(config("robots/pi-cart.toml"));
        run.args(["--set", set, "--out"]).arg(folder.path()).output().unwrap()
    };
    let missing = call("robot.devices.base.port=\"/dev/ttyUSB99\"");
    assert_exit(&missing, 2, &["/dev/ttyUSB99 does not exist", "port"]);
}

/// The firmware on a pseudo terminal.
struct Firmware {
    child: Child,
    /// Speeds of the wheels, counts per second.
    speeds: Arc<Mutex<[i64; 2]>>,
}

impl Firmware {
    /// Compiles and starts it behind the path `port`.
    fn start(folder: &TestFolder, port: &Path) -> Firmware {
        let (sources, program) = (workspace().join("sensors/serial/firmware"), folder.file("firmware"));
        let mut gcc = Command::new("gcc");
        gcc.args(["-std=c99", "-o"]).arg(&program).args([sources.join("robot.c"), sources.join("host.c")]);
        assert!(gcc.status().unwrap().success());
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let mut settings = tcgetattr(&master).unwrap();
        settings.make_raw();
        tcsetattr(&master, OptionalActions::Now, &settings).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        symlink(&name, port).unwrap();
        // Open while the firmware runs: a terminal without its other side ends.
        let _ = File::options().read(true).write(true).open(&name).map(std::mem::forget);
        let line = File::from(master);
        let mut command = Command::new(&program);
        let mut child =
            command.stdin(line.try_clone().unwrap()).stdout(line).stderr(Stdio::piped()).spawn().unwrap();
        let speeds = Arc::new(Mutex::new([0; 2]));
        let (of_thread, log) = (Arc::clone(&speeds), BufReader::new(child.stderr.take().unwrap()));
        std::thread::spawn(move || {
            for line in log.lines().map_while(Result::ok) {
                let mut numbers = line.split(' ').map(|number| number.parse().unwrap());
                *of_thread.lock().unwrap() = [numbers.next().unwrap(), numbers.next().unwrap()];
            }
        });
        Firmware { child, speeds }
    }

    fn speeds(&self) -> [i64; 2] {
        *self.speeds.lock().unwrap()
    }
}

/// A process that ends with its test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Firmware {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_task_drives_the_firmware_and_stops_it_when_the_supervisor_dies() {
    let folder = TestFolder::new("devices");
    let (port, picture) = (folder.file("port"), folder.file("picture.jpg"));
    let firmware = Firmware::start(&folder, &port);
    image::GrayImage::from_pixel(640, 480, image::Luma([120])).save(&picture).unwrap();
    let name = format!("devices-{}", std::process::id());
    let mut run = yamabico();
    run.arg("run").arg(config("teleop.toml")).arg("--live").arg("--robot").arg(config("robots/pi-cart.toml"));
    let loop_of_pictures = format!("while cat {}; do sleep 0.05; done", picture.display());
    for set in [
        format!("robot.name=\"{name}\""),
        format!("robot.devices.base.port=\"{}\"", port.display()),
        "robot.devices.base.counts_per_m=5000".to_owned(),
        format!("robot.sensors.front.command=[\"sh\", \"-c\", \"{loop_of_pictures}\"]"),
        // The firmware has one sonar, which sees a wall a meter ahead. A busy machine must not look like silent sensors.
        "robot.sensors.sonar.azimuths_deg=[0]".to_owned(),
        "robot.sensors.sonar.max_age_ms=3000".to_owned(),
        "behaviors.sonar-halt.stale_ms=2000".to_owned(),
        "robot.devices.base.deadline_ms=20000".to_owned(),
        "robot.devices.camera.deadline_ms=20000".to_owned(),
        "behaviors.teleop.deadline_ms=20000".to_owned(),
    ] {
        run.args(["--set", &set]);
    }
    let run = run.arg("--out").arg(folder.path()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut run = Process(run.spawn().unwrap());

    let begun = Instant::now();
    let client = loop {
        match RobotClient::join(&name) {
            Ok(client) => break client,
            Err(error) => assert!(begun.elapsed() < TIMEOUT, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    let stick = client.stick().unwrap();
    let mut sequence = 0;
    let mut hold_until = |problem: &str, is_done: &dyn Fn() -> bool| {
        let begun = Instant::now();
        while !is_done() {
            assert!(begun.elapsed() < TIMEOUT, "{problem}: {:?}", firmware.speeds());
            sequence += 1;
            let stamp_ns = Time::monotonic_now().0;
            stick.publish(&Stick { stamp_ns, sequence, turn: 0.5, ..Stick::default() }, &[]).unwrap();
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let turns = || firmware.speeds()[0] < -50 && firmware.speeds()[1] > 50;
    hold_until("does not turn", &turns);

    // Killed: no stop command is sent.
    run.0.kill().unwrap();
    let killed = Instant::now();
    while firmware.speeds() != [0, 0] {
        assert!(killed.elapsed() < Duration::from_secs(5), "drives on: {:?}", firmware.speeds());
        std::thread::sleep(Duration::from_millis(5));
    }
    println!("the wheels stand {:.2} s after the supervisor was killed", killed.elapsed().as_secs_f64());
}
