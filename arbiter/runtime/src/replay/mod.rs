//! Replay of a recording: the recorded inputs go to the same behaviors and the same arbiter, and every proposal, output,
//! decision and command is compared with the recorded one, byte by byte.
//!
//! | file | contents |
//! |---|---|
//! | `recorded_task` | the task of a recording, from its attached files |
//! | `steps` | the messages of a recording, one step after the other |
//! | `comparison` | recorded and replayed messages side by side |
//! | `difference` | one difference: author, axes, fields |
//! | `control_change` | changes of control: when, on which axis, who drives instead |
//! | `what_if_recorder` | the recording of a what-if |
//! | `closed_loop` | a recorded simulation again, with changes |
//! | `in_lockstep` | the replay of a run in lockstep |

mod closed_loop;
mod comparison;
mod control_change;
mod difference;
mod in_lockstep;
mod recorded_task;
mod steps;
mod what_if_recorder;

pub use closed_loop::{ClosedLoop, close_loop};
pub use comparison::{FirstDifference, TopicComparison};
pub use control_change::ControlChange;
pub use difference::FieldDifference;
pub use in_lockstep::{Options, Report, replay};
pub use recorded_task::{Changes, Devices, RecordedTask, ReplayError};
