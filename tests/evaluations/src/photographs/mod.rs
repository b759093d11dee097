//! Scores on photographs.

mod answers;
pub mod corridor_drive;
pub mod floor_masks;
pub mod mirror_floors;
pub mod multi_floor;
pub mod no_corridor;
pub mod reliability;
pub mod york_urban;

use std::path::Path;

use nalgebra::Vector2;
use yamabico_drawing::Canvas;

use self::answers::Look;

/// Reads the lines of the table `name` of a data set, without its header.
fn table_lines(folder: &Path, name: &str) -> Result<Vec<String>, String> {
    let path = folder.join(name);
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(text.lines().skip(1).map(str::to_owned).collect())
}

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
