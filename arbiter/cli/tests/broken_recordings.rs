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

/// Memory that a command may reserve, kB: less than the 4 GB of the lie, more than the shared memory of a replay.
const MAX_MEMORY_KB: u32 = 3 << 20;

#[test]
fn a_length_that_lies_reserves_no_memory() {
    let folder = TestFolder::new("broken-lengths");
    let file = folder.file("run.mcap");
    let mut run = yamabico();
    run.args(["run", "--no-report", "--set", "run.duration_s=3"]).arg(config("corridor.toml"));
    assert_exit(&run.arg("--out").arg(folder.path()).output().unwrap(), 1, &[]);
    let whole = std::fs::read(&file).unwrap();
    let mut places = yamabico_mcap::Records::open(&file).unwrap();
    let mut chunks = Vec::new();
    while let Some(record) = places.next().unwrap() {
        chunks.extend((record.opcode == yamabico_mcap::Opcode::CHUNK).then_some(record.at as usize));
    }
    // A schema whose name claims 4 GB, before the first message and after it; and a file that a fuzzer found.
    let lie = [&[3, 10, 0, 0, 0, 0, 0, 0, 0, 99, 0][..], &u32::MAX.to_le_bytes(), &[0; 4]].concat();
    let with_lie = |at: usize| [&whole[..at], &lie, &whole[at..]].concat();
    let seed = yamabico_testkit::workspace().join("sensors/recording/tests/seeds/mcap/lengths.mcap");
    let commands: [&[&str]; 9] = [
        &["info"],
        &["info", "--robot-toml"],
        &["replay"],
        &["replay", "--decisions"],
        &["why"],
        &["report"],
        &["repair"],
        &["topic", "echo", "decision", "-n", "1", "--recording"],
        &["view", "--port", "0", "--no-foxglove"],
    ];
    let files = [
        (with_lie(chunks[0]), 2),
        (with_lie(chunks[chunks.len() - 1]), 0),
        (std::fs::read(seed).unwrap(), 2),
    ];
    for (index, (bytes, replayed)) in files.into_iter().enumerate() {
        // A view of what can be read goes on until Ctrl-C.
        for command in commands.into_iter().filter(|command| index == 2 || command[0] != "view") {
            std::fs::write(&file, &bytes).unwrap();
            let limited = format!("ulimit -v {MAX_MEMORY_KB}; exec '{}' \"$@\"", binary().display());
            let mut limited_command = Command::new("sh");
            limited_command.args(["-c", &limited, "sh"]).args(command).arg(&file).stdin(Stdio::null());
            let output = limited_command.current_dir(folder.path()).output().unwrap();
            let (said, code) = (text(&output), output.status.code());
            println!("{command:?}: {code:?}: {}", said.trim_end().lines().last().unwrap_or_default());
            assert!(
                matches!(code, Some(0..=3)) && !said.contains("panicked"),
                "{command:?}: {code:?}: {said}"
            );
            assert!(command[0] != "replay" || code == Some(replayed), "{command:?}: {code:?}: {said}");
        }
    }
}
