//! Horizontal edges of an image: upper and lower boundaries of objects.

use yamabico_core::image::ImageView;
use yamabico_vision::bit_image::{BitImage, pack};
use yamabico_vision::vectorize::{self, Kernel};

/// Minimum number of adjacent columns that a horizontal line covers.
const RUN: u32 = 7;

/// Horizontal edge operator with its row buffers: a quarter of the absolute vertical Sobel derivative (an ideal step of
/// g gray levels gives g), rounded down, with non-maximum suppression along the column (of equal neighbors the upper
/// one is kept). The border is replicated.
#[derive(Clone, Debug, Default)]
pub struct HorizontalEdges {
    /// Row sums (1 2 1) of three rows; row v in slot v % 3.
    sums: [Vec<i16>; 3],
    /// Magnitudes of three rows, padded to whole words; row v in slot v % 3.
    magnitudes: [Vec<u8>; 3],
}

impl HorizontalEdges {
    /// Sets the pixels of `out` with a thinned magnitude of at least `min_gradient` > 0, and resizes it to the size of
    /// `image`.
    pub fn edges(&mut self, image: ImageView, min_gradient: u8, out: &mut BitImage) {
        out.clear(image.width(), image.height());
        for slot in 0..3 {
            self.sums[slot].resize(image.width(), 0);
            self.magnitudes[slot].clear();
            self.magnitudes[slot].resize(image.width().next_multiple_of(64), 0);
        }
        vectorize::run(Edges { image, rows: self, min_gradient: min_gradient.max(1), out });
    }

    #[inline(always)]
    fn sum(&mut self, image: ImageView, v: usize) {
        let (row, out) = (image.row(v), &mut self.sums[v % 3]);
        let last = row.len() - 1;
        out[0] = 3 * i16::from(row[0]) + i16::from(row[1.min(last)]);
        out[last] = 3 * i16::from(row[last]) + i16::from(row[last.saturating_sub(1)]);
        if last >= 2 {
            let (left, here, right) = (&row[..last - 1], &row[1..last], &row[2..]);
            for (i, out) in out[1..last].iter_mut().enumerate() {
                *out = i16::from(left[i]) + 2 * i16::from(here[i]) + i16::from(right[i]);
            }
        }
    }

    /// Computes the magnitudes of row `v`. Rows must be computed in increasing order, from 0.
    #[inline(always)]
    fn magnitude(&mut self, image: ImageView, v: usize) {
        let last = image.height() - 1;
        if v == 0 {
            self.sum(image, 0);
        }
        if v < last {
            self.sum(image, v + 1);
        }
        let [above, below] =
            [v.saturating_sub(1), (v + 1).min(last)].map(|row| &self.sums[row % 3][..image.width()]);
        let out = &mut self.magnitudes[v % 3][..image.width()];
        for u in 0..out.len() {
            out[u] = ((below[u] - above[u]).unsigned_abs() >> 2) as u8;
        }
    }
}

struct Edges<'a> {
    image: ImageView<'a>,
    rows: &'a mut HorizontalEdges,
    min_gradient: u8,
    out: &'a mut BitImage,
}

impl Kernel for Edges<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let height = self.image.height();
        self.rows.magnitude(self.image, 0);
        let mut flags = [0_u8; 64];
        for v in 0..height {
            if v + 1 < height {
                self.rows.magnitude(self.image, v + 1);
            } else {
                self.rows.magnitudes[(v + 1) % 3].fill(0);
            }
            if v == 0 {
                self.rows.magnitudes[2].fill(0);
            }
            let [above, here, below] =
                [v + 2, v, v + 1].map(|row| self.rows.magnitudes[row % 3].as_chunks::<64>().0);
            for (((word, above), here), below) in
                self.out.row_mut(v).iter_mut().zip(above).zip(here).zip(below)
            {
                for i in 0..64 {
                    flags[i] = u8::from(here[i] > above[i])
                        & u8::from(here[i] >= below[i])
                        & u8::from(here[i] >= self.min_gradient);
                }
                *word = pack(&flags);
            }
        }
    }
}

/// Writes to `out` the pixels of `mask` that are part of a nearly horizontal line: of seven adjacent columns, each
/// with a pixel in the same or an adjacent row.
pub fn horizontal_lines(mask: &BitImage, spare: &mut BitImage, out: &mut BitImage) {
    spare.clear(mask.width(), mask.height());
    out.clear(mask.width(), mask.height());
    let stride = mask.stride();
    let words = mask.words();
    let len = words.len();
    let at = |words: &[u64], i: usize| words.get(i).copied().unwrap_or(0);
    // Dilate by one row; then keep the first column of runs of seven; then restore the whole runs.
    let tall: &mut [u64] = spare.words_mut();
    for (i, tall) in tall.iter_mut().enumerate() {
        let above = if i >= stride { words[i - stride] } else { 0 };
        *tall = words[i] | above | at(words, i + stride);
    }
    let run = out.words_mut();
    for i in 0..len {
        let (here, after) = (tall[i], at(tall, i + 1));
        run[i] = (1..RUN).fold(here, |run, k| run & (here >> k | after << (64 - k)));
    }
    for i in 0..len {
        let (before, here) = (if i > 0 { run[i - 1] } else { 0 }, run[i]);
        tall[i] = (1..RUN).fold(here, |wide, k| wide | here << k | before >> (64 - k));
    }
    for i in 0..len {
        let above = if i >= stride { tall[i - stride] } else { 0 };
        run[i] = (tall[i] | above | at(tall, i + stride)) & words[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn equals_the_definition_on_every_size() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(10);
        let (mut operator, mut bits) = (HorizontalEdges::default(), BitImage::default());
        for (width, height) in [(1, 1), (3, 2), (2, 5), (64, 6), (70, 9)] {
            let data: Vec<u8> = (0..width * height)
                .map(|_| if random.random::<bool>() { 255 } else { random.random::<u8>() & 3 })
                .collect();
            let image = ImageView::new(&data, width, height, width).unwrap();
            operator.edges(image, 30, &mut bits);
            let at = |u: isize, v: isize| i32::from(image.pixel(u.max(0) as usize, v.max(0) as usize));
            let magnitude = |u: isize, v: isize| {
                if v < 0 || v >= height as isize {
                    return 0;
                }
                let sum = |v: isize| at(u - 1, v) + 2 * at(u, v) + at(u + 1, v);
                (sum(v + 1) - sum(v - 1)).abs() / 4
            };
            for v in 0..height as isize {
                for u in 0..width as isize {
                    let [above, here, below] = [-1, 0, 1].map(|dv| magnitude(u, v + dv));
                    let expected = here > above && here >= below && here >= 30;
                    assert_eq!(bits.get(u as usize, v as usize), expected, "{width}x{height} at {u} {v}");
                }
            }
        }
    }

    #[test]
    fn only_level_lines_of_seven_columns_are_kept() {
        let (mut mask, mut spare, mut out) =
            (BitImage::new(200, 40), BitImage::default(), BitImage::default());
        mask.draw_line(Vector2::new(55.0, 10.0), Vector2::new(75.0, 12.0));
        mask.draw_line(Vector2::new(100.0, 20.0), Vector2::new(105.0, 20.0));
        mask.draw_line(Vector2::new(120.0, 0.0), Vector2::new(120.0, 39.0));
        horizontal_lines(&mask, &mut spare, &mut out);
        let columns: Vec<usize> = (0..200).filter(|&u| (0..40).any(|v| out.get(u, v))).collect();
        assert_eq!((columns.first(), columns.last(), columns.len()), (Some(&55), Some(&75), 21));
    }
}
