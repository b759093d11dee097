//! Pictures from files and folders, as gray images.

use std::path::{Path, PathBuf};

use yamabico_core::image::GrayImage;

use crate::LearningError;

/// Endings of the names of pictures in a folder.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Picture with its name.
#[derive(Clone, Debug)]
pub struct Picture {
    /// File, or number and time in a recording.
    pub name: String,
    /// Gray levels.
    pub gray: GrayImage,
}

impl Picture {
    /// Width and height, px.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.gray.width() as u32, self.gray.height() as u32]
    }
}

/// Reads the pictures at `paths`, files or folders of PNG and JPEG files, in the order of their names; at least one, all of one size.
///
/// # Errors
/// [`LearningError::Unsuitable`]: a path does not exist, a folder has no pictures, a file is no picture, or sizes differ.
pub fn read(paths: &[PathBuf]) -> Result<Vec<Picture>, LearningError> {
    let files = files(paths).map_err(LearningError::Unsuitable)?;
    let pictures: Result<Vec<Picture>, String> = files.iter().map(|file| read_file(file)).collect();
    let pictures = pictures.map_err(LearningError::Unsuitable)?;
    let first = &pictures[0];
    if let Some(other) = pictures.iter().find(|picture| picture.size() != first.size()) {
        let ([width, height], [other_width, other_height]) = (first.size(), other.size());
        return Err(LearningError::Unsuitable(format!(
            "{} has {other_width} x {other_height} pixels, but {} has {width} x {height}: take all pictures with one camera at one size, \
             and do not turn or crop them",
            other.name, first.name
        )));
    }
    Ok(pictures)
}

/// Returns true if `path` is a recording and not a picture or a folder of pictures.
#[must_use]
pub fn is_recording(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mcap"))
}

fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, String> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            files.extend(pictures_in(path)?);
        } else if path.exists() {
            files.push(path.clone());
        } else {
            return Err(format!("{} does not exist: name pictures or a folder of pictures", path.display()));
        }
    }
    if files.is_empty() {
        Err("no picture is named: name pictures or a folder of pictures".to_owned())
    } else {
        Ok(files)
    }
}

fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let cannot = |error: std::io::Error| format!("cannot read {}: {error}", folder.display());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        let path = entry.map_err(cannot)?.path();
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        if ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) {
            found.push(path);
        }
    }
    found.sort();
    if found.is_empty() {
        return Err(format!(
            "the folder {} has no .png, .jpg or .jpeg file (folders in it are not searched): add pictures or name another folder",
            folder.display()
        ));
    }
    Ok(found)
}

fn read_file(path: &Path) -> Result<Picture, String> {
    let refused = |reason: String| {
        format!(
            "{} is no picture that can be read: {reason}; remove it or save it again as PNG or JPEG",
            path.display()
        )
    };
    let bytes = std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let luma = image::load_from_memory(&bytes).map_err(|error| refused(error.to_string()))?.into_luma8();
    if luma.width() < 64 || luma.height() < 64 {
        return Err(refused(format!("it has only {} x {} pixels", luma.width(), luma.height())));
    }
    let mut gray = GrayImage::new(luma.width() as usize, luma.height() as usize);
    gray.pixels_mut().copy_from_slice(luma.as_raw());
    Ok(Picture { name: path.display().to_string(), gray })
}
