//! Replay of a recording: the recorded inputs go to the same behaviors and the same arbiter, and every proposal, output,
//! decision and command is compared with the recorded one, byte by byte.
//!
//! | file | contents |
//! |---|---|
//! | `recorded_task`, `recorded_programs` | the task of a recording, from its attached files, and the programs that it names |
//! | `steps`, `window` | the messages of a recording: step after step, and the last seconds of them |
//! | `prelude` | the beginning of a recording that a replay from its middle passes over |
//! | `in_lockstep` | the replay of a run in lockstep |
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
mod difference;
mod from_log;
mod in_lockstep;
mod losses;
mod prelude;
mod recorded_programs;
mod recorded_task;
mod report;
mod steps;
mod what_if_recorder;
mod window;

pub use closed_loop::{ClosedLoop, close_loop};
pub use comparison::{FirstDifference, TopicComparison};
pub use control_change::ControlChange;
pub use difference::FieldDifference;
pub use recorded_task::{Changes, Devices, Programs, RecordedTask, ReplayError};
pub use report::{Options, Part, Report};

use std::path::Path;

use yamabico_core::plugins::Plugins;

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
