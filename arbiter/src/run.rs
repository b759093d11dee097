//! A whole run: opened, driven to its end, recorded, summed up.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::Serialize;
use yamabico_core::config::{Overrides, Task};
use yamabico_core::sensor::DeviceError;

use crate::execution::{self, End, Lockstep, Plan, Progress, SeatError, topics};
use crate::record::{Digest, ImageFormat, McapRecorder, Pace, RecordError, Recording, Tap, Tee};

/// How a task is run.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Of everything that is drawn by chance.
    pub seed: u64,
    /// Threads that the behaviours share in lockstep.
    pub threads: usize,
    /// In real time.
    pub live: bool,
    /// Where the recording goes; none for no recording.
    pub recording: Option<PathBuf>,
    /// Where plots go; none for no plots. Made where it is missing.
    pub out: Option<PathBuf>,
    /// What was changed in the task, for the record.
    pub overrides: Overrides,
}

/// A run that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Something could not be opened; nothing moved.
    #[error(transparent)]
    Setup(#[from] SeatError),
    /// What the run is to leave behind cannot be written; nothing moved.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The output folder cannot be made; nothing moved.
    #[error("cannot make the output folder {}: {source}; choose another with --out", folder.display())]
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

/// A run that was made: what became of it, and what it left behind.
#[derive(Debug, Serialize)]
pub struct Ran {
    /// Why it ended.
    pub end: End,
    /// The figures.
    #[serde(flatten)]
    pub summary: RunSummary,
    /// The recording, where there is one: path and size in bytes.
    pub recording: Option<(PathBuf, u64)>,
    /// The plot of where the robot went, where there is one.
    pub trajectory: Option<PathBuf>,
    /// What could not be written, in words.
    pub losses: Vec<String>,
}

impl Ran {
    /// Whether the run did what was asked: the goal was reached, or there was none.
    pub fn is_done(&self) -> bool {
        matches!(self.end, End::Arrived | End::SensorsEnded)
    }
}
