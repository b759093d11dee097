//! What a run was like: a table of numbers and a picture of the way.
//!
//! Both are built from the messages of the run alone, by [`Tap`](crate::record::Tap)s; wall-clock figures are handed in
//! beside them and never enter the digest.

mod control;
mod encounter;
mod latency;
mod summary;
mod trace;
mod trajectory;

pub use control::{ControlLog, Halt};
pub use encounter::{Encounter, Encounters};
pub use latency::{Latency, LatencyFigures, Spread};
pub use summary::{BehaviorSummary, Ending, ReferenceLine, RunSummary, SummaryTap, Timing};
pub use trace::{HaltMark, Trace, TracePoint, Way};
pub use trajectory::{Corner, PictureError, draw_trajectory, write_trajectory};

/// A robot slower than this stands, m/s.
pub const STANDING_MPS: f64 = 0.01;
