//! The plot of a threshold table: for each place, the number of differing pixels over the threshold.

use std::path::Path;

use yamabico_drawing::Canvas;
use yamabico_drawing::palette::{GRID, INK};
use yamabico_stationary_obstacle_avoider::threshold_learning::EdgeCounts;
use yamabico_stationary_obstacle_avoider::threshold_table::Place;

use crate::LearningError;
use crate::error::write_png;

const SIZE: (usize, usize) = (720, 440);
const LEFT: f64 = 56.0;
const BOTTOM: f64 = 396.0;
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 350.0;

/// Writes the plot: a curve N(T) for each place, with a cross at its T0. The N axis is scaled by the square root.
///
/// # Errors
/// [`LearningError::Write`].
pub(super) fn plot(path: &Path, curves: &[Vec<EdgeCounts>], places: &[Place]) -> Result<(), LearningError> {
    let mut pixels = vec![255; 3 * SIZE.0 * SIZE.1];
    let Some(mut canvas) = Canvas::new(&mut pixels, SIZE.0, SIZE.1) else { return Ok(()) };
    let rows = curves.iter().flatten();
    let max_count = rows.clone().map(EdgeCounts::max_count).max().unwrap_or(1).max(1);
    let max_threshold = rows.map(|row| row.threshold).max().unwrap_or(150);
    let at = |threshold: f64, count: f64| {
        let x = LEFT + WIDTH * threshold / f64::from(max_threshold);
        [x, BOTTOM - HEIGHT * (count / f64::from(max_count)).sqrt()].into()
    };
    for threshold in (0..=u32::from(max_threshold)).step_by(25).map(f64::from) {
        canvas.line(at(threshold, 0.0), at(threshold, f64::from(max_count)), GRID);
        let x = at(threshold, 0.0).x - 8.0;
        canvas.text([x, BOTTOM + 10.0].into(), &format!("{threshold:.0}"), INK);
    }
    for share in [0.0, 0.04, 0.16, 0.36, 0.64, 1.0] {
        let count = share * f64::from(max_count);
        canvas.line(at(0.0, count), at(f64::from(max_threshold), count), GRID);
        let y = at(0.0, count).y - 4.0;
        canvas.text([8.0, y].into(), &format!("{count:.0}"), INK);
    }
    for (i, curve) in curves.iter().enumerate() {
        let shade = (230 * i / curves.len().max(1)) as u8;
        let color = [shade, 90, 230 - shade];
        for pair in curve.windows(2) {
            let point = |row: &EdgeCounts| at(f64::from(row.threshold), f64::from(row.max_count()));
            canvas.line(point(&pair[0]), point(&pair[1]), color);
        }
    }
    for place in places {
        canvas.cross(at(f64::from(place.t0), f64::from(place.n0)), 4.0, INK);
    }
    let title = "N, differing pixels, over T, gray levels: a curve for each place, a cross at its T0";
    canvas.text([LEFT, 14.0].into(), title, INK);
    write_png(path, &pixels, SIZE)
}
