//! Band-passed images: Gauss of sigma s minus Gauss of 6 s.
//!
//! Removes exposure, the glow of lamps and soft mirror images, and keeps the grain and the joints of a floor.

use crate::vectorize::{self, Kernel};
use yamabico_geometry::image::ImageView;

/// Units of a [`BandImage`] per gray level.
pub const BAND_UNIT: f32 = 32.0;

/// Factor of the wide Gauss.
const WIDE: f32 = 6.0;
/// Reduction of the image below the wide Gauss.
const REDUCTION: usize = 4;
/// Variance that reducing by box and enlarging by interpolation add, square pixels.
const REDUCTION_VARIANCE: f32 = 3.9;

/// Lower part of a band-passed image.
#[derive(Clone, Debug, Default)]
pub struct BandImage {
    width: usize,
    /// First row of the image that is stored.
    top: usize,
    levels: Vec<i16>,
}

impl BandImage {
    /// Creates a blank image of the rows from `top`.
    #[must_use]
    pub fn new(width: usize, height: usize, top: usize) -> Self {
        Self { width, top, levels: vec![0; width * height.saturating_sub(top)] }
    }

    /// Width, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// First row.
    #[must_use]
    pub fn top(&self) -> usize {
        self.top
    }

    /// Value and derivatives along u and v (units per px) at the pixel that holds the position; 0 at and beyond the
    /// border.
    #[inline(always)]
    pub(crate) fn level_and_gradient(&self, u: f32, v: f32) -> (f32, f32, f32) {
        // Processors convert to 32 bits faster than to 64.
        let (column, row) = (u as u32 as usize, (v as u32 as usize).wrapping_sub(self.top));
        let rows = self.levels.len() / self.width.max(1);
        if column == 0 || column + 1 >= self.width || row == 0 || row.saturating_add(1) >= rows {
            return (0.0, 0.0, 0.0);
        }
        let at = row * self.width + column;
        let three = |at: usize| {
            let row = self.levels.get(at - 1..at + 2);
            row.map_or([0.0; 3], |row| [row[0], row[1], row[2]].map(f32::from))
        };
        let [a, b, c] = [three(at - self.width), three(at), three(at + self.width)];
        let across = (a[2] - a[0] + 2.0 * (b[2] - b[0]) + c[2] - c[0]) / 8.0;
        let down = (c[0] - a[0] + 2.0 * (c[1] - a[1]) + c[2] - a[2]) / 8.0;
        (b[1], across, down)
    }

    /// Values of the rows from [`BandImage::top`], in 1/[`BAND_UNIT`] gray level.
    #[must_use]
    pub fn levels(&self) -> &[i16] {
        &self.levels
    }
}

/// Band-pass filter of one scale with its buffers.
#[derive(Clone, Debug)]
pub struct BandPass {
    narrow: Vec<f32>,
    wide: Vec<f32>,
    /// Rows after the horizontal pass of the narrow Gauss.
    across: Vec<f32>,
    /// Reduced image, then smoothed.
    reduced: Vec<f32>,
    smoothed: Vec<f32>,
    row: Vec<f32>,
    sum: Vec<f32>,
    /// Row of the wide Gauss at the size of the image.
    enlarged: Vec<f32>,
}

impl BandPass {
    /// Creates a filter with the sigma of its narrow Gauss, px.
    #[must_use]
    pub fn new(sigma_px: f32) -> Self {
        let wide = (WIDE * sigma_px).powi(2) - REDUCTION_VARIANCE;
        Self {
            narrow: half_kernel(sigma_px),
            wide: half_kernel(wide.max(0.1).sqrt() / REDUCTION as f32),
            across: Vec::new(),
            reduced: Vec::new(),
            smoothed: Vec::new(),
            row: Vec::new(),
            sum: Vec::new(),
            enlarged: Vec::new(),
        }
    }

    /// Filters the rows of `image` from `out.top()`.
    pub fn filter(&mut self, image: ImageView, out: &mut BandImage) {
        out.width = image.width();
        out.levels.resize(image.width() * image.height().saturating_sub(out.top), 0);
        vectorize::run(Filter { image, buffers: self, out });
    }

    #[inline(always)]
    fn run(&mut self, image: ImageView, out: &mut BandImage) {
        let (width, height, top) = (image.width(), image.height(), out.top);
        let rows = height.saturating_sub(top);
        self.row.resize(width + 2 * self.narrow.len().max(self.wide.len()), 0.0);
        self.sum.resize(width, 0.0);
        let small_width = self.blur_reduced(image, top);
        self.enlarged.resize(REDUCTION * small_width, 0.0);
        let first = top / REDUCTION;
        // Horizontal pass, with the rows above that the vertical pass needs.
        let radius = self.narrow.len() - 1;
        let start = top.saturating_sub(radius);
        self.across.resize((height - start) * width, 0.0);
        for (v, across) in self.across.chunks_exact_mut(width).enumerate() {
            let row = &mut self.row[..width + 2 * radius];
            for (value, &level) in row[radius..].iter_mut().zip(image.row(start + v)) {
                *value = f32::from(level);
            }
            repeat_ends(row, radius);
            convolve(row, &self.narrow, across);
        }
        for v in 0..rows {
            let row = |offset: usize, back: bool| {
                let v = v + top;
                let v = if back { v.saturating_sub(offset) } else { (v + offset).min(height - 1) };
                let begin = (v.max(start) - start) * width;
                &self.across[begin..begin + width]
            };
            let sum = &mut self.sum[..width];
            weigh(&self.narrow, sum, |offset| (row(offset, true), row(offset, false)));
            // Wide Gauss of this row, enlarged from the reduced image.
            let small_rows = self.smoothed.len() / small_width;
            let position = (v + top) as f32 / REDUCTION as f32 - 0.375 - first as f32;
            let (upper, share) = (position.floor(), position - position.floor());
            let small_row = |i: f32| {
                let begin = (i.max(0.0) as usize).min(small_rows - 1) * small_width;
                &self.smoothed[begin..begin + small_width]
            };
            let wide = &mut self.row[..small_width + 2];
            for ((value, &a), &b) in wide[1..].iter_mut().zip(small_row(upper)).zip(small_row(upper + 1.0)) {
                *value = a + share * (b - a);
            }
            wide[0] = wide[1];
            wide[small_width + 1] = wide[small_width];
            enlarge(wide, &mut self.enlarged);
            let levels = &mut out.levels[v * width..(v + 1) * width];
            for ((level, &narrow), &wide) in levels.iter_mut().zip(&*sum).zip(&self.enlarged) {
                *level = (BAND_UNIT * (narrow - wide)) as i32 as i16;
            }
        }
    }

    /// Reduces the image from row `top` on and applies the wide Gauss; returns the reduced width.
    #[inline(always)]
    fn blur_reduced(&mut self, image: ImageView, top: usize) -> usize {
        let (width, height) = (image.width().div_ceil(REDUCTION), image.height().div_ceil(REDUCTION));
        let first = top / REDUCTION;
        let rows = height - first;
        self.reduced.resize(width * rows, 0.0);
        self.smoothed.resize(width * rows, 0.0);
        for (y, reduced) in self.reduced.chunks_exact_mut(width).enumerate() {
            reduced.fill(0.0);
            for dv in 0..REDUCTION {
                let row = image.row(((first + y) * REDUCTION + dv).min(image.height() - 1));
                let (blocks, rest) = row.as_chunks::<REDUCTION>();
                let total = |block: &[u8]| block.iter().map(|&level| u32::from(level)).sum::<u32>() as f32;
                for (sum, block) in reduced.iter_mut().zip(blocks) {
                    *sum += total(block) / (REDUCTION * REDUCTION) as f32;
                }
                if let ([.., sum], false) = (&mut *reduced, rest.is_empty()) {
                    *sum += total(rest) / (REDUCTION * rest.len()) as f32;
                }
            }
        }
        let radius = self.wide.len() - 1;
        for (reduced, smoothed) in
            self.reduced.chunks_exact_mut(width).zip(self.smoothed.chunks_exact_mut(width))
        {
            let row = &mut self.row[..width + 2 * radius];
            row[radius..radius + width].copy_from_slice(reduced);
            repeat_ends(row, radius);
            convolve(row, &self.wide, smoothed);
            reduced.copy_from_slice(smoothed);
        }
        for (y, smoothed) in self.smoothed.chunks_exact_mut(width).enumerate() {
            let row = |y: usize| &self.reduced[y * width..(y + 1) * width];
            let rows_around =
                |offset: usize| (row(y.saturating_sub(offset)), row((y + offset).min(rows - 1)));
            weigh(&self.wide, smoothed, rows_around);
        }
        width
    }
}

struct Filter<'a> {
    image: ImageView<'a>,
    buffers: &'a mut BandPass,
    out: &'a mut BandImage,
}

impl Kernel for Filter<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.buffers.run(self.image, self.out);
    }
}

/// Weights of a Gauss at the distances 0, 1, 2, ..., normalized.
fn half_kernel(sigma: f32) -> Vec<f32> {
    let radius = (3.0 * sigma).ceil().max(1.0) as i32;
    let mut half: Vec<f32> = (0..=radius).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * half.iter().sum::<f32>() - 1.0;
    half.iter_mut().for_each(|weight| *weight /= sum);
    half
}

/// Repeats the first and last value over `radius` entries on either side.
#[inline(always)]
fn repeat_ends(row: &mut [f32], radius: usize) {
    let end = row.len() - radius;
    let (first, last) = (row[radius], row[end - 1]);
    row[..radius].fill(first);
    row[end..].fill(last);
}

#[inline(always)]
fn convolve(row: &[f32], half: &[f32], out: &mut [f32]) {
    let (width, radius) = (out.len(), half.len() - 1);
    weigh(half, out, |offset| (&row[radius - offset..][..width], &row[radius + offset..][..width]));
}

/// Sums of the values at each distance before and behind a place, as `at` gives them, by the weights `half`: the sums of many
/// places at a time stay in registers.
#[inline(always)]
fn weigh<'a>(half: &[f32], out: &mut [f32], at: impl Fn(usize) -> (&'a [f32], &'a [f32])) {
    const LANES: usize = 64;
    let Some(last) = out.len().checked_sub(LANES) else {
        return weigh_places::<1>(half, out, at, 0..out.len());
    };
    weigh_places::<LANES>(half, out, &at, (0..last).step_by(LANES).chain([last]));
}

/// Sums of the places from each of `begins`, `LANES` at a time; see [`weigh`].
#[inline(always)]
fn weigh_places<'a, const LANES: usize>(
    half: &[f32],
    out: &mut [f32],
    at: impl Fn(usize) -> (&'a [f32], &'a [f32]),
    begins: impl Iterator<Item = usize>,
) {
    for begin in begins {
        let places = begin..begin + LANES;
        let mut sums = [0.0_f32; LANES];
        for (sum, &value) in sums.iter_mut().zip(&at(0).0[places.clone()]) {
            *sum = half[0] * value;
        }
        for (offset, &weight) in half.iter().enumerate().skip(1) {
            let (before, behind) = at(offset);
            for ((sum, &a), &b) in sums.iter_mut().zip(&before[places.clone()]).zip(&behind[places.clone()]) {
                *sum += weight * (a + b);
            }
        }
        out[places].copy_from_slice(&sums);
    }
}

/// Enlarges the row `small`, which has one repeated value on either side.
#[inline(always)]
fn enlarge(small: &[f32], out: &mut [f32]) {
    for (out, window) in out.as_chunks_mut::<REDUCTION>().0.iter_mut().zip(small.windows(3)) {
        let (left, right) = (window[1] - window[0], window[2] - window[1]);
        *out = [
            window[0] + 0.625 * left,
            window[0] + 0.875 * left,
            window[1] + 0.125 * right,
            window[1] + 0.375 * right,
        ];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filtered(data: &[u8], width: usize, height: usize, top: usize, sigma: f32) -> BandImage {
        let mut out = BandImage::new(width, height, top);
        BandPass::new(sigma).filter(ImageView::new(data, width, height, width).unwrap(), &mut out);
        out
    }

    /// Both Gausses by definition, over the whole image.
    fn by_definition(data: &[u8], width: usize, height: usize, u: usize, v: usize, sigma: f32) -> f32 {
        let gauss = |sigma: f32| {
            let radius = (4.0 * sigma) as i32;
            let (mut sum, mut weights) = (0.0, 0.0);
            for dv in -radius..=radius {
                for du in -radius..=radius {
                    let weight = (-0.5 * ((du * du + dv * dv) as f32) / (sigma * sigma)).exp();
                    let (x, y) = (
                        (u as i32 + du).clamp(0, width as i32 - 1),
                        (v as i32 + dv).clamp(0, height as i32 - 1),
                    );
                    sum += weight * f32::from(data[y as usize * width + x as usize]);
                    weights += weight;
                }
            }
            sum / weights
        };
        gauss(sigma) - gauss(WIDE * sigma)
    }

    #[test]
    fn equals_two_gausses_within_a_gray_level() {
        let (width, height) = (101, 90);
        let data: Vec<u8> = (0..width * height)
            .map(|i| {
                let (u, v) = ((i % width) as f32, (i / width) as f32);
                (120.0 + 60.0 * (u * 0.35).sin() * (v * 0.22).cos() + 0.4 * v) as u8
            })
            .collect();
        for (sigma, top) in [(0.9, 0), (2.0, 37)] {
            let out = filtered(&data, width, height, top, sigma);
            for (u, v) in [(50, 45), (20, 60), (80, 70), (40, 88), (3, 50), (99, 85)] {
                let ours = f32::from(out.levels()[(v - top) * width + u]) / BAND_UNIT;
                let expected = by_definition(&data, width, height, u, v, sigma);
                assert!((ours - expected).abs() < 1.5, "sigma {sigma} at {u} {v}: {ours}, not {expected}");
            }
        }
    }

    #[test]
    fn brightness_and_slow_changes_vanish() {
        let (width, height) = (64, 48);
        let data: Vec<u8> = (0..width * height).map(|i| (60 + i % width + i / width) as u8).collect();
        let out = filtered(&data, width, height, 0, 0.9);
        let inner = (20..28).flat_map(|v| (24..40).map(move |u| v * width + u));
        assert!(inner.map(|i| out.levels()[i].abs()).max().unwrap() <= 8);
    }
}
