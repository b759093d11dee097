//! A picture in cells of a few pixels, free of noise and small spots.

use super::lab::{Lab, LabTables};
use crate::floor_appearance::Picture;

/// Columns of cells in a picture.
const COLUMNS: usize = 64;

/// Colors of the cells of a picture: means over their pixels, then medians over 3 x 3 cells.
#[derive(Clone, Debug)]
pub struct CellImage {
    tables: LabTables,
    /// Width and height of the pictures, pixels.
    picture: (usize, usize),
    /// Pixels of a cell, columns and rows.
    cell: [usize; 2],
    /// Numbers of cells, columns and rows.
    size: [usize; 2],
    /// Sums of the channels of one row of cells.
    sums: Vec<[u32; 3]>,
    means: Vec<Lab>,
    colors: Vec<Lab>,
}

impl CellImage {
    /// Creates the cells of pictures with `width` columns and `height` rows of pixels: about four pixels wide and two high
    /// for 256 columns.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        let across = (width / COLUMNS).max(1);
        let down = (across / 2).max(1);
        let size = [width / across, height / down];
        let blank = vec![Lab::default(); size[0] * size[1]];
        Self {
            tables: LabTables::default(),
            picture: (width, height),
            cell: [across, down],
            size,
            sums: vec![[0; 3]; size[0]],
            means: blank.clone(),
            colors: blank,
        }
    }

    /// Numbers of cells, columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Middle of a cell, pixels.
    #[must_use]
    pub fn middle(&self, column: usize, row: usize) -> [f64; 2] {
        let middle = |index: usize, pixels: usize| (index * pixels) as f64 + 0.5 * (pixels as f64 - 1.0);
        [middle(column, self.cell[0]), middle(row, self.cell[1])]
    }

    /// Colors of a row of cells.
    #[must_use]
    pub fn row(&self, row: usize) -> &[Lab] {
        &self.colors[row * self.size[0]..][..self.size[0]]
    }

    /// Takes in a picture. Returns false, and keeps the colors, if its size is another one.
    pub fn fill(&mut self, picture: Picture) -> bool {
        let [across, down] = self.cell;
        let [columns, rows] = self.size;
        let size = match picture {
            Picture::Gray(image) => (image.width(), image.height()),
            Picture::Color(image) => (image.width(), image.height()),
        };
        if size != self.picture {
            return false;
        }
        let share = 1.0 / (across * down) as f32;
        for row in 0..rows {
            self.sums.fill([0; 3]);
            for v in row * down..(row + 1) * down {
                match picture {
                    Picture::Gray(image) => {
                        for (sum, pixels) in self.sums.iter_mut().zip(image.row(v).chunks_exact(across)) {
                            sum[0] += pixels.iter().map(|&gray| u32::from(gray)).sum::<u32>();
                        }
                    }
                    Picture::Color(image) => {
                        for (sum, pixels) in self.sums.iter_mut().zip(image.row(v).chunks_exact(across)) {
                            for pixel in pixels {
                                for (sum, &channel) in sum.iter_mut().zip(pixel) {
                                    *sum += u32::from(channel);
                                }
                            }
                        }
                    }
                }
            }
            let means = &mut self.means[row * columns..][..columns];
            for (mean, sum) in means.iter_mut().zip(&self.sums) {
                *mean = match picture {
                    Picture::Gray(_) => self.tables.lab_of_gray(sum[0] as f32 * share),
                    Picture::Color(_) => self.tables.lab_of_rgb(sum.map(|sum| sum as f32 * share)),
                };
            }
        }
        self.take_medians();
        true
    }

    /// Medians of the means over 3 x 3 cells; the border keeps the means.
    fn take_medians(&mut self) {
        let [columns, rows] = self.size;
        self.colors.copy_from_slice(&self.means);
        for row in 1..rows.saturating_sub(1) {
            for column in 1..columns.saturating_sub(1) {
                let at = row * columns + column;
                for channel in 0..3 {
                    let near =
                        |dy: usize, dx: usize| self.means[at + dy * columns + dx - columns - 1][channel];
                    self.colors[at][channel] = median_of_nine([
                        near(0, 0),
                        near(0, 1),
                        near(0, 2),
                        near(1, 0),
                        near(1, 1),
                        near(1, 2),
                        near(2, 0),
                        near(2, 1),
                        near(2, 2),
                    ]);
                }
            }
        }
    }
}

/// Median of nine numbers by minima and maxima alone (Paeth 1990).
fn median_of_nine(mut x: [f32; 9]) -> f32 {
    let mut order = |a: usize, b: usize| {
        let (low, high) = (x[a].min(x[b]), x[a].max(x[b]));
        (x[a], x[b]) = (low, high);
    };
    for (a, b) in [
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 1),
        (3, 4),
        (6, 7),
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 3),
        (5, 8),
        (4, 7),
        (3, 6),
        (1, 4),
        (2, 5),
        (4, 7),
        (4, 2),
        (6, 4),
        (4, 2),
    ] {
        order(a, b);
    }
    x[4]
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_geometry::image::{ImageView, RgbView};

    #[test]
    fn the_median_is_that_of_a_sorted_list() {
        let mut seed = 1_u32;
        for _ in 0..500 {
            let mut values = [0.0_f32; 9];
            for value in &mut values {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *value = (seed >> 24) as f32;
            }
            let mut sorted = values;
            sorted.sort_by(f32::total_cmp);
            assert_eq!(median_of_nine(values), sorted[4], "{values:?}");
        }
    }

    #[test]
    fn gray_and_color_give_the_same_lightness_and_spots_vanish() {
        let (width, height) = (256, 192);
        let mut gray = vec![90_u8; width * height];
        for v in 80..84 {
            for u in 100..104 {
                gray[v * width + u] = 250;
            }
        }
        let color: Vec<u8> = gray.iter().flat_map(|&gray| [gray; 3]).collect();
        let (mut of_gray, mut of_color) = (CellImage::new(width, height), CellImage::new(width, height));
        assert_eq!(of_gray.size(), [64, 96]);
        assert!(of_gray.fill(Picture::Gray(ImageView::new(&gray, width, height, width).expect("an image"))));
        let view = RgbView::new(&color, width, height, 3 * width).expect("an image");
        assert!(of_color.fill(Picture::Color(view)));
        for row in 0..96 {
            for (a, b) in of_gray.row(row).iter().zip(of_color.row(row)) {
                assert!((a[0] - b[0]).abs() < 0.5 && b[1].abs() < 0.5 && b[2].abs() < 0.5, "{a:?} {b:?}");
                assert!((a[0] - of_gray.row(0)[0][0]).abs() < 0.01, "the spot is gone");
            }
        }
        for (width, height) in [(128, 96), (255, 192), (256, 191)] {
            let other = ImageView::new(&gray, width, height, 256).expect("an image");
            assert!(!of_gray.fill(Picture::Gray(other)));
        }
    }
}
