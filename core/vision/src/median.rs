//! 3x3 median filter for 8-bit images.

use super::vectorize::{self, Kernel};
use yamabico_geometry::image::{GrayImage, ImageView};

/// 3x3 median filter with its row buffers.
#[derive(Clone, Debug, Default)]
pub struct Median3 {
    /// Minimum, median and maximum of each column of three, with one replicated column on either side.
    low: Vec<u8>,
    middle: Vec<u8>,
    high: Vec<u8>,
}

impl Median3 {
    /// Writes the median of each pixel and its eight neighbors to `out`, and resizes it to the size of `image`. The
    /// border is replicated. Allocates only for an image wider or larger than any before.
    pub fn filter(&mut self, image: ImageView, out: &mut GrayImage) {
        let width = image.width();
        out.resize(width, image.height());
        for buffer in [&mut self.low, &mut self.middle, &mut self.high] {
            buffer.resize(width + 2, 0);
        }
        vectorize::run(Filter { image, rows: self, out: out.pixels_mut() });
    }
}

struct Filter<'a> {
    image: ImageView<'a>,
    rows: &'a mut Median3,
    out: &'a mut [u8],
}

impl Kernel for Filter<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Median3 { low, middle, high } = self.rows;
        for (v, out) in self.out.chunks_exact_mut(self.image.width()).enumerate() {
            let (above, here, below) =
                (self.image.row(v.saturating_sub(1)), self.image.row(v), self.image.row(v + 1));
            sort_columns(above, here, below, low, middle, high);
            median_of_sorted(low, middle, high, out);
        }
    }
}

/// Sorts each column of three; element u + 1 of the results belongs to column u.
#[inline(always)]
fn sort_columns(above: &[u8], here: &[u8], below: &[u8], low: &mut [u8], middle: &mut [u8], high: &mut [u8]) {
    let width = here.len();
    let (above, below) = (&above[..width], &below[..width]);
    {
        let (low, middle, high) =
            (&mut low[1..width + 1], &mut middle[1..width + 1], &mut high[1..width + 1]);
        for u in 0..width {
            let (a, b, c) = (above[u], here[u], below[u]);
            let (small, large) = (a.min(b), a.max(b));
            let upper = large.min(c);
            low[u] = small.min(c);
            middle[u] = small.max(upper);
            high[u] = large.max(c);
        }
    }
    for row in [low, middle, high] {
        row[0] = row[1];
        row[width + 1] = row[width];
    }
}

/// The median of nine is the median of three: the maximum of the minima, the median of the medians, the minimum of the
/// maxima.
#[inline(always)]
fn median_of_sorted(low: &[u8], middle: &[u8], high: &[u8], out: &mut [u8]) {
    let width = out.len();
    let (l0, l1, l2) = (&low[..width], &low[1..width + 1], &low[2..width + 2]);
    let (m0, m1, m2) = (&middle[..width], &middle[1..width + 1], &middle[2..width + 2]);
    let (h0, h1, h2) = (&high[..width], &high[1..width + 1], &high[2..width + 2]);
    for u in 0..width {
        let lows = l0[u].max(l1[u]).max(l2[u]);
        let middles = median_of_three(m0[u], m1[u], m2[u]);
        let highs = h0[u].min(h1[u]).min(h2[u]);
        out[u] = median_of_three(lows, middles, highs);
    }
}

#[inline(always)]
fn median_of_three(a: u8, b: u8, c: u8) -> u8 {
    a.min(b).max(a.max(b).min(c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn by_sorting(image: ImageView) -> Vec<u8> {
        let mut out = Vec::new();
        for v in 0..image.height() {
            for u in 0..image.width() {
                let mut nine: Vec<u8> = (0..9)
                    .map(|i| image.pixel((u + i % 3).saturating_sub(1), (v + i / 3).saturating_sub(1)))
                    .collect();
                nine.sort_unstable();
                out.push(nine[4]);
            }
        }
        out
    }

    #[test]
    fn equals_sorting_on_every_size_and_instruction_set() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(5);
        let mut median = Median3::default();
        let mut out = GrayImage::default();
        for (width, height) in [(1, 1), (2, 1), (1, 7), (3, 3), (31, 5), (65, 9), (130, 4)] {
            let stride = width + 3;
            let data: Vec<u8> = (0..stride * height).map(|_| random.random()).collect();
            let image = ImageView::new(&data, width, height, stride).unwrap();
            let expected = by_sorting(image);
            median.filter(image, &mut out);
            assert_eq!(out.pixels(), expected, "{width} x {height}");
            let mut base = vec![0; width * height];
            Filter { image, rows: &mut median, out: &mut base }.run();
            assert_eq!(base, expected, "base instruction set, {width} x {height}");
        }
    }
}
