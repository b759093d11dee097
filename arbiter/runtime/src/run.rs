//! A whole run: opened, run to its end, recorded and summarized.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use serde::Serialize;
use yamabico_core::sensor::DeviceError;
use yamabico_host::config::{GoalArea, Overrides, Task};

use crate::execution::{
    CallStats, HostError, Live, Lockstep, Overlays, Plan, Progress, RunEnd, RunStats, run_lockstep, sensors,
};
use crate::record::{Identity, McapRecorder, Pace, RecordError, Recording, RecordingResult, Tap, Tee};
use crate::report::{
    ReferenceLine, RunFacts, RunSummary, Spread, SummaryTap, Timing, Trace, write_report, write_trajectory,
};
use crate::supervisor::Program;

/// Options of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Seed of every random number.
    pub seed: u64,
    /// Number of threads that run the behaviors in lockstep.
    pub threads: usize,
    /// File of the recording; `None` for no recording. Its folder is created if it is missing.
    pub recording: Option<PathBuf>,
    /// If set, an existing recording is replaced; otherwise it is refused.
    pub overwrite: bool,
    /// Overlays of the behaviors, if there is a recording.
    pub overlays: Overlays,
    /// Real time, or lockstep as fast as possible.
    pub pace: Pace,
    /// Report beside the recording, an HTML file.
    pub report: Report,
    /// Folder of `trajectory.png`; `None` for no plot. It is created if it is missing.
    pub plots: Option<PathBuf>,
    /// Changes of the task from the command line, for the recording.
    pub overrides: Overrides,
    /// Program of the plugins' processes in a live run; without it, every plugin gets a thread. In lockstep, it starts the
    /// behaviors that are external programs; without it they are refused.
    pub program: Option<Program>,
}

impl Default for Options {
    /// Seed 1, lockstep on one thread, no recording, no plot, no changes; a recording would hold overlays.
    fn default() -> Options {
        let pace = Pace::Lockstep;
        Options {
            seed: 1,
            threads: 1,
            pace,
            recording: None,
            overwrite: false,
            overlays: Overlays::Recorded,
            report: Report::None,
            plots: None,
            overrides: Overrides::default(),
            program: None,
        }
    }
}

/// Report of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Report {
    /// No report.
    #[default]
    None,
    /// Beside the recording, with the extension `html`.
    BesideRecording,
}

/// Failure of a run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A part did not open; nothing moved.
    #[error(transparent)]
    Setup(#[from] HostError),
    /// The recording could not be started; nothing moved.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The output folder could not be created; nothing moved.
    #[error("could not create the folder {}: {source}; choose another", folder.display())]
    Folder {
        /// Folder.
        folder: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The working directory is unknown, so that the recording cannot name its files; nothing moved.
    #[error("the working directory is unknown: {0}; start in an existing folder")]
    WorkingDirectory(std::io::Error),
    /// A device failed during the run.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

impl RunError {
    /// Returns true if a device failed: during the run, or when it was opened although no key of its table is wrong. Otherwise
    /// the task, the robot file or the options are wrong.
    pub fn is_of_a_device(&self) -> bool {
        match self {
            RunError::Device(_) => true,
            RunError::Setup(HostError::Device { reason, .. }) => reason.key.is_empty(),
            _ => false,
        }
    }
}

/// Result of a run.
#[derive(Debug, Serialize)]
pub struct RunResult {
    /// Name of the task.
    pub task: String,
    /// Seed of every random number.
    pub seed: u64,
    /// Goal of the task.
    pub goal: Option<GoalArea>,
    /// Cause of the end.
    pub end: RunEnd,
    /// Figures.
    #[serde(flatten)]
    pub summary: RunSummary,
    /// Number of messages lost to buffer overflow: figures, digest and recording lack them.
    pub lost_messages: u64,
    /// Recording, if there is one.
    pub recording: Option<RecordingSummary>,
    /// Report, if there is one.
    pub report: Option<PathBuf>,
    /// Cause why the requested report is missing.
    pub report_problem: Option<String>,
    /// Plot of the trajectory, if there is one.
    pub trajectory: Option<PathBuf>,
    /// Cause why the requested plot is missing.
    pub trajectory_problem: Option<String>,
}

/// Recording of a run.
#[derive(Debug, Serialize)]
pub struct RecordingSummary {
    /// File.
    pub path: PathBuf,
    /// Size of the file.
    pub bytes: u64,
    /// Number of recorded messages on each topic of the bus.
    pub messages: BTreeMap<String, u64>,
    /// Number of missing images and messages: lost to buffer overflow, or dropped because the disk was too slow or full.
    pub missing: u64,
    /// Cause why the recording is incomplete, if it is.
    pub problem: Option<String>,
}

impl RunResult {
    /// Returns true if the run did what the task asks for: it reached the goal, or, without a goal, ran to its end.
    pub fn is_done(&self) -> bool {
        match self.end {
            RunEnd::Arrived => true,
            RunEnd::SensorsEnded | RunEnd::TimeOver => self.goal.is_none(),
            RunEnd::Interrupted => false,
        }
    }
}

impl RecordingSummary {
    fn of(recorded: RecordingResult, lost_messages: u64) -> RecordingSummary {
        RecordingSummary {
            missing: lost_messages + recorded.images_dropped + recorded.messages_dropped,
            problem: recorded.error.map(|error| error.to_string()),
            path: recorded.path,
            bytes: recorded.bytes,
            messages: recorded.messages,
        }
    }
}

/// Runs `task` to its end. `tap` receives every message, `progress` is called after every step. `interrupt`, once set, stops
/// the robot and ends the run.
///
/// A failing recording or plot does not end the run; the result reports it.
///
/// # Errors
/// A part does not open, or a device fails during the run.
pub fn run(
    task: &Task,
    options: &Options,
    interrupt: &AtomicBool,
    tap: &mut dyn Tap,
    progress: &mut dyn FnMut(Progress),
) -> Result<RunResult, RunError> {
    let recording_folder = options.recording.as_deref().and_then(Path::parent);
    [recording_folder, options.plots.as_deref()].into_iter().flatten().try_for_each(create_folder)?;
    // The file is created only once everything is open: a run that cannot start leaves no recording.
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
    let (lost_messages, walls) = (robot.lost(), robot.walls());
    let stats = robot.finish();
    let run_facts = RunFacts {
        arrived: end == Ok(RunEnd::Arrived),
        wall_s,
        timings: stats.behaviors.into_iter().map(|(name, record)| (name, timing(&record))).collect(),
        latencies: stats.latencies,
        tick_lateness: Spread::of(&stats.lateness),
        restarts: stats.restarts,
    };
    let summary = summary.finish(run_facts);
    let facts = result_facts(&summary, end.as_ref(), &walls);
    let recording = recorder.map(|recorder| RecordingSummary::of(recorder.finish(facts), lost_messages));
    let end = end?;
    let wants_report = options.report == Report::BesideRecording;
    // A recording that failed would only give a report of its beginning.
    let whole = recording.as_ref().filter(|recording| wants_report && recording.problem.is_none());
    let report = whole.map(|recording| {
        let page = recording.path.with_extension("html");
        write_report(&recording.path, &page).map(|()| page)
    });
    let (report, report_problem) = match report.transpose() {
        Ok(report) => (report, None),
        Err(error) => (None, Some(error.to_string())),
    };
    let plot = options.plots.as_deref().map(|folder| folder.join("trajectory.png"));
    let written = plot.as_deref().map(|path| write_trajectory(path, &trace, &walls, task.run.goal.as_ref()));
    let trajectory_problem = written.and_then(Result::err).map(|error| error.to_string());
    Ok(RunResult {
        task: task.name.clone(),
        seed: options.seed,
        goal: task.run.goal,
        end,
        summary,
        lost_messages,
        recording,
        report,
        report_problem,
        trajectory: plot.filter(|_| trajectory_problem.is_none()),
        trajectory_problem,
    })
}

/// Facts known after a run, for its recording.
fn result_facts(
    summary: &RunSummary,
    end: Result<&RunEnd, &DeviceError>,
    walls: &[Vec<[f64; 2]>],
) -> BTreeMap<String, String> {
    // Neither can fail to become JSON; a report gets along without them.
    let json = |value: serde_json::Result<String>| value.unwrap_or_default();
    let end = match end {
        Ok(end) => end.as_str().to_owned(),
        Err(_) => "failed".to_owned(),
    };
    [
        ("digest", summary.digest.clone()),
        ("end", end),
        ("summary", json(serde_json::to_string(summary))),
        ("walls", json(serde_json::to_string(walls))),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

/// A robot at a standstill with everything open.
enum Opened {
    Lockstep(Box<Lockstep>),
    Live(Box<Live>),
}

impl Opened {
    fn open(task: &Task, options: &Options) -> Result<Opened, HostError> {
        let overlays = if options.recording.is_some() { options.overlays } else { Overlays::OnRequest };
        let plan = Plan { overlays, ..Plan::new(task, options.seed) };
        Ok(match options.pace {
            Pace::Lockstep => {
                let program = options.program.as_ref();
                Opened::Lockstep(Box::new(Lockstep::open(plan, task.run.step, options.threads, program)?))
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
    ) -> Result<RunEnd, DeviceError> {
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

    fn finish(self) -> RunStats {
        match self {
            Opened::Lockstep(lockstep) => lockstep.finish(),
            Opened::Live(live) => live.finish(),
        }
    }
}

/// Creates `folder`; an empty path is the working directory.
fn create_folder(folder: &Path) -> Result<(), RunError> {
    if folder.as_os_str().is_empty() {
        return Ok(());
    }
    std::fs::create_dir_all(folder).map_err(|source| RunError::Folder { folder: folder.to_owned(), source })
}

fn record(task: &Task, options: &Options, path: &Path) -> Result<McapRecorder, RunError> {
    let identity = Identity::of(task, &options.overrides, options.seed, options.pace);
    let (identity, files) = identity.map_err(RunError::WorkingDirectory)?;
    let mut facts = identity.facts();
    let robot = &task.robot.robot;
    facts.extend([
        ("robot_name".to_owned(), robot.name.clone()),
        ("radius_m".to_owned(), robot.radius_m.to_string()),
        ("goal".to_owned(), serde_json::to_string(&task.run.goal).unwrap_or_default()),
    ]);
    let recording = Recording {
        replaces: options.overwrite,
        robot: task.robot.robot.clone(),
        sensors: sensors(task),
        files,
        facts,
        ..Recording::new(path, options.pace)
    };
    Ok(McapRecorder::create(recording)?)
}

fn timing(record: &CallStats) -> Timing {
    let micros = |duration: Duration| duration.as_secs_f64() * 1e6;
    Timing {
        calls: record.calls.count(),
        p50_us: micros(record.calls.quantile(0.5)),
        p99_us: micros(record.calls.quantile(0.99)),
        overruns: record.overruns,
        panics: record.panics,
    }
}
