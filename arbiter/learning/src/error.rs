//! Reasons why nothing was learned.

use std::fmt::Display;
use std::path::Path;

use yamabico_parameters::{FileKind, Problems};
use yamabico_runtime::record::PlaybackError;
use yamabico_runtime::run::RunError;

/// A reason why nothing was learned.
#[derive(Debug, thiserror::Error)]
pub enum LearningError {
    /// The task file or the robot file is wrong.
    #[error("{0}")]
    Configuration(Problems),
    /// The task, the images or the arguments are valid, but nothing can be learned from them.
    #[error("{0}")]
    Unsuitable(String),
    /// The drive failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The recording cannot be read.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// A file cannot be written.
    #[error("{0}")]
    Write(String),
}

impl LearningError {
    /// The file `path` cannot be written.
    pub(crate) fn write(path: &Path, reason: impl Display) -> LearningError {
        LearningError::Write(format!("cannot write {}: {reason}", path.display()))
    }

    /// Returns true if the task and the arguments were fine, but a device or the disk failed.
    #[must_use]
    pub fn is_of_a_device(&self) -> bool {
        match self {
            LearningError::Run(error) => error.is_of_a_device(),
            LearningError::Write(_) => true,
            LearningError::Configuration(_) | LearningError::Unsuitable(_) | LearningError::Playback(_) => {
                false
            }
        }
    }
}

/// Writes `text`, a file of `kind`, to `path`, after a line that names its schema for editors as in `configs/maps`; creates
/// missing folders.
pub(crate) fn write_text(path: &Path, kind: &FileKind, text: &str) -> Result<(), LearningError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let created = folder.map_or(Ok(()), std::fs::create_dir_all);
    let text = format!("#:schema ../schemas/{}.json\n{text}", kind.key);
    created.and_then(|()| std::fs::write(path, text)).map_err(|error| LearningError::write(path, error))
}

/// Writes `pixels`, three bytes each, as a PNG of `size`.
pub(crate) fn write_png(path: &Path, pixels: &[u8], size: (usize, usize)) -> Result<(), LearningError> {
    let (width, height) = (size.0 as u32, size.1 as u32);
    image::save_buffer(path, pixels, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|error| LearningError::write(path, error))
}
