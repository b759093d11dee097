//! A recorded simulation again, with changes: the world reacts, and the ways are compared.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::Serialize;
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::plugins::Plugins;
use yamabico_core::time::Time;

use super::recorded_task::{Devices, RecordedTask, ReplayError};
use super::report::Options;
use crate::execution::{Progress, RunEnd};
use crate::record::{Tap, Tee, play};
use crate::report::{ReferenceLine, RunFacts, RunSummary, SummaryTap};
use crate::run::{self, RunError, run};

/// Result of a closed loop.
#[derive(Debug, Serialize)]
pub struct ClosedLoop {
    /// Figures of the recorded run.
    pub recorded: RunSummary,
    /// Figures of the run with changes.
    pub changed: RunSummary,
    /// Cause of its end.
    pub end: RunEnd,
    /// Largest distance between both robots at the same time, m, and that time, s; `None` without a truth.
    pub largest_deviation: Option<(f64, f64)>,
    /// Distance between both robots at the end of the shorter run, m.
    pub final_deviation_m: Option<f64>,
}

/// Runs the simulation of the recording `path` again with the changes of `options` and the same seed, and compares the ways.
///
/// # Errors
/// The recording cannot be read, was not simulated in lockstep, or the run fails.
pub fn close_loop(
    path: &Path,
    plugins: &Plugins,
    options: &Options,
    interrupt: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> Result<ClosedLoop, ReplayError> {
    let programs = options.programs();
    let recorded = RecordedTask::open(path, &options.changes, plugins, Devices::Open, programs)?;
    if !recorded.is_lockstep() {
        let reason = "only a simulation in lockstep can be run again in a closed loop".to_owned();
        return Err(ReplayError::Unsupported { path: path.to_owned(), reason });
    }
    let (mut summary, mut before) = (SummaryTap::new(ReferenceLine::default()), Way::default());
    play(path, &mut Tee(vec![&mut summary, &mut before]))?;
    if before.0.is_empty() {
        let reason = "it holds no truth of a simulator, so that its world cannot react".to_owned();
        return Err(ReplayError::Unsupported { path: path.to_owned(), reason });
    }
    let options = run::Options {
        seed: recorded.identity.run.seed,
        threads: options.threads,
        program: options.program.clone(),
        ..run::Options::default()
    };
    let mut after = Way::default();
    let ran =
        run(&recorded.task, &options, interrupt, &mut after, progress).map_err(|error| match error {
            RunError::Setup(error) => ReplayError::Open(error),
            RunError::Device(error) => ReplayError::Device(error),
            error => ReplayError::Unsupported { path: path.to_owned(), reason: error.to_string() },
        })?;
    let pairs = before.0.iter().zip(&after.0);
    let mut distances =
        pairs.map(|((time, a), (_, b))| ((a[0] - b[0]).hypotenuse(a[1] - b[1]), time.as_secs_f64()));
    Ok(ClosedLoop {
        recorded: summary.finish(RunFacts::default()),
        changed: ran.summary,
        end: ran.end,
        largest_deviation: distances.clone().max_by(|a, b| a.0.total_cmp(&b.0)),
        final_deviation_m: distances.next_back().map(|(distance_m, _)| distance_m),
    })
}

/// True positions of a run, one for each step.
#[derive(Default)]
struct Way(Vec<(Time, [f64; 2])>);

impl Tap for Way {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if message.name == Truth::NAME
            && let Some(View { header: truth, .. }) = View::<Truth>::of(RawMessage { header, items })
        {
            self.0.push((time, [truth.x, truth.y]));
        }
    }
}
