//! Morphological opening and closing of masks by squares, 64 pixels at a time.
//!
//! Outside the image a mask is empty for dilation and full for erosion, so that the border has no effect.

use super::bit_image::BitImage;
use super::vectorize::{self, Kernel};

/// Workspace for morphological operations. Allocates only for a mask larger than any before.
#[derive(Clone, Debug, Default)]
pub struct Morphology {
    spare: BitImage,
    /// Bits of a row that are pixels; none in the padding word after the row.
    inside: Vec<u64>,
}

impl Morphology {
    /// Closing: dilates `n` times by 3 x 3, then erodes `n` times. Fills gaps up to 2 n pixels wide.
    pub fn close(&mut self, mask: &mut BitImage, n: u32) {
        self.dilate(mask, n);
        self.erode(mask, n);
    }

    /// Opening: erodes `n` times by 3 x 3, then dilates `n` times. Removes structures up to 2 n pixels wide.
    pub fn open(&mut self, mask: &mut BitImage, n: u32) {
        self.erode(mask, n);
        self.dilate(mask, n);
    }

    /// Sets every pixel with a set neighbor, `n` times.
    pub fn dilate(&mut self, mask: &mut BitImage, n: u32) {
        self.prepare(mask);
        for _ in 0..n {
            vectorize::run(Dilate { mask, spare: &mut self.spare, inside: &self.inside });
        }
    }

    /// Clears every pixel with an unset neighbor, `n` times.
    pub fn erode(&mut self, mask: &mut BitImage, n: u32) {
        self.prepare(mask);
        if n > 0 {
            vectorize::run(Complement { mask, inside: &self.inside });
            for _ in 0..n {
                vectorize::run(Dilate { mask, spare: &mut self.spare, inside: &self.inside });
            }
            vectorize::run(Complement { mask, inside: &self.inside });
        }
    }

    fn prepare(&mut self, mask: &BitImage) {
        let (width, stride) = (mask.width(), mask.stride());
        if (self.spare.width(), self.spare.height()) != (width, mask.height()) {
            self.spare.clear(width, mask.height());
            self.inside.clear();
            self.inside.resize(mask.words().len().saturating_sub(1), 0);
            for row in self.inside.chunks_exact_mut(stride) {
                row[..width / 64].fill(u64::MAX);
                if !width.is_multiple_of(64) {
                    row[width / 64] = (1 << (width % 64)) - 1;
                }
            }
        }
    }
}

struct Dilate<'a> {
    mask: &'a mut BitImage,
    spare: &'a mut BitImage,
    inside: &'a [u64],
}

impl Kernel for Dilate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let stride = self.mask.stride();
        let len = self.inside.len();
        if len == 0 {
            return;
        }
        // Horizontal pass, then vertical pass. The last row is followed by its padding word.
        let words = self.mask.words();
        let (before, here, after) = (&words[..len - 1], &words[1..len], &words[2..=len]);
        let wide = &mut self.spare.words_mut()[1..len];
        let inside = &self.inside[..len - 1];
        for i in 0..wide.len() {
            wide[i] = (here[i] | here[i] << 1 | here[i] >> 1 | before[i] >> 63 | after[i] << 63) & inside[i];
        }
        let wide = &self.spare.words()[1..];
        let out = &mut self.mask.words_mut()[1..];
        out.copy_from_slice(wide);
        let rest = len - stride;
        let (below, above) = (&wide[stride..], &wide[..rest]);
        for (out, &below) in out[..rest].iter_mut().zip(below) {
            *out |= below;
        }
        for (out, &above) in out[stride..].iter_mut().zip(above) {
            *out |= above;
        }
    }
}

struct Complement<'a> {
    mask: &'a mut BitImage,
    inside: &'a [u64],
}

impl Kernel for Complement<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (word, &inside) in self.mask.words_mut().iter_mut().skip(1).zip(self.inside) {
            *word = !*word & inside;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Reference implementation, pixel by pixel.
    fn reference(mask: &BitImage, is_wanted: bool) -> BitImage {
        let mut out = BitImage::new(mask.width(), mask.height());
        for v in 0..mask.height() {
            for u in 0..mask.width() {
                let beside = (v.saturating_sub(1)..=(v + 1).min(mask.height() - 1))
                    .flat_map(|y| (u.saturating_sub(1)..=(u + 1).min(mask.width() - 1)).map(move |x| (x, y)));
                let has_any = beside.into_iter().any(|(x, y)| mask.get(x, y) == is_wanted);
                if has_any == is_wanted {
                    out.set(u, v);
                }
            }
        }
        out
    }

    #[test]
    fn fast_and_plain_agree_at_every_width() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(5);
        let mut morphology = Morphology::default();
        for (width, height) in [(1, 1), (1, 9), (63, 4), (64, 5), (65, 5), (128, 3), (200, 17), (256, 2)] {
            for share in [0.05, 0.5, 0.95] {
                let mut mask = BitImage::new(width, height);
                for i in 0..width * height {
                    if random.random_bool(share) {
                        mask.set(i % width, i / width);
                    }
                }
                let (mut grown, mut shrunk) = (mask.clone(), mask.clone());
                morphology.dilate(&mut grown, 2);
                assert_eq!(grown, reference(&reference(&mask, true), true), "{width} x {height}");
                morphology.erode(&mut shrunk, 2);
                assert_eq!(shrunk, reference(&reference(&mask, false), false), "{width} x {height}");
            }
        }
    }

    #[test]
    fn closing_fills_lines_and_opening_removes_specks() {
        let mut morphology = Morphology::default();
        let mut mask = BitImage::new(90, 20);
        (0..20).for_each(|v| (0..90).filter(|u| !(40..44).contains(u)).for_each(|u| mask.set(u, v)));
        let mut narrow = mask.clone();
        morphology.close(&mut narrow, 1);
        assert_eq!(narrow, mask, "four pixels are too wide for one round");
        morphology.close(&mut mask, 2);
        assert_eq!(mask.count(), 90 * 20);
        let mut speck = BitImage::new(90, 20);
        speck.set(64, 7);
        morphology.open(&mut speck, 1);
        assert_eq!(speck.count(), 0);
        morphology.close(&mut BitImage::default(), 2);
    }
}
