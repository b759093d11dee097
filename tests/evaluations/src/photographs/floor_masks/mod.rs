//! Precision and recall of free floor on photographs with floor masks: the navel grid's brightness, and the floor's look.

mod ranking;
mod rendered;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use image::RgbImage;
use yamabico_core::image::{GrayImage, RgbView};
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::navel_grid::{CellDetector, Polarity};
use yamabico_vision::floor_appearance::{FloorAppearance, FloorPlace, Picture};

use self::ranking::Ranking;
use crate::arguments::{Data, Parameters, Seeds};
use crate::images::{Output, load_gray, load_rgb};
use crate::report::{Report, Table, number, optional};

/// Recall at which the precision is compared.
const RECALL: f64 = 0.7;
/// Color of floor in overlays.
const GREEN: [u8; 3] = [0, 255, 0];
/// Color of the true floor's outline in overlays.
const RED: [u8; 3] = [255, 0, 0];

/// Precision and recall of free floor on photographs (`floor_masks/`, `corridor_drive/`).
///
/// `floor_masks` has masks of the whole floor and of uncertain pixels, `corridor_drive` masks of a safe lane, so that only recall counts
/// there. Photographs are evaluated independently. Brightness: scaled to the navel grid, with the polarity that leaves the foreground
/// free (bright if both do; no free cell if neither does); counted are the pixels of the cells below the lowest obstacle of each column.
/// Look: blocks with log odds above 0, for a level camera and without a learned look, in color and in gray; the precision at recall 0.7
/// ranks the pixels of all images of a row together. Baseline: the lower half of every image is floor. With `--seeds`, instead of
/// photographs: the pictures of the robot's camera in buildings drawn from these seeds, by kind of floor, with the camera's mount known.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    parameters: Parameters,
    #[command(flatten)]
    seeds: Seeds,
    /// Only scenes whose name begins with this; may be repeated.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Folder for images with the floor by its look (green) and the true floor's outline (red).
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
}

/// A photograph with its masks.
struct Frame {
    name: String,
    color: RgbImage,
    gray: GrayImage,
    mask: GrayImage,
    ignore: Option<GrayImage>,
    place: FloorPlace,
}

impl Frame {
    fn load(folder: &Path, name: &str) -> Result<Self, String> {
        let path = |kind: &str, extension: &str| folder.join(kind).join(format!("{name}.{extension}"));
        let (image, ignore) = (path("images", "jpg"), path("ignore", "png"));
        Ok(Self {
            name: name.to_owned(),
            color: load_rgb(&image)?,
            gray: load_gray(&image)?,
            mask: load_gray(&path("masks", "png"))?,
            ignore: if ignore.exists() { Some(load_gray(&ignore)?) } else { None },
            place: FloorPlace::UNKNOWN_CAMERA,
        })
    }

    /// Returns the scene: the name ends with the frame number.
    fn scene(&self) -> &str {
        let scene = self.name.rsplit_once("_f").map_or(self.name.as_str(), |(scene, _)| scene);
        scene.trim_start_matches("robot_hand_")
    }

    fn is_floor(&self, u: usize, v: usize) -> bool {
        self.mask.pixels().get(v * self.mask.width() + u).is_some_and(|&pixel| pixel > 127)
    }

    fn is_ignored(&self, u: usize, v: usize) -> bool {
        let i = v * self.mask.width() + u;
        self.ignore.as_ref().is_some_and(|ignore| ignore.pixels().get(i).is_some_and(|&pixel| pixel > 127))
    }
}

/// Method that finds the floor.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Method {
    Brightness,
    Look,
    GrayLook,
    LowerHalf,
}

impl Method {
    const ALL: [Self; 4] = [Self::Brightness, Self::Look, Self::GrayLook, Self::LowerHalf];

    const fn name(self) -> &'static str {
        match self {
            Self::Brightness => "brightness",
            Self::Look => "look",
            Self::GrayLook => "look, gray",
            Self::LowerHalf => "baseline: lower half",
        }
    }
}

/// The methods with their buffers.
struct Finder {
    cells: CellDetector,
    appearance: FloorAppearance,
    free: Vec<u32>,
}

impl Finder {
    /// Writes the log odds of floor of each pixel (above 0: floor) to `log_odds`; returns false if the image is refused.
    fn find(&mut self, method: Method, frame: &Frame, log_odds: &mut Vec<f32>) -> Result<bool, String> {
        let (width, height) = (frame.mask.width(), frame.mask.height());
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (u, v)));
        log_odds.clear();
        match method {
            Method::LowerHalf => {
                log_odds.extend(pixels.map(|(_, v)| if 2 * v >= height { 1.0 } else { -1.0 }));
            }
            Method::Brightness => {
                if !self.mark(frame)? {
                    return Ok(false);
                }
                let (rows, columns) = (self.cells.size().rows, self.free.len());
                log_odds.extend(pixels.map(|(u, v)| {
                    let row_from_bottom = rows - 1 - v * rows / height;
                    if (row_from_bottom as u32) < self.free[u * columns / width] { 1.0 } else { -1.0 }
                }));
            }
            Method::Look | Method::GrayLook => {
                let view = RgbView::new(frame.color.as_raw(), width, height, 3 * width);
                let picture = match method {
                    Method::Look => Picture::Color(view.map_err(|error| error.to_string())?),
                    _ => Picture::Gray(frame.gray.view().map_err(|error| error.to_string())?),
                };
                let Ok(votes) = self.appearance.observe(picture, &frame.place) else {
                    return Ok(false);
                };
                log_odds.extend(pixels.map(|(u, v)| votes.log_odds_at_pixel(u, v)));
            }
        }
        Ok(true)
    }

    /// Counts the free cells of each column; false if there are none.
    fn mark(&mut self, frame: &Frame) -> Result<bool, String> {
        let view = frame.gray.view().map_err(|error| error.to_string())?;
        let polarities = [Polarity::BrightFloor, Polarity::DarkFloor];
        let found = self.cells.measure(view).is_ok().then(|| {
            polarities.into_iter().find(|&polarity| self.cells.cells(polarity).is_foreground_free())
        });
        let Some(Some(polarity)) = found else { return Ok(false) };
        self.cells.cells(polarity).profile(&mut self.free);
        Ok(true)
    }
}

/// Pixels counted over images.
#[derive(Clone, Default)]
struct Score {
    images: usize,
    refused: usize,
    detected: u64,
    floor: u64,
    both: u64,
    ranking: Ranking,
}

impl Score {
    fn of(frame: &Frame, log_odds: Option<&[f32]>) -> Self {
        let mut score = Self { images: 1, refused: usize::from(log_odds.is_none()), ..Self::default() };
        let (width, height) = (frame.mask.width(), frame.mask.height());
        for (v, u) in (0..height).flat_map(|v| (0..width).map(move |u| (v, u))) {
            if frame.is_ignored(u, v) {
                continue;
            }
            let is_floor = frame.is_floor(u, v);
            let log_odds = log_odds.map(|log_odds| log_odds[v * width + u]);
            let is_detected = log_odds.is_some_and(|log_odds| log_odds > 0.0);
            score.floor += u64::from(is_floor);
            score.detected += u64::from(is_detected);
            score.both += u64::from(is_floor && is_detected);
            score.ranking.add(log_odds, is_floor);
        }
        score
    }

    fn add(&mut self, other: &Score) {
        self.images += other.images;
        self.refused += other.refused;
        self.detected += other.detected;
        self.floor += other.floor;
        self.both += other.both;
        self.ranking.merge(&other.ranking);
    }

    fn row(&self, table: &mut Table, method: Method, name: &str) {
        table.row([
            method.name().into(),
            name.into(),
            self.images.into(),
            number(self.both as f64 / self.detected as f64, 3),
            number(self.both as f64 / self.floor as f64, 3),
            optional(self.ranking.precision_at(RECALL), 3),
            self.refused.into(),
        ]);
    }
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let config: Config = self.parameters.over("")?.try_into().map_err(|error| format!("{error}"))?;
        let mut finder = Finder {
            cells: CellDetector::new(config.grid(), config.min_contrast, config.floor_evenness),
            appearance: FloorAppearance::default(),
            free: Vec::new(),
        };
        let output = Output::new(self.overlays.clone())?;
        let mut tables = Vec::new();
        let seeds = self.seeds.or(0..0);
        if !seeds.is_empty() {
            let frames = seeds.map(rendered::frame);
            tables.push(self.table("Buildings drawn from seeds", frames, &mut finder, &output)?);
            return Ok(Report::new(tables));
        }
        for (set, title) in [
            ("floor_masks", "Floor masks"),
            ("corridor_drive", "Corridor drive (the mask is a lane: recall counts)"),
        ] {
            if let Some(folder) = self.data.set(set) {
                let names = image_names(&folder)?;
                let frames = names.iter().map(|name| Frame::load(&folder, name));
                tables.push(self.table(title, frames, &mut finder, &output)?);
            }
        }
        Ok(Report::new(tables))
    }

    fn table(
        &self,
        title: &str,
        frames: impl Iterator<Item = Result<Frame, String>>,
        finder: &mut Finder,
        output: &Output,
    ) -> Result<Table, String> {
        let mut scores = BTreeMap::<(Method, String), Score>::new();
        let mut log_odds = Vec::new();
        for frame in frames {
            let frame = frame?;
            let is_chosen = |scene: &String| frame.scene().starts_with(scene.as_str());
            if !self.scene.is_empty() && !self.scene.iter().any(is_chosen) {
                continue;
            }
            for method in Method::ALL {
                let is_found = finder.find(method, &frame, &mut log_odds)?;
                let score = Score::of(&frame, is_found.then_some(log_odds.as_slice()));
                scores.entry((method, frame.scene().to_owned())).or_default().add(&score);
                if method == Method::Look && is_found {
                    overlay(output, &frame, &log_odds)?;
                }
            }
        }
        let columns = &[
            "method",
            "images",
            "count",
            "precision",
            "recall",
            "precision at recall 0.7",
            "without free floor",
        ];
        let mut table = Table::new(title, columns);
        for method in Method::ALL {
            let mut all = Score::default();
            for ((_, scene), score) in scores.iter().filter(|((of, _), _)| *of == method) {
                all.add(score);
                if method != Method::LowerHalf {
                    score.row(&mut table, method, scene);
                }
            }
            all.row(&mut table, method, "all");
        }
        Ok(table)
    }
}

/// Writes the image with the floor in green and the outline of the true floor in red.
fn overlay(output: &Output, frame: &Frame, log_odds: &[f32]) -> Result<(), String> {
    if !output.is_on() {
        return Ok(());
    }
    let mut image = frame.color.clone();
    let width = frame.mask.width();
    for (u, v, pixel) in image.enumerate_pixels_mut() {
        let (u, v) = (u as usize, v as usize);
        if log_odds[v * width + u] > 0.0 {
            (0..3).for_each(|i| pixel[i] = pixel[i] / 2 + GREEN[i] / 2);
        }
        let is_floor = frame.is_floor(u, v);
        if is_floor != frame.is_floor(u + 1, v) || is_floor != frame.is_floor(u, v + 1) {
            pixel.0 = RED;
        }
    }
    output.rgb(&frame.name, image.as_raw(), image.width(), image.height())
}

/// Returns the names of the images that have a mask, without extension, sorted.
fn image_names(folder: &Path) -> Result<Vec<String>, String> {
    let images = folder.join("images");
    let entries = std::fs::read_dir(&images).map_err(|error| format!("{}: {error}", images.display()))?;
    let stems = entries.filter_map(|entry| entry.ok()?.path().file_stem()?.to_str().map(str::to_owned));
    let mut names: Vec<String> =
        stems.filter(|name| folder.join("masks").join(format!("{name}.png")).exists()).collect();
    names.sort();
    if names.is_empty() { Err(format!("{}: no images with masks", folder.display())) } else { Ok(names) }
}
