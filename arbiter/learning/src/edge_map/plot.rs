//! The plot of a map of vertical edges.

use std::path::Path;

use nalgebra::{SymmetricEigen, Vector2};
use yamabico_drawing::palette::{GRID, INK};
use yamabico_drawing::{Canvas, Color};
use yamabico_vision::azimuth_map::{EdgeMap, SurfaceState};

use crate::LearningError;
use crate::error::write_png;

/// Width and height of the plot, px.
const SIZE: usize = 640;
/// Border around the map, px.
const MARGIN: f64 = 40.0;
const FREE: Color = [120, 190, 120];
const EDGE: Color = [200, 30, 60];

/// Writes the plot: edges as crosses with their covariance ellipses at three standard deviations, surfaces as lines (solid ones
/// black, unknown ones gray, empty ones not drawn), the outline of the free space in green, a grid of 0.5 m.
///
/// # Errors
/// [`LearningError::Write`].
pub(super) fn plot(path: &Path, map: &EdgeMap) -> Result<(), LearningError> {
    let mut pixels = vec![255; 3 * SIZE * SIZE];
    let Some(mut canvas) = Canvas::new(&mut pixels, SIZE, SIZE) else { return Ok(()) };
    let points = || map.edges.iter().map(|edge| edge.at_m).chain(map.free_m.iter().copied());
    let bound =
        |axis: usize, pick: fn(f64, f64) -> f64, from: f64| points().map(|at| at[axis]).fold(from, pick);
    let low = [0, 1].map(|axis| bound(axis, f64::min, f64::INFINITY));
    let high = [0, 1].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY));
    let span = (high[0] - low[0]).max(high[1] - low[1]).max(0.5);
    let scale = (SIZE as f64 - 2.0 * MARGIN) / span;
    let at = |x: f64, y: f64| {
        Vector2::new(MARGIN + scale * (x - low[0]), SIZE as f64 - MARGIN - scale * (y - low[1]))
    };
    for line in (2.0 * low[0].min(low[1])).floor() as i32..=(2.0 * high[0].max(high[1])).ceil() as i32 {
        let meters = 0.5 * f64::from(line);
        canvas.line(at(meters, low[1]), at(meters, low[1] + span), GRID);
        canvas.line(at(low[0], meters), at(low[0] + span, meters), GRID);
    }
    for (i, &[x, y]) in map.free_m.iter().enumerate() {
        let [to_x, to_y] = map.free_m[(i + 1) % map.free_m.len()];
        canvas.line(at(x, y), at(to_x, to_y), FREE);
    }
    for surface in &map.surfaces {
        let end = |number| map.edge(number).map(|edge| at(edge.at_m[0], edge.at_m[1]));
        let color = match surface.state {
            SurfaceState::Empty => continue,
            SurfaceState::Unknown => [170; 3],
            SurfaceState::Solid | SurfaceState::Nearer => INK,
        };
        if let (Some(right), Some(left)) = (end(surface.right), end(surface.left)) {
            canvas.line(right, left, color);
        }
    }
    for edge in &map.edges {
        let center = at(edge.at_m[0], edge.at_m[1]);
        canvas.cross(center, 4.0, EDGE);
        let axes = SymmetricEigen::new(edge.located().covariance);
        let ellipse = |turn: f64| {
            let circle = Vector2::new(turn.cos(), turn.sin())
                .component_mul(&axes.eigenvalues.map(|v| 3.0 * v.max(0.0).sqrt()));
            let offset = axes.eigenvectors * circle;
            at(edge.at_m[0] + offset.x, edge.at_m[1] + offset.y)
        };
        for step in 0..24 {
            let turn = |k: i32| std::f64::consts::TAU * f64::from(k) / 24.0;
            canvas.line(ellipse(turn(step)), ellipse(turn(step + 1)), EDGE);
        }
        canvas.text(center + Vector2::new(6.0, -12.0), &edge.number.to_string(), INK);
    }
    canvas.text(Vector2::new(8.0, 8.0), "vertical edges with three sigma, grid 0.5 m", INK);
    write_png(path, &pixels, (SIZE, SIZE))
}
