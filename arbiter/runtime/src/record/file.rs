//! Output file that reports only its first failure.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::RecordError;

/// Buffered output file. After its first failure, it keeps the error and discards all further data, so that the recorder
/// reports one error and the file position stays defined.
pub(super) struct OutputFile {
    file: BufWriter<File>,
    path: PathBuf,
    position: u64,
    length: u64,
    failure: Failure,
}

/// First failure of an [`OutputFile`], shared between threads.
#[derive(Clone, Default)]
pub(super) struct Failure(Arc<Mutex<FailureState>>);

#[derive(Default)]
struct FailureState {
    failed: bool,
    error: Option<RecordError>,
    bytes: u64,
}

impl Failure {
    /// Returns true if the file has failed.
    pub fn has_happened(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).failed
    }

    /// Takes the failure out, once.
    pub fn take(&self) -> Option<RecordError> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).error.take()
    }

    /// Size of the file, bytes; up to the failure if there was one.
    pub fn bytes(&self) -> u64 {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).bytes
    }

    /// Records the size of the file; a file that has failed grows no more.
    fn grown_to(&self, bytes: u64) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !state.failed {
            state.bytes = bytes;
        }
    }

    fn set(&self, error: RecordError) {
        tracing::error!("{error}");
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.failed = true;
        state.error.get_or_insert(error);
    }
}

impl OutputFile {
    /// Creates the file. An existing one is truncated if it is to be replaced, and refused otherwise; a device or a pipe is
    /// neither.
    pub fn create(path: &Path, replaces: bool) -> Result<OutputFile, RecordError> {
        let is_special = path.metadata().is_ok_and(|data| !data.is_file() && !data.is_dir());
        let opened = match replaces || is_special {
            true => File::create(path),
            false => File::create_new(path),
        };
        let file = opened.map_err(|error| RecordError::opening(path, error))?;
        Ok(OutputFile {
            file: BufWriter::with_capacity(1 << 18, file),
            path: path.to_owned(),
            position: 0,
            length: 0,
            failure: Failure::default(),
        })
    }

    /// Handle to the failure.
    pub fn failure(&self) -> Failure {
        self.failure.clone()
    }

    fn fail(&self, error: io::Error) {
        self.failure.set(RecordError::writing(&self.path, self.length, error));
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.failure.has_happened()
            && let Err(error) = self.file.write_all(bytes)
        {
            self.fail(error);
        }
        self.position += bytes.len() as u64;
        self.length = self.length.max(self.position);
        self.failure.grown_to(self.length);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.failure.has_happened()
            && let Err(error) = self.file.flush()
        {
            self.fail(error);
        }
        Ok(())
    }
}

impl Seek for OutputFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let target = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
            SeekFrom::End(by) => self.length.checked_add_signed(by),
        };
        let target = target.ok_or(io::ErrorKind::InvalidInput)?;
        if target != self.position {
            if !self.failure.has_happened()
                && let Err(error) = self.file.seek(SeekFrom::Start(target))
            {
                self.fail(error);
            }
            self.position = target;
        }
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_one_failure_and_later_writes_are_discarded() {
        let mut file = OutputFile::create(Path::new("/dev/full"), false).unwrap();
        let failure = file.failure();
        file.write_all(&[1; 1 << 20]).unwrap();
        file.flush().unwrap();
        assert!(failure.has_happened());
        assert!(matches!(failure.take(), Some(RecordError::Full { .. })));
        assert_eq!(file.seek(SeekFrom::Start(8)).unwrap(), 8);
        file.write_all(&[2; 4]).unwrap();
        assert_eq!(file.stream_position().unwrap(), 12);
        assert_eq!(file.seek(SeekFrom::End(0)).unwrap(), 1 << 20);
        assert!(failure.take().is_none() && failure.has_happened());
        assert!(failure.bytes() < 1 << 20, "discarded bytes are not in the file");
    }
}
