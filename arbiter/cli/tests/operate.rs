//! `yamabico learn thresholds` and `yamabico goto` from outside: what they write, where they send a robot, what they refuse.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;

/// Longest wait for a run that was started to get going.
const PATIENCE: Duration = Duration::from_secs(60);

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(name)
}

/// A folder of its own for what a test leaves behind.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let folder = std::env::temp_dir().join(format!("yamabico-operate-{}-{test}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Folder(folder)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn yamabico() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yamabico"));
    command.env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

/// Ended with this code; what was said holds every one of `words`.
fn assert_ended(ended: &Output, code: i32, words: &[&str]) {
    let said =
        format!("{}{}", String::from_utf8_lossy(&ended.stdout), String::from_utf8_lossy(&ended.stderr));
    assert_eq!(ended.status.code(), Some(code), "{said}");
    for word in words {
        assert!(said.contains(word), "no `{word}` in {said}");
    }
}

fn learn(task: &Path, folder: &Folder, arguments: &[&str]) -> Output {
    let mut command = yamabico();
    command.args(["learn", "thresholds"]).arg(task).arg("--out").arg(folder.file("learned.toml"));
    command.args(arguments).output().unwrap()
}

#[test]
fn a_short_drive_through_the_empty_hallway_teaches_thresholds() {
    let folder = Folder::new("learn");
    let short = [
        "--json",
        "--every",
        "0.5",
        "--set",
        "robot.devices.sim.clutter=\"none\"",
        "--set",
        "run.goal.x_m=1.5",
        "--set",
        "run.duration_s=20",
    ];
    let ended = learn(&config("hallway.toml"), &folder, &short);
    assert_ended(&ended, 0, &[]);
    let json: Value = serde_json::from_slice(&ended.stdout).unwrap();
    let learned = ThresholdTable::read(&folder.file("learned.toml")).unwrap();
    assert_eq!(json["places"].as_array().unwrap().len(), learned.places.len());
    assert_eq!((learned.width, learned.height, learned.regions), (256, 240, 5));
    assert!((2..=5).contains(&learned.places.len()), "{} places in 1.2 m", learned.places.len());
    for place in &learned.places {
        assert!((0.0..=2.0).contains(&place.x_m) && place.y_m.abs() < 0.3, "{place:?}");
        assert!(place.t0 >= 5 && place.recall >= 0.5, "{place:?}");
    }
    let plot = image::open(json["plot"].as_str().unwrap()).unwrap();
    assert!(plot.width() > 400);
}

#[test]
fn what_nothing_can_be_learned_from_is_refused() {
    let folder = Folder::new("refused");
    assert_ended(&learn(&config("no-such-task.toml"), &folder, &[]), 2, &["no-such-task.toml"]);
    let blind = learn(&config("office.toml"), &folder, &[]);
    assert_ended(&blind, 2, &["map-localizer"]);
    assert_ended(&learn(&config("hallway.toml"), &folder, &["--every", "0"]), 2, &["every"]);
    assert!(!folder.file("learned.toml").exists());
}

/// A live run; none is left behind.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill().and_then(|()| self.0.wait());
    }
}

fn goto(robot: &str, file: &Path) -> Output {
    yamabico().arg("goto").arg(file).args(["--robot", robot]).output().unwrap()
}

#[test]
fn a_file_of_goals_sends_a_live_robot_from_one_to_the_next() {
    let folder = Folder::new("goto");
    let robot = format!("goto-{}", std::process::id());
    let goals = folder.file("goals.toml");
    std::fs::write(
        &goals,
        "[[goal]]\nx_m = 0.4\ny_m = 0.0\n[[goal]]\nx_m = 0.8\ny_m = 0.1\ntolerance_m = 0.2\n",
    )
    .unwrap();
    assert_ended(&goto(&robot, &goals), 2, &[&robot]);

    let mut command = yamabico();
    command.arg("run").arg(config("hallway.toml")).arg("--out").arg(&folder.0).arg("--live");
    command.args(["--set", &format!("robot.name={robot}"), "--set", "run.goal.x_m=1000"]);
    command.args(["--set", "behaviors.map-localizer.route=[[0.3, 0.0]]"]);
    command.args(["--set", "robot.devices.sim.clutter=\"none\""]);
    let _running = Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    let begun = Instant::now();
    let ended = loop {
        let ended = goto(&robot, &goals);
        let is_up = ended.status.code() == Some(0);
        if is_up || begun.elapsed() > PATIENCE {
            break ended;
        }
        std::thread::sleep(Duration::from_millis(200));
    };
    assert_ended(&ended, 0, &["arrived (0.4, 0), (0.8, 0.1)"]);

    std::fs::write(&goals, "[[goal]]\nx_m = 0.4\nz_m = 0.0\n").unwrap();
    assert_ended(&goto(&robot, &goals), 2, &["goals.toml", "z_m"]);
}
