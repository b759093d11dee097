//! Drawing of the detector's evidence over the camera image.

use nalgebra::Vector2;
use yamabico_core::image::ImageView;
use yamabico_drawing::{Canvas, Color};

use crate::detector::Detector;

/// Vertical edges that the map explains.
const EXPLAINED: Color = [60, 200, 60];
/// Edges that the map does not explain.
const EXTRA: Color = [255, 60, 60];
/// Edges of the map that were not observed.
const MISSING: Color = [70, 120, 255];
/// Strongest brightness step on the floor of a region, and the regions that hold an obstacle.
const STEP: Color = [255, 220, 0];
/// Upper boundary of the floor that is searched for steps.
const FLOOR: Color = [150, 90, 200];

/// Draws the evidence of `detector` in its last frame over `image`, the image of that frame.
pub fn draw(detector: &Detector, image: ImageView, canvas: &mut Canvas) {
    canvas.copy_gray(image);
    for (u, v) in detector.floor() {
        canvas.dot(Vector2::new(u as f64, v as f64), FLOOR);
    }
    let (seen, expected) = (detector.seen(), detector.expected());
    for (u, v) in expected.pixels() {
        canvas.dot(Vector2::new(u as f64, v as f64), MISSING);
    }
    for (u, v) in seen.pixels() {
        let is_extra = detector.difference().is_extra(seen, u, v);
        canvas.dot(Vector2::new(u as f64, v as f64), if is_extra { EXTRA } else { EXPLAINED });
    }
    for (u, v) in detector.level().pixels() {
        canvas.dot(Vector2::new(u as f64, v as f64), EXTRA);
    }
    let last = image.height() as f64 - 1.0;
    for (region, result) in detector.results().iter().enumerate() {
        let columns = detector.regions().columns(region);
        let (first, end) = (columns.start as f64, columns.end as f64 - 1.0);
        canvas.line(Vector2::new(first, last - 6.0), Vector2::new(first, last), [200; 3]);
        if result.is_step {
            canvas.line(result.step.foot, Vector2::new(result.step.foot.x, result.step.top_v), STEP);
        }
        if result.is_obstacle {
            for row in 0..3 {
                let v = last - f64::from(row);
                canvas.line(Vector2::new(first, v), Vector2::new(end, v), STEP);
            }
        }
    }
}
