//! The simulator, a recording, and robots on serial lines.

use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use yamabico::plugins::plugins;
use yamabico_core::message::{Command, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_played_devices::create2::Roomba;
use yamabico_played_devices::lidar::Ld19;
use yamabico_played_devices::picture_server::serve;
use yamabico_played_devices::plug::{Device, Plug};
use yamabico_played_devices::turtlebot3::OpenCr;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};
use yamabico_testkit::config;

use super::world::World;
use super::{Reached, TASK, driven_down};
use crate::program::{TIMEOUT, TestFolder, assert_exit, yamabico};

/// The commands of a run.
#[derive(Default)]
struct Commands(Vec<[f64; 2]>);

impl Tap for Commands {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if message.name == Command::NAME {
            let twist = bytemuck::pod_read_unaligned::<Command>(header).twist;
            self.0.push([twist.linear, twist.angular]);
        }
    }
}

/// Runs the task in lockstep on a robot file, or on its own; returns the commands and a summary.
fn in_lockstep(robot: Option<PathBuf>, recording: Option<PathBuf>) -> (Vec<[f64; 2]>, String) {
    let task = load(&config(TASK), &Overrides { robot, set: Vec::new() }, &plugins());
    let task = task.unwrap_or_else(|problems| panic!("{problems}"));
    let options = Options { seed: 1, recording, ..Options::default() };
    let mut commands = Commands::default();
    let result = run(&task, &options, &AtomicBool::new(false), &mut commands, &mut |_| {}).unwrap();
    let contacts = result.summary.contacts.map_or(String::new(), |contacts| format!(", {contacts} contacts"));
    (commands.0, format!("{}, {:.1} m driven{contacts}", result.end.as_str(), result.summary.distance_m))
}

#[test]
fn the_simulator_and_a_recording_of_it_take_the_task() {
    let folder = TestFolder::new("one-task");
    let recording = folder.file("run.mcap");
    let (simulated, outcome) = in_lockstep(None, Some(recording.clone()));
    Reached::of(&simulated).check("simulator", 0.4, &outcome);
    assert!(outcome.starts_with("arrived"), "{outcome}");

    let info = yamabico().arg("info").arg(&recording).arg("--robot-toml").output().unwrap();
    assert_exit(&info, 0, &["driver = \"recording\""]);
    let robot = folder.file("robot.toml");
    std::fs::write(&robot, &info.stdout).unwrap();
    let (replayed, outcome) = in_lockstep(Some(robot), None);
    Reached::of(&replayed).check("recording of it", 0.4, &outcome);
}

/// A process that ends with its test.
struct Run(Child);

impl Run {
    /// Starts the task on a robot file, with changed keys of the robot alone.
    fn start(robot: &str, keys: &[String], folder: &TestFolder) -> Run {
        let mut run = yamabico();
        run.arg("run").arg(config(TASK)).args(["--live", "--no-report", "--no-overlays", "--robot"]);
        run.arg(config(&format!("robots/{robot}.toml"))).arg("--out").arg(folder.path());
        let name = format!("robot.name=\"{robot}-{}\"", std::process::id());
        for key in keys.iter().chain([&name]) {
            assert!(key.starts_with("robot."), "{key} is of the task");
            run.args(["--set", key]);
        }
        let log = std::fs::File::create(folder.file("log")).unwrap();
        Run(run.stdout(Stdio::null()).stderr(log).spawn().unwrap())
    }

    fn is_running(&mut self) -> bool {
        self.0.try_wait().unwrap().is_none()
    }

    /// Interrupts it, like Ctrl-C, and waits for its end.
    fn interrupt(&mut self) {
        let pid = Pid::from_child(&self.0);
        kill_process(pid, Signal::INT).unwrap();
        let begun = Instant::now();
        while self.is_running() {
            assert!(begun.elapsed() < TIMEOUT, "it does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A base in the world: the port in front of it, and its speed and turn rate.
struct Base<D: Device> {
    plug: Arc<Plug<D>>,
    world: World,
    lidar: Plug<Ld19>,
}

impl<D: Device> Base<D> {
    fn new(device: D, camera: &str, twist: impl Fn(&D) -> [f64; 2] + Send + 'static) -> Base<D> {
        let plug = Arc::new(Plug::new(device));
        let of_world = Arc::clone(&plug);
        let world = World::start(camera, move |_, _| twist(&of_world.device()));
        let lidar = Plug::new(Ld19::new(world.ranger()));
        Base { plug, world, lidar }
    }

    /// Drives the task on the robot file `robot`, at most `max_mps` fast.
    fn drive(&self, robot: &str, max_mps: f64, keys: &[String]) {
        let folder = TestFolder::new(robot);
        let port = |device: &str, port: &Path| {
            format!("robot.devices.{device}.port={:?}", port.display().to_string())
        };
        let mut all = vec![port("base", &self.plug.port()), port("lidar", &self.lidar.port())];
        all.extend_from_slice(keys);
        let mut run = Run::start(robot, &all, &folder);
        let outcome = driven_down(&self.world, robot, &mut || run.is_running());
        run.interrupt();
        let stopped = Instant::now();
        while self.world.driven().last() != Some(&[0.0; 2]) {
            assert!(stopped.elapsed() < Duration::from_secs(5), "{robot} drives on");
            std::thread::sleep(Duration::from_millis(20));
        }
        Reached::of(&self.world.driven()).check(robot, max_mps, &outcome);
    }
}

/// Keys of a smaller picture, which a busy machine renders in time, and how the simulator mounts the camera.
fn picture(mount: &str) -> (String, String) {
    let size = "{ width = 320, height = 240, fov_deg = 60 }";
    let camera = format!("period_ms = 100\nlatency_ms = 0\nintrinsics = {size}\nmount = {mount}");
    (camera, format!("robot.sensors.front.intrinsics={size}"))
}

/// Keys that give a busy machine time.
fn patience() -> Vec<String> {
    let ages = ["front", "sonar", "wheels"].map(|sensor| format!("robot.sensors.{sensor}.max_age_ms=2000"));
    let deadlines =
        ["base", "lidar", "camera"].map(|device| format!("robot.devices.{device}.deadline_ms=20000"));
    ages.into_iter().chain(deadlines).collect()
}

#[test]
fn a_create2_with_a_network_camera_and_a_lidar_takes_the_task() {
    const TRACK_M: f64 = 0.235;
    let (camera, size) = picture("{ x_m = 0.05, z_m = 0.4, tilt_deg = 8 }");
    let base = Base::new(Roomba::new(0), &camera, |robot| {
        let [left, right] = robot.speeds;
        [0.5 * (left + right), (right - left) / TRACK_M]
    });
    let url =
        format!("robot.sensors.front.url=\"http://127.0.0.1:{}/\"", serve(Arc::clone(&base.world.picture)));
    base.drive("create2", 0.4, &[patience(), vec![size, url]].concat());
}

#[test]
fn a_turtlebot3_takes_the_task() {
    let (camera, size) = picture("{ x_m = 0.07, z_m = 0.1 }");
    let base = Base::new(OpenCr::new(0), &camera, OpenCr::command);
    // The program in place of rpicam-vid copies the pictures from a socket to its output.
    let port = serve(Arc::clone(&base.world.picture));
    let copy =
        format!("exec 3<>/dev/tcp/127.0.0.1/{port}; printf 'GET / HTTP/1.0\\r\\n\\r\\n' >&3; exec cat <&3");
    let program = format!("robot.sensors.front.command={:?}", ["bash", "-c", copy.as_str()]);
    base.drive("turtlebot3", 0.22, &[patience(), vec![size, program]].concat());
}
