//! Smoothed image strip around a vertical edge.
//!
//! An edge looks the same along its length: the mean over several rows removes noise and preserves the edge.

use crate::template::PatchOrigin;
use nalgebra::Vector2;
use yamabico_core::image::{GrayImage, ImageView};

/// Rows of the vertical mean, an odd number.
const ROWS: usize = 9;
/// Half width of the horizontal binomial filter, columns.
const MARGIN: usize = 2;

/// A smoothed image strip. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Strip {
    smooth: GrayImage,
    origin: Vector2<f64>,
    line: Vec<u8>,
    across: Vec<u16>,
    sums: Vec<u16>,
}

impl Strip {
    /// Cuts `width` x `height` pixels around `middle`: means over 9 rows of the binomial (1, 4, 6, 4, 1)/16 along the row. The
    /// border is replicated. Returns true if the middle lies in the image.
    pub fn cut(&mut self, image: ImageView<'_>, middle: Vector2<f64>, width: usize, height: usize) -> bool {
        let inside = |at: f64, size: usize| (0.0..size as f64).contains(&at);
        if !inside(middle.x, image.width()) || !inside(middle.y, image.height()) {
            return false;
        }
        let left = middle.x.round() as isize - (width / 2) as isize;
        let top = middle.y.round() as isize - (height / 2) as isize;
        self.origin = Vector2::new(left as f64, top as f64);
        self.smooth.resize(width, height);
        let rows = height + ROWS - 1;
        self.across.resize(rows * width, 0);
        for (row, out) in self.across.chunks_exact_mut(width).enumerate() {
            let v = (top + row as isize - (ROWS / 2) as isize).max(0) as usize;
            take_line(image.row(v), left - MARGIN as isize, width + 2 * MARGIN, &mut self.line);
            let from = |k: usize| self.line.iter().skip(k).map(|&level| u16::from(level));
            let outer = from(0).zip(from(4));
            let inner = from(1).zip(from(3));
            for (((sum, (a, e)), (b, d)), c) in out.iter_mut().zip(outer).zip(inner).zip(from(2)) {
                *sum = a + e + 4 * (b + d) + 6 * c;
            }
        }
        self.sums.clear();
        self.sums.resize(width, 0);
        const DIVISOR: u16 = 16 * ROWS as u16;
        for row in 0..rows {
            let newest = &self.across[row * width..][..width];
            for (sum, &level) in self.sums.iter_mut().zip(newest) {
                *sum += level;
            }
            let Some(out_row) = (row + 1).checked_sub(ROWS) else { continue };
            let out = &mut self.smooth.pixels_mut()[out_row * width..][..width];
            let oldest = &self.across[out_row * width..][..width];
            for ((sum, out), &level) in self.sums.iter_mut().zip(out).zip(oldest) {
                *out = ((*sum + DIVISOR / 2) / DIVISOR) as u8;
                *sum -= level;
            }
        }
        true
    }

    /// Returns the strip as an image; `None` before the first cut.
    #[must_use]
    pub fn view(&self) -> Option<ImageView<'_>> {
        self.smooth.view().ok()
    }

    /// Converts a pixel of the image to the strip.
    #[must_use]
    pub fn inside(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        pixel - self.origin
    }

    /// Converts a column of the strip to the image.
    #[must_use]
    pub fn outside(&self, column: f64) -> f64 {
        column + self.origin.x
    }

    /// Returns the origin of a patch of this size that has the strip's `pixel` at column `edge` in its middle row; `None` if it
    /// leaves the strip to the left or above.
    #[must_use]
    pub fn place(pixel: Vector2<f64>, edge: f64, height: usize) -> Option<PatchOrigin> {
        let corner = Vector2::new(pixel.x - edge, pixel.y - (height / 2) as f64).map(f64::round);
        (corner.x >= 0.0 && corner.y >= 0.0)
            .then(|| PatchOrigin { u: corner.x as usize, v: corner.y as usize })
    }
}

/// Copies `count` pixels of a row from column `first` on; the border is replicated.
fn take_line(row: &[u8], first: isize, count: usize, line: &mut Vec<u8>) {
    line.clear();
    if let Some(inside) = usize::try_from(first).ok().and_then(|first| row.get(first..first + count)) {
        line.extend_from_slice(inside);
        return;
    }
    let last = row.len() as isize - 1;
    line.extend((first..first + count as isize).map(|u| row[u.clamp(0, last) as usize]));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_and_the_border_is_repeated() {
        let data: Vec<u8> = (0..40 * 30).map(|i| (3 * (i % 40)) as u8).collect();
        let image = ImageView::new(&data, 40, 30, 40).unwrap();
        let mut strip = Strip::default();
        assert!(strip.cut(image, Vector2::new(20.4, 15.0), 16, 12));
        let view = strip.view().unwrap();
        assert_eq!((view.width(), view.height()), (16, 12));
        assert_eq!(view.row(5)[3], 3 * 15, "column 12 + 3");
        assert!((strip.inside(Vector2::new(20.4, 15.0)).x - 8.4).abs() < 1e-9);
        assert!(strip.cut(image, Vector2::new(1.0, 0.0), 16, 12));
        assert_eq!(strip.view().unwrap().row(0)[2], 0);
        assert!(!strip.cut(image, Vector2::new(f64::NAN, 3.0), 16, 12));
        assert!(!strip.cut(image, Vector2::new(40.0, 3.0), 16, 12));
    }

    #[test]
    fn noise_falls_to_a_fifth() {
        let mut seed = 1_u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((seed >> 24) % 64) as u8 + 90
        };
        let data: Vec<u8> = (0..100 * 100).map(|_| noise()).collect();
        let mut strip = Strip::default();
        strip.cut(ImageView::new(&data, 100, 100, 100).unwrap(), Vector2::new(50.0, 50.0), 60, 60);
        let deviation = |pixels: &[u8]| {
            let mean = pixels.iter().map(|&x| f64::from(x)).sum::<f64>() / pixels.len() as f64;
            (pixels.iter().map(|&x| (f64::from(x) - mean).powi(2)).sum::<f64>() / pixels.len() as f64).sqrt()
        };
        let (before, after) = (deviation(&data), deviation(strip.view().unwrap().row(30)));
        assert!(after < 0.25 * before, "{before} to {after}");
    }
}
