//! Why a recording failed.

use std::io;
use std::path::{Path, PathBuf};

/// A recording that could not be begun, or that broke off.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The folder of the file is not there.
    #[error("cannot record to {}: there is no folder {}; create it or choose another file", path.display(), folder.display())]
    FolderMissing {
        /// The file.
        path: PathBuf,
        /// The folder that is missing.
        folder: PathBuf,
    },
    /// The path names a folder.
    #[error("cannot record to {}: it is a folder; give the name of a file in it, such as {}", path.display(), path.join("run.mcap").display())]
    IsAFolder {
        /// The folder.
        path: PathBuf,
    },
    /// The file may not be written.
    #[error("cannot record to {}: {source}; make it writable or choose another file", path.display())]
    NotWritable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The disk, or the quota, is full.
    #[error("the recording {} broke off after {written} bytes: {source}; free some space or record elsewhere", path.display())]
    Full {
        /// The file.
        path: PathBuf,
        /// Bytes that were written.
        written: u64,
        /// What the system said.
        source: io::Error,
    },
    /// Writing failed in another way.
    #[error("the recording {} broke off after {written} bytes: {source}; record to another disk", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Bytes that were written.
        written: u64,
        /// What the system said.
        source: io::Error,
    },
    /// The thread that writes ended before its time.
    #[error("the recording {} broke off: its writer failed ({reason}); please report this", path.display())]
    Writer {
        /// The file.
        path: PathBuf,
        /// What it said.
        reason: String,
    },
}

impl RecordError {
    /// Why `path` could not be created.
    pub(super) fn opening(path: &Path, source: io::Error) -> RecordError {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::NotFound => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                RecordError::FolderMissing { folder: folder.unwrap_or(Path::new(".")).to_owned(), path }
            }
            io::ErrorKind::IsADirectory => RecordError::IsAFolder { path },
            kind if is_full(kind) => RecordError::Full { path, written: 0, source },
            _ => RecordError::NotWritable { path, source },
        }
    }

    /// Why writing to `path` broke off after `written` bytes.
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
    fn each_failure_has_its_name_and_its_remedy() {
        let path = Path::new("out/run.mcap");
        let cases = [
            (io::ErrorKind::NotFound, "no folder out; create it"),
            (io::ErrorKind::IsADirectory, "such as out/run.mcap/run.mcap"),
            (io::ErrorKind::PermissionDenied, "make it writable"),
            (io::ErrorKind::ReadOnlyFilesystem, "make it writable"),
            (io::ErrorKind::StorageFull, "free some space"),
        ];
        for (kind, words) in cases {
            let error = RecordError::opening(path, kind.into()).to_string();
            assert!(error.contains(words) && error.contains("out/run.mcap"), "{error}");
        }
        let error = RecordError::writing(path, 7, io::ErrorKind::QuotaExceeded.into()).to_string();
        assert!(error.contains("after 7 bytes") && error.contains("free some space"), "{error}");
    }
}
