//! How much of the floor in photographs the navel grid takes for free, and how much of what it takes is floor.
//!
//! `evaluate_floor_masks [DIR] [--set TOML]`
//!
//! DIR holds `floor_masks/` (images, masks of the whole floor, masks of what is uncertain) and `corridor_drive/` (images, masks
//! of a safe lane); without it `YAMABICO_DATA`, else `../shared/data` beside the workspace. A folder that is not there is
//! skipped with a line that says so. Photographs are scaled to the grid, each stands alone, the polarity is the one that
//! leaves the foreground free (bright where both do; a photograph where neither does has no free cell). Counted are pixels
//! of the cells below each column's lowest obstacle. Nobody chose these cameras or floors for the method: most show floors
//! that are not brighter than everything else. For comparison: taking the lower half of every picture for floor.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use yamabico_core::image::{GrayImage, ImageView};
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::navel_grid::{Cells, Look, Polarity};

fn main() -> ExitCode {
    match evaluate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

/// Pixels counted over pictures.
#[derive(Clone, Copy, Default)]
struct Score {
    pictures: usize,
    refused: usize,
    told: u64,
    floor: u64,
    both: u64,
}

impl Score {
    fn add(&mut self, other: &Score) {
        self.pictures += other.pictures;
        self.refused += other.refused;
        self.told += other.told;
        self.floor += other.floor;
        self.both += other.both;
    }

    fn precision(&self) -> f64 {
        self.both as f64 / self.told as f64
    }

    fn recall(&self) -> f64 {
        self.both as f64 / self.floor as f64
    }
}

fn evaluate() -> Result<(), String> {
    let (mut data, mut toml) = (None, String::new());
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--set" => toml = toml + &rest.next().ok_or("--set needs a value")? + "\n",
            _ if data.is_none() && !argument.starts_with('-') => data = Some(PathBuf::from(&argument)),
            _ => return Err(format!("unknown argument {argument}")),
        }
    }
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = data.or_else(|| std::env::var_os("YAMABICO_DATA").map(PathBuf::from)).unwrap_or(beside);
    let config: Config = toml::from_str(&toml).map_err(|e| e.to_string())?;
    let mut look = Look::new(config.grid(), config.min_contrast, config.floor_evenness);
    floor_masks(&data.join("floor_masks"), &mut look)?;
    corridor_drive(&data.join("corridor_drive"), &mut look)
}

fn floor_masks(folder: &Path, look: &mut Look) -> Result<(), String> {
    let Some(names) = names_in(folder, "floor masks")? else { return Ok(()) };
    let (mut scenes, mut halves) = (BTreeMap::<String, Score>::new(), Score::default());
    for name in &names {
        let image = read(&folder.join("images").join(format!("{name}.jpg")))?;
        let mask = read(&folder.join("masks").join(format!("{name}.png")))?;
        let ignore = read(&folder.join("ignore").join(format!("{name}.png")))?;
        // The name ends with the frame's number.
        let scene = name.rsplit_once("_f").map_or(name.as_str(), |(scene, _)| scene);
        let score = score(look, &image, &mask, Some(&ignore))?;
        scenes.entry(scene.trim_start_matches("robot_hand_").to_owned()).or_default().add(&score);
        halves.add(&count(&mask, Some(&ignore), |_, v| 2 * v >= mask.height()));
    }
    let mut all = Score::default();
    for (scene, score) in &scenes {
        print_score(scene, score);
        all.add(score);
    }
    print_score("floor masks, all", &all);
    print_score("... the lower half of each picture", &halves);
    Ok(())
}

fn corridor_drive(folder: &Path, look: &mut Look) -> Result<(), String> {
    let Some(names) = names_in(folder, "corridor drive")? else { return Ok(()) };
    let (mut all, mut halves) = (Score::default(), Score::default());
    for name in &names {
        let mask_path = folder.join("masks").join(format!("{name}.png"));
        if !mask_path.exists() {
            continue;
        }
        let image = read(&folder.join("images").join(format!("{name}.jpg")))?;
        let mask = read(&mask_path)?;
        all.add(&score(look, &image, &mask, None)?);
        halves.add(&count(&mask, None, |_, v| 2 * v >= mask.height()));
    }
    print_score("corridor drive (the mask is a lane: recall counts)", &all);
    print_score("... the lower half of each picture", &halves);
    Ok(())
}

fn print_score(what: &str, score: &Score) {
    println!(
        "{what}: {} pictures, precision {:.3}, recall {:.3}; {} without free floor",
        score.pictures,
        score.precision(),
        score.recall(),
        score.refused
    );
}

/// Names of the pictures without their ending; `None` where the folder is not there.
fn names_in(folder: &Path, what: &str) -> Result<Option<Vec<String>>, String> {
    let Ok(entries) = std::fs::read_dir(folder.join("images")) else {
        println!("{what}: skipped, {} is not there", folder.display());
        return Ok(None);
    };
    let mut names: Vec<String> =
        entries.filter_map(|entry| entry.ok()?.path().file_stem()?.to_str().map(str::to_owned)).collect();
    names.sort();
    if names.is_empty() { Err(format!("{}: no pictures", folder.display())) } else { Ok(Some(names)) }
}

fn read(path: &Path) -> Result<GrayImage, String> {
    let problem = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let rgb = image::open(path).map_err(|e| problem(&e))?.to_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let mut gray = GrayImage::default();
    gray.copy_from_rgb8(rgb.as_raw(), width, height, 3 * width).map_err(|e| problem(&e))?;
    Ok(gray)
}

fn score(
    look: &mut Look,
    image: &GrayImage,
    mask: &GrayImage,
    ignore: Option<&GrayImage>,
) -> Result<Score, String> {
    let view: ImageView = image.view().map_err(|e| e.to_string())?;
    let mut free = Vec::new();
    if look.measure(view).is_ok() {
        let polarities = [Polarity::BrightFloor, Polarity::DarkFloor];
        if let Some(&polarity) = polarities.iter().find(|&&p| look.cells(p).is_foreground_free()) {
            let cells: &Cells = look.cells(polarity);
            cells.profile(&mut free);
        }
    }
    let Some(columns) = Some(free.len()).filter(|&columns| columns > 0) else {
        return Ok(Score { refused: 1, ..count(mask, ignore, |_, _| false) });
    };
    let rows = look.size().rows;
    Ok(count(mask, ignore, |u, v| {
        let row_from_bottom = rows - 1 - v * rows / mask.height();
        (row_from_bottom as u32) < free[u * columns / mask.width()]
    }))
}

fn count(mask: &GrayImage, ignore: Option<&GrayImage>, told: impl Fn(usize, usize) -> bool) -> Score {
    let mut score = Score { pictures: 1, ..Score::default() };
    for v in 0..mask.height() {
        for u in 0..mask.width() {
            let place = v * mask.width() + u;
            if ignore.is_some_and(|ignore| ignore.pixels().get(place).is_some_and(|&pixel| pixel > 127)) {
                continue;
            }
            let (is_floor, is_told) = (mask.pixels()[place] > 127, told(u, v));
            score.floor += u64::from(is_floor);
            score.told += u64::from(is_told);
            score.both += u64::from(is_floor && is_told);
        }
    }
    score
}
