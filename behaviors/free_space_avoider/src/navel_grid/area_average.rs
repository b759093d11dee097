//! Image scaling by area averaging: each output pixel is the mean of the input area that it covers.

use yamabico_core::image::{GrayImage, ImageView};
use yamabico_vision::vectorize::{self, Kernel};

/// Scales images to any size. Reuses its row buffer between images.
#[derive(Clone, Debug, Default)]
pub struct AreaAverage {
    /// One output row, before averaging over columns.
    row: Vec<f32>,
    /// For each output column, the first input column that it covers, and the weights of that and the following
    /// columns.
    columns: Vec<usize>,
    shares: Vec<f32>,
    /// Input and output width that the weights are for.
    widths: (usize, usize),
}

impl AreaAverage {
    /// Scales `image` to the size of `out`. Each output pixel is the area-weighted mean of the covered input pixels,
    /// rounded to the nearest gray level. An empty `out` stays empty. Allocates only for an image wider than any
    /// before.
    pub fn scale(&mut self, image: ImageView, out: &mut GrayImage) {
        let (width, height) = (out.width(), out.height());
        if width == 0 || height == 0 {
            return;
        }
        self.prepare(image.width(), width);
        vectorize::run(Scale { image, buffers: self, out: out.pixels_mut(), width, height });
    }

    fn prepare(&mut self, old: usize, new: usize) {
        if self.widths == (old, new) {
            return;
        }
        self.widths = (old, new);
        let span = span(old, new);
        // Every output column reads `span` input columns; those outside the covered area have zero weight.
        self.row.clear();
        self.row.resize(old + span, 0.0);
        self.columns.clear();
        self.columns.extend((0..new).map(|column| column * old / new));
        self.shares.clear();
        for column in 0..new {
            let covered = Covered::by(column, old, new).map(|(_, share)| share);
            self.shares.extend(covered.chain(std::iter::repeat(0.0)).take(span));
        }
    }
}

/// Maximum number of input columns that an output column can touch.
#[inline(always)]
fn span(old: usize, new: usize) -> usize {
    old.div_ceil(new) + 1
}

struct Scale<'a> {
    image: ImageView<'a>,
    buffers: &'a mut AreaAverage,
    out: &'a mut [u8],
    width: usize,
    height: usize,
}

impl Kernel for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Scale { image, buffers: AreaAverage { row, columns, shares, .. }, out, width, height } = self;
        let span = span(image.width(), width);
        for (v, out) in out.chunks_exact_mut(width).enumerate() {
            row.fill(0.0);
            for (old, share) in Covered::by(v, image.height(), height) {
                for (sum, &pixel) in row.iter_mut().zip(image.row(old)) {
                    *sum += share * f32::from(pixel);
                }
            }
            for ((pixel, &begin), shares) in out.iter_mut().zip(&*columns).zip(shares.chunks_exact(span)) {
                let covered = row[begin..begin + span].iter().zip(shares);
                *pixel = (covered.map(|(sum, share)| sum * share).sum::<f32>() + 0.5) as u8;
            }
        }
    }
}

/// Iterator over the input rows (or columns) that an output row covers, each with its weight; the weights sum to 1.
struct Covered {
    at: usize,
    old: usize,
    new: usize,
    begin: usize,
    end: usize,
}

impl Covered {
    /// Returns the rows that output row `index` of `new` covers, of `old` input rows. Boundaries are in units of 1 /
    /// `new` input row, so that they are integers.
    #[inline(always)]
    fn by(index: usize, old: usize, new: usize) -> Self {
        let begin = index * old;
        Self { at: begin / new, old, new, begin, end: begin + old }
    }
}

impl Iterator for Covered {
    type Item = (usize, f32);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let (low, high) = (self.begin.max(self.at * self.new), self.end.min((self.at + 1) * self.new));
        let item = (low < high).then(|| (self.at, (high - low) as f32 / self.old as f32));
        self.at += 1;
        item
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn scaled(data: &[u8], width: usize, height: usize, new: [usize; 2]) -> Vec<u8> {
        let mut out = GrayImage::new(new[0], new[1]);
        AreaAverage::default().scale(ImageView::new(data, width, height, width).unwrap(), &mut out);
        out.pixels().to_vec()
    }

    #[test]
    fn whole_and_broken_shares() {
        assert_eq!(scaled(&[10, 20, 30, 40], 2, 2, [1, 1]), [25]);
        assert_eq!(scaled(&[0, 30, 60], 3, 1, [2, 1]), [10, 50]);
        assert_eq!(scaled(&[0, 90], 2, 1, [3, 1]), [0, 45, 90]);
        assert_eq!(scaled(&[7, 9], 2, 1, [2, 2]), [7, 9, 7, 9]);
        assert!(scaled(&[7, 9], 2, 1, [0, 3]).is_empty());
    }

    #[test]
    fn one_tone_stays_and_the_mean_is_kept() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(2);
        for (width, height) in [(640, 480), (341, 179), (1001, 703)] {
            assert!(scaled(&vec![255; width * height], width, height, [340, 180]).iter().all(|&p| p == 255));
            let data: Vec<u8> = (0..width * height).map(|_| random.random()).collect();
            let mean = |pixels: &[u8]| {
                pixels.iter().map(|&pixel| f64::from(pixel)).sum::<f64>() / pixels.len() as f64
            };
            let difference = mean(&data) - mean(&scaled(&data, width, height, [340, 180]));
            assert!(difference.abs() < 0.02, "{width} x {height}: {difference}");
        }
    }
}
