//! Vertical image regions, and the number of set mask pixels in each.

use yamabico_vision::bit_image::BitImage;
use yamabico_vision::vectorize::{self, Kernel};

/// Vertical regions of equal width, counted from the left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Regions {
    width: usize,
    count: usize,
    /// First column of each region, and the image width at the end.
    first: Vec<usize>,
    /// Intersections of mask words and regions, ordered by word.
    pieces: Vec<Piece>,
}

/// Columns that a mask word and a region have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub word: usize,
    pub region: usize,
    pub mask: u64,
}

impl Regions {
    /// Divides an image of `width` columns into `count` regions, at least one: column u is in region floor(count u /
    /// width).
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

    /// Width of the image, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Intersections of the words of a mask row with the regions, ordered by word.
    #[inline(always)]
    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Number of regions.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Columns of a region; empty for an index out of range.
    #[must_use]
    pub fn columns(&self, region: usize) -> std::ops::Range<usize> {
        match (self.first.get(region), self.first.get(region + 1)) {
            (Some(&first), Some(&end)) => first..end,
            _ => self.width..self.width,
        }
    }

    /// Region of a column; the last one for a column out of range.
    #[must_use]
    pub fn of_column(&self, u: usize) -> usize {
        (self.count * u / self.width.max(1)).min(self.count - 1)
    }

    /// Writes to `counts` the number of set pixels of the mask in each region; zeros if the mask's width differs.
    pub fn count_columns(&self, mask: &BitImage, counts: &mut Vec<u32>) {
        counts.clear();
        counts.resize(self.count, 0);
        if mask.width() != self.width {
            return;
        }
        vectorize::run(CountColumns { mask, regions: self, counts });
    }

    /// Calls `take(region, count)` for each region that overlaps the word with index `word` of a row; `count` is the
    /// number of set `bits` in it.
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
