//! The vertical regions of a picture, and how many bits of a mask lie in each.

use super::bit_image::BitImage;
use super::vectorize::{self, Kernel};

/// The vertical regions of a picture: equal in columns, counted from the left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Regions {
    width: usize,
    count: usize,
    /// The columns of each region: its first one.
    first: Vec<usize>,
    /// What each word of a row shares with each region, word by word.
    pieces: Vec<Piece>,
}

/// Columns that a word of a row and a region share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub word: usize,
    pub region: usize,
    pub mask: u64,
}

impl Regions {
    /// `count` regions of a picture of `width` columns: column u is in region floor(count u / width). At least one.
    #[must_use]
    pub fn new(width: usize, count: usize) -> Self {
        let count = count.max(1);
        let first: Vec<usize> = (0..=count).map(|region| (region * width).div_ceil(count)).collect();
        let shared = |word: usize, region: usize| {
            let [start, end] = [first[region], first[region + 1]].map(|u| u.clamp(64 * word, 64 * word + 64));
            let below = |u: usize| if u == 64 { u64::MAX } else { (1 << u) - 1 };
            let mask = below(end - 64 * word) & !below(start - 64 * word);
            (mask != 0).then_some(Piece { word, region, mask })
        };
        let words = 0..width.div_ceil(64);
        let mut pieces = Vec::new();
        for word in words {
            pieces.extend((0..count).filter_map(|region| shared(word, region)));
        }
        Self { width, count, first, pieces }
    }

    /// Columns of the picture.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// What each word of a row of bits shares with each region, word by word.
    #[inline(always)]
    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// How many.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The columns of a region; none beyond the last.
    #[must_use]
    pub fn columns(&self, region: usize) -> std::ops::Range<usize> {
        match (self.first.get(region), self.first.get(region + 1)) {
            (Some(&first), Some(&end)) => first..end,
            _ => self.width..self.width,
        }
    }

    /// The region of a column; the last one beyond.
    #[must_use]
    pub fn of_column(&self, u: usize) -> usize {
        (self.count * u / self.width.max(1)).min(self.count - 1)
    }

    /// Writes to `counts` how many pixels of a mask, whose width must be that of the regions, are set in each.
    pub fn count_columns(&self, mask: &BitImage, counts: &mut Vec<u32>) {
        counts.clear();
        counts.resize(self.count, 0);
        if mask.width() != self.width {
            return;
        }
        vectorize::run(CountColumns { mask, regions: self, counts });
    }

    /// Calls `take` for each region that the bits of the word at place `word` of a row lie in, with their number.
    #[inline(always)]
    pub(crate) fn split(&self, bits: u64, word: usize, mut take: impl FnMut(usize, u32)) {
        for piece in self.pieces.iter().filter(|piece| piece.word == word) {
            take(piece.region, (bits & piece.mask).count_ones());
        }
    }
}

struct CountColumns<'a> {
    mask: &'a BitImage,
    regions: &'a Regions,
    counts: &'a mut [u32],
}

impl Kernel for CountColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for v in 0..self.mask.height() {
            let row = self.mask.row(v);
            for piece in &self.regions.pieces {
                self.counts[piece.region] += (row[piece.word] & piece.mask).count_ones();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_share_the_columns() {
        let regions = Regions::new(256, 5);
        let widths: Vec<usize> = (0..5).map(|region| regions.columns(region).len()).collect();
        assert_eq!(widths, [52, 51, 51, 51, 51]);
        assert!((0..256).all(|u| regions.columns(regions.of_column(u)).contains(&u)));
        assert!(regions.columns(5).is_empty());
    }

    #[test]
    fn pieces_cover_every_column_once() {
        for (width, count) in [(256, 5), (130, 5), (63, 3), (64, 1), (200, 7), (20, 31)] {
            let regions = Regions::new(width, count);
            let mut of = vec![Vec::new(); width];
            for piece in regions.pieces() {
                for bit in (0..64).filter(|bit| piece.mask >> bit & 1 == 1) {
                    of[64 * piece.word + bit].push(piece.region);
                }
            }
            for (u, of) in of.iter().enumerate() {
                assert_eq!(of, &[regions.of_column(u)], "{u} of {width} in {count}");
            }
        }
    }
}
