//! Precision and recall of the navel grid's free floor on photographs with floor masks.

use std::collections::BTreeMap;
use std::path::Path;

use clap::Args;
use yamabico_core::image::GrayImage;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::navel_grid::{CellDetector, Polarity};

use crate::arguments::{Data, Parameters};
use crate::images::load_gray;
use crate::report::{Report, Table, number};

/// Precision and recall of the navel grid's free floor on photographs (`floor_masks/`, `corridor_drive/`).
///
/// `floor_masks` has masks of the whole floor and of uncertain pixels, `corridor_drive` masks of a safe lane, so that only recall counts
/// there. Photographs are scaled to the grid and evaluated independently, with the polarity that leaves the foreground free (bright if
/// both do; no free cell if neither does). Counted are the pixels of the cells below the lowest obstacle of each column. The cameras
/// and floors were not chosen for the method: most floors are not brighter than everything else. Baseline: the lower half of every
/// image is floor.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    parameters: Parameters,
}

/// Pixels counted over images.
#[derive(Clone, Copy, Default)]
struct Score {
    images: usize,
    refused: usize,
    detected: u64,
    floor: u64,
    both: u64,
}

impl Score {
    fn add(&mut self, other: &Score) {
        self.images += other.images;
        self.refused += other.refused;
        self.detected += other.detected;
        self.floor += other.floor;
        self.both += other.both;
    }

    fn row(&self, table: &mut Table, name: &str) {
        table.row([
            name.into(),
            self.images.into(),
            number(self.both as f64 / self.detected as f64, 3),
            number(self.both as f64 / self.floor as f64, 3),
            self.refused.into(),
        ]);
    }
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let config: Config = self.parameters.over("")?.try_into().map_err(|error| format!("{error}"))?;
        let mut detector = CellDetector::new(config.grid(), config.min_contrast, config.floor_evenness);
        let mut tables = Vec::new();
        if let Some(folder) = self.data.set("floor_masks") {
            tables.push(floor_masks(&folder, &mut detector)?);
        }
        if let Some(folder) = self.data.set("corridor_drive") {
            tables.push(corridor_drive(&folder, &mut detector)?);
        }
        Ok(Report::new(tables))
    }
}

fn table(title: &str) -> Table {
    Table::new(title, &["images", "count", "precision", "recall", "without free floor"])
}

fn floor_masks(folder: &Path, detector: &mut CellDetector) -> Result<Table, String> {
    let (mut scenes, mut halves) = (BTreeMap::<String, Score>::new(), Score::default());
    for name in &image_names(folder)? {
        let image = load_gray(&folder.join("images").join(format!("{name}.jpg")))?;
        let mask = load_gray(&folder.join("masks").join(format!("{name}.png")))?;
        let ignore = load_gray(&folder.join("ignore").join(format!("{name}.png")))?;
        // The name ends with the frame number.
        let scene = name.rsplit_once("_f").map_or(name.as_str(), |(scene, _)| scene);
        let score = score(detector, &image, &mask, Some(&ignore))?;
        scenes.entry(scene.trim_start_matches("robot_hand_").to_owned()).or_default().add(&score);
        halves.add(&count(&mask, Some(&ignore), |_, v| 2 * v >= mask.height()));
    }
    let (mut table, mut all) = (table("Floor masks"), Score::default());
    for (scene, score) in &scenes {
        score.row(&mut table, scene);
        all.add(score);
    }
    all.row(&mut table, "all");
    halves.row(&mut table, "baseline: lower half");
    Ok(table)
}

fn corridor_drive(folder: &Path, detector: &mut CellDetector) -> Result<Table, String> {
    let (mut all, mut halves) = (Score::default(), Score::default());
    for name in &image_names(folder)? {
        let mask_path = folder.join("masks").join(format!("{name}.png"));
        if !mask_path.exists() {
            continue;
        }
        let image = load_gray(&folder.join("images").join(format!("{name}.jpg")))?;
        let mask = load_gray(&mask_path)?;
        all.add(&score(detector, &image, &mask, None)?);
        halves.add(&count(&mask, None, |_, v| 2 * v >= mask.height()));
    }
    let mut table = table("Corridor drive (the mask is a lane: recall counts)");
    all.row(&mut table, "all");
    halves.row(&mut table, "baseline: lower half");
    Ok(table)
}

/// Returns the names of the images without extension, sorted.
fn image_names(folder: &Path) -> Result<Vec<String>, String> {
    let folder = folder.join("images");
    let entries = std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut names: Vec<String> =
        entries.filter_map(|entry| entry.ok()?.path().file_stem()?.to_str().map(str::to_owned)).collect();
    names.sort();
    if names.is_empty() { Err(format!("{}: no images", folder.display())) } else { Ok(names) }
}

fn score(
    detector: &mut CellDetector,
    image: &GrayImage,
    mask: &GrayImage,
    ignore: Option<&GrayImage>,
) -> Result<Score, String> {
    let view = image.view().map_err(|error| error.to_string())?;
    let mut free = Vec::new();
    if detector.measure(view).is_ok() {
        let polarities = [Polarity::BrightFloor, Polarity::DarkFloor];
        if let Some(&polarity) =
            polarities.iter().find(|&&polarity| detector.cells(polarity).is_foreground_free())
        {
            detector.cells(polarity).profile(&mut free);
        }
    }
    let columns = free.len();
    if columns == 0 {
        return Ok(Score { refused: 1, ..count(mask, ignore, |_, _| false) });
    }
    let rows = detector.size().rows;
    Ok(count(mask, ignore, |u, v| {
        let row_from_bottom = rows - 1 - v * rows / mask.height();
        (row_from_bottom as u32) < free[u * columns / mask.width()]
    }))
}

fn count(mask: &GrayImage, ignore: Option<&GrayImage>, is_detected: impl Fn(usize, usize) -> bool) -> Score {
    let mut score = Score { images: 1, ..Score::default() };
    for v in 0..mask.height() {
        for u in 0..mask.width() {
            let i = v * mask.width() + u;
            if ignore.is_some_and(|ignore| ignore.pixels().get(i).is_some_and(|&pixel| pixel > 127)) {
                continue;
            }
            let (is_floor, is_detected) = (mask.pixels()[i] > 127, is_detected(u, v));
            score.floor += u64::from(is_floor);
            score.detected += u64::from(is_detected);
            score.both += u64::from(is_floor && is_detected);
        }
    }
    score
}
