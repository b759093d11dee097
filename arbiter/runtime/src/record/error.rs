//! Failures of a recording.

use std::io;
use std::path::{Path, PathBuf};

/// Failure to start or to continue a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The folder of the file is missing.
    #[error("cannot record to {}: the folder {} does not exist; create it or choose another file", path.display(), folder.display())]
    FolderMissing {
        /// File.
        path: PathBuf,
        /// Missing folder.
        folder: PathBuf,
    },
    /// The path is a folder.
    #[error("cannot record to {}: it is a folder; give the name of a file in it, such as {}", path.display(), path.join("run.mcap").display())]
    IsAFolder {
        /// Folder.
        path: PathBuf,
    },
    /// The file exists and is not to be replaced.
    #[error("cannot record to {}: it exists; choose another file, or replace it with --overwrite", path.display())]
    Exists {
        /// File.
        path: PathBuf,
    },
    /// The file is not writable.
    #[error("cannot record to {}: {source}; make it writable or choose another file", path.display())]
    NotWritable {
        /// File.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The disk, or the quota, is full.
    #[error("the recording {} failed after {written} bytes: {source}; free some space or record elsewhere", path.display())]
    Full {
        /// File.
        path: PathBuf,
        /// Number of bytes written.
        written: u64,
        /// Cause.
        source: io::Error,
    },
    /// Writing failed for another reason.
    #[error("the recording {} failed after {written} bytes: {source}; record to another disk", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Number of bytes written.
        written: u64,
        /// Cause.
        source: io::Error,
    },
    /// The writer's thread failed.
    #[error("the recording {} failed: its writer panicked ({reason}); report this as a bug", path.display())]
    Writer {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
}

impl RecordError {
    /// Failure to create `path`.
    pub(super) fn opening(path: &Path, source: io::Error) -> RecordError {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::NotFound => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                RecordError::FolderMissing { folder: folder.unwrap_or(Path::new(".")).to_owned(), path }
            }
            io::ErrorKind::AlreadyExists if path.is_dir() => RecordError::IsAFolder { path },
            io::ErrorKind::AlreadyExists => RecordError::Exists { path },
            io::ErrorKind::IsADirectory => RecordError::IsAFolder { path },
            kind if is_full(kind) => RecordError::Full { path, written: 0, source },
            _ => RecordError::NotWritable { path, source },
        }
    }

    /// Failure to write to `path` after `written` bytes.
    pub(super) fn writing(path: &Path, written: u64, source: io::Error) -> RecordError {
        let path = path.to_owned();
        if is_full(source.kind()) {
            RecordError::Full { path, written, source }
        } else {
            RecordError::Io { path, written, source }
        }
    }
}

fn is_full(kind: io::ErrorKind) -> bool {
    matches!(kind, io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_failure_has_a_cause_and_a_remedy() {
        let path = Path::new("out/run.mcap");
        let cases = [
            (io::ErrorKind::NotFound, "the folder out does not exist; create it"),
            (io::ErrorKind::IsADirectory, "such as out/run.mcap/run.mcap"),
            (io::ErrorKind::AlreadyExists, "it exists; choose another file"),
            (io::ErrorKind::PermissionDenied, "make it writable"),
            (io::ErrorKind::ReadOnlyFilesystem, "make it writable"),
            (io::ErrorKind::StorageFull, "free some space"),
        ];
        for (kind, text) in cases {
            let error = RecordError::opening(path, kind.into()).to_string();
            assert!(error.contains(text) && error.contains("out/run.mcap"), "{error}");
        }
        let error = RecordError::writing(path, 7, io::ErrorKind::QuotaExceeded.into()).to_string();
        assert!(error.contains("after 7 bytes") && error.contains("free some space"), "{error}");
    }
}
