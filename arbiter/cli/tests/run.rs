//! `yamabico run`: exit codes, output, Ctrl-C, full disks and broken images.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;
use yamabico_testkit::config;

use crate::program::{TestFolder, await_true, binary, yamabico};

/// Speed above which a robot counts as driving, m/s.
const DRIVING_MPS: f64 = 0.05;
/// A goal behind the wall of the hallway: the run never ends by itself.
const NEVER: [&str; 4] = ["--set", "run.goal.y_m=15", "--set", "run.duration_s=100000"];
const LIVE: [&str; 5] = [NEVER[0], NEVER[1], NEVER[2], NEVER[3], "--live"];

/// An output folder and a robot name for one test.
struct Setup {
    folder: TestFolder,
    robot: String,
}

impl Setup {
    fn new(test: &str) -> Setup {
        let robot = format!("cli-{}-{test}", std::process::id());
        Setup { folder: TestFolder::new(&format!("run-{test}")), robot }
    }

    fn recording(&self) -> PathBuf {
        self.folder.file("run.mcap")
    }

    fn command(&self, task: &str, arguments: &[&str]) -> Command {
        let mut command = yamabico();
        command.arg("run").arg(config(task)).arg("--out").arg(self.folder.path());
        command.arg("--set").arg(format!("robot.name={}", self.robot)).args(arguments);
        command
    }

    fn run(&self, task: &str, arguments: &[&str]) -> Ended {
        Ended::of(self.command(task, arguments).output().unwrap())
    }

    /// Starts a run.
    fn start(&self, task: &str, arguments: &[&str]) -> Running {
        let mut command = self.command(task, arguments);
        Running(Some(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()))
    }

    /// Starts a live run, and returns once the robot drives.
    fn start_live(&self) -> Running {
        let running = self.start("hallway.toml", &LIVE);
        await_true("the robot does not drive", || {
            // `topic echo` would wait forever if the run had ended in between.
            let mut echo = Command::new("timeout");
            let echo = echo.arg("10").arg(binary()).args(["topic", "echo", "truth", "--once"]);
            let echo = echo.args(["--json", "--robot", &self.robot]);
            let truth: Option<Value> = serde_json::from_slice(&echo.output().unwrap().stdout).ok();
            truth.is_some_and(|truth| truth["vx"].as_f64() > Some(DRIVING_MPS))
        });
        running
    }

    /// Speeds of the simulated robot in the recording, m/s, oldest first.
    fn recorded_speeds(&self) -> Vec<f64> {
        let bytes = std::fs::read(self.recording()).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let truth = messages.filter(|message| message.channel.topic == "truth");
        let speed = |data: &[u8]| serde_json::from_slice::<Value>(data).unwrap()["vx"].as_f64().unwrap();
        truth.map(|message| speed(&message.data)).collect()
    }

    /// Asserts that the recorded robot drove, and stopped before the end.
    fn assert_recorded_to_rest(&self) {
        let speeds = self.recorded_speeds();
        let fastest = speeds.iter().copied().fold(0.0, f64::max);
        assert!(fastest > DRIVING_MPS, "the top speed was {fastest} m/s");
        let last = speeds.last().unwrap();
        assert!(last.abs() < 0.01, "the last speed is {last} m/s");
    }
}

/// A run in progress, killed when dropped.
struct Running(Option<Child>);

impl Running {
    /// Presses Ctrl-C and waits for the end.
    fn interrupt(mut self) -> Ended {
        let child = self.0.take().unwrap();
        let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        Ended::of(child.wait_with_output().unwrap())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            let _ = child.kill().and_then(|()| child.wait());
        }
    }
}

#[derive(Debug)]
struct Ended {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Ended {
    fn of(output: Output) -> Ended {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Ended { code: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) }
    }

    fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    /// Asserts the exit code, and that the printed text contains each of `parts`.
    fn assert(&self, code: i32, parts: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        for part in parts {
            assert!(self.out.contains(part) || self.err.contains(part), "`{part}` is missing in {self:?}");
        }
    }
}

#[test]
fn arrived_is_zero_and_json_is_json() {
    let setup = Setup::new("arrived");
    let ran = setup.run("hallway.toml", &["--set", "run.goal.x_m=0.5", "--json"]);
    ran.assert(0, &[]);
    let json = ran.json();
    assert_eq!((json["end"].as_str(), json["seed"].as_u64()), (Some("arrived"), Some(1)), "{json}");
    assert_eq!((json["lost_messages"].as_u64(), json["recording"]["missing"].as_u64()), (Some(0), Some(0)));
    assert!(json["recording"]["problem"].is_null() && json["trajectory_problem"].is_null());
    assert!(Path::new(json["trajectory"].as_str().unwrap()).is_file());
    setup.assert_recorded_to_rest();
}

#[test]
fn not_arrived_is_one() {
    let setup = Setup::new("late");
    setup.run("hallway.toml", &["--set", "run.duration_s=1"]).assert(1, &["digest"]);
}

#[test]
fn configuration_errors_are_two_and_nothing_is_opened() {
    let setup = Setup::new("mistakes");
    for (set, part) in [
        ("behaviors.wall-follower.speed_mps=nan", "speed_mps"),
        ("behaviors.wall-follower.sped_mps=0.2", "speed_mps"),
        ("robot.sensors.front.period_ms=-1", "period_ms"),
        ("run.duration_s=soon", "duration_s"),
    ] {
        setup.run("hallway.toml", &["--set", set]).assert(2, &[part, "nothing was opened"]);
    }
    setup.run("no-such-task.toml", &[]).assert(2, &["no-such-task.toml"]);
    setup.run("hallway.toml", &["--threads", "0"]).assert(2, &["--threads"]);
    assert!(!setup.recording().exists());
}

#[test]
fn ctrl_c_ends_a_lockstep_run_at_rest_with_its_table() {
    let setup = Setup::new("lockstep");
    let running = setup.start("hallway.toml", &NEVER);
    // The files of the task come first, then the first seconds of the run together.
    await_true("nothing is recorded", || {
        std::fs::metadata(setup.recording()).is_ok_and(|file| file.len() > 1_000_000)
    });
    running.interrupt().assert(1, &["interrupted", "wall-follower", "digest"]);
    setup.assert_recorded_to_rest();
}

#[test]
fn ctrl_c_ends_a_live_run_at_rest_with_its_table() {
    let setup = Setup::new("live");
    let running = setup.start_live();
    running.interrupt().assert(1, &["interrupted", "wall-follower", "digest"]);
    setup.assert_recorded_to_rest();
}

#[test]
fn a_second_run_of_a_running_robot_is_refused() {
    let setup = Setup::new("twice");
    let running = setup.start_live();
    setup.run("hallway.toml", &LIVE).assert(2, &["already running", &setup.robot]);
    running.interrupt().assert(1, &["interrupted"]);
    setup.assert_recorded_to_rest();
}

#[test]
fn a_full_disk_ends_the_recording_but_not_the_run() {
    let setup = Setup::new("full");
    let short = ["--set", "run.duration_s=2", "--json"];
    let whole = setup.run("hallway.toml", &short).json();
    let ran = setup.run("hallway.toml", &[&short[..], &["--record", "/dev/full"]].concat());
    ran.assert(1, &[]);
    let json = ran.json();
    let problem = json["recording"]["problem"].as_str().unwrap();
    assert!(problem.contains("/dev/full failed") && problem.contains("free some space"), "{problem}");
    assert_eq!(json["digest"], whole["digest"], "the run itself is the same");
}

#[test]
fn a_file_size_limit_ends_the_recording_but_not_the_run() {
    let setup = Setup::new("limit");
    let whole = setup.command("hallway.toml", &["--set", "run.duration_s=2"]);
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -f 8; exec \"$0\" \"$@\""]).arg(whole.get_program()).args(whole.get_args());
    Ended::of(limited.output().unwrap()).assert(1, &["run.mcap failed", "free some space", "digest"]);
}

#[test]
fn without_its_trajectory_plot_a_run_still_has_its_table() {
    let setup = Setup::new("trajectory");
    std::fs::create_dir(setup.folder.file("trajectory.png")).unwrap();
    let ran = setup.run("hallway.toml", &["--set", "run.duration_s=1"]);
    ran.assert(1, &["digest", "run.mcap", "cannot write", "trajectory.png"]);
    assert!(setup.recording().is_file());
}

#[test]
fn an_output_folder_that_cannot_be_created_is_reported_before_the_run() {
    let setup = Setup::new("folder");
    let file = setup.folder.file("file");
    std::fs::write(&file, "").unwrap();
    let ran = setup.run("hallway.toml", &["--record", file.join("run.mcap").to_str().unwrap()]);
    ran.assert(2, &["create the folder", "choose another"]);
    assert!(!ran.out.contains("digest"));
}

/// Runs corridor-photos.toml on these files, each a name and its content.
fn run_photos(setup: &Setup, files: &[(&str, &[u8])]) -> Ended {
    let photos = setup.folder.file("photos");
    std::fs::create_dir_all(&photos).unwrap();
    for (name, bytes) in files {
        std::fs::write(photos.join(name), bytes).unwrap();
    }
    let set = format!("robot.sensors.front.files={}", photos.display());
    setup.run("corridor-photos.toml", &["--set", &set])
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let image = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x ^ y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn a_run_on_images_ends_with_the_last_image() {
    let setup = Setup::new("photos");
    let good = png(960, 540);
    run_photos(&setup, &[("a.png", &good), ("b.png", &good)])
        .assert(0, &["all sensors ended", "wall-follower"]);
}

#[test]
fn broken_images_are_named_with_a_remedy() {
    let good = png(960, 540);
    let cases: [(&str, &[u8], i32, [&str; 2]); 5] = [
        ("small", &png(96, 54), 2, ["has 96x54 pixels, but `intrinsics` has 960x540", "correct one of them"]),
        ("text", b"This is no picture.", 2, ["is neither a PNG nor a JPEG file", "convert or remove it"]),
        ("empty", b"", 2, ["is neither a PNG nor a JPEG file", "convert or remove it"]),
        ("head", &good[..20], 2, ["is truncated", "copy it again"]),
        ("body", &good[..good.len() / 2], 2, ["is truncated", "copy it again"]),
    ];
    for (name, bytes, code, words) in cases {
        let setup = Setup::new(name);
        let ran = run_photos(&setup, &[("a.png", &good), ("b.png", bytes)]);
        ran.assert(code, &["b.png", words[0], words[1]]);
        assert!(!ran.out.contains("digest"), "{ran:?}");
    }
}

#[test]
fn a_missing_or_empty_folder_of_images_is_reported() {
    let setup = Setup::new("no-photos");
    run_photos(&setup, &[("notes.txt", b"")]).assert(2, &["photos contains no .png, .jpg or .jpeg file"]);
    let setup = Setup::new("no-folder");
    let set = format!("robot.sensors.front.files={}/none", setup.folder.path().display());
    setup
        .run("corridor-photos.toml", &["--set", &set])
        .assert(2, &["does not exist", "none", "set `files` to a folder"]);
}
