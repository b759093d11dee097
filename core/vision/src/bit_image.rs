//! Binary images (masks) with one bit per pixel, processed 64 pixels at a time.

use nalgebra::Vector2;

use super::vectorize::{self, Kernel};
use yamabico_geometry::image::ImageView;

/// Maximum coordinate of a shape that is drawn, pixels.
const FARTHEST_PX: f64 = 1e5;

/// Mask of `width` x `height` pixels. Reuse allocates only to grow.
///
/// Rows are 64-bit words, leftmost pixel in the lowest bit. An empty word before the first row and after every row lets
/// whole images be shifted sideways without bits crossing into the adjacent row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BitImage {
    width: usize,
    height: usize,
    words: Vec<u64>,
}

impl BitImage {
    /// Creates an empty mask.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        let mut image = Self::default();
        image.clear(width, height);
        image
    }

    /// Resizes and clears the mask.
    pub fn clear(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.words.clear();
        self.words.resize(1 + self.stride() * height, 0);
    }

    /// Width, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns true if the pixel in column `u` and row `v` is set; false outside the image.
    #[must_use]
    pub fn get(&self, u: usize, v: usize) -> bool {
        u < self.width && v < self.height && self.words[self.word_index(u, v)] >> (u % 64) & 1 == 1
    }

    /// Sets the pixel in column `u` and row `v`; ignores pixels outside the image.
    pub fn set(&mut self, u: usize, v: usize) {
        if u < self.width && v < self.height {
            let index = self.word_index(u, v);
            self.words[index] |= 1 << (u % 64);
        }
    }

    /// Draws a line between two pixels: one pixel per row if it is steep, else one per column, clipped to the image.
    /// Ignores a line with a non-finite endpoint, or one more than 1e5 px away.
    pub fn draw_line(&mut self, from: Vector2<f64>, to: Vector2<f64>) {
        if !from.iter().chain(to.iter()).all(|x| x.abs() < FARTHEST_PX) {
            return;
        }
        let along = to - from;
        let is_steep = along.y.abs() >= along.x.abs();
        let (main, step) = if is_steep { (1, along.y) } else { (0, along.x) };
        let (first, last) = (from[main].min(to[main]).round(), from[main].max(to[main]).round());
        let size = if is_steep { self.height } else { self.width };
        let (first, last) = (first.max(0.0) as usize, last.min(size as f64 - 1.0));
        if last < 0.0 || size == 0 {
            return;
        }
        let slope = if step == 0.0 { 0.0 } else { along[1 - main] / step };
        let (low, high) = (from[1 - main].min(to[1 - main]), from[1 - main].max(to[1 - main]));
        for i in first..=last as usize {
            let across = (from[1 - main] + slope * (i as f64 - from[main])).max(low).min(high);
            // Rounds without a library call.
            if across > -0.5 {
                let nearest = (across + 0.5) as usize;
                let (u, v) = if is_steep { (nearest, i) } else { (i, nearest) };
                self.set(u, v);
            }
        }
    }

    /// Fills a convex quadrilateral, with corners in order, including pixels within half a row of it. Ignores one with
    /// a non-finite corner, or one more than 1e5 px away.
    pub fn fill_quad(&mut self, corners: [Vector2<f64>; 4]) {
        if !corners.iter().flatten().all(|x| x.abs() < FARTHEST_PX) {
            return;
        }
        let [top, bottom] =
            [f64::min, f64::max].map(|pick| corners.map(|c| c.y).into_iter().fold(corners[0].y, pick));
        let last = bottom.round().min(self.height as f64 - 1.0);
        if last < 0.0 {
            return;
        }
        for v in top.round().max(0.0) as usize..=last as usize {
            let (low, high) = (v as f64 - 0.5, v as f64 + 0.5);
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..4 {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                let run = b - a;
                if a.y.max(b.y) < low || a.y.min(b.y) > high {
                    continue;
                }
                let share = |y: f64| if run.y == 0.0 { y - low } else { ((y - a.y) / run.y).clamp(0.0, 1.0) };
                for u in [low, high].map(|y| a.x + run.x * share(y)) {
                    (left, right) = (left.min(u), right.max(u));
                }
            }
            self.span(v, left, right);
        }
    }

    /// Sets the pixels of row `v` from column `left` to column `right`, both rounded.
    fn span(&mut self, v: usize, left: f64, right: f64) {
        if !(right >= -0.5 && left < self.width as f64 - 0.5 && left <= right) {
            return;
        }
        let first = (left.max(0.0) + 0.5) as usize;
        let last = ((right + 0.5) as usize).min(self.width - 1);
        let row = self.row_mut(v);
        for (i, word) in row.iter_mut().enumerate().take(last / 64 + 1).skip(first / 64) {
            let from = u64::MAX << (first.max(64 * i) - 64 * i);
            let to = u64::MAX >> (63 - (last.min(64 * i + 63) - 64 * i));
            *word |= from & to;
        }
    }

    /// Sets exactly the pixels of `image` of at least `min_level`, and resizes the mask to its size.
    pub fn threshold(&mut self, image: ImageView, min_level: u8) {
        self.clear(image.width(), image.height());
        vectorize::run(Threshold { image, min_level, out: self });
    }

    /// Clears the pixels that are set in `other`; no effect if the sizes differ.
    pub fn subtract(&mut self, other: &BitImage) {
        if (self.width, self.height) == (other.width, other.height) {
            for (word, other) in self.words.iter_mut().zip(&other.words) {
                *word &= !other;
            }
        }
    }

    /// Copies size and pixels of another mask.
    pub fn copy_from(&mut self, other: &BitImage) {
        (self.width, self.height) = (other.width, other.height);
        self.words.clone_from(&other.words);
    }

    /// Clears the pixels that are not set in `other`; no effect if the sizes differ.
    pub fn intersect(&mut self, other: &BitImage) {
        if (self.width, self.height) == (other.width, other.height) {
            for (word, other) in self.words.iter_mut().zip(&other.words) {
                *word &= other;
            }
        }
    }

    /// Clears the rows above row `v`.
    pub fn clear_above(&mut self, v: usize) {
        let end = (1 + v.min(self.height) * self.stride()).min(self.words.len());
        self.words[..end].fill(0);
    }

    /// Number of set pixels.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.words.iter().map(|word| word.count_ones()).sum()
    }

    /// Writes to `out` the pixels that are part of a nearly vertical line: of five consecutive rows, each with a pixel
    /// in the same or an adjacent column. Removes shorter lines and lines inclined by more than 30 degrees.
    pub fn vertical_lines(&self, spare: &mut BitImage, out: &mut BitImage) {
        spare.clear(self.width, self.height);
        out.clear(self.width, self.height);
        vectorize::run(Upright { image: self, spare, out });
    }

    /// Words of row `v`.
    #[inline]
    #[must_use]
    pub fn row(&self, v: usize) -> &[u64] {
        let start = 1 + v * self.stride();
        &self.words[start..start + self.stride() - 1]
    }

    /// Column and row of each set pixel, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.height).flat_map(move |v| {
            (0..self.width).filter(move |&u| self.row(v)[u / 64] >> (u % 64) & 1 == 1).map(move |u| (u, v))
        })
    }

    /// Number of words from one row to the next: those of a row and the empty one after it.
    #[inline]
    #[must_use]
    pub fn stride(&self) -> usize {
        self.width.div_ceil(64) + 1
    }

    /// All words: an empty word, then the rows, each followed by an empty word.
    #[inline]
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Like [`BitImage::words`], but mutable. The padding words must stay empty.
    #[inline]
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Like [`BitImage::row`], but mutable. Bits beyond the width must stay unset.
    #[inline]
    pub fn row_mut(&mut self, v: usize) -> &mut [u64] {
        let stride = self.stride();
        let start = 1 + v * stride;
        &mut self.words[start..start + stride - 1]
    }

    /// Index in [`BitImage::words`] of the word of a pixel.
    #[inline]
    #[must_use]
    pub fn word_index(&self, u: usize, v: usize) -> usize {
        1 + v * self.stride() + u / 64
    }
}

struct Upright<'a> {
    image: &'a BitImage,
    spare: &'a mut BitImage,
    out: &'a mut BitImage,
}

impl Kernel for Upright<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let stride = self.image.stride();
        let words = &self.image.words[..];
        let len = words.len();
        if self.image.height < 5 {
            return;
        }
        // Dilate by one column; then keep the first row of runs of five; then restore the whole runs.
        let (before, here, after) = (&words[..len - 2], &words[1..len - 1], &words[2..]);
        let wide = &mut self.spare.words[1..len - 1];
        for i in 0..wide.len() {
            wide[i] = here[i] | here[i] << 1 | here[i] >> 1 | before[i] >> 63 | after[i] << 63;
        }
        let wide = &self.spare.words[..];
        let rows = len - 4 * stride;
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|row| &wide[row * stride..][..rows]);
        let run = &mut self.out.words[..rows];
        for i in 0..rows {
            run[i] = a[i] & b[i] & c[i] & d[i] & e[i];
        }
        // Runs include the adjacent pixels on either side.
        let run = &self.out.words[..];
        let wide = &mut self.spare.words[1..len - 1];
        for i in 0..wide.len() {
            wide[i] = run[i + 1] | run[i + 1] << 1 | run[i + 1] >> 1 | run[i] >> 63 | run[i + 2] << 63;
        }
        let wide = &self.spare.words[..];
        let out = &mut self.out.words[..];
        out.copy_from_slice(wide);
        for row in 1..5 {
            let shifted = &mut out[row * stride..];
            for i in 0..shifted.len() {
                shifted[i] |= wide[i];
            }
        }
        for (out, &image) in out.iter_mut().zip(words) {
            *out &= image;
        }
    }
}

struct Threshold<'a> {
    image: ImageView<'a>,
    min_level: u8,
    out: &'a mut BitImage,
}

impl Kernel for Threshold<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut flags = [0; 64];
        for v in 0..self.image.height() {
            let row = self.image.row(v);
            for (word, levels) in self.out.row_mut(v).iter_mut().zip(row.chunks(64)) {
                flags[levels.len()..].fill(0);
                for (flag, &level) in flags.iter_mut().zip(levels) {
                    *flag = u8::from(level >= self.min_level);
                }
                *word = pack(&flags);
            }
        }
    }
}

/// Packs 64 flags, each 0 or 1, into a word, the first flag in the lowest bit.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn pack(flags: &[u8; 64]) -> u64 {
    use std::arch::x86_64::{_mm_loadu_si128, _mm_movemask_epi8, _mm_slli_epi16};
    let mut word = 0;
    for (i, sixteen) in flags.as_chunks::<16>().0.iter().enumerate() {
        #[allow(
            unsafe_code,
            reason = "SSE2 is part of x86-64, and 16 bytes are read of 16; twice as fast as products"
        )]
        let bits =
            unsafe { _mm_movemask_epi8(_mm_slli_epi16::<7>(_mm_loadu_si128(sixteen.as_ptr().cast()))) };
        word |= u64::from(bits as u16) << (16 * i);
    }
    word
}

#[cfg(not(target_arch = "x86_64"))]
pub use pack_by_products as pack;

/// Like `pack`, but portable.
#[cfg(any(test, not(target_arch = "x86_64")))]
#[inline(always)]
pub fn pack_by_products(flags: &[u8; 64]) -> u64 {
    // The product moves the lowest bit of byte i to bit 56 + i without collisions.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut word = 0;
    for (i, &eight) in flags.as_chunks::<8>().0.iter().enumerate() {
        word |= (u64::from_le_bytes(eight).wrapping_mul(GATHER) >> 56) << (8 * i);
    }
    word
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_become_bits_in_their_order() {
        for i in 0..64 {
            let mut flags = [0; 64];
            flags[i] = 1;
            assert_eq!(pack(&flags), 1 << i);
        }
        assert_eq!(pack(&[1; 64]), u64::MAX);
        let flags = std::array::from_fn(|i| (0x9e37_79b9_7f4a_7c15_u64 >> i & 1) as u8);
        assert_eq!((pack(&flags), pack_by_products(&flags)), (0x9e37_79b9_7f4a_7c15, 0x9e37_79b9_7f4a_7c15));
    }

    #[test]
    fn a_threshold_keeps_what_reaches_it() {
        let data: Vec<u8> = (0..3 * 70).map(|i| (i % 70) as u8).collect();
        let mut mask = BitImage::default();
        mask.threshold(ImageView::new(&data, 70, 3, 70).unwrap(), 66);
        assert_eq!(mask.count(), 3 * 4);
        assert!(mask.get(66, 1) && !mask.get(65, 1) && !mask.get(70, 1) && !mask.get(0, 3));
        assert_eq!(mask.pixels().next(), Some((66, 0)));
    }

    #[test]
    fn only_upright_lines_of_five_rows_are_kept() {
        let (mut mask, mut spare, mut out) =
            (BitImage::new(200, 40), BitImage::default(), BitImage::default());
        mask.draw_line(Vector2::new(63.0, 5.0), Vector2::new(65.0, 25.0));
        mask.draw_line(Vector2::new(150.0, 10.0), Vector2::new(150.0, 13.0));
        mask.draw_line(Vector2::new(80.0, 0.0), Vector2::new(119.0, 39.0));
        mask.draw_line(Vector2::new(0.0, 39.0), Vector2::new(199.0, 39.0));
        mask.vertical_lines(&mut spare, &mut out);
        let rows: Vec<usize> = out.pixels().map(|(_, v)| v).collect();
        assert_eq!((rows.first(), rows.last(), rows.len()), (Some(&5), Some(&25), 21));
        assert!(out.pixels().all(|(u, _)| (63..=65).contains(&u)));
    }

    #[test]
    fn a_quad_covers_the_lines_across_it_and_little_more() {
        let (a, b) = (Vector2::new(-20.0, 10.0), Vector2::new(180.0, 44.0));
        for (near, far) in [
            (Vector2::new(0.0, 3.0), Vector2::new(0.0, 9.0)),
            (Vector2::new(5.0, 0.0), Vector2::new(5.0, 0.0)),
        ] {
            let (mut lines, mut quad) = (BitImage::new(150, 50), BitImage::new(150, 50));
            for i in -90..=90 {
                let share = f64::from(i) / 90.0;
                lines.draw_line(a + near * share, b + far * share);
            }
            quad.fill_quad([a - near, a + near, b + far, b - far]);
            let covered = lines.count();
            assert!(covered > 100 && quad.count() < covered + covered / 3, "{covered} {}", quad.count());
            lines.subtract(&quad);
            assert_eq!(lines.count(), 0);
        }
        let mut column = BitImage::new(130, 20);
        column.fill_quad([[62.0, 5.0], [66.0, 5.0], [66.0, 8.0], [62.0, 8.0]].map(Vector2::from));
        assert_eq!((column.count(), column.get(62, 5), column.get(66, 8)), (20, true, true));
        column.fill_quad([[f64::NAN, 5.0], [66.0, 5.0], [66.0, 8.0], [62.0, 8.0]].map(Vector2::from));
        column.fill_quad([[-9.0, 5.0], [-2.0, 5.0], [-2.0, 8.0], [-9.0, 8.0]].map(Vector2::from));
        column.fill_quad([[131.0, -5.0], [140.0, -5.0], [140.0, 40.0], [131.0, 40.0]].map(Vector2::from));
        assert_eq!(column.count(), 20);
    }

    #[test]
    fn a_steep_line_has_a_pixel_in_each_of_its_rows() {
        let mut mask = BitImage::new(100, 50);
        mask.draw_line(Vector2::new(70.0, 40.0), Vector2::new(66.0, 10.0));
        assert_eq!(mask.count(), 31);
        assert!(mask.get(70, 40) && mask.get(66, 10) && mask.get(68, 25));
        mask.clear(100, 50);
        mask.draw_line(Vector2::new(-20.0, 3.0), Vector2::new(200.0, 3.0));
        assert_eq!(mask.count(), 100);
        mask.draw_line(Vector2::new(f64::NAN, 3.0), Vector2::new(2.0, 30.0));
        mask.draw_line(Vector2::new(5.0, -30.0), Vector2::new(5.0, -1.0));
        assert_eq!(mask.count(), 100);
    }
}
