//! How well the column of the corridor's vanishing point agrees with the labels of a drive along a real corridor.
//!
//! `evaluate_corridor_drive DIR [--json] [--out DIR]` compares every frame with a labeled column (`labels.csv`) without
//! any prediction. The camera is uncalibrated: a focal length of half the width is assumed, which only decides how far
//! from the horizon a point may be. It prints the median and 90th percentile of the column's error, and how often the
//! steering sign is right among the frames whose label is more than 10 px off the center.

#[allow(dead_code, reason = "the other evaluations use the rest")]
mod evaluation;

use evaluation::{Arguments, draw, load_gray, percentile};
use nalgebra::Vector2;
use serde_json::json;
use std::process::ExitCode;
use yamabico_core::camera::Intrinsics;
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

/// Labels nearer to the center say nothing about where to steer, px.
const STEERING_DEADBAND_PX: f64 = 10.0;

fn main() -> ExitCode {
    evaluation::exit_code(Arguments::parse().and_then(|arguments| evaluate(&arguments)))
}

fn evaluate(arguments: &Arguments) -> Result<(), String> {
    let (mut errors, mut found, mut steered, mut right) = (Vec::new(), 0, 0, 0);
    for (name, label) in labels(arguments)? {
        let file = arguments.folder.join("images").join(format!("{name}.jpg"));
        let image = load_gray(&file)?;
        let view = image.view().map_err(|e| format!("{name}: {e}"))?;
        let (width, height) = (view.width() as f64, view.height() as f64);
        let camera = Intrinsics {
            fx: 0.5 * width,
            fy: 0.5 * width,
            cx: 0.5 * (width - 1.0),
            cy: 0.5 * (height - 1.0),
            width: view.width() as u32,
            height: view.height() as u32,
        };
        let mut detector = SegmentDetector::new(SegmentConfig::default());
        let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
        let segments = detector.detect(view).unwrap_or_default();
        let point = finder.find(segments, &camera, None);
        if let Some(folder) = &arguments.out {
            let path = folder.join(format!("{name}.png"));
            draw(view, segments, point.as_ref().ok(), Some(Vector2::new(label.x, label.y)), &path)?;
        }
        // A frame without a point counts as half the picture off and as steered wrongly.
        let column = point.ok().map(|p| p.pixel.x);
        found += usize::from(column.is_some());
        errors.push(column.map_or(0.5 * width, |u| (u - label.x).abs()));
        let offset = label.x - camera.cx;
        if offset.abs() > STEERING_DEADBAND_PX {
            steered += 1;
            right += usize::from(column.is_some_and(|u| (u - camera.cx) * offset > 0.0));
        }
    }
    if errors.is_empty() {
        return Err("no labeled frame".into());
    }
    let (median, p90) = (percentile(&errors, 0.5), percentile(&errors, 0.9));
    let share = f64::from(right as u32) / f64::from(steered.max(1) as u32);
    if arguments.json {
        println!(
            "{}",
            json!({"frames": errors.len(), "found": found, "median_px": median, "p90_px": p90,
                   "steering_frames": steered, "steering_right": right})
        );
    } else {
        println!(
            "{found} of {} found, column error median {median:.1}, 90 % {p90:.1} px; steering sign right in {right} of \
             {steered} frames ({:.1} %)",
            errors.len(),
            100.0 * share
        );
    }
    Ok(())
}

/// Name and labeled vanishing point of every frame that has one.
fn labels(arguments: &Arguments) -> Result<Vec<(String, Vector2<f64>)>, String> {
    let path = arguments.folder.join("labels.csv");
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut labels = Vec::new();
    for line in text.lines().skip(1) {
        // The polygons between the quotes hold commas; the point is the last two fields.
        let name = line.split(',').next().unwrap_or_default();
        let mut last = line.rsplit(',');
        let (v, u) = (last.next().unwrap_or_default(), last.next().unwrap_or_default());
        if let (Ok(u), Ok(v)) = (u.trim().parse(), v.trim().parse()) {
            labels.push((name.to_owned(), Vector2::new(u, v)));
        }
    }
    Ok(labels)
}
