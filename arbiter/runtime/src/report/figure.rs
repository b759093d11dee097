//! A figure of lines, marks and texts, written as pixels or as SVG.

use std::fmt::Write;

use nalgebra::Vector2;
use yamabico_drawing::{Canvas, Color, font};

/// Coordinates in a figure: two units are one pixel.
pub(super) type Pixel = (i32, i32);

/// Units of a figure per pixel.
const UNITS_PER_PX: f64 = 2.0;
/// Size of a text (its em), units.
pub(super) const TEXT: f64 = 26.0;
/// Height of a capital letter, units.
pub(super) const LETTER_HEIGHT: i32 = (font::CAPITAL * TEXT) as i32 + 1;

/// Figure whose shapes are drawn in their order.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    width: i32,
    height: i32,
    shapes: Vec<Shape>,
}

#[derive(Clone, Debug)]
enum Shape {
    Line { points: Vec<Pixel>, thickness: i32, color: Color },
    Rectangle { upper_left: Pixel, size: Pixel, color: Color },
    Ring { center: Pixel, radius: i32, thickness: i32, color: Color },
    Text { upper_left: Pixel, text: String, color: Color },
}

/// Returns the width of a text, units.
pub(super) fn text_width(text: &str) -> i32 {
    font::width(text, TEXT).ceil() as i32
}

impl Figure {
    /// Creates an empty figure of this size, units.
    pub(super) fn new(width: i32, height: i32) -> Figure {
        Figure { width, height, shapes: Vec::new() }
    }

    /// Draws lines between consecutive points.
    pub(super) fn line(&mut self, points: Vec<Pixel>, thickness: i32, color: Color) {
        if points.len() > 1 {
            self.shapes.push(Shape::Line { points, thickness, color });
        }
    }

    /// Fills a rectangle.
    pub(super) fn rectangle(&mut self, upper_left: Pixel, size: Pixel, color: Color) {
        self.shapes.push(Shape::Rectangle { upper_left, size, color });
    }

    /// Draws a circle.
    pub(super) fn ring(&mut self, center: Pixel, radius: i32, thickness: i32, color: Color) {
        self.shapes.push(Shape::Ring { center, radius, thickness, color });
    }

    /// Draws a text; its capitals begin at `upper_left`.
    pub(super) fn text(&mut self, upper_left: Pixel, text: impl Into<String>, color: Color) {
        self.shapes.push(Shape::Text { upper_left, text: text.into(), color });
    }

    /// The figure as pixels on white; `None` without a size.
    pub fn pixels(&self) -> Option<image::RgbImage> {
        let [width, height] =
            [self.width, self.height].map(|units| (f64::from(units) / UNITS_PER_PX) as usize);
        let mut bytes = vec![255; width.checked_mul(height)?.checked_mul(3)?];
        let mut canvas = Canvas::new(&mut bytes, width, height)?;
        // Centers of pixels lie at whole numbers, half a pixel from their edges.
        let at =
            |(x, y): Pixel| Vector2::new(f64::from(x), f64::from(y)) / UNITS_PER_PX - Vector2::repeat(0.5);
        let px = |units: i32| f64::from(units) / UNITS_PER_PX;
        for shape in &self.shapes {
            match shape {
                Shape::Line { points, thickness, color } => {
                    for ends in points.windows(2) {
                        canvas.stroke(at(ends[0]), at(ends[1]), px(*thickness), *color);
                    }
                }
                Shape::Rectangle { upper_left, size: (wide, high), color } => {
                    for row in 0..px(*high).round() as i32 {
                        let left = at(*upper_left) + Vector2::new(0.5, 0.5 + f64::from(row));
                        canvas.line(left, left + Vector2::new(px(*wide) - 1.0, 0.0), *color);
                    }
                }
                Shape::Ring { center, radius, thickness, color } => {
                    canvas.ring(at(*center), px(*radius), px(*thickness), *color);
                }
                Shape::Text { upper_left: (x, y), text, color } => {
                    font::pixels(text, TEXT / UNITS_PER_PX, [px(*x), px(*y)], |u, v, coverage| {
                        canvas.mix(Vector2::new(f64::from(u), f64::from(v)), *color, coverage);
                    });
                }
            }
        }
        image::RgbImage::from_raw(width as u32, height as u32, bytes)
    }

    /// The figure as SVG, for a file of its own or within HTML. Texts keep their widths in any font.
    pub fn svg(&self) -> String {
        let [width, height] = [self.width, self.height].map(|units| f64::from(units) / UNITS_PER_PX);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {} {}\" \
             font-family=\"DejaVu Sans, Verdana, Arial, sans-serif\" font-size=\"{TEXT}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
            self.width, self.height
        );
        for shape in &self.shapes {
            // Writing to a `String` cannot fail.
            let _ = match shape {
                Shape::Line { points, thickness, color } => {
                    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x},{y}")).collect();
                    writeln!(
                        svg,
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{thickness}\" \
                         stroke-linejoin=\"round\"/>",
                        points.join(" "),
                        hexadecimal(*color)
                    )
                }
                Shape::Rectangle { upper_left: (x, y), size: (wide, high), color } => writeln!(
                    svg,
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{high}\" fill=\"{}\"/>",
                    hexadecimal(*color)
                ),
                Shape::Ring { center: (x, y), radius, thickness, color } => writeln!(
                    svg,
                    "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"none\" stroke=\"{}\" \
                     stroke-width=\"{thickness}\"/>",
                    hexadecimal(*color)
                ),
                Shape::Text { upper_left: (x, y), text, color } => writeln!(
                    svg,
                    "<text x=\"{x}\" y=\"{}\" textLength=\"{}\" lengthAdjust=\"spacingAndGlyphs\" fill=\"{}\">{}</text>",
                    y + LETTER_HEIGHT,
                    text_width(text),
                    hexadecimal(*color),
                    escaped(text)
                ),
            };
        }
        svg + "</svg>\n"
    }
}

/// Color in HTML and SVG.
pub(super) fn hexadecimal([red, green, blue]: Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Text in HTML and SVG.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            '\'' => safe += "&#39;",
            letter if letter.is_control() && letter != '\n' => safe.push('\u{b7}'),
            letter => safe.push(letter),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_svg_show_the_same_shapes() {
        let mut figure = Figure::new(200, 100);
        figure.line(vec![(20, 50), (180, 50)], 4, [255, 0, 0]);
        figure.rectangle((20, 60), (20, 20), [0, 0, 255]);
        figure.ring((100, 50), 30, 4, [0, 128, 0]);
        figure.text((60, 10), "a < b", [0, 0, 0]);
        let pixels = figure.pixels().unwrap();
        assert_eq!((pixels.width(), pixels.height()), (100, 50));
        assert_eq!((pixels.get_pixel(30, 24).0[1], pixels.get_pixel(15, 35).0), (0, [0, 0, 255]));
        let svg = figure.svg();
        for part in ["viewBox=\"0 0 200 100\"", "#ff0000", "r=\"30\"", "a &lt; b", "textLength"] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        assert!(Figure::default().pixels().is_none_or(|pixels| pixels.width() == 0));
    }
}
