//! How well the corridor's vanishing point is found in the photographs of the York Urban Database.
//!
//! `evaluate_york_urban DIR [--json] [--out DIR]` takes every photograph with a horizontal vanishing point in view and
//! compares, without any prediction, with the raw `vp_dirs` of `ground_truth.json`. It prints how many were found, the
//! median and 90th percentile of the error in degrees and the recall under 3, 5 and 10 degrees, for all and for the indoor
//! ones; `--out` writes a picture of each: segments yellow, inliers green, the point found red, the truth blue.

mod evaluation;

use evaluation::{Arguments, draw, load_gray, percentile};
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::process::ExitCode;
use yamabico_core::camera::Intrinsics;
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

struct Photograph {
    name: String,
    is_indoor: bool,
    segments: usize,
    /// Degrees; `None` when nothing was found.
    error_deg: Option<f64>,
}

fn main() -> ExitCode {
    evaluation::exit_code(Arguments::parse().and_then(|arguments| evaluate(&arguments)))
}

fn evaluate(arguments: &Arguments) -> Result<(), String> {
    let truth = evaluation::load_json(&arguments.folder.join("ground_truth.json"))?;
    let camera = camera(&truth["camera"]).ok_or("ground_truth.json: camera is incomplete")?;
    let mut photographs = Vec::new();
    for entry in truth["images"].as_array().ok_or("ground_truth.json: no images")? {
        if let Some(axis) = axis_in_view(entry) {
            photographs.push(look_at(entry, axis, &camera, arguments)?);
        }
    }
    if photographs.is_empty() {
        return Err("no photograph has a horizontal vanishing point in view".into());
    }
    let all = summary(photographs.iter());
    let indoor = summary(photographs.iter().filter(|p| p.is_indoor));
    if arguments.json {
        let each: Vec<_> = photographs
            .iter()
            .map(|p| json!({"name": p.name, "indoor": p.is_indoor, "segments": p.segments, "error_deg": p.error_deg}))
            .collect();
        println!("{}", json!({"all": all, "indoor": indoor, "photographs": each}));
        return Ok(());
    }
    for p in &photographs {
        let place = if p.is_indoor { "indoor" } else { "outdoor" };
        let error = p.error_deg.map_or("not found".to_owned(), |e| format!("{e:.3} degrees"));
        println!("{:<24} {place:<8} {:>4} segments  {error}", p.name, p.segments);
    }
    for (label, row) in [("all", &all), ("indoor", &indoor)] {
        println!(
            "{label:<7} {} of {} found, error median {:.3}, 90 % {:.3} degrees; within 3, 5, 10 degrees: {}, {}, {}",
            row["found"],
            row["images"],
            as_number(&row["median_deg"]),
            as_number(&row["p90_deg"]),
            row["within_3_deg"],
            row["within_5_deg"],
            row["within_10_deg"],
        );
    }
    Ok(())
}

fn look_at(
    entry: &Value,
    axis: Vector3<f64>,
    camera: &Intrinsics,
    arguments: &Arguments,
) -> Result<Photograph, String> {
    let file = entry["file"].as_str().ok_or("an image without file")?;
    let image = load_gray(&arguments.folder.join(file))?;
    let view = image.view().map_err(|e| format!("{file}: {e}"))?;
    let mut detector = SegmentDetector::new(SegmentConfig::default());
    let segments = detector.detect(view).unwrap_or_default();
    let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
    let found = finder.find(segments, camera, None);
    let name = entry["name"].as_str().unwrap_or(file).to_owned();
    if let Some(folder) = &arguments.out {
        let truth = camera.pixel_from_normalized(axis.xy() / axis.z);
        draw(view, segments, found.as_ref().ok(), Some(truth), &folder.join(format!("{name}.png")))?;
    }
    let cosine = |direction: Vector3<f64>| direction.dot(&axis).abs().min(1.0);
    Ok(Photograph {
        name,
        is_indoor: entry["indoor"].as_bool().unwrap_or(false),
        segments: segments.len(),
        error_deg: found.ok().map(|point| cosine(point.direction).acos().to_degrees()),
    })
}

/// The labeled direction whose vanishing point is in view, as a unit vector that points ahead.
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

fn summary<'a>(photographs: impl Iterator<Item = &'a Photograph>) -> Value {
    // What was not found counts as a right angle.
    let mut errors: Vec<f64> = Vec::new();
    let mut found = 0;
    for p in photographs {
        found += usize::from(p.error_deg.is_some());
        errors.push(p.error_deg.unwrap_or(90.0));
    }
    let within = |limit: f64| errors.iter().filter(|&&e| e <= limit).count();
    json!({
        "images": errors.len(), "found": found,
        "median_deg": percentile(&errors, 0.5), "p90_deg": percentile(&errors, 0.9),
        "within_3_deg": within(3.0), "within_5_deg": within(5.0), "within_10_deg": within(10.0),
    })
}

fn as_number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}
