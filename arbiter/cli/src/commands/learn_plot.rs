//! How much differs from the map at each threshold, as a picture.

use std::path::Path;

use yamabico_drawing::lettering;
use yamabico_drawing::{Canvas, Color};
use yamabico_stationary_obstacle_avoider::threshold_learning::Row;
use yamabico_stationary_obstacle_avoider::threshold_table::Place;

const SIZE: (usize, usize) = (720, 440);
const LEFT: f64 = 56.0;
const BOTTOM: f64 = 396.0;
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 350.0;
const INK: Color = [40; 3];
const GRID: Color = [228; 3];

/// Writes the picture: a curve a place, N over T, and a cross at its T0.
///
/// # Errors
/// A file that cannot be written, in words.
pub fn plot(path: &Path, curves: &[Vec<Row>], places: &[Place]) -> Result<(), String> {
    let mut pixels = vec![255; 3 * SIZE.0 * SIZE.1];
    let Some(mut canvas) = Canvas::new(&mut pixels, SIZE.0, SIZE.1) else { return Ok(()) };
    let rows = curves.iter().flatten();
    let largest = rows.clone().map(Row::largest).max().unwrap_or(1).max(1);
    let farthest = rows.map(|row| row.threshold).max().unwrap_or(150);
    let at = |threshold: f64, count: f64| {
        let x = LEFT + WIDTH * threshold / f64::from(farthest);
        [x, BOTTOM - HEIGHT * (count / f64::from(largest)).sqrt()].into()
    };
    for threshold in (0..=u32::from(farthest)).step_by(25).map(f64::from) {
        canvas.line(at(threshold, 0.0), at(threshold, f64::from(largest)), GRID);
        write(&mut canvas, at(threshold, 0.0).x - 8.0, BOTTOM + 10.0, &format!("{threshold:.0}"));
    }
    for share in [0.0, 0.04, 0.16, 0.36, 0.64, 1.0] {
        let count = share * f64::from(largest);
        canvas.line(at(0.0, count), at(f64::from(farthest), count), GRID);
        write(&mut canvas, 8.0, at(0.0, count).y - 4.0, &format!("{count:.0}"));
    }
    for (i, curve) in curves.iter().enumerate() {
        let shade = (230 * i / curves.len().max(1)) as u8;
        let color = [shade, 90, 230 - shade];
        for pair in curve.windows(2) {
            let point = |row: &Row| at(f64::from(row.threshold), f64::from(row.largest()));
            canvas.line(point(&pair[0]), point(&pair[1]), color);
        }
    }
    for place in places {
        canvas.cross(at(f64::from(place.t0), f64::from(place.n0)), 4.0, INK);
    }
    write(
        &mut canvas,
        LEFT,
        14.0,
        "N, differing pixels, over T, gray levels: a curve a place, its T0 a cross",
    );
    let (width, height) = (SIZE.0 as u32, SIZE.1 as u32);
    image::save_buffer(path, &pixels, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|error| format!("{}: {error}", path.display()))
}

fn write(canvas: &mut Canvas, x: f64, y: f64, text: &str) {
    for (right, below) in lettering::pixels(text) {
        canvas.dot([x + f64::from(right), y + f64::from(below)].into(), INK);
    }
}
