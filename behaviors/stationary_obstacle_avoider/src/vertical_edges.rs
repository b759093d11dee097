//! Vertical edges of an image, and their difference from the edges that a map predicts.
//!
//! Ohya, Kosaka & Kak (1998): difference image of observed and expected edges, counted in vertical regions. Differs
//! from \[1\]: edges are thinned along the row, and matching has a tolerance of a few columns.

use crate::regions::Regions;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_vision::bit_image::{BitImage, pack};
use yamabico_vision::vectorize::{self, Kernel};

/// Vertical edge operator with its row buffers: a quarter of the absolute horizontal Sobel derivative (an ideal step of
/// g gray levels gives g), rounded down, with non-maximum suppression along the row (of equal neighbors the left one is
/// kept). The border is replicated.
#[derive(Clone, Debug, Default)]
pub struct VerticalEdges {
    /// Column sums (1 2 1), with a replicated column on either side.
    sums: Vec<i16>,
    /// Magnitudes, with an empty column on either side, padded to a whole word.
    magnitude: Vec<u8>,
}

impl VerticalEdges {
    /// Writes the thinned magnitudes to `out`, gray levels, 0 if there is no edge, and resizes it to the size of
    /// `image`.
    pub fn thinned(&mut self, image: ImageView, out: &mut GrayImage) {
        out.resize(image.width(), image.height());
        self.prepare(image.width());
        vectorize::run(Thinned { image, rows: self, out: out.pixels_mut() });
    }

    /// Sets the pixels of `out` with a thinned magnitude of at least `min_gradient` > 0, and resizes it to the size of
    /// `image`.
    pub fn edges(&mut self, image: ImageView, min_gradient: u8, out: &mut BitImage) {
        out.clear(image.width(), image.height());
        self.prepare(image.width());
        vectorize::run(Edges { image, rows: self, min_gradient: min_gradient.max(1), out });
    }

    fn prepare(&mut self, width: usize) {
        self.sums.resize(width + 2, 0);
        self.magnitude.clear();
        self.magnitude.resize(width.next_multiple_of(64) + 2, 0);
    }

    /// Computes the magnitudes of row `v`; the magnitude of column u is at index u + 1.
    #[inline(always)]
    fn row(&mut self, image: ImageView, v: usize) {
        let width = image.width();
        let (above, here, below) =
            (&image.row(v.saturating_sub(1))[..width], &image.row(v)[..width], &image.row(v + 1)[..width]);
        let inner = &mut self.sums[1..=width];
        for u in 0..width {
            inner[u] = i16::from(above[u]) + 2 * i16::from(here[u]) + i16::from(below[u]);
        }
        self.sums[0] = self.sums[1];
        self.sums[width + 1] = self.sums[width];
        let (left, right) = (&self.sums[..width], &self.sums[2..width + 2]);
        let out = &mut self.magnitude[1..=width];
        for u in 0..width {
            out[u] = ((right[u] - left[u]).unsigned_abs() >> 2) as u8;
        }
    }
}

struct Thinned<'a> {
    image: ImageView<'a>,
    rows: &'a mut VerticalEdges,
    out: &'a mut [u8],
}

impl Kernel for Thinned<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let width = self.image.width();
        for (v, out) in self.out.chunks_exact_mut(width).enumerate() {
            self.rows.row(self.image, v);
            let row = &self.rows.magnitude;
            let (left, here, right) = (&row[..width], &row[1..=width], &row[2..width + 2]);
            for u in 0..width {
                let is_largest = (here[u] > left[u]) & (here[u] >= right[u]);
                out[u] = if is_largest { here[u] } else { 0 };
            }
        }
    }
}

struct Edges<'a> {
    image: ImageView<'a>,
    rows: &'a mut VerticalEdges,
    min_gradient: u8,
    out: &'a mut BitImage,
}

impl Kernel for Edges<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut flags = [0_u8; 64];
        for v in 0..self.image.height() {
            self.rows.row(self.image, v);
            let row = &self.rows.magnitude;
            let last = row.len() - 2;
            let (left, here, right) = (row[..last].as_chunks::<64>().0, &row[1..=last], &row[2..]);
            let (here, right) = (here.as_chunks::<64>().0, right.as_chunks::<64>().0);
            let words = self.out.row_mut(v).iter_mut();
            for (((word, left), here), right) in words.zip(left).zip(here).zip(right) {
                for i in 0..64 {
                    flags[i] = u8::from(here[i] > left[i])
                        & u8::from(here[i] >= right[i])
                        & u8::from(here[i] >= self.min_gradient);
                }
                *word = pack(&flags);
            }
        }
    }
}

/// Difference of observed and expected edges, with its buffers.
#[derive(Clone, Debug, Default)]
pub struct EdgeDifference {
    /// Number of pixels in each region of the symmetric difference: observed but not expected, or expected but not
    /// observed.
    pub differing: Vec<u32>,
    /// Number of pixels in each region that are observed but not expected.
    pub extra: Vec<u32>,
    /// Number of expected pixels.
    pub expected: u32,
    /// Number of expected pixels that are observed.
    pub found: u32,
    surplus: Vec<u64>,
    missing: Vec<u64>,
}

impl EdgeDifference {
    /// Share of the expected pixels that is observed, 0 to 1; `None` if nothing is expected.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        (self.expected > 0).then(|| f64::from(self.found) / f64::from(self.expected))
    }

    /// Maximum of `differing` over all regions.
    #[must_use]
    pub fn max_count(&self) -> u32 {
        self.differing.iter().copied().max().unwrap_or(0)
    }

    /// Compares two masks of equal size. A pixel matches if the other mask has a pixel in the same row at most
    /// `tolerance_px` (up to 63) columns away. All counts are zero if the sizes differ.
    pub fn compare(&mut self, seen: &BitImage, expected: &BitImage, tolerance_px: usize, regions: &Regions) {
        for counts in [&mut self.differing, &mut self.extra] {
            counts.clear();
            counts.resize(regions.count(), 0);
        }
        (self.expected, self.found) = (0, 0);
        if (seen.width(), seen.height(), seen.width())
            != (expected.width(), expected.height(), regions.width())
        {
            return;
        }
        self.surplus.resize(seen.words().len(), 0);
        self.missing.resize(seen.words().len(), 0);
        let radius = tolerance_px.min(63) as u32;
        let (surplus, missing) = (&mut self.surplus[..], &mut self.missing[..]);
        vectorize::run(Compare { seen, expected, radius, surplus, missing });
        (self.expected, self.found) = vectorize::run(Count {
            expected,
            surplus: &self.surplus,
            missing: &self.missing,
            regions,
            differing: &mut self.differing,
            extra: &mut self.extra,
        });
    }

    /// Removes the pixels of `explained` from the observed but unexpected pixels and from both counts. The masks must
    /// have the size of those compared last, and `seen` must be the same mask.
    pub fn explain(&mut self, seen: &BitImage, explained: &BitImage, regions: &Regions) {
        if self.surplus.len() != explained.words().len() || seen.words().len() != explained.words().len() {
            return;
        }
        let stride = seen.stride();
        for (at, (surplus, &known)) in self.surplus.iter_mut().zip(explained.words()).enumerate() {
            let gone = *surplus & known;
            if gone != 0 {
                *surplus &= !known;
                regions.split(gone, (at - 1) % stride, |region, count| {
                    self.extra[region] -= count.min(self.extra[region]);
                    self.differing[region] -= count.min(self.differing[region]);
                });
            }
        }
    }

    /// Returns true if a pixel of `seen`, the mask compared last, is not expected.
    #[must_use]
    pub fn is_extra(&self, seen: &BitImage, u: usize, v: usize) -> bool {
        let at = 1 + v * seen.stride() + u / 64;
        u < seen.width() && self.surplus.get(at).is_some_and(|word| word >> (u % 64) & 1 == 1)
    }
}

struct Count<'a> {
    expected: &'a BitImage,
    surplus: &'a [u64],
    missing: &'a [u64],
    regions: &'a Regions,
    differing: &'a mut [u32],
    extra: &'a mut [u32],
}

impl Kernel for Count<'_> {
    /// Number of expected pixels, and number of those that are observed.
    type Output = (u32, u32);

    #[inline(always)]
    fn run(self) -> (u32, u32) {
        let (stride, mut all, mut lost) = (self.expected.stride(), 0, 0);
        for v in 0..self.expected.height() {
            let row = 1 + v * stride..v * stride + stride;
            let (surplus, missing) = (&self.surplus[row.clone()], &self.missing[row]);
            for (model, missing) in self.expected.row(v).iter().zip(missing) {
                all += model.count_ones();
                lost += missing.count_ones();
            }
            for piece in self.regions.pieces() {
                let extra = (surplus[piece.word] & piece.mask).count_ones();
                self.extra[piece.region] += extra;
                self.differing[piece.region] += extra + (missing[piece.word] & piece.mask).count_ones();
            }
        }
        (all, all - lost)
    }
}

struct Compare<'a> {
    seen: &'a BitImage,
    expected: &'a BitImage,
    radius: u32,
    surplus: &'a mut [u64],
    missing: &'a mut [u64],
}

impl Kernel for Compare<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (seen, expected) = (self.seen.words(), self.expected.words());
        let len = seen.len();
        if len < 3 {
            return;
        }
        let inner = 1..len - 1;
        let near = |words: &[u64], out: &mut [u64]| {
            let (before, here, after) = (&words[..len - 2], &words[1..len - 1], &words[2..]);
            let out = &mut out[inner.clone()];
            out.copy_from_slice(here);
            for shift in 1..=self.radius {
                for i in 0..out.len() {
                    out[i] |= here[i] << shift | before[i] >> (64 - shift);
                    out[i] |= here[i] >> shift | after[i] << (64 - shift);
                }
            }
        };
        near(expected, self.surplus);
        near(seen, self.missing);
        for i in inner {
            self.surplus[i] = seen[i] & !self.surplus[i];
            self.missing[i] = expected[i] & !self.missing[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn magnitude(image: ImageView, u: isize, v: isize) -> u16 {
        if u < 0 || u >= image.width() as isize {
            return 0;
        }
        let at =
            |du: isize, dv: isize| i16::from(image.pixel((u + du).max(0) as usize, (v + dv).max(0) as usize));
        let sum = |du| at(du, -1) + 2 * at(du, 0) + at(du, 1);
        (sum(1) - sum(-1)).unsigned_abs() / 4
    }

    #[test]
    fn equals_the_definition_on_every_size() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(8);
        let mut operator = VerticalEdges::default();
        let (mut thinned, mut bits) = (GrayImage::default(), BitImage::default());
        for (width, height) in [(1, 1), (2, 3), (63, 2), (64, 4), (65, 3), (200, 5)] {
            let data: Vec<u8> = (0..width * height)
                .map(|_| if random.random::<bool>() { 255 } else { random.random::<u8>() & 3 })
                .collect();
            let image = ImageView::new(&data, width, height, width).unwrap();
            operator.thinned(image, &mut thinned);
            operator.edges(image, 30, &mut bits);
            for v in 0..height {
                for u in 0..width {
                    let [left, here, right] =
                        [-1, 0, 1].map(|du| magnitude(image, u as isize + du, v as isize));
                    let expected = if here > left && here >= right { here } else { 0 };
                    assert_eq!(
                        u16::from(thinned.pixels()[v * width + u]),
                        expected,
                        "{width}x{height} {u} {v}"
                    );
                    assert_eq!(bits.get(u, v), expected >= 30, "{width}x{height} {u} {v}");
                }
            }
        }
    }

    #[test]
    fn a_step_gives_its_height_once_a_row() {
        let data: Vec<u8> = (0..4 * 20).map(|i| if i % 20 < 10 { 40 } else { 65 }).collect();
        let mut out = GrayImage::default();
        VerticalEdges::default().thinned(ImageView::new(&data, 20, 4, 20).unwrap(), &mut out);
        for row in out.pixels().chunks(20) {
            assert_eq!((row[9], row.iter().filter(|&&m| m > 0).count()), (25, 1));
        }
    }

    #[test]
    fn counts_equal_the_definition_pixel_by_pixel() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(9);
        let mut difference = EdgeDifference::default();
        for (width, height, tolerance, count) in
            [(40, 6, 0, 5), (130, 4, 2, 5), (64, 3, 63, 3), (200, 7, 3, 7)]
        {
            let mut mask = || {
                let mut mask = BitImage::new(width, height);
                for _ in 0..width * height / 12 {
                    mask.set(random.random_range(0..width), random.random_range(0..height));
                }
                mask
            };
            let (seen, expected, regions) = (mask(), mask(), Regions::new(width, count));
            difference.compare(&seen, &expected, tolerance, &regions);
            let is_near = |mask: &BitImage, u: usize, v: usize| {
                (u.saturating_sub(tolerance)..=u + tolerance).any(|u| mask.get(u, v))
            };
            let (mut both, mut extra, mut found) = (vec![0; count], vec![0; count], 0);
            for v in 0..height {
                for u in 0..width {
                    let surplus = seen.get(u, v) && !is_near(&expected, u, v);
                    let missing = expected.get(u, v) && !is_near(&seen, u, v);
                    both[count * u / width] += u32::from(surplus || missing);
                    extra[count * u / width] += u32::from(surplus);
                    found += u32::from(expected.get(u, v) && !missing);
                }
            }
            assert_eq!((&difference.differing, &difference.extra), (&both, &extra), "{width} x {height}");
            assert_eq!((difference.expected, difference.found), (expected.count(), found));
        }
    }
}
