//! Recordings made and replayed, compared to the byte.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failure here is the result")]

mod live_runs;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use clap::Args;
use serde_json::Value;
use yamabico_live_robot::venv;

use self::live_runs::LiveRun;
use crate::live::program;
use crate::report::{Report, Table, number};

/// Tasks that run in lockstep.
const TASKS: [&str; 11] = [
    "corner",
    "corridor",
    PHOTOS,
    "field",
    "hallway",
    "intersection",
    "localization",
    "mapping",
    "office",
    "room",
    "teleop",
];
/// Task that needs the photographs of the data folder.
const PHOTOS: &str = "corridor-photos";
/// Seeds of each of them.
const SEEDS: [u64; 2] = [1, 2];
/// Task with a behavior in Python, and its seeds in lockstep.
const PYTHON: (&str, [u64; 3]) = ("corridor-python", [1, 2, 3]);

/// Make recordings and replay them: every message of behaviors and arbiter, compared to the byte.
///
/// 40 recordings: every task in lockstep, live runs of the hallway with kills, with requests in their middle and on a busy
/// machine, runs with a behavior in Python, and one with a simulator in Python that owns the clock. The recording of a replay that
/// differs is kept. Needs `cargo build --release` first, and Python and `YAMABICO_DATA` for some: without them these are left out.
#[derive(Args)]
pub struct Arguments {
    /// Maximum duration of a run in lockstep, s; by default that of its task.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Duration of a live run besides its events, s.
    #[arg(long, value_name = "S", default_value_t = 6.0)]
    live_s: f64,
    /// Kills in each live run that has any.
    #[arg(long, default_value_t = 20)]
    kills: usize,
    /// Runs whose name contains this word only.
    #[arg(long, value_name = "WORD", default_value = "")]
    only: String,
}

/// A recording with the outcome of its replay.
struct Replayed {
    name: String,
    what: String,
    /// Standard output of `replay --json`; null if it failed.
    report: Value,
    problem: String,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let bench = Bench {
            program: program()?,
            folder: std::env::temp_dir().join(format!("yamabico-replays-{}", std::process::id())),
        };
        std::fs::create_dir_all(&bench.folder).map_err(|error| error.to_string())?;
        let python = venv::interpreter(&bench.program);
        let mut replayed = Vec::new();
        let has_photos = std::env::var_os("YAMABICO_DATA").is_some();
        let is_wanted = |name: &str| name.contains(&self.only) && (has_photos || !name.contains(PHOTOS));
        let lockstep = TASKS.iter().flat_map(|task| SEEDS.map(|seed| (*task, seed, None)));
        let in_python =
            python.iter().flat_map(|python| PYTHON.1.map(|seed| (PYTHON.0, seed, Some(python.as_path()))));
        for (task, seed, python) in lockstep.chain(in_python) {
            let name = format!("{task}, seed {seed}");
            if is_wanted(&name) {
                replayed.push(self.in_lockstep(&bench, name, task, seed, python));
            }
        }
        for run in LiveRun::all(self.kills) {
            if !is_wanted(run.name) || (run.needs_python && python.is_none()) {
                continue;
            }
            let file = bench.folder.join("live.mcap");
            let what = run.record(&bench.program, python.as_deref(), self.live_s, &file);
            let report = bench.replay(&file, python.as_deref());
            replayed.push(bench.judge(run.name.to_owned(), what, report, &file));
        }
        Ok(table(&replayed))
    }

    fn in_lockstep(
        &self,
        bench: &Bench,
        name: String,
        task: &str,
        seed: u64,
        python: Option<&Path>,
    ) -> Replayed {
        let file = bench.folder.join(format!("{task}-{seed}.mcap"));
        let mut run = bench.command(python);
        run.arg("run")
            .arg(yamabico_testkit::config(&format!("{task}.toml")))
            .args(["--seed", &seed.to_string()]);
        run.args(["--json", "--no-report", "--overwrite", "--out"])
            .arg(&bench.folder)
            .arg("--record")
            .arg(&file);
        if task == PHOTOS
            && let Some(data) = std::env::var_os("YAMABICO_DATA")
        {
            let images = Path::new(&data).join("corridor_drive/images");
            run.args(["--set", &format!("robot.sensors.front.files={:?}", images.display().to_string())]);
        }
        if let Some(seconds) = self.seconds {
            run.args(["--set", &format!("run.duration_s={seconds}")]);
        }
        let ran = run.output().expect("the program starts");
        let result: Value = serde_json::from_slice(&ran.stdout).unwrap_or_default();
        let what = format!("lockstep, {}", result["end"].as_str().unwrap_or("failed"));
        let report = bench.replay(&file, python);
        bench.judge(name, what, report, &file)
    }
}

/// Place where recordings are made.
struct Bench {
    program: PathBuf,
    folder: PathBuf,
}

impl Bench {
    /// A call of the program, with the folder of this interpreter first in PATH.
    fn command(&self, python: Option<&Path>) -> Command {
        let mut command = Command::new(&self.program);
        if let Some(folder) = python.and_then(Path::parent) {
            command.env("PATH", live_runs::path_with(folder));
        }
        command.stdin(Stdio::null()).env("NO_COLOR", "1");
        command
    }

    fn replay(&self, file: &Path, python: Option<&Path>) -> Output {
        let mut replay = self.command(python);
        replay.arg("replay").arg(file).arg("--json").args(python.map(|_| "--programs"));
        replay.output().expect("the program starts")
    }

    /// Reads the outcome of a replay, and removes the recording if it is as it must be.
    fn judge(&self, name: String, what: String, replay: Output, file: &Path) -> Replayed {
        let report: Value = serde_json::from_slice(&replay.stdout).unwrap_or_default();
        let notes = report["notes"].as_array().cloned().unwrap_or_default();
        let early = notes.iter().filter_map(Value::as_str).filter(|note| note.contains("replayed up to"));
        let early: Vec<&str> = early.collect();
        let problem = match (replay.status.success(), &report["first"]) {
            (_, first) if !first.is_null() => {
                format!("{} at {} s: {}", first["topic"], first["time_s"], first["what"])
            }
            (false, _) => String::from_utf8_lossy(&replay.stderr).trim().to_owned(),
            (true, _) => early.join("; "),
        };
        if problem.is_empty() {
            let _ = std::fs::remove_file(file);
        } else {
            eprintln!("{name}: {problem}");
            let kept = self.folder.join(format!("kept-{}.mcap", name.replace([',', ' '], "-")));
            let _ = std::fs::rename(file, &kept);
            eprintln!("  kept as {}", kept.display());
        }
        eprintln!("{name}: {what}: {} messages", compared(&report));
        Replayed { name, what, report, problem }
    }
}

fn compared(report: &Value) -> u64 {
    sum(report, "compared")
}

/// Sum of a count over all topics.
fn sum(report: &Value, key: &str) -> u64 {
    let topics = report["topics"].as_object();
    topics.map_or(0, |topics| topics.values().filter_map(|topic| topic[key].as_u64()).sum())
}

fn table(replayed: &[Replayed]) -> Report {
    let mut rows = Table::new(
        "Replays",
        &[
            "recording",
            "made",
            "time, s",
            "messages compared",
            "different",
            "missing",
            "extra",
            "x real time",
            "problem",
        ],
    );
    let (mut messages, mut failed) = (0, 0);
    for Replayed { name, what, report, problem } in replayed {
        let (seconds, wall_s) =
            (report["seconds"].as_f64().unwrap_or(0.0), report["wall_s"].as_f64().unwrap_or(0.0));
        rows.row([
            name.as_str().into(),
            what.as_str().into(),
            number(seconds, 1),
            compared(report).into(),
            sum(report, "different").into(),
            sum(report, "missing").into(),
            sum(report, "extra").into(),
            number(seconds / wall_s.max(1e-9), 1),
            problem.as_str().into(),
        ]);
        messages += compared(report);
        failed += usize::from(!problem.is_empty() || compared(report) == 0);
    }
    let mut summary = Table::new("Summary", &["recordings", "equal to the byte", "messages compared"]);
    summary.row([replayed.len().into(), (replayed.len() - failed).into(), messages.into()]);
    Report::new([rows, summary])
        .require(failed == 0, format!("{failed} recordings do not replay to the byte"))
}
