//! Number of dark pixels in each cell of a regular grid.

use yamabico_core::image::ImageView;
use yamabico_vision::vectorize::{self, Kernel};

/// Counts dark pixels in square cells. Reuses its buffer between images.
#[derive(Clone, Debug, Default)]
pub struct DarkCells {
    /// Number of dark pixels in each pixel column, over the rows since the last summation.
    columns: Vec<u8>,
}

impl DarkCells {
    /// Writes to `counts` the number of pixels below `first_bright` in each `cell_px` x `cell_px` cell, row by row from
    /// the top, with as many cells per row as fit into the image's width. Pixels to the right of the last whole cell
    /// are ignored; cells below the image, and all cells if `cell_px` is 0, are 0. Allocates only for an image wider
    /// than any before.
    pub fn count(&mut self, image: ImageView, first_bright: u8, cell_px: usize, counts: &mut [u32]) {
        counts.fill(0);
        let cells = image.width().checked_div(cell_px).unwrap_or(0);
        if cells == 0 {
            return;
        }
        self.columns.clear();
        self.columns.resize(cells * cell_px, 0);
        vectorize::run(Count { image, first_bright, cell_px, columns: &mut self.columns, counts });
    }
}

struct Count<'a> {
    image: ImageView<'a>,
    first_bright: u8,
    cell_px: usize,
    columns: &'a mut [u8],
    counts: &'a mut [u32],
}

impl Kernel for Count<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Count { image, first_bright, cell_px, columns, counts } = self;
        let bands = image.height() / cell_px;
        for (band, counts) in counts.chunks_exact_mut(columns.len() / cell_px).take(bands).enumerate() {
            let (mut v, end) = (band * cell_px, (band + 1) * cell_px);
            while v < end {
                // At most as many rows as a byte can count.
                let last = end.min(v + usize::from(u8::MAX));
                for row in v..last {
                    for (dark, &pixel) in columns.iter_mut().zip(image.row(row)) {
                        *dark += u8::from(pixel < first_bright);
                    }
                }
                v = last;
                for (count, cell) in counts.iter_mut().zip(columns.chunks_exact_mut(cell_px)) {
                    *count += cell.iter().map(|&dark| u32::from(dark)).sum::<u32>();
                    cell.fill(0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn equals_counting_one_by_one() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(9);
        let mut cells = DarkCells::default();
        for (width, height, cell_px) in [(340, 180, 20), (41, 33, 7), (300, 600, 300), (5, 5, 1), (9, 9, 10)]
        {
            let stride = width + 2;
            let data: Vec<u8> = (0..stride * height).map(|_| random.random()).collect();
            let image = ImageView::new(&data, width, height, stride).unwrap();
            for first_bright in [1, 77, 255] {
                let (columns, rows) = (width / cell_px, height / cell_px);
                let mut expected = vec![0; columns * rows];
                for v in 0..rows * cell_px {
                    for u in 0..columns * cell_px {
                        let is_dark = image.pixel(u, v) < first_bright;
                        expected[v / cell_px * columns + u / cell_px] += u32::from(is_dark);
                    }
                }
                let mut counts = vec![7; columns * rows];
                cells.count(image, first_bright, cell_px, &mut counts);
                assert_eq!(counts, expected, "{width} x {height}, cells of {cell_px}");
                let mut base = vec![0; columns * rows];
                let mut scratch = vec![0; columns * cell_px];
                if columns > 0 {
                    let columns = scratch.as_mut_slice();
                    Count { image, first_bright, cell_px, columns, counts: &mut base }.run();
                }
                assert_eq!(base, expected, "base instruction set");
            }
        }
    }

    #[test]
    fn cells_outside_the_image_are_empty() {
        let data = [0; 16];
        let image = ImageView::new(&data, 4, 4, 4).unwrap();
        let mut counts = [9; 6];
        DarkCells::default().count(image, 1, 2, &mut counts);
        assert_eq!(counts, [4, 4, 4, 4, 0, 0]);
        DarkCells::default().count(image, 1, 0, &mut counts);
        assert_eq!(counts, [0; 6]);
    }
}
