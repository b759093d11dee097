//! Recordings that end before their run, by a kill or for want of space: what they hold is whole, and replays.

use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_runtime::record::{Tap, play};
use yamabico_testkit::config;

use crate::program::{TestFolder, assert_exit, await_true, binary, text, yamabico};

/// Maximum age of the newest recorded message when the run is killed, s.
const MAX_LOST_S: f64 = 1.0;

/// Newest stamp of a recording.
#[derive(Default)]
struct Newest(Time);

impl Tap for Newest {
    fn message(&mut self, _: &str, _: &MessageType, time: Time, _: &[u8], _: &[u8]) {
        self.0 = self.0.max(time);
    }
}

#[test]
fn a_killed_live_run_loses_at_most_its_last_second() {
    let folder = TestFolder::new("broken-killed");
    let file = folder.file("run.mcap");
    let robot = format!("robot.name=broken-{}", std::process::id());
    let mut run = yamabico();
    run.args(["run", "--live"]).arg(config("corridor.toml")).arg("--out").arg(folder.path());
    run.args(["--set", &robot, "--set", "run.duration_s=100000"]);
    let mut run = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    await_true("nothing is recorded", || file.metadata().is_ok_and(|data| data.len() > 1 << 18));
    std::thread::sleep(Duration::from_secs(2));
    let killed = Time::monotonic_now();
    run.kill().unwrap();
    run.wait().unwrap();
    let mut newest = Newest::default();
    let played = play(&file, &mut newest).unwrap();
    let lost_s = killed.seconds_after(newest.0);
    println!("the newest of {} messages is {lost_s:.3} s older than the kill", played.messages);
    assert!(played.broken_off.is_some() && lost_s < MAX_LOST_S, "{lost_s} s are lost");
    let replayed = yamabico().arg("replay").arg(&file).output().unwrap();
    assert_exit(&replayed, 0, &["equal to the byte", "the recording breaks off"]);
}

#[test]
fn a_file_size_limit_ends_the_recording_and_not_the_run() {
    let folder = TestFolder::new("broken-limit");
    // Blocks of 512 bytes.
    let limited = format!("ulimit -f 3000; exec '{}' \"$@\"", binary().display());
    let mut run = Command::new("sh");
    run.args(["-c", &limited, "sh", "run"]).arg(config("corridor.toml")).args(["--json", "--no-report"]);
    run.arg("--out").arg(folder.path()).args(["--set", "run.duration_s=6"]).stdin(Stdio::null());
    let ran = run.output().unwrap();
    assert_eq!(ran.status.code(), Some(1), "{}", text(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert_eq!(report["end"], "time-over", "{report}");
    assert!(report["time_s"].as_f64() > Some(5.9), "{report}");
    let problem = report["recording"]["problem"].as_str().unwrap();
    assert!(problem.contains("free some space"), "{problem}");
    assert!(report["recording"]["missing"].as_u64() > Some(100), "{report}");
    let replayed = yamabico().arg("replay").arg(folder.file("run.mcap")).output().unwrap();
    assert_exit(&replayed, 0, &["equal to the byte", "the recording breaks off"]);
}
