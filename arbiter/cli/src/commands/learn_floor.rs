//! `yamabico learn floor`: the colors of a floor, from pictures in which people marked it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use serde::Serialize;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_color_file::ColorFile;
use yamabico_vision::floor_training::{FloorTraining, Judged, Label};

use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, Print, exit, fail, table};

/// A mask at least so bright is floor ...
const MIN_FLOOR: u8 = 192;
/// ... and at most so bright something else; between them it says nothing.
const MAX_OTHER: u8 = 63;
/// Ends of the names of masks, after the name of the picture.
const MASK: &str = ".mask.png";

/// What `learn floor` is told.
#[derive(Args)]
pub struct Arguments {
    /// The folder: pictures NAME.png or NAME.jpg, each with a mask NAME.mask.png of the same size. White in a mask is floor, black
    /// something else, gray is left out.
    folder: PathBuf,
    /// The file that is written.
    #[arg(long, value_name = "FILE.toml", default_value = "floor.toml")]
    out: PathBuf,
    /// What is written.
    #[arg(long, value_enum, default_value_t = Form::Table)]
    form: Form,
}

/// How floor colors are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Form {
    /// A class for each of 32 x 32 x 32 colors.
    Table,
    /// A smallest and a largest red, green and blue: faster, and enough for a floor in one light.
    Thresholds,
}

/// What was learned.
#[derive(Debug, Serialize)]
struct Learned {
    file: PathBuf,
    form: Form,
    pictures: Vec<Picture>,
}

/// What one picture gave, and how well the others tell it.
#[derive(Debug, Serialize)]
struct Picture {
    name: String,
    floor_px: u64,
    other_px: u64,
    recall: f64,
    false_alarms: f64,
    /// By what was learned from the other pictures alone; none where there is no other.
    recall_by_others: Option<f64>,
    false_alarms_by_others: Option<f64>,
}

/// Learns and prints how well.
pub fn learn(arguments: &Arguments, print: Print) -> ExitCode {
    let marked = match read_folder(&arguments.folder) {
        Ok(marked) => marked,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let mut all = FloorTraining::default();
    marked.iter().for_each(|(_, training)| all.merge(training));
    let Some(colors) = colors(&all, arguments.form) else {
        return fail("no pixel of any mask is white: nothing is floor", BAD_CONFIGURATION);
    };
    let pictures = marked.iter().enumerate().map(|(i, (name, training))| {
        let mut others = FloorTraining::default();
        marked.iter().enumerate().filter(|(k, _)| *k != i).for_each(|(_, (_, other))| others.merge(other));
        let by_others = colors_of_others(&others, arguments.form).map(|colors| training.judge(&colors));
        let (floor_px, other_px) = training.counts();
        let Judged { recall, false_alarms } = training.judge(&colors);
        Picture {
            name: name.clone(),
            floor_px,
            other_px,
            recall,
            false_alarms,
            recall_by_others: by_others.map(|judged| judged.recall),
            false_alarms_by_others: by_others.map(|judged| judged.false_alarms),
        }
    });
    let learned = Learned { file: arguments.out.clone(), form: arguments.form, pictures: pictures.collect() };
    if let Err(problem) = write(&arguments.out, &colors) {
        return fail(&problem, DEVICE_FAILED);
    }
    print.show(&learned, text);
    exit(DONE)
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

/// The pictures of a folder by name, and the marked pixels of each.
fn read_folder(folder: &Path) -> Result<Vec<(String, FloorTraining)>, String> {
    let cannot = |error: std::io::Error| format!("{}: {error}", folder.display());
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        paths.push(entry.map_err(cannot)?.path());
    }
    paths.sort();
    let mut marked = Vec::new();
    for path in &paths {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let is_picture = [".png", ".jpg", ".jpeg"].iter().any(|end| name.ends_with(end));
        if is_picture && !name.ends_with(MASK) {
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or(name);
            let mask = folder.join(format!("{stem}{MASK}"));
            marked.push((name.to_owned(), read_pair(path, &mask)?));
        }
    }
    for mask in &paths {
        let stem = mask.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(MASK));
        let has_picture = |stem: &str| marked.iter().any(|(name, _)| name.starts_with(&format!("{stem}.")));
        if stem.is_some_and(|stem| !has_picture(stem)) {
            return Err(format!("{}: there is no picture to this mask", mask.display()));
        }
    }
    if marked.is_empty() {
        return Err(format!(
            "{}: no picture NAME.png or NAME.jpg with a mask NAME{MASK} in it",
            folder.display()
        ));
    }
    Ok(marked)
}

fn read_pair(picture: &Path, mask: &Path) -> Result<FloorTraining, String> {
    if !mask.exists() {
        return Err(format!(
            "{}: its mask {} is missing: white where the floor is, black elsewhere",
            picture.display(),
            mask.display()
        ));
    }
    let open = |path: &Path| image::open(path).map_err(|error| format!("{}: {error}", path.display()));
    let (colors, marks) = (open(picture)?.to_rgb8(), open(mask)?.to_luma8());
    if colors.dimensions() != marks.dimensions() {
        let ((width, height), (other_width, other_height)) = (colors.dimensions(), marks.dimensions());
        return Err(format!(
            "{}: {other_width} x {other_height} pixels, but the picture has {width} x {height}",
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

fn write(out: &Path, colors: &FloorColors) -> Result<(), String> {
    let cannot = |error: &dyn std::fmt::Display| format!("{}: {error}", out.display());
    let text = toml::to_string_pretty(&ColorFile::from(colors)).map_err(|e| cannot(&e))?;
    if let Some(folder) = out.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| cannot(&e))?;
    }
    let head = "# Colors of a floor, as `yamabico learn floor` learned them from marked pictures.\n";
    std::fs::write(out, format!("{head}{text}")).map_err(|e| cannot(&e))
}

fn text(learned: &Learned) -> String {
    let head =
        ["picture", "floor px", "other px", "recall", "false alarms", "recall by others", "false by others"];
    let mut rows = table(&head, 1..head.len());
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let maybe = |share: Option<f64>| share.map_or_else(|| "-".into(), percent);
    for picture in &learned.pictures {
        rows.add_row([
            picture.name.clone(),
            picture.floor_px.to_string(),
            picture.other_px.to_string(),
            percent(picture.recall),
            percent(picture.false_alarms),
            maybe(picture.recall_by_others),
            maybe(picture.false_alarms_by_others),
        ]);
    }
    format!(
        "{rows}\nwritten to {}: name it as `floor_colors` of a free-space-avoider\n",
        learned.file.display()
    )
}
