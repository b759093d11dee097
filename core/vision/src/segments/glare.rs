//! Rejection of segments inside lens glare.

use super::Segment;
use nalgebra::Vector2;
use yamabico_geometry::image::ImageView;

/// Minimum gray level of a saturated pixel.
const SATURATED: u8 = 250;
/// Sampling distance to either side of the edge, px.
const SIDE_PX: f64 = 3.0;
/// Number of samples along the segment.
const SAMPLES: usize = 8;

/// Returns true if both sides of the segment are saturated: a thin mark inside a glare streak, not an edge of the
/// scene.
pub(super) fn is_glare(image: ImageView, segment: &Segment) -> bool {
    (0..SAMPLES).all(|i| {
        let share = (i as f64 + 0.5) / SAMPLES as f64;
        let on_edge = segment.p0 + (segment.p1 - segment.p0) * share;
        [-SIDE_PX, SIDE_PX].iter().all(|side| is_saturated(image, on_edge + segment.normal * *side))
    })
}

fn is_saturated(image: ImageView, point: Vector2<f64>) -> bool {
    image.pixel(point.x.round().max(0.0) as usize, point.y.round().max(0.0) as usize) >= SATURATED
}
