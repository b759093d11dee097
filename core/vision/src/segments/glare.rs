//! Rejects the borders of lens glare.

use super::Segment;
use nalgebra::Vector2;
use yamabico_geometry::image::ImageView;

/// Gray level from which a pixel counts as saturated.
const SATURATED: u8 = 250;
/// How far from the edge the two sides are looked at, px.
const SIDE_PX: f64 = 3.0;
/// Places along the segment.
const PLACES: usize = 8;

/// Whether both sides of the segment are saturated: a thin mark inside a glare streak, not an edge of the scene.
pub(super) fn is_glare(image: ImageView, segment: &Segment) -> bool {
    (0..PLACES).all(|i| {
        let share = (i as f64 + 0.5) / PLACES as f64;
        let on_edge = segment.p0 + (segment.p1 - segment.p0) * share;
        [-SIDE_PX, SIDE_PX].iter().all(|side| is_saturated(image, on_edge + segment.normal * *side))
    })
}

fn is_saturated(image: ImageView, place: Vector2<f64>) -> bool {
    image.pixel(place.x.round().max(0.0) as usize, place.y.round().max(0.0) as usize) >= SATURATED
}
