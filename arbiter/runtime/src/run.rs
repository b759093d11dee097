//! A whole run: opened, driven to its end, recorded, summed up.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use serde::Serialize;
use yamabico_core::sensor::DeviceError;
use yamabico_host::config::{GoalArea, Overrides, Task};

use crate::execution::{
    BehaviorRecord, End, Fared, Live, Lockstep, Plan, Progress, SeatError, run_lockstep, topics,
};
use crate::record::{McapRecorder, Pace, RecordError, Recorded, Recording, Tap, Tee};
use crate::report::{Ending, ReferenceLine, RunSummary, Spread, SummaryTap, Timing, Trace, write_trajectory};
use crate::supervisor::Program;

/// How a task is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Of everything that is drawn by chance.
    pub seed: u64,
    /// Threads that the behaviors share in lockstep.
    pub threads: usize,
    /// Where the recording goes; none for no recording. Its folder is made where it is missing.
    pub recording: Option<PathBuf>,
    /// In real time instead of as fast as possible.
    pub pace: Pace,
    /// Where `trajectory.png` goes; none for no picture. The folder is made where it is missing.
    pub pictures: Option<PathBuf>,
    /// What was changed in the task, for the record.
    pub overrides: Overrides,
    /// What the processes of plugins run that are to have their own in real time; without it, every plugin gets a thread.
    pub program: Option<Program>,
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
            program: None,
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
    /// A device failed on the way.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

impl RunError {
    /// Whether a device is to blame: it does not open though no key of its table is wrong, or it failed on the way. Else the
    /// task, the robot file or the options are.
    pub fn is_of_a_device(&self) -> bool {
        match self {
            RunError::Device(_) => true,
            RunError::Setup(SeatError::Device { reason, .. }) => reason.key.is_empty(),
            _ => false,
        }
    }
}

/// A run that was made: what became of it, and what it left behind.
#[derive(Debug, Serialize)]
pub struct Ran {
    /// The task's name.
    pub task: String,
    /// Of everything that was drawn by chance.
    pub seed: u64,
    /// Where it was to arrive.
    pub goal: Option<GoalArea>,
    /// Why it ended.
    pub end: End,
    /// The figures.
    #[serde(flatten)]
    pub summary: RunSummary,
    /// Messages whose numbers are missing, because they came too fast or their device passed over them: the figures, the
    /// digest and the recording are without them.
    pub unseen: u64,
    /// The recording, where there is one.
    pub recording: Option<Left>,
    /// The picture of the way, where there is one.
    pub trajectory: Option<PathBuf>,
    /// Why there is no picture of the way, where one was asked for.
    pub trajectory_problem: Option<String>,
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
    /// Pictures and messages that are not in it: unseen, or left out because the disk was too slow or full.
    pub missing: u64,
    /// Why it broke off, where it did.
    pub problem: Option<String>,
}

impl Ran {
    /// Whether the run did what was asked: the goal was reached; without a goal, it went on to its end.
    pub fn is_done(&self) -> bool {
        match self.end {
            End::Arrived => true,
            End::SensorsEnded | End::TimeOver => self.goal.is_none(),
            End::Interrupted => false,
        }
    }
}

impl Left {
    fn of(recorded: Recorded, unseen: u64) -> Left {
        Left {
            missing: unseen + recorded.pictures_dropped + recorded.messages_dropped,
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
/// What a run leaves behind must not cost the run: a recording that breaks off and a picture that cannot be written are told
/// in what is returned.
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
    let recording_folder = options.recording.as_deref().and_then(Path::parent);
    [recording_folder, options.pictures.as_deref()].into_iter().flatten().try_for_each(make_folder)?;
    // An earlier recording is replaced only once everything is open: it may be that of a run that still goes on.
    let mut robot = Opened::open(task, options)?;
    let mut recorder = options.recording.as_deref().map(|path| record(task, options, path)).transpose()?;
    let (mut summary, mut trace) = (SummaryTap::new(ReferenceLine::default()), Trace::default());
    let began = Instant::now();
    let end = {
        let mut taps: Vec<&mut dyn Tap> = vec![&mut summary, &mut trace, tap];
        taps.extend(recorder.as_mut().map(|recorder| recorder as &mut dyn Tap));
        robot.run(task, interrupt, &mut Tee(taps), progress)
    };
    let wall_s = began.elapsed().as_secs_f64();
    let (unseen, walls) = (robot.lost(), robot.walls());
    let facts = [("digest".to_owned(), summary.digest().hex())];
    let recording = recorder.map(|recorder| Left::of(recorder.finish(facts.into()), unseen));
    let end = end?;
    let fared = robot.finish();
    let ending = Ending {
        arrived: end == End::Arrived,
        wall_s,
        timings: fared.behaviors.into_iter().map(|(name, record)| (name, timing(&record))).collect(),
        latencies: fared.latencies,
        tick_lateness: Spread::of(&fared.lateness),
        restarts: fared.restarts,
    };
    let picture = options.pictures.as_deref().map(|folder| folder.join("trajectory.png"));
    let written = picture.as_deref().map(|path| write_trajectory(path, &trace, &walls));
    let trajectory_problem = written.and_then(Result::err).map(|error| error.to_string());
    Ok(Ran {
        task: task.name.clone(),
        seed: options.seed,
        goal: task.run.goal,
        end,
        summary: summary.finish(ending),
        unseen,
        recording,
        trajectory: picture.filter(|_| trajectory_problem.is_none()),
        trajectory_problem,
    })
}

/// A robot at rest with everything open.
enum Opened {
    Lockstep(Box<Lockstep>),
    Live(Box<Live>),
}

impl Opened {
    fn open(task: &Task, options: &Options) -> Result<Opened, SeatError> {
        let plan = Plan::new(task, options.seed);
        Ok(match options.pace {
            Pace::Lockstep => {
                Opened::Lockstep(Box::new(Lockstep::open(plan, task.run.step, options.threads)?))
            }
            Pace::Live => {
                Opened::Live(Box::new(Live::open(plan, &task.robot.robot.name, options.program.clone())?))
            }
        })
    }

    fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        match self {
            Opened::Lockstep(lockstep) => lockstep.walls(),
            Opened::Live(live) => live.walls(),
        }
    }

    fn run(
        &mut self,
        task: &Task,
        interrupt: &AtomicBool,
        tap: &mut dyn Tap,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<End, DeviceError> {
        match self {
            Opened::Lockstep(lockstep) => run_lockstep(lockstep, &task.run, interrupt, tap, progress),
            Opened::Live(live) => live.run(&task.run, interrupt, tap, progress),
        }
    }

    fn lost(&self) -> u64 {
        match self {
            Opened::Lockstep(lockstep) => lockstep.lost(),
            Opened::Live(live) => live.lost(),
        }
    }

    fn finish(self) -> Fared {
        match self {
            Opened::Lockstep(lockstep) => lockstep.finish(),
            Opened::Live(live) => live.finish(),
        }
    }
}

/// `folder` may be empty: the working directory.
fn make_folder(folder: &Path) -> Result<(), RunError> {
    if folder.as_os_str().is_empty() {
        return Ok(());
    }
    std::fs::create_dir_all(folder).map_err(|source| RunError::Folder { folder: folder.to_owned(), source })
}

fn record(task: &Task, options: &Options, path: &Path) -> Result<McapRecorder, RunError> {
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
        panics: record.panics,
    }
}
