//! Report on a run: its summary and the plot of its trajectory.
//!
//! Both are built from the messages of the run alone, by [`Tap`](crate::record::Tap)s; wall-clock figures are added
//! separately and never enter the digest.

mod charts;
mod control;
mod encounter;
mod figure;
mod labels;
mod latency;
mod moments;
mod page;
mod recorded;
mod summary;
mod timeline;
mod trace;
mod trajectory;

use control::ControlLog;
pub use control::Halt;
pub use encounter::Encounter;
use encounter::Encounters;
pub use figure::Figure;
pub(crate) use latency::Latency;
pub use latency::{LatencyFigures, Spread};
pub use page::{ReportError, write_report};
pub use summary::{BehaviorSummary, ReferenceLine, RunFacts, RunSummary, SummaryTap, Timing};
pub use trace::{HaltMark, Trace, TracePoint, Track};
pub use trajectory::{Corner, PlotError, draw_trajectory, write_trajectory};

/// Speed below which the robot stands, m/s.
const STANDING_MPS: f64 = 0.01;
