//! Files of a sequence, and their validation.

use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use image::{ImageError, ImageFormat, ImageReader};

use crate::config::ImageSequenceConfig;

/// Error from opening or reading an image sequence.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// No folder or file has this path.
    #[error("{} does not exist: set `files` to a folder, a pattern such as `drive/*.png`, or a file", .0.display())]
    Missing(PathBuf),
    /// The folder contains no image.
    #[error("the folder {} contains no .png, .jpg or .jpeg file: add images or name another folder", .0.display())]
    EmptyFolder(PathBuf),
    /// The pattern matches no file.
    #[error("no file matches the pattern {}: correct the pattern or the folder", .0.display())]
    NoMatch(PathBuf),
    /// The pattern is invalid.
    #[error("{} is not a valid pattern: {reason}", path.display())]
    BadPattern {
        /// Path with the pattern.
        path: PathBuf,
        /// Description of the error.
        reason: String,
    },
    /// A file or folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// File or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A file is neither PNG nor JPEG.
    #[error("{} is neither a PNG nor a JPEG file: convert or remove it", .0.display())]
    NotAnImage(PathBuf),
    /// A file is truncated.
    #[error("{} is truncated: copy it again or remove it", .0.display())]
    Truncated(PathBuf),
    /// The times of capture are unknown.
    #[error("{}: {reason}; correct `stamps`, or leave it out for a constant rate", path.display())]
    Stamps {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// A file cannot be decoded.
    #[error("{} cannot be decoded: {reason}; save it again or remove it", path.display())]
    Corrupt {
        /// File.
        path: PathBuf,
        /// Description of the error.
        reason: String,
    },
    /// An image has another size than the camera.
    #[error(
        "{} has {actual_width}x{actual_height} pixels, but `intrinsics` has {width}x{height}: correct one of them",
        path.display()
    )]
    WrongSize {
        /// File.
        path: PathBuf,
        /// Width of the image, pixels.
        actual_width: u32,
        /// Height of the image, pixels.
        actual_height: u32,
        /// Width in the intrinsics, pixels.
        width: u32,
        /// Height in the intrinsics, pixels.
        height: u32,
    },
}

impl SequenceError {
    /// Returns the error for a file that could not be decoded.
    pub(crate) fn decoding(path: &Path, error: ImageError) -> SequenceError {
        let path = path.to_owned();
        match error {
            ImageError::IoError(source) if source.kind() == io::ErrorKind::UnexpectedEof => {
                SequenceError::Truncated(path)
            }
            ImageError::IoError(source) => SequenceError::Unreadable { path, source },
            ImageError::Unsupported(_) => SequenceError::NotAnImage(path),
            other => SequenceError::Corrupt { path, reason: other.to_string() },
        }
    }
}

/// Returns the files of a folder, pattern or path, sorted by name, at least one. Relative paths start at `folder`.
///
/// # Errors
/// A missing path, an empty or unreadable folder, an invalid pattern or one without a match.
fn list(files: &str, folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let path: PathBuf = folder.join(files).components().collect();
    let mut found = if path.is_dir() {
        images_in(&path)?
    } else if path.is_file() {
        return Ok(vec![path]);
    } else if files.contains(['*', '?', '[']) {
        match_pattern(files, folder)?
    } else {
        return Err(SequenceError::Missing(path));
    };
    found.sort();
    Ok(found)
}

fn images_in(folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let unreadable = |source| SequenceError::Unreadable { path: folder.to_owned(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
        if extension.is_some_and(|extension| ["png", "jpg", "jpeg"].iter().any(|known| extension == *known)) {
            found.push(path);
        }
    }
    if found.is_empty() { Err(SequenceError::EmptyFolder(folder.to_owned())) } else { Ok(found) }
}

/// Returns the files that match a pattern. Special characters in the path of `folder` are not part of the pattern.
fn match_pattern(files: &str, folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let path = folder.join(files);
    let folder = glob::Pattern::escape(&folder.to_string_lossy());
    let pattern = Path::new(&folder).join(files);
    let paths = glob::glob(&pattern.to_string_lossy())
        .map_err(|error| SequenceError::BadPattern { path: path.clone(), reason: error.msg.to_owned() })?;
    let found = paths
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| SequenceError::Unreadable { path: error.path().to_owned(), source: error.into() })?;
    let found: Vec<_> = found.into_iter().filter(|path| path.is_file()).collect();
    if found.is_empty() { Err(SequenceError::NoMatch(path)) } else { Ok(found) }
}

/// Finds the files of a sequence, at least one, and validates each. Relative paths start at `folder`.
///
/// # Errors
/// The errors of [`list`] and [`inspect`].
pub(crate) fn find(config: &ImageSequenceConfig, folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let files = list(&config.files, folder)?;
    for file in &files {
        inspect(file, config.intrinsics.width, config.intrinsics.height)?;
    }
    Ok(files)
}

/// Checks format, size and completeness of a file without decoding it.
///
/// # Errors
/// A file that is unreadable, not an image, truncated, or not of this size.
fn inspect(path: &Path, width: u32, height: u32) -> Result<(), SequenceError> {
    let unreadable = |source| SequenceError::Unreadable { path: path.to_owned(), source };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let format = image::guess_format(&bytes).map_err(|_| SequenceError::NotAnImage(path.to_owned()))?;
    let actual = ImageReader::with_format(Cursor::new(&bytes), format)
        .into_dimensions()
        .map_err(|error| SequenceError::decoding(path, error))?;
    check_size(path, actual, width, height)?;
    if is_complete(format, &bytes) { Ok(()) } else { Err(SequenceError::Truncated(path.to_owned())) }
}

/// Returns true if the data of an image are complete. The JPEG decoder does not report truncated data: it fills the rest with
/// gray.
pub(crate) fn is_complete(format: ImageFormat, bytes: &[u8]) -> bool {
    match format {
        ImageFormat::Jpeg => jpeg_is_complete(bytes),
        ImageFormat::Png => png_is_complete(bytes),
        _ => true,
    }
}

/// Returns true if the last chunk exists.
fn png_is_complete(bytes: &[u8]) -> bool {
    let mut at = 8;
    while let Some(&[a, b, c, d, ref kind @ ..]) = bytes.get(at..at + 8) {
        if kind == b"IEND" {
            return true;
        }
        // Length, type and checksum have four bytes each.
        at = at.saturating_add(12).saturating_add(u32::from_be_bytes([a, b, c, d]) as usize);
    }
    false
}

/// Returns true if the image data end with the end marker.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == START_OF_SCAN {
            // Within a scan, 0xff is followed by zero or a restart marker, so the data cannot contain the end marker.
            return bytes[at..].windows(2).any(|pair| pair == END_OF_IMAGE);
        }
        // Padding before a marker is one byte of 0xff; a segment starts with its length.
        at += if marker == 0xff { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
    }
    false
}

/// Checks the size of an image, pixels.
///
/// # Errors
/// [`SequenceError::WrongSize`].
pub(crate) fn check_size(
    path: &Path,
    actual: (u32, u32),
    width: u32,
    height: u32,
) -> Result<(), SequenceError> {
    if actual == (width, height) {
        return Ok(());
    }
    let (actual_width, actual_height) = actual;
    Err(SequenceError::WrongSize { path: path.to_owned(), actual_width, actual_height, width, height })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_marker_in_a_thumbnail_is_not_the_end() {
        let thumbnail = [0xff, 0xe1, 0, 6, 0xff, 0xd9, 1, 2];
        let scan = [0xff, 0xda, 0, 2, 1, 2, 3, 0xff, 0, 4];
        let cut = [&[0xff, 0xd8][..], &thumbnail, &scan].concat();
        assert!(!jpeg_is_complete(&cut));
        assert!(jpeg_is_complete(&[&cut[..], &[0xff, 0xd9]].concat()));
        assert!(!jpeg_is_complete(&[0xff, 0xd8]) && !jpeg_is_complete(&[]));
    }
}
