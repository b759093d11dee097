//! Scores on photographs.

pub mod corridor_drive;
pub mod floor_masks;
pub mod mirror_floors;
pub mod york_urban;

use nalgebra::Vector2;
use yamabico_drawing::Canvas;
use yamabico_vision::segments::Segment;
use yamabico_vision::vanishing_point::VanishingPoint;

/// Draws segments yellow, inliers green, the vanishing point red and the true one blue.
fn draw_vanishing_point(
    canvas: &mut Canvas,
    segments: &[Segment],
    found: Option<&VanishingPoint>,
    truth: Vector2<f64>,
) {
    for segment in segments {
        canvas.line(segment.p0, segment.p1, [230, 190, 0]);
    }
    if let Some(point) = found {
        for &i in point.inliers {
            canvas.line(segments[i].p0, segments[i].p1, [0, 255, 60]);
        }
        canvas.cross(point.pixel, 14.0, [255, 0, 0]);
    }
    canvas.cross(truth, 8.0, [60, 120, 255]);
}
