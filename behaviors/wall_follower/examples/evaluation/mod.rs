//! What the evaluations on photographs share: arguments, loading, percentiles and the picture of one result.

use nalgebra::Vector2;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_drawing::Canvas;
use yamabico_vision::segments::Segment;
use yamabico_vision::vanishing_point::VanishingPoint;

/// `DIR [--json] [--out DIR]`
pub struct Arguments {
    pub folder: PathBuf,
    pub json: bool,
    pub out: Option<PathBuf>,
}

impl Arguments {
    pub fn parse() -> Result<Self, String> {
        let (mut folder, mut json, mut out) = (None, false, None);
        let mut rest = std::env::args().skip(1);
        while let Some(argument) = rest.next() {
            match argument.as_str() {
                "--json" => json = true,
                "--out" => out = Some(PathBuf::from(rest.next().ok_or("--out needs a folder")?)),
                _ if folder.is_none() && !argument.starts_with('-') => folder = Some(PathBuf::from(argument)),
                _ => return Err(format!("unknown argument {argument}; usage: DIR [--json] [--out DIR]")),
            }
        }
        if let Some(out) = &out {
            std::fs::create_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
        }
        Ok(Self { folder: folder.ok_or("usage: DIR [--json] [--out DIR]")?, json, out })
    }
}

pub fn exit_code(result: Result<(), String>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

pub fn load_json(path: &Path) -> Result<Value, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

pub fn load_gray(path: &Path) -> Result<GrayImage, String> {
    let rgb = image::open(path).map_err(|e| format!("{}: {e}", path.display()))?.to_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let mut gray = GrayImage::default();
    gray.copy_from_rgb8(rgb.as_raw(), width, height, 3 * width)
        .map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(gray)
}

/// Percentile `share` in [0, 1], linear between the values; NaN for none.
pub fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    low + (high - low) * place.fract()
}

/// Writes the picture: segments yellow, inliers green, the point found red, the truth (a cross, in blue).
pub fn draw(
    view: ImageView,
    segments: &[Segment],
    found: Option<&VanishingPoint>,
    truth: Option<Vector2<f64>>,
    path: &Path,
) -> Result<(), String> {
    let (width, height) = (view.width(), view.height());
    let mut data = vec![0; 3 * width * height];
    let mut canvas = Canvas::new(&mut data, width, height).ok_or("a canvas of the wrong size")?;
    canvas.copy_gray(view);
    for segment in segments {
        canvas.line(segment.p0, segment.p1, [230, 190, 0]);
    }
    if let Some(point) = found {
        for &i in point.inliers {
            canvas.line(segments[i].p0, segments[i].p1, [0, 255, 60]);
        }
        canvas.cross(point.pixel, 14.0, [255, 0, 0]);
    }
    if let Some(truth) = truth {
        canvas.cross(truth, 8.0, [60, 120, 255]);
    }
    image::save_buffer(path, &data, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| format!("{}: {e}", path.display()))
}
