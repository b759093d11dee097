//! Replay of a recording: the recorded inputs go to the same behaviors and the same arbiter, and every proposal, output,
//! decision and command is compared with the recorded one, byte by byte.
//!
//! | file | contents |
//! |---|---|
//! | `recorded_task`, `recorded_programs` | the task of a recording, from its attached files, and the programs that it names |
//! | `steps`, `window` | the messages of a recording: step after step, and the last seconds of them |
//! | `prelude` | the beginning of a recording that a replay from its middle passes over |
//! | `in_lockstep` | the replay of a run in lockstep |
//! | `decisions` | the decisions of a run in lockstep alone |
//! | `streams` | the same on all processors, as long as every message is equal |
//! | `from_log`, `behavior_replay`, `arbiter_replay` | the replay of a live run |
//! | `losses` | messages that a live recording lacks |
//! | `comparison`, `difference` | recorded and replayed messages side by side |
//! | `control_change` | changes of control: when, on which axis, who drives instead |
//! | `what_if_recorder` | the recording of a what-if |
//! | `closed_loop` | a recorded simulation again, with changes |

mod arbiter_replay;
mod behavior_replay;
mod closed_loop;
mod comparison;
mod control_change;
mod decisions;
mod difference;
mod from_log;
mod in_lockstep;
mod losses;
mod prelude;
mod recorded_programs;
mod recorded_task;
mod report;
mod steps;
mod streams;
mod what_if_recorder;
mod window;

pub use closed_loop::{ClosedLoop, close_loop};
pub use comparison::{FirstDifference, TopicComparison};
pub use control_change::ControlChange;
pub use difference::FieldDifference;
pub use recorded_task::{Changes, Devices, Programs, RecordedTask, ReplayError};
pub use report::{Options, Part, Report};

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use recorded_task::TemporaryFolder;
use yamabico_core::plugins::Plugins;

use crate::record::runs;

/// Replays every run in the file `path`: one, or several recordings one after the other. See [`replay`].
///
/// # Errors
/// See [`replay`]; the first run that fails ends it.
pub fn replay_runs(path: &Path, plugins: &Plugins, options: &Options) -> Result<Vec<Report>, ReplayError> {
    let runs = runs(path)?;
    if runs.len() == 1 {
        return Ok(vec![replay(path, plugins, options)?]);
    }
    if options.output.is_some() {
        let reason = format!("it holds {} runs, and a what-if is recorded for one", runs.len());
        return Err(ReplayError::Unsupported { path: path.to_owned(), reason });
    }
    let folder = TemporaryFolder::create()?;
    let file = folder.path().join("run.mcap");
    let failed = |source| ReplayError::Unpack { folder: folder.path().to_owned(), source };
    let each = runs.into_iter().map(|run| {
        copy(path, run, &file).map_err(failed)?;
        Ok(Report { recording: path.to_owned(), ..replay(&file, plugins, options)? })
    });
    each.collect()
}

/// Copies a part of a file.
fn copy(from: &Path, part: Range<u64>, to: &Path) -> std::io::Result<()> {
    let mut from = File::open(from)?;
    from.seek(SeekFrom::Start(part.start))?;
    std::io::copy(&mut from.take(part.end - part.start), &mut File::create(to)?).map(drop)
}

/// Replays the recording `path` with behaviors of `plugins`, and compares.
///
/// # Errors
/// The recording cannot be read or replayed, or a part does not open.
pub fn replay(path: &Path, plugins: &Plugins, options: &Options) -> Result<Report, ReplayError> {
    let recorded = RecordedTask::open(path, &options.changes, plugins, Devices::Closed, options.programs())?;
    match recorded.is_lockstep() {
        true => in_lockstep::replay_lockstep(path, options, &recorded),
        false => from_log::replay_log(path, options, &recorded),
    }
}
