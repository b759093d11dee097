//! Gray image in floating point: smoothing, halving, and sampling between pixels.

use nalgebra::Vector2;
use yamabico_geometry::image::ImageView;

/// Gray image, row by row; pixel centers lie on integers.
#[derive(Clone, Debug, Default)]
pub struct FloatImage {
    /// Gray levels.
    pub data: Vec<f32>,
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
}

impl FloatImage {
    /// Copies an 8-bit image.
    #[must_use]
    pub fn of(image: ImageView<'_>) -> Self {
        let rows = (0..image.height()).flat_map(|v| image.row(v).iter().map(|&level| f32::from(level)));
        Self { data: rows.collect(), width: image.width(), height: image.height() }
    }

    /// Gray level of a pixel; outside of the image, of the nearest one.
    #[must_use]
    pub fn at(&self, u: isize, v: isize) -> f32 {
        let u = u.clamp(0, self.width as isize - 1) as usize;
        let v = v.clamp(0, self.height as isize - 1) as usize;
        self.data[v * self.width + u]
    }

    /// Gray level at a position, interpolated between the four nearest pixels; `None` outside of the image.
    #[must_use]
    pub fn sample(&self, at: Vector2<f64>) -> Option<f64> {
        let (last_u, last_v) = (self.width as f64 - 1.0, self.height as f64 - 1.0);
        if !(at.x >= 0.0 && at.y >= 0.0 && at.x <= last_u && at.y <= last_v) {
            return None;
        }
        let (u, v) = (
            (at.x as usize).min(self.width.saturating_sub(2)),
            (at.y as usize).min(self.height.saturating_sub(2)),
        );
        let (du, dv) = ((at.x - u as f64) as f32, (at.y - v as f64) as f32);
        let (top, bottom) = (v * self.width + u, (v + 1).min(self.height - 1) * self.width + u);
        let right = usize::from(self.width > 1);
        let across = |row: usize| self.data[row] + du * (self.data[row + right] - self.data[row]);
        Some(f64::from(across(top) + dv * (across(bottom) - across(top))))
    }

    /// Smooths by a Gaussian of this standard deviation, px.
    #[must_use]
    pub fn smoothed(&self, sigma_px: f64) -> Self {
        let reach = (3.0 * sigma_px).ceil() as isize;
        let weights: Vec<f32> =
            (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp() as f32).collect();
        let sum: f32 = weights.iter().sum();
        let weights: Vec<f32> = weights.iter().map(|weight| weight / sum).collect();
        let across = self.convolved(&weights, reach, [1, 0]);
        across.convolved(&weights, reach, [0, 1])
    }

    /// Halves width and height by the mean of four pixels; pixel (u, v) then covers (2u + 0.5, 2v + 0.5).
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut data = Vec::with_capacity(width * height);
        for v in 0..height {
            let (top, bottom) = (2 * v * self.width, (2 * v + 1) * self.width);
            data.extend((0..width).map(|u| {
                let at = |row: usize| self.data[row + 2 * u] + self.data[row + 2 * u + 1];
                0.25 * (at(top) + at(bottom))
            }));
        }
        Self { data, width, height }
    }

    /// Doubles width and height by interpolation; pixel (u, v) of this image then lies at (2u + 0.5, 2v + 0.5).
    #[must_use]
    pub fn doubled(&self) -> Self {
        let (width, height) = (2 * self.width, 2 * self.height);
        let last = Vector2::new(self.width as f64 - 1.0, self.height as f64 - 1.0);
        let level = |index: usize| {
            let at =
                Vector2::new((index % width) as f64, (index / width) as f64).map(|place| 0.5 * place - 0.25);
            self.sample(at.sup(&Vector2::zeros()).inf(&last)).unwrap_or(0.0) as f32
        };
        Self { data: (0..width * height).map(level).collect(), width, height }
    }

    fn convolved(&self, weights: &[f32], reach: isize, [du, dv]: [isize; 2]) -> Self {
        let (width, height) = (self.width as isize, self.height as isize);
        let mut data = vec![0.0; self.data.len()];
        for v in 0..height {
            for u in 0..width {
                let inside =
                    u >= reach * du && u + reach * du < width && v >= reach * dv && v + reach * dv < height;
                let out = (v * width + u) as usize;
                data[out] = if inside {
                    let first = ((v - reach * dv) * width + u - reach * du) as usize;
                    let step = (dv * width + du) as usize;
                    weights.iter().enumerate().map(|(i, weight)| weight * self.data[first + i * step]).sum()
                } else {
                    let at = |i: usize| self.at(u + (i as isize - reach) * du, v + (i as isize - reach) * dv);
                    weights.iter().enumerate().map(|(i, weight)| weight * at(i)).sum()
                };
            }
        }
        Self { data, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp() {
        let pixels: Vec<u8> = (0..32 * 24).map(|i| (4 * (i % 32)) as u8).collect();
        let image = FloatImage::of(ImageView::new(&pixels, 32, 24, 32).unwrap());
        let smooth = image.smoothed(1.5);
        assert!((smooth.sample(Vector2::new(15.25, 11.5)).unwrap() - 61.0).abs() < 1e-4);
        assert!((image.doubled().at(21, 9) - 4.0 * 10.25).abs() < 1e-4);
        assert!((image.halved().at(4, 3) - 4.0 * 8.5).abs() < 1e-4);
        assert!(
            image.sample(Vector2::new(31.1, 3.0)).is_none()
                && image.sample(Vector2::new(f64::NAN, 0.0)).is_none()
        );
    }
}
