//! Error of the vanishing point on the York Urban Database.

use std::path::Path;

use clap::Args;
use nalgebra::Vector3;
use serde_json::Value;
use yamabico_core::camera::Intrinsics;
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

use super::draw_vanishing_point;
use crate::arguments::Data;
use crate::images::{Output, load_gray};
use crate::report::{Cell, Report, Table, number, optional};
use crate::statistics::percentile;

/// Error of a photograph without a vanishing point, degrees.
const NOT_FOUND_DEG: f64 = 90.0;

/// Error of the vanishing point on the York Urban Database (`york_urban/`).
///
/// Takes every photograph with a horizontal vanishing point in view and compares the vanishing point, found without prediction, with the
/// labeled directions `vp_dirs` of `ground_truth.json`. Images: segments yellow, inliers green, vanishing point red, truth blue.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

struct Photograph {
    name: String,
    is_indoor: bool,
    segments: usize,
    /// Angle between found and true direction, degrees; `None` if no vanishing point was found.
    error_deg: Option<f64>,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("york_urban") else { return Ok(Report::default()) };
        let path = folder.join("ground_truth.json");
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let truth: Value =
            serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        let camera = camera(&truth["camera"]).ok_or("ground_truth.json: camera is incomplete")?;
        let mut photographs = Vec::new();
        for entry in truth["images"].as_array().ok_or("ground_truth.json: no images")? {
            if let Some(axis) = axis_in_view(entry) {
                photographs.push(evaluate(entry, axis, &camera, &folder, out)?);
            }
        }
        if photographs.is_empty() {
            return Err("no photograph has a horizontal vanishing point in view".to_owned());
        }
        let mut each = Table::new("York Urban", &["photograph", "place", "segments", "error, degrees"]);
        for p in &photographs {
            let place = if p.is_indoor { "indoor" } else { "outdoor" };
            each.row([p.name.clone().into(), place.into(), p.segments.into(), optional(p.error_deg, 3)]);
        }
        let mut all = Table::new(
            "Summary (no vanishing point counts as 90 degrees)",
            &[
                "photographs",
                "count",
                "found",
                "median, deg",
                "90 %, deg",
                "within 3",
                "within 5",
                "within 10",
            ],
        );
        all.row(summary("all", photographs.iter()));
        all.row(summary("indoor", photographs.iter().filter(|p| p.is_indoor)));
        Ok(Report::new([each, all]))
    }
}

fn evaluate(
    entry: &Value,
    axis: Vector3<f64>,
    camera: &Intrinsics,
    folder: &Path,
    out: &Output,
) -> Result<Photograph, String> {
    let file = entry["file"].as_str().ok_or("ground_truth.json: an image without file")?;
    let image = load_gray(&folder.join(file))?;
    let view = image.view().map_err(|error| format!("{file}: {error}"))?;
    let mut detector = SegmentDetector::new(SegmentConfig::default());
    let segments = detector.detect(view).unwrap_or_default();
    let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
    let found = finder.find(segments, camera, None);
    let name = entry["name"].as_str().unwrap_or(file).to_owned();
    out.overlay(&name, view, |canvas| {
        let truth = camera.pixel_from_normalized(axis.xy() / axis.z);
        draw_vanishing_point(canvas, segments, found.as_ref().ok(), truth);
    })?;
    let cosine = |direction: Vector3<f64>| direction.dot(&axis).abs().min(1.0);
    Ok(Photograph {
        name,
        is_indoor: entry["indoor"].as_bool().unwrap_or(false),
        segments: segments.len(),
        error_deg: found.ok().map(|point| cosine(point.direction).acos().to_degrees()),
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

fn summary<'a>(name: &str, photographs: impl Iterator<Item = &'a Photograph>) -> [Cell; 8] {
    let errors: Vec<Option<f64>> = photographs.map(|p| p.error_deg).collect();
    let found = errors.iter().filter(|error| error.is_some()).count();
    let errors: Vec<f64> = errors.iter().map(|error| error.unwrap_or(NOT_FOUND_DEG)).collect();
    let within = |limit: f64| errors.iter().filter(|&&error| error <= limit).count();
    [
        name.into(),
        errors.len().into(),
        found.into(),
        number(percentile(&errors, 0.5), 3),
        number(percentile(&errors, 0.9), 3),
        within(3.0).into(),
        within(5.0).into(),
        within(10.0).into(),
    ]
}
