//! Plot of the share of detected boxes over contrast.

use nalgebra::Vector2;
use yamabico_drawing::font;
use yamabico_drawing::palette::{GRID, INK};
use yamabico_drawing::{Canvas, Color};

use crate::images::Output;

const SIZE: (usize, usize) = (640, 420);
const LEFT: f64 = 60.0;
const TOP: f64 = 44.0;
const WIDTH: f64 = 550.0;
const HEIGHT: f64 = 310.0;

/// A curve of the plot.
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Color of the curve.
    pub color: Color,
    /// Contrast (gray levels), share (percent) and number of images of each point.
    pub points: &'a [(f64, f64, usize)],
}

/// Writes the plot as `contrast.png`, contrast from 0 to `max`.
pub fn plot(out: &Output, curves: &[Curve<'_>], max: f64) -> Result<(), String> {
    let mut pixels = vec![255; 3 * SIZE.0 * SIZE.1];
    let mut canvas = Canvas::new(&mut pixels, SIZE.0, SIZE.1).unwrap();
    let at = |contrast: f64, share: f64| {
        Vector2::new(LEFT + WIDTH * contrast / max, TOP + HEIGHT * (1.0 - share / 100.0))
    };
    for share in (0..=100).step_by(10).map(f64::from) {
        canvas.line(at(0.0, share), at(max, share), if share == 0.0 { INK } else { GRID });
        let text = format!("{share:.0}");
        let left = LEFT - 8.0 - font::width(&text, font::TEXT_PX);
        canvas.text(Vector2::new(left, at(0.0, share).y - 4.0), &text, INK);
    }
    for contrast in (0..=max as u32).step_by(4).map(f64::from) {
        canvas.line(at(contrast, 0.0), at(contrast, 100.0), if contrast == 0.0 { INK } else { GRID });
        let text = format!("{contrast:.0}");
        let left = at(contrast, 0.0).x - 0.5 * font::width(&text, font::TEXT_PX);
        canvas.text(Vector2::new(left, TOP + HEIGHT + 8.0), &text, INK);
    }
    let n = |pick: fn(usize, usize) -> usize| {
        curves.iter().flat_map(|curve| curve.points).map(|point| point.2).reduce(pick).unwrap_or(0)
    };
    canvas.text(Vector2::new(LEFT, 8.0), "share of boxes detected in single images, by contrast", INK);
    let count = format!("each point: {} to {} images", n(usize::min), n(usize::max));
    canvas.text(Vector2::new(LEFT, 22.0), &count, INK);
    let below = "maximum difference to the background along the vertical outline, gray levels";
    canvas.text(Vector2::new(LEFT, TOP + HEIGHT + 26.0), below, INK);
    canvas.text(Vector2::new(6.0, 30.0), "%", INK);
    for (curve, row) in curves.iter().zip(0_u8..) {
        for pair in curve.points.windows(2) {
            canvas.line(at(pair[0].0, pair[0].1), at(pair[1].0, pair[1].1), curve.color);
        }
        for point in curve.points {
            canvas.cross(at(point.0, point.1), 3.0, curve.color);
        }
        let legend = at(max, 0.0) + Vector2::new(-210.0, -60.0 + 16.0 * f64::from(row));
        canvas.line(legend, legend + Vector2::new(20.0, 0.0), curve.color);
        canvas.cross(legend + Vector2::new(10.0, 0.0), 3.0, curve.color);
        canvas.text(legend + Vector2::new(28.0, -4.0), curve.name, INK);
    }
    out.rgb("contrast", &pixels, SIZE.0 as u32, SIZE.1 as u32)
}
