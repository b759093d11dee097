//! Drawing into an RGB image.

use crate::font;
use nalgebra::Vector2;
use yamabico_geometry::image::ImageView;

/// A color: red, green, blue.
pub type Color = [u8; 3];

/// A borrowed RGB image: three bytes per pixel, no padding between rows.
#[derive(Debug)]
pub struct Canvas<'a> {
    data: &'a mut [u8],
    width: usize,
    height: usize,
}

impl<'a> Canvas<'a> {
    /// Creates a canvas of `width` x `height` pixels on `data`, or returns `None` if `data` does not hold exactly three
    /// bytes per pixel.
    pub fn new(data: &'a mut [u8], width: usize, height: usize) -> Option<Self> {
        (width.checked_mul(height)?.checked_mul(3)? == data.len()).then_some(Self { data, width, height })
    }

    /// Copies a gray image to the upper left corner, cropped to the canvas.
    pub fn copy_gray(&mut self, image: ImageView) {
        let width = self.width.min(image.width());
        for v in 0..self.height.min(image.height()) {
            let row = &mut self.data[3 * v * self.width..][..3 * width];
            for (rgb, &gray) in row.as_chunks_mut::<3>().0.iter_mut().zip(image.row(v)) {
                *rgb = [gray; 3];
            }
        }
    }

    /// Sets the pixel nearest to `at`, if it lies inside the canvas.
    pub fn dot(&mut self, at: Vector2<f64>, color: Color) {
        let (u, v) = (at.x.round(), at.y.round());
        if u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64 {
            let start = 3 * (v as usize * self.width + u as usize);
            self.data[start..start + 3].copy_from_slice(&color);
        }
    }

    /// Mixes `color` into the pixel nearest to `at`: 0 leaves the pixel, 1 replaces it.
    pub fn mix(&mut self, at: Vector2<f64>, color: Color, share: f64) {
        let (u, v) = (at.x.round(), at.y.round());
        if u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64 {
            let start = 3 * (v as usize * self.width + u as usize);
            for (old, new) in self.data[start..start + 3].iter_mut().zip(color) {
                let mixed = f64::from(*old) + share.clamp(0.0, 1.0) * (f64::from(new) - f64::from(*old));
                *old = mixed.round() as u8;
            }
        }
    }

    /// Draws a smooth line between two points, `thickness` pixels wide, clipped to the canvas.
    pub fn stroke(&mut self, from: Vector2<f64>, to: Vector2<f64>, thickness: f64, color: Color) {
        let Some((from, to)) = self.clip(from, to) else { return };
        let along = to - from;
        let length = along.norm();
        let across =
            if length > 0.0 { Vector2::new(-along.y, along.x) / length } else { Vector2::new(0.0, 1.0) };
        // Step along the longer axis; in each step, cover the pixels on the other.
        let is_flat = along.x.abs() >= along.y.abs();
        let half = 0.5 * thickness;
        let steps = along.amax().round().max(1.0);
        let lean = if is_flat { across.y.abs() } else { across.x.abs() };
        let reach = ((half + 1.0) / lean.max(0.5)).ceil();
        for i in 0..=steps as usize {
            let at = (from + along * (i as f64 / steps)).map(f64::round);
            for side in -(reach as i32)..=reach as i32 {
                let side = f64::from(side);
                let pixel = at + if is_flat { Vector2::new(0.0, side) } else { Vector2::new(side, 0.0) };
                let distance = (pixel - from).dot(&across).abs();
                self.mix(pixel, color, half + 0.5 - distance);
            }
        }
    }

    /// Draws a smooth circle, `thickness` pixels wide.
    pub fn ring(&mut self, center: Vector2<f64>, radius: f64, thickness: f64, color: Color) {
        let corners = (radius.abs().min(1e4).sqrt() * 8.0).ceil().max(8.0);
        let corner = |i: usize| {
            let (sin, cos) = (i as f64 / corners * std::f64::consts::TAU).sin_cos();
            center + radius * Vector2::new(cos, sin)
        };
        for i in 0..corners as usize {
            self.stroke(corner(i), corner(i + 1), thickness, color);
        }
    }

    /// Draws a line between two points, one pixel wide, clipped to the canvas.
    pub fn line(&mut self, from: Vector2<f64>, to: Vector2<f64>, color: Color) {
        let Some((from, to)) = self.clip(from, to) else { return };
        let along = to - from;
        let steps = along.amax().ceil().max(1.0);
        for i in 0..=steps as usize {
            self.dot(from + along * (i as f64 / steps), color);
        }
    }

    /// Draws an upright cross with arms of `arm` pixels.
    pub fn cross(&mut self, at: Vector2<f64>, arm: f64, color: Color) {
        let (across, down) = (Vector2::new(arm, 0.0), Vector2::new(0.0, arm));
        self.line(at - across, at + across, color);
        self.line(at - down, at + down, color);
    }

    /// Draws a line of text, [`font::TEXT_PX`] in size, with the upper left corner of its capitals at `at`.
    pub fn text(&mut self, at: Vector2<f64>, text: &str, color: Color) {
        font::pixels(text, font::TEXT_PX, [at.x, at.y], |x, y, coverage| {
            self.mix(Vector2::new(f64::from(x), f64::from(y)), color, coverage);
        });
    }

    /// Draws the outline of a box between two opposite corners.
    pub fn outline(&mut self, corner: Vector2<f64>, opposite: Vector2<f64>, color: Color) {
        let [b, d] = [Vector2::new(opposite.x, corner.y), Vector2::new(corner.x, opposite.y)];
        for (from, to) in [(corner, b), (b, opposite), (opposite, d), (d, corner)] {
            self.line(from, to, color);
        }
    }

    /// Clips a line to the canvas and a margin of one pixel.
    fn clip(&self, from: Vector2<f64>, to: Vector2<f64>) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let along = to - from;
        let (mut begin, mut end) = (0.0_f64, 1.0_f64);
        for (start, step, size) in [(from.x, along.x, self.width), (from.y, along.y, self.height)] {
            let (low, high) = ((-1.0 - start) / step, (size as f64 - start) / step);
            if step == 0.0 {
                if !(-1.0..=size as f64).contains(&start) {
                    return None;
                }
            } else {
                begin = begin.max(low.min(high));
                end = end.min(low.max(high));
            }
        }
        let is_finite = from.iter().chain(&to).all(|x| x.is_finite());
        (is_finite && begin <= end).then(|| (from + along * begin, from + along * end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_is_as_wide_as_its_thickness_in_every_direction() {
        for to in [[59.0, 10.0], [10.0, 59.0], [59.0, 40.0], [20.0, 59.0], [0.0, 59.0]] {
            let mut data = vec![0; 3 * 60 * 60];
            let from = Vector2::new(10.0, 10.0);
            let to = Vector2::from(to);
            Canvas::new(&mut data, 60, 60).unwrap().stroke(from, to, 3.0, [255, 255, 255]);
            let ink: f64 = data.iter().step_by(3).map(|&level| f64::from(level) / 255.0).sum();
            let wanted = 3.0 * (to - from).norm();
            assert!((ink / wanted - 1.0).abs() < 0.12, "{to}: {ink} of {wanted}");
        }
        let mut data = vec![0; 3 * 8 * 8];
        let mut canvas = Canvas::new(&mut data, 8, 8).unwrap();
        canvas.stroke(Vector2::new(f64::NAN, 0.0), Vector2::new(1.0, 1.0), 3.0, [255; 3]);
        canvas.ring(Vector2::new(1e9, 1e9), 1e300, 2.0, [255; 3]);
        canvas.ring(Vector2::new(4.0, 4.0), f64::NAN, 2.0, [255; 3]);
        assert!(data.iter().all(|&level| level == 0));
    }

    #[test]
    fn lines_are_clipped_to_the_canvas() {
        let mut data = vec![0; 3 * 8 * 4];
        let mut canvas = Canvas::new(&mut data, 8, 4).unwrap();
        canvas.line(Vector2::new(-1e9, 2.0), Vector2::new(1e9, 2.0), [255, 0, 0]);
        canvas.line(Vector2::new(0.0, -50.0), Vector2::new(7.0, -50.0), [0, 255, 0]);
        canvas.line(Vector2::new(f64::NAN, 0.0), Vector2::new(7.0, 3.0), [0, 0, 255]);
        let (pixels, _) = data.as_chunks::<3>();
        assert!(pixels[16..24].iter().all(|&p| p == [255, 0, 0]));
        assert_eq!(pixels.iter().filter(|&&p| p != [0, 0, 0]).count(), 8);
        assert!(Canvas::new(&mut data[1..], 8, 4).is_none());
    }
}
