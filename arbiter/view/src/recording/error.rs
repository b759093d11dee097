//! Failures of a recording.

use std::path::{Path, PathBuf};

use yamabico_mcap::ReadError;

/// Failure to open a recording, or to read from it.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened or read.
    #[error("recording {} cannot be read: {source}", path.display())]
    NotReadable {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file is not a recording.
    #[error("{} is no recording of Yamabico: {reason}", path.display())]
    NoRecording {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// The recording has no decision up to this time.
    #[error("{} has no decision up to {at_s} s: it covers {begin_s:.2} s to {end_s:.2} s", path.display())]
    NoDecision {
        /// File.
        path: PathBuf,
        /// Time, s.
        at_s: f64,
        /// First decision, s.
        begin_s: f64,
        /// End of the recording, s.
        end_s: f64,
    },
}

impl RecordingError {
    /// Failure to read the recording `path`.
    pub(super) fn new(path: &Path, error: ReadError) -> RecordingError {
        let path = path.to_owned();
        match error {
            ReadError::Io(source) => RecordingError::NotReadable { path, source },
            error => RecordingError::NoRecording { path, reason: error.to_string() },
        }
    }
}
