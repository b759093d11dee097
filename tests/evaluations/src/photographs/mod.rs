//! Scores on photographs.

mod answers;
pub mod corridor_drive;
pub mod floor_masks;
pub mod mirror_floors;
pub mod multi_floor;
pub mod no_corridor;
pub mod reliability;
pub mod york_urban;

use nalgebra::Vector2;
use yamabico_drawing::Canvas;

use self::answers::Look;

/// Draws segments yellow, those that meet at the vanishing point green, the vanishing point red and the true one blue, with the
/// probability of a corridor.
fn draw_answer(canvas: &mut Canvas, look: &Look, truth: Option<Vector2<f64>>) {
    for segment in &look.segments {
        canvas.line(segment.p0, segment.p1, [230, 190, 0]);
    }
    for &member in &look.members {
        canvas.line(look.segments[member].p0, look.segments[member].p1, [0, 255, 60]);
    }
    if let Some(point) = look.point {
        canvas.cross(point, 14.0, [255, 0, 0]);
    }
    if let Some(truth) = truth {
        canvas.cross(truth, 8.0, [60, 120, 255]);
    }
    let text = format!("p {:.2}, tracked {:.2}", look.sighting.probability, look.acting);
    canvas.text(Vector2::new(6.0, 6.0), &text, [255, 60, 60]);
}
