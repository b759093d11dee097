//! Error of the vanishing point on the York Urban Database.

use std::path::Path;

use clap::Args;
use nalgebra::{Vector2, Vector3};
use serde_json::Value;
use yamabico_core::camera::{Calibration, Intrinsics};

use super::answers::{Answer, Looker, Summary};
use super::draw_answer;
use crate::arguments::Data;
use crate::images::{Output, load_gray};
use crate::report::{Cell, Report, Table, number, optional};
use crate::statistics::percentile;

/// Error of a photograph without a vanishing point, degrees.
const NOT_FOUND_DEG: f64 = 90.0;

/// Error of the vanishing point on the York Urban Database (`york_urban/`), and its probability.
///
/// Takes every photograph with a horizontal vanishing point in view and compares the vanishing point, found without prediction, with the
/// labeled directions `vp_dirs` of `ground_truth.json`. The method that presumes the horizon answers in the same table. Images:
/// segments yellow, inliers green, vanishing point red, truth blue.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

struct Photograph {
    is_indoor: bool,
    segments: usize,
    answer: Answer,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("york_urban") else { return Ok(Report::default()) };
        let photographs = photographs(&folder, out)?;
        let mut each = Table::new(
            "York Urban",
            &["photograph", "place", "segments", "probability", "error, degrees", "presumed horizon: error"],
        );
        for p in &photographs {
            let place = if p.is_indoor { "indoor" } else { "outdoor" };
            each.row([
                p.answer.name.clone().into(),
                place.into(),
                p.segments.into(),
                number(p.answer.probability, 3),
                optional(p.answer.error_deg, 3),
                optional(p.answer.presumed_deg, 3),
            ]);
        }
        let mut all = Table::new(
            "Errors (no vanishing point counts as 90 degrees)",
            &["photographs", "count", "median, deg", "90 %, deg", "within 3", "within 5", "within 10"],
        );
        let of = |is_wanted: fn(&Photograph) -> bool| -> Vec<&Answer> {
            photographs.iter().filter(|p| is_wanted(p)).map(|p| &p.answer).collect()
        };
        let (every, indoor) = (of(|_| true), of(|p| p.is_indoor));
        let mut summary = Summary::new("Summary");
        for (name, answers) in [("all", &every), ("indoor", &indoor)] {
            all.row(errors(&format!("{name}, evidence"), answers, |answer| answer.error_deg));
            all.row(errors(&format!("{name}, presumed horizon"), answers, |answer| answer.presumed_deg));
            summary.row(name, answers);
        }
        Ok(Report::new([each, all, summary.0]))
    }
}

/// Answers about the indoor photographs.
pub fn indoor_answers(folder: &Path) -> Result<Vec<Answer>, String> {
    let photographs = photographs(folder, &Output::new(None)?)?;
    Ok(photographs.into_iter().filter(|p| p.is_indoor).map(|p| p.answer).collect())
}

fn photographs(folder: &Path, out: &Output) -> Result<Vec<Photograph>, String> {
    let path = folder.join("ground_truth.json");
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let truth: Value = serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
    let camera = camera(&truth["camera"]).ok_or("ground_truth.json: camera is incomplete")?;
    let mut photographs = Vec::new();
    for entry in truth["images"].as_array().ok_or("ground_truth.json: no images")? {
        if let Some(axis) = axis_in_view(entry) {
            photographs.push(evaluate(entry, axis, camera, folder, out)?);
        }
    }
    if photographs.is_empty() {
        return Err("no photograph has a horizontal vanishing point in view".to_owned());
    }
    Ok(photographs)
}

fn evaluate(
    entry: &Value,
    axis: Vector3<f64>,
    camera: Intrinsics,
    folder: &Path,
    out: &Output,
) -> Result<Photograph, String> {
    let file = entry["file"].as_str().ok_or("ground_truth.json: an image without file")?;
    let name = entry["name"].as_str().unwrap_or(file);
    let image = load_gray(&folder.join(file))?;
    let truth = camera.pixel_from_normalized(axis.xy() / axis.z);
    let (answer, look) = Looker::new(camera, Calibration::Measured).answer(name, &image, Some(truth))?;
    let view = image.view().map_err(|error| format!("{file}: {error}"))?;
    out.overlay(name, view, |canvas| draw_answer(canvas, &look, Some(truth)))?;
    // Both coordinates count: the camera is calibrated.
    let angle_deg =
        |point: Vector2<f64>| camera.normalized_from_pixel(point).push(1.0).angle(&axis).to_degrees();
    Ok(Photograph {
        is_indoor: entry["indoor"].as_bool().unwrap_or(false),
        segments: look.segments.len(),
        answer: Answer {
            acting: answer.probability,
            error_deg: Some(look.point.map_or(NOT_FOUND_DEG, angle_deg)),
            presumed_deg: look.presumed.map(angle_deg),
            ..answer
        },
    })
}

/// Returns the labeled direction whose vanishing point is in view, as a unit vector that points ahead.
fn axis_in_view(entry: &Value) -> Option<Vector3<f64>> {
    let index = entry["in_image_horizontal_vp"]["vp_index"].as_u64()? as usize;
    let numbers: Vec<f64> = entry["vp_dirs"][index].as_array()?.iter().filter_map(Value::as_f64).collect();
    let axis = Vector3::from_column_slice(numbers.get(..3)?).normalize();
    Some(if axis.z < 0.0 { -axis } else { axis })
}

fn camera(truth: &Value) -> Option<Intrinsics> {
    let number = |key: &str| truth[key].as_f64();
    let f = number("f_px")?;
    Some(Intrinsics { fx: f, fy: f, cx: number("cx")?, cy: number("cy")?, width: 640, height: 480 })
}

fn errors(name: &str, answers: &[&Answer], error: fn(&Answer) -> Option<f64>) -> [Cell; 7] {
    let errors: Vec<f64> = answers.iter().map(|answer| error(answer).unwrap_or(NOT_FOUND_DEG)).collect();
    let within = |limit: f64| errors.iter().filter(|&&error| error <= limit).count();
    [
        name.into(),
        errors.len().into(),
        number(percentile(&errors, 0.5), 3),
        number(percentile(&errors, 0.9), 3),
        within(3.0).into(),
        within(5.0).into(),
        within(10.0).into(),
    ]
}
