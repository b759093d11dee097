//! Which files make a sequence, and whether each can be one of its pictures.

use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use image::{ImageError, ImageFormat, ImageReader};

use crate::config::ImageSequenceConfig;

/// A sequence that cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// Neither a folder nor a file of that name.
    #[error("there is no folder or file {}; give a folder, a pattern such as `drive/*.png`, or a file", .0.display())]
    Missing(PathBuf),
    /// The folder has no picture.
    #[error("the folder {} has no .png, .jpg or .jpeg file; put some there or name another", .0.display())]
    EmptyFolder(PathBuf),
    /// The pattern fits no file.
    #[error("no file fits the pattern {}; change it or the folder", .0.display())]
    NoMatch(PathBuf),
    /// The pattern is not one.
    #[error("{} is not a pattern: {reason}", path.display())]
    BadPattern {
        /// The pattern.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file or folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file is neither PNG nor JPEG.
    #[error("{} is neither a PNG nor a JPEG file; convert it or take it out", .0.display())]
    NotAnImage(PathBuf),
    /// A file breaks off.
    #[error("{} is cut short: the picture is not complete; copy it again or take it out", .0.display())]
    Truncated(PathBuf),
    /// A file that cannot be decoded.
    #[error("{} cannot be decoded: {reason}; save it again or take it out", path.display())]
    Broken {
        /// Which.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A picture has another size than the camera.
    #[error("{} is {actual_width}x{actual_height}, but `intrinsics` says {width}x{height}; change one of them", path.display())]
    WrongSize {
        /// Which.
        path: PathBuf,
        /// Its width.
        actual_width: u32,
        /// Its height.
        actual_height: u32,
        /// The camera's width.
        width: u32,
        /// The camera's height.
        height: u32,
    },
}

impl SequenceError {
    /// Why `path` could not be decoded.
    pub(crate) fn decoding(path: &Path, error: ImageError) -> SequenceError {
        let path = path.to_owned();
        match error {
            ImageError::IoError(source) if source.kind() == io::ErrorKind::UnexpectedEof => {
                SequenceError::Truncated(path)
            }
            ImageError::IoError(source) => SequenceError::Unreadable { path, source },
            ImageError::Unsupported(_) => SequenceError::NotAnImage(path),
            other => SequenceError::Broken { path, reason: other.to_string() },
        }
    }
}

/// The files that `files` names, sorted by name; `folder` is where relative paths start. Never empty.
///
/// # Errors
/// Nothing of that name, an empty folder, a pattern without a match, an unreadable folder.
fn list(files: &str, folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let path: PathBuf = folder.join(files).components().collect();
    let mut found = if path.is_dir() {
        pictures_in(&path)?
    } else if path.is_file() {
        return Ok(vec![path]);
    } else if files.contains(['*', '?', '[']) {
        matches_of(files, folder)?
    } else {
        return Err(SequenceError::Missing(path));
    };
    found.sort();
    Ok(found)
}

fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
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

/// Only what the robot file says is a pattern; the folder that it lies in is taken as it is.
fn matches_of(files: &str, folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
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

/// Finds the pictures of a sequence and looks at each; `folder` is where relative paths start. Never empty.
///
/// # Errors
/// As [`list`] and [`inspect`].
pub(crate) fn find(config: &ImageSequenceConfig, folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let files = list(&config.files, folder)?;
    for file in &files {
        inspect(file, config.intrinsics.width, config.intrinsics.height)?;
    }
    Ok(files)
}

/// Tells a picture's kind and size and whether it is all there, without decoding it.
///
/// # Errors
/// Unreadable, not an image, cut short, or not `width` x `height`.
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

/// Whether a picture's data come to their end: the decoder of JPEG fills what is missing with gray and says nothing.
pub(crate) fn is_complete(format: ImageFormat, bytes: &[u8]) -> bool {
    match format {
        ImageFormat::Jpeg => jpeg_is_complete(bytes),
        ImageFormat::Png => png_is_complete(bytes),
        _ => true,
    }
}

/// Whether the chunks go on to the last one.
fn png_is_complete(bytes: &[u8]) -> bool {
    let mut at = 8;
    while let Some(&[a, b, c, d, ref kind @ ..]) = bytes.get(at..at + 8) {
        if kind == b"IEND" {
            return true;
        }
        // Length, kind and checksum are four bytes each.
        at = at.saturating_add(12).saturating_add(u32::from_be_bytes([a, b, c, d]) as usize);
    }
    false
}

/// Whether the picture's data come to their end marker.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == START_OF_SCAN {
            // Within a scan 0xff is followed by zero or a restart marker: the end marker cannot occur by chance.
            return bytes[at..].windows(2).any(|pair| pair == END_OF_IMAGE);
        }
        // Padding before a marker is one byte of 0xff; a segment tells its length.
        at += if marker == 0xff { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
    }
    false
}

/// # Errors
/// `WrongSize`.
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
