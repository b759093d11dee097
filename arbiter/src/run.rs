//! A whole run: opened, driven to its end, recorded, summed up.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use serde::Serialize;
use yamabico_core::config::{Overrides, Task};
use yamabico_core::sensor::DeviceError;

use crate::execution::{
    BehaviorRecord, End, Live, Lockstep, Plan, Progress, SeatError, run_lockstep, topics,
};
use crate::record::{McapRecorder, Pace, RecordError, Recorded, Recording, Tap, Tee};
use crate::report::{
    Ending, PictureError, ReferenceLine, RunSummary, SummaryTap, Timing, Trace, write_trajectory,
};

/// How a task is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Of everything that is drawn by chance.
    pub seed: u64,
    /// Threads that the behaviours share in lockstep.
    pub threads: usize,
    /// Where the recording goes; none for no recording. Its folder is made where it is missing.
    pub recording: Option<PathBuf>,
    /// In real time instead of as fast as possible.
    pub pace: Pace,
    /// Where `trajectory.png` goes; none for no picture. The folder is made where it is missing.
    pub pictures: Option<PathBuf>,
    /// What was changed in the task, for the record.
    pub overrides: Overrides,
}

impl Default for Options {
    /// Seed 1, lockstep on one thread, no recording, no picture, nothing changed.
    fn default() -> Options {
        let pace = Pace::Lockstep;
        Options {
            seed: 1,
            threads: 1,
            pace,
            recording: None,
            pictures: None,
            overrides: Overrides::default(),
        }
    }
}

/// A run that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Something could not be opened; nothing moved.
    #[error(transparent)]
    Setup(#[from] SeatError),
    /// The recording cannot be begun; nothing moved.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The output folder cannot be made; nothing moved.
    #[error("cannot make the folder {}: {source}; choose another place", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The picture of the way cannot be made; the run itself went to its end.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A device failed on the way.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// A run that was made: what became of it, and what it left behind.
#[derive(Debug, Serialize)]
pub struct Ran {
    /// The task's name.
    pub task: String,
    /// Of everything that was drawn by chance.
    pub seed: u64,
    /// Why it ended.
    pub end: End,
    /// The figures.
    #[serde(flatten)]
    pub summary: RunSummary,
    /// The recording, where there is one.
    pub recording: Option<Left>,
    /// The picture of the way, where there is one.
    pub trajectory: Option<PathBuf>,
}

/// A recording that was left behind.
#[derive(Debug, Serialize)]
pub struct Left {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Messages in it on each topic of the bus.
    pub messages: BTreeMap<String, u64>,
    /// Pictures and messages that are not in it because the disk was too slow or full.
    pub missing: u64,
    /// Why it broke off, where it did.
    pub problem: Option<String>,
}

impl Ran {
    /// Whether the run did what was asked: the goal was reached, or there was none.
    pub fn is_done(&self) -> bool {
        matches!(self.end, End::Arrived | End::SensorsEnded)
    }
}

impl From<Recorded> for Left {
    fn from(recorded: Recorded) -> Left {
        Left {
            missing: recorded.pictures_dropped + recorded.messages_dropped,
            problem: recorded.error.map(|error| error.to_string()),
            path: recorded.path,
            bytes: recorded.bytes,
            messages: recorded.messages,
        }
    }
}

/// Runs `task` to its end; `tap` is shown every message, `progress` every step. `interrupt`, once set, stops the robot and
/// ends the run.
///
/// # Errors
/// Something that does not open, or a device that fails on the way.
pub fn run(
    task: &Task,
    options: &Options,
    interrupt: &AtomicBool,
    tap: &mut dyn Tap,
    progress: &mut dyn FnMut(Progress),
) -> Result<Ran, RunError> {
    let mut recorder = options.recording.as_deref().map(|path| record(task, options, path)).transpose()?;
    let (mut summary, mut trace) = (SummaryTap::new(ReferenceLine::default()), Trace::default());
    let began = Instant::now();
    let outcome = {
        let mut taps: Vec<&mut dyn Tap> = vec![&mut summary, &mut trace, tap];
        taps.extend(recorder.as_mut().map(|recorder| recorder as &mut dyn Tap));
        execute(task, options, interrupt, &mut Tee(taps), progress)
    };
    let wall_s = began.elapsed().as_secs_f64();
    let digest = summary.digest().hex();
    let left = recorder.map(|recorder| recorder.finish([("digest".to_owned(), digest)].into()).into());
    let Execution { end, records, walls } = outcome?;
    let timings = records.into_iter().map(|(name, record)| (name, timing(&record))).collect();
    let summary = summary.finish(Ending { arrived: end == End::Arrived, wall_s, timings });
    let trajectory = options.pictures.as_deref().map(|folder| picture(folder, &trace, &walls)).transpose()?;
    Ok(Ran { task: task.name.clone(), seed: options.seed, end, summary, recording: left, trajectory })
}

struct Execution {
    end: End,
    records: Vec<(String, BehaviorRecord)>,
    walls: Vec<Vec<[f64; 2]>>,
}

fn execute(
    task: &Task,
    options: &Options,
    interrupt: &AtomicBool,
    tap: &mut dyn Tap,
    progress: &mut dyn FnMut(Progress),
) -> Result<Execution, RunError> {
    let plan = Plan::new(task, options.seed);
    match options.pace {
        Pace::Lockstep => {
            let mut lockstep = Lockstep::open(plan, task.run.step, options.threads)?;
            let walls = lockstep.walls();
            let end = run_lockstep(&mut lockstep, &task.run, interrupt, tap, progress)?;
            Ok(Execution { end, records: lockstep.finish(), walls })
        }
        Pace::Live => {
            let mut live = Live::start(plan, &task.robot.robot.name)?;
            let walls = live.walls();
            let (end, records) = live.run(&task.run, interrupt, tap, progress)?;
            Ok(Execution { end, records, walls })
        }
    }
}

fn picture(folder: &Path, trace: &Trace, walls: &[Vec<[f64; 2]>]) -> Result<PathBuf, RunError> {
    make_folder(folder)?;
    let path = folder.join("trajectory.png");
    write_trajectory(&path, trace, walls)?;
    Ok(path)
}

fn make_folder(folder: &Path) -> Result<(), RunError> {
    std::fs::create_dir_all(folder).map_err(|source| RunError::Folder { folder: folder.to_owned(), source })
}

fn record(task: &Task, options: &Options, path: &Path) -> Result<McapRecorder, RunError> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        make_folder(folder)?;
    }
    let files = [&task.path, &task.robot.path].into_iter();
    let text =
        |path: &PathBuf| (path.display().to_string(), std::fs::read_to_string(path).unwrap_or_default());
    let sensors = task.robot.sensors.iter();
    let facts = [
        ("seed", options.seed.to_string()),
        ("overrides", options.overrides.set.join("\n")),
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let recording = Recording {
        robot: task.robot.robot.clone(),
        sensors: sensors.map(|sensor| (topics::sensor(&sensor.part.name), sensor.info.clone())).collect(),
        files: files.map(text).collect(),
        facts: facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect(),
        ..Recording::new(path, options.pace)
    };
    Ok(McapRecorder::create(recording)?)
}

fn timing(record: &BehaviorRecord) -> Timing {
    let micros = |duration: Duration| duration.as_secs_f64() * 1e6;
    Timing {
        calls: record.calls.count(),
        p50_us: micros(record.calls.quantile(0.5)),
        p99_us: micros(record.calls.quantile(0.99)),
        overruns: record.overruns,
    }
}
