//! `yamabico run` from outside: exit codes, what is printed, Ctrl-C, and what the disk and the pictures can do to it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Longest wait for a run that was started to get going.
const PATIENCE: Duration = Duration::from_secs(60);
/// A robot that is faster than this drives.
const DRIVING_MPS: f64 = 0.05;
/// Farther than the hallway is long.
const NEVER: [&str; 4] = ["--set", "run.goal.x_m=1000", "--set", "run.duration_s=100000"];
const LIVE: [&str; 5] = [NEVER[0], NEVER[1], NEVER[2], NEVER[3], "--live"];

fn await_true(what_is_not: &str, is_there: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_there() {
        assert!(begun.elapsed() < PATIENCE, "{what_is_not}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(name)
}

/// A folder of its own for what a test leaves behind, and a robot name of its own.
struct Place {
    folder: PathBuf,
    robot: String,
}

impl Place {
    fn new(test: &str) -> Place {
        let robot = format!("cli-{}-{test}", std::process::id());
        let folder = std::env::temp_dir().join(format!("yamabico-{robot}"));
        std::fs::create_dir_all(&folder).unwrap();
        Place { folder, robot }
    }

    fn recording(&self) -> PathBuf {
        self.folder.join("run.mcap")
    }

    fn command(&self, task: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yamabico"));
        command.arg("run").arg(config(task)).arg("--out").arg(&self.folder);
        command.arg("--set").arg(format!("robot.name={}", self.robot)).args(arguments);
        command.env("NO_COLOR", "1").stdin(Stdio::null());
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
            // Echo waits for ever where the run has ended in between.
            let mut echo = Command::new("timeout");
            let echo = echo.args(["10", env!("CARGO_BIN_EXE_yamabico"), "topic", "echo", "truth", "--once"]);
            let echo = echo.args(["--json", "--robot", &self.robot]);
            let told: Option<Value> = serde_json::from_slice(&echo.output().unwrap().stdout).ok();
            told.is_some_and(|truth| truth["vx"].as_f64() > Some(DRIVING_MPS))
        });
        running
    }

    /// Speeds of the simulated robot in the recording, m/s, in order.
    fn recorded_speeds(&self) -> Vec<f64> {
        let bytes = std::fs::read(self.recording()).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let truth = messages.filter(|message| message.channel.topic == "truth");
        let speed = |data: &[u8]| serde_json::from_slice::<Value>(data).unwrap()["vx"].as_f64().unwrap();
        truth.map(|message| speed(&message.data)).collect()
    }

    /// The recording shows a robot that drove, and stands at its end.
    fn assert_recorded_to_rest(&self) {
        let speeds = self.recorded_speeds();
        let fastest = speeds.iter().copied().fold(0.0, f64::max);
        assert!(fastest > DRIVING_MPS, "it drove at {fastest} m/s");
        let last = speeds.last().unwrap();
        assert!(last.abs() < 0.01, "it ended at {last} m/s");
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// A run under way; none is left behind.
struct Running(Option<Child>);

impl Running {
    /// Presses Ctrl-C and waits for the end.
    fn interrupt(mut self) -> Ended {
        let child = self.0.take().unwrap();
        let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(told.success());
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

    /// Ended with this code; what was said holds every one of `words`.
    fn assert(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        for word in words {
            assert!(self.out.contains(word) || self.err.contains(word), "no `{word}` in {self:?}");
        }
    }
}

#[test]
fn arrived_is_zero_and_json_is_json() {
    let place = Place::new("arrived");
    let ran = place.run("hallway.toml", &["--set", "run.goal.x_m=0.5", "--json"]);
    ran.assert(0, &[]);
    let json = ran.json();
    assert_eq!((json["end"].as_str(), json["seed"].as_u64()), (Some("arrived"), Some(1)), "{json}");
    assert_eq!((json["unseen"].as_u64(), json["recording"]["missing"].as_u64()), (Some(0), Some(0)));
    assert!(json["recording"]["problem"].is_null() && json["trajectory_problem"].is_null());
    assert!(Path::new(json["trajectory"].as_str().unwrap()).is_file());
    place.assert_recorded_to_rest();
}

#[test]
fn not_arrived_is_one() {
    let place = Place::new("late");
    place.run("hallway.toml", &["--set", "run.duration_s=1"]).assert(1, &["digest"]);
}

#[test]
fn mistakes_are_two_and_nothing_is_opened() {
    let place = Place::new("mistakes");
    for (set, words) in [
        ("behaviors.wall-follower.speed_mps=nan", "speed_mps"),
        ("behaviors.wall-follower.sped_mps=0.2", "speed_mps"),
        ("robot.sensors.front.period_ms=-1", "period_ms"),
        ("run.duration_s=soon", "duration_s"),
    ] {
        place.run("hallway.toml", &["--set", set]).assert(2, &[words, "nothing was opened"]);
    }
    place.run("no-such-task.toml", &[]).assert(2, &["no-such-task.toml"]);
    place.run("hallway.toml", &["--threads", "0"]).assert(2, &["--threads"]);
    assert!(!place.recording().exists());
}

#[test]
fn ctrl_c_ends_a_lockstep_run_at_rest_with_its_table() {
    let place = Place::new("lockstep");
    let running = place.start("hallway.toml", &NEVER);
    // The first seconds of a run are written together.
    await_true("nothing is recorded", || {
        std::fs::metadata(place.recording()).is_ok_and(|file| file.len() > 0)
    });
    running.interrupt().assert(1, &["interrupted", "wall-follower", "digest"]);
    place.assert_recorded_to_rest();
}

#[test]
fn ctrl_c_ends_a_live_run_at_rest_with_its_table() {
    let place = Place::new("live");
    let running = place.start_live();
    running.interrupt().assert(1, &["interrupted", "wall-follower", "digest"]);
    place.assert_recorded_to_rest();
}

#[test]
fn a_robot_that_runs_is_refused_and_runs_on() {
    let place = Place::new("twice");
    let running = place.start_live();
    place.run("hallway.toml", &LIVE).assert(2, &["already running", &place.robot]);
    running.interrupt().assert(1, &["interrupted"]);
    place.assert_recorded_to_rest();
}

#[test]
fn a_full_disk_costs_the_recording_and_not_the_run() {
    let place = Place::new("full");
    let short = ["--set", "run.duration_s=2", "--json"];
    let whole = place.run("hallway.toml", &short).json();
    let ran = place.run("hallway.toml", &[&short[..], &["--record", "/dev/full"]].concat());
    ran.assert(1, &[]);
    let json = ran.json();
    let problem = json["recording"]["problem"].as_str().unwrap();
    assert!(problem.contains("/dev/full broke off") && problem.contains("free some space"), "{problem}");
    assert_eq!(json["digest"], whole["digest"], "the run itself is the same");
}

#[test]
fn a_file_that_may_not_grow_costs_the_recording_and_not_the_run() {
    let place = Place::new("limit");
    let whole = place.command("hallway.toml", &["--set", "run.duration_s=2"]);
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -f 8; exec \"$0\" \"$@\""]).arg(whole.get_program()).args(whole.get_args());
    Ended::of(limited.output().unwrap()).assert(1, &["run.mcap broke off", "free some space", "digest"]);
}

#[test]
fn a_picture_that_cannot_be_written_costs_no_table() {
    let place = Place::new("picture");
    std::fs::create_dir(place.folder.join("trajectory.png")).unwrap();
    let ran = place.run("hallway.toml", &["--set", "run.duration_s=1"]);
    ran.assert(1, &["digest", "run.mcap", "cannot write", "trajectory.png"]);
    assert!(place.recording().is_file());
}

#[test]
fn an_output_folder_that_cannot_be_made_is_told_before_anything_moves() {
    let place = Place::new("folder");
    let file = place.folder.join("file");
    std::fs::write(&file, "").unwrap();
    let ran = place.run("hallway.toml", &["--record", file.join("run.mcap").to_str().unwrap()]);
    ran.assert(2, &["cannot make the folder", "choose another place"]);
    assert!(!ran.out.contains("digest"));
}

/// Runs corridor-photos.toml over these files: name and content.
fn run_photos(place: &Place, files: &[(&str, &[u8])]) -> Ended {
    let photos = place.folder.join("photos");
    std::fs::create_dir_all(&photos).unwrap();
    for (name, bytes) in files {
        std::fs::write(photos.join(name), bytes).unwrap();
    }
    let set = format!("robot.sensors.front.files={}", photos.display());
    place.run("corridor-photos.toml", &["--set", &set])
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let picture = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x ^ y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn pictures_that_are_all_right_are_run_to_their_end() {
    let place = Place::new("photos");
    let good = png(960, 540);
    run_photos(&place, &[("a.png", &good), ("b.png", &good)])
        .assert(0, &["all sensors ended", "wall-follower"]);
}

#[test]
fn pictures_that_cannot_be_shown_are_named_with_what_to_do() {
    let good = png(960, 540);
    let cases: [(&str, &[u8], i32, [&str; 2]); 5] = [
        ("small", &png(96, 54), 2, ["is 96x54, but `intrinsics` says 960x540", "change one of them"]),
        ("text", b"This is no picture.", 2, ["is neither a PNG nor a JPEG file", "convert it"]),
        ("empty", b"", 2, ["is neither a PNG nor a JPEG file", "convert it"]),
        ("head", &good[..20], 2, ["is cut short", "copy it again"]),
        ("body", &good[..good.len() / 2], 2, ["is cut short", "copy it again"]),
    ];
    for (name, bytes, code, words) in cases {
        let place = Place::new(name);
        let ran = run_photos(&place, &[("a.png", &good), ("b.png", bytes)]);
        ran.assert(code, &["b.png", words[0], words[1]]);
        assert!(!ran.out.contains("digest"), "{ran:?}");
    }
}

#[test]
fn a_folder_without_pictures_or_none_at_all_is_told() {
    let place = Place::new("no-photos");
    run_photos(&place, &[("notes.txt", b"")]).assert(2, &["photos has no .png, .jpg or .jpeg file"]);
    let place = Place::new("no-folder");
    let set = format!("robot.sensors.front.files={}/none", place.folder.display());
    place
        .run("corridor-photos.toml", &["--set", &set])
        .assert(2, &["there is no folder or file", "none", "give a folder"]);
}
