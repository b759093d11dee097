//! Pictures with overlays: the one renderer for recordings, reports and views.

use image::RgbImage;
use nalgebra::Vector2;
use yamabico_core::message::{MarkKind, OverlayMark};
use yamabico_core::overlay::{LayerView, Space, layers};
use yamabico_drawing::{Canvas, Color, font};

/// Width that pictures are enlarged to at least, px.
const MIN_WIDTH_PX: u32 = 640;
/// Thickness of a line, px.
const LINE_PX: f64 = 1.6;
/// Radius of the ring that stands for a point, px.
const POINT_PX: f64 = 2.0;
/// Size of a text (its em), px.
const TEXT_PX: f64 = 17.0;
/// Color around a text.
const SHADOW: Color = [15; 3];
/// Places of the shadows of a text around it, px.
const AROUND: [[f64; 2]; 4] = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]];
/// Opacity of each shadow.
const SHADE: f64 = 0.55;

/// Returns `picture`, enlarged by a whole factor to a readable size, with the layers in pixels drawn on it that `shows` accepts.
pub fn with_overlays(
    picture: &RgbImage,
    overlays: &[&[OverlayMark]],
    shows: &dyn Fn(&LayerView<'_>) -> bool,
) -> RgbImage {
    let factor = MIN_WIDTH_PX.div_ceil(picture.width().max(1)).clamp(1, 8);
    let (width, height) = (picture.width() * factor, picture.height() * factor);
    let mut larger = RgbImage::from_fn(width, height, |u, v| *picture.get_pixel(u / factor, v / factor));
    if let Some(mut canvas) = Canvas::new(&mut larger, width as usize, height as usize) {
        for marks in overlays {
            paint(&mut canvas, marks, f64::from(factor), shows);
        }
    }
    larger
}

/// Draws the layers in pixels that `shows` accepts on a picture that was enlarged by `factor`.
pub fn paint(
    canvas: &mut Canvas<'_>,
    marks: &[OverlayMark],
    factor: f64,
    shows: &dyn Fn(&LayerView<'_>) -> bool,
) {
    // The center of a pixel of the frame is the center of its square in the enlarged picture.
    let at = |x: f64, y: f64| Vector2::new(x, y) * factor + Vector2::repeat(0.5 * (factor - 1.0));
    let drawn = || layers(marks).filter(|layer| layer.space == Space::Image && shows(layer));
    for layer in drawn() {
        for mark in layer.marks {
            let from = at(mark.x, mark.y);
            match mark.kind() {
                Some(MarkKind::Line) => canvas.stroke(from, at(mark.x2, mark.y2), LINE_PX, layer.color),
                Some(MarkKind::Point) => canvas.ring(from, POINT_PX, LINE_PX, layer.color),
                Some(MarkKind::Circle) => canvas.ring(from, mark.x2 * factor, LINE_PX, layer.color),
                _ => {}
            }
        }
    }
    // Texts last, so that no line crosses them.
    for layer in drawn() {
        for mark in layer.marks.iter().filter(|mark| mark.kind() == Some(MarkKind::Text)) {
            let corner = at(mark.x, mark.y);
            let mut write = |shift: [f64; 2], color: Color, opacity: f64| {
                let upper_left = [corner.x + shift[0], corner.y + shift[1]];
                font::pixels(mark.text.as_str(), TEXT_PX, upper_left, |u, v, coverage| {
                    canvas.mix(Vector2::new(f64::from(u), f64::from(v)), color, opacity * coverage);
                });
            };
            AROUND.iter().for_each(|shift| write(*shift, SHADOW, SHADE));
            write([0.0; 2], layer.color, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::overlay::{GREEN, Overlay, RED};

    #[test]
    fn layers_are_drawn_at_their_pixels_and_hidden_ones_are_not() {
        let mut overlay = Overlay::default();
        overlay.image("line", RED).line(Vector2::new(10.0, 20.0), Vector2::new(90.0, 20.0));
        overlay.image("hidden", GREEN).line(Vector2::new(10.0, 40.0), Vector2::new(90.0, 40.0));
        overlay.robot("gate", GREEN).line(Vector2::new(10.0, 60.0), Vector2::new(90.0, 60.0));
        let picture = RgbImage::from_pixel(160, 120, image::Rgb([100; 3]));
        let drawn = with_overlays(&picture, &[overlay.marks()], &|layer| layer.name.as_str() != "hidden");
        assert_eq!(drawn.dimensions(), (640, 480));
        let [red, green, _] = drawn.get_pixel(4 * 50 + 1, 4 * 20 + 1).0;
        assert!(red > 200 && green < 90, "{red} {green}");
        assert!(drawn.pixels().all(|pixel| pixel.0 != GREEN));
    }

    #[test]
    fn hostile_marks_do_no_harm() {
        let hostile = [f64::NAN, f64::INFINITY, -1e300, 1e300];
        let mut marks = vec![OverlayMark { kind: 0, ..OverlayMark::default() }];
        for kind in 2..9 {
            marks.extend(hostile.map(|v| OverlayMark {
                kind,
                x: v,
                y: v,
                x2: v,
                y2: -v,
                ..OverlayMark::default()
            }));
        }
        let picture = RgbImage::from_pixel(64, 48, image::Rgb([100; 3]));
        assert_eq!(with_overlays(&picture, &[&marks], &|_| true).width(), 512);
        assert_eq!(with_overlays(&RgbImage::new(0, 0), &[&marks], &|_| true).width(), 0);
    }
}
