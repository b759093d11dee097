//! The colors of a floor, from images in which people marked it.

use std::path::{Path, PathBuf};

use serde::Serialize;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_color_file::{ColorFile, FLOOR_COLORS_FILE};
use yamabico_vision::floor_training::{ColorAccuracy, FloorTraining, Label};

use crate::LearningError;
use crate::error::write_text;

/// Minimum brightness of a mask pixel that marks floor.
const MIN_FLOOR: u8 = 192;
/// Maximum brightness of a mask pixel that marks something else; a pixel between the two bounds is left out.
const MAX_OTHER: u8 = 63;
/// Ending of the name of a mask, after the name of its image.
const MASK: &str = ".mask.png";

/// The form of a set of floor colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// A class for each of 32 x 32 x 32 colors.
    Table,
    /// A minimum and a maximum of red, green and blue.
    Thresholds,
}

/// The floor colors learned from a folder.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// The file that was written.
    pub file: PathBuf,
    /// The form of the colors in it.
    pub form: Form,
    /// The images, by name.
    pub images: Vec<MarkedImage>,
}

/// A marked image and how well its floor is recognized.
#[derive(Debug, Serialize)]
pub struct MarkedImage {
    /// File name.
    pub name: String,
    /// Number of pixels marked as floor.
    pub floor_px: u64,
    /// Number of pixels marked as something else.
    pub other_px: u64,
    /// Share of the floor pixels that is recognized, 0 to 1.
    pub recall: f64,
    /// Share of the other pixels that is mistaken for floor, 0 to 1.
    pub false_alarms: f64,
    /// Recall of the colors learned from all other images; `None` for a single image.
    pub recall_by_others: Option<f64>,
    /// Share of false alarms of the colors learned from all other images; `None` for a single image.
    pub false_alarms_by_others: Option<f64>,
}

/// Learns from the images NAME.png and NAME.jpg of `folder`, each with a mask NAME.mask.png, and writes `file`.
///
/// # Errors
/// [`LearningError`]; a folder without images, a missing or extra mask, and masks without floor are unsuitable.
pub fn learn(folder: &Path, file: &Path, form: Form) -> Result<Learned, LearningError> {
    let marked = read_folder(folder).map_err(LearningError::Unsuitable)?;
    let mut all = FloorTraining::default();
    marked.iter().for_each(|(_, training)| all.merge(training));
    let Some(colors) = colors(&all, form) else {
        let problem = format!("{}: no mask has a white pixel, so no pixel is floor", folder.display());
        return Err(LearningError::Unsuitable(problem));
    };
    let images = marked.iter().enumerate().map(|(i, (name, training))| {
        let mut others = FloorTraining::default();
        marked.iter().enumerate().filter(|(k, _)| *k != i).for_each(|(_, (_, other))| others.merge(other));
        let by_others = colors_of_others(&others, form).map(|colors| training.evaluate(&colors));
        let (floor_px, other_px) = training.counts();
        let ColorAccuracy { recall, false_alarms } = training.evaluate(&colors);
        MarkedImage {
            name: name.clone(),
            floor_px,
            other_px,
            recall,
            false_alarms,
            recall_by_others: by_others.map(|judged| judged.recall),
            false_alarms_by_others: by_others.map(|judged| judged.false_alarms),
        }
    });
    let learned = Learned { file: file.to_owned(), form, images: images.collect() };
    let text = toml::to_string_pretty(&ColorFile::from(&colors))
        .map_err(|error| LearningError::write(file, error))?;
    let head = "# Colors of a floor, learned by `yamabico learn floor` from marked images.\n";
    write_text(file, &FLOOR_COLORS_FILE, &format!("{head}{text}"))?;
    Ok(learned)
}

fn colors(training: &FloorTraining, form: Form) -> Option<FloorColors> {
    match form {
        _ if training.counts().0 == 0 => None,
        Form::Table => Some(training.table()),
        Form::Thresholds => training.thresholds(),
    }
}

fn colors_of_others(others: &FloorTraining, form: Form) -> Option<FloorColors> {
    (others.counts() != (0, 0)).then(|| colors(others, form)).flatten()
}

/// The images of a folder by name, with the marked pixels of each.
fn read_folder(folder: &Path) -> Result<Vec<(String, FloorTraining)>, String> {
    let cannot = |error: std::io::Error| format!("cannot read {}: {error}", folder.display());
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        paths.push(entry.map_err(cannot)?.path());
    }
    paths.sort();
    let mut marked = Vec::new();
    for path in &paths {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let is_image = [".png", ".jpg", ".jpeg"].iter().any(|end| name.ends_with(end));
        if is_image && !name.ends_with(MASK) {
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or(name);
            let mask = folder.join(format!("{stem}{MASK}"));
            marked.push((name.to_owned(), read_pair(path, &mask)?));
        }
    }
    for mask in &paths {
        let stem = mask.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(MASK));
        let has_image = |stem: &str| marked.iter().any(|(name, _)| name.starts_with(&format!("{stem}.")));
        if stem.is_some_and(|stem| !has_image(stem)) {
            return Err(format!(
                "{}: the image of this mask is missing: add it, or remove the mask",
                mask.display()
            ));
        }
    }
    if marked.is_empty() {
        return Err(format!(
            "{} has no images: add images NAME.png or NAME.jpg, each with a mask NAME{MASK}",
            folder.display()
        ));
    }
    Ok(marked)
}

fn read_pair(image: &Path, mask: &Path) -> Result<FloorTraining, String> {
    if !mask.exists() {
        return Err(format!(
            "{}: its mask {} is missing: draw the floor white and everything else black",
            image.display(),
            mask.display()
        ));
    }
    let open = |path: &Path| image::open(path).map_err(|error| format!("{}: {error}", path.display()));
    let (colors, marks) = (open(image)?.to_rgb8(), open(mask)?.to_luma8());
    if colors.dimensions() != marks.dimensions() {
        let ((width, height), (mask_width, mask_height)) = (colors.dimensions(), marks.dimensions());
        return Err(format!(
            "{} has {mask_width} x {mask_height} pixels, but its image has {width} x {height}: make them equal",
            mask.display()
        ));
    }
    let mut training = FloorTraining::default();
    for (color, mark) in colors.pixels().zip(marks.pixels()) {
        match mark.0[0] {
            MIN_FLOOR.. => training.add(color.0, Label::Floor),
            0..=MAX_OTHER => training.add(color.0, Label::Other),
            _ => {}
        }
    }
    Ok(training)
}
