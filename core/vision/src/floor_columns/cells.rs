//! A picture in cells of a few pixels, free of noise and small spots.

use std::ops::Range;

use super::lab::{Lab, LabTables};
use crate::floor_appearance::Picture;
use crate::vectorize::{self, Kernel};

/// Columns of cells in a picture.
const COLUMNS: usize = 64;
/// Numbers that are compared side by side.
const LANES: usize = 8;

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
    /// Means of one channel; the rows end in [`LANES`] numbers without meaning.
    means: Vec<f32>,
    /// Medians of one row of that channel.
    medians: Vec<f32>,
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
        let stride = size[0] + LANES;
        Self {
            tables: LabTables::default(),
            picture: (width, height),
            cell: [across, down],
            size,
            sums: vec![[0; 3]; size[0]],
            means: vec![0.0; stride * size[1]],
            medians: vec![0.0; stride],
            colors: vec![Lab::default(); size[0] * size[1]],
        }
    }

    /// Numbers of cells, columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Pixels of a cell, columns and rows.
    #[must_use]
    pub fn cell(&self) -> [usize; 2] {
        self.cell
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

    /// Mean lightness of the cells in these rows of a column.
    #[must_use]
    pub fn lightness(&self, column: usize, rows: Range<usize>) -> f32 {
        let count = rows.len() as f32;
        rows.map(|row| self.row(row)[column][0]).sum::<f32>() / count
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
            let colors = &mut self.colors[row * columns..][..columns];
            for (color, sum) in colors.iter_mut().zip(&self.sums) {
                *color = match picture {
                    Picture::Gray(_) => self.tables.lab_of_gray(sum[0] as f32 * share),
                    Picture::Color(_) => self.tables.lab_of_rgb(sum.map(|sum| sum as f32 * share)),
                };
            }
        }
        // The other channels of gray pictures are zero.
        let channels = if matches!(picture, Picture::Gray(_)) { 1 } else { 3 };
        (0..channels).for_each(|channel| self.take_medians(channel));
        true
    }

    /// Medians of a channel over 3 x 3 cells; the border keeps the means.
    fn take_medians(&mut self, channel: usize) {
        let [columns, rows] = self.size;
        let stride = columns + LANES;
        for (means, colors) in self.means.chunks_exact_mut(stride).zip(self.colors.chunks_exact(columns)) {
            means.iter_mut().zip(colors).for_each(|(mean, color)| *mean = color[channel]);
        }
        let inside = 1..columns.saturating_sub(1);
        for row in 1..rows.saturating_sub(1) {
            let rows = [row - 1, row, row + 1].map(|row| &self.means[row * stride..][..stride]);
            vectorize::run(RowMedians { rows, medians: &mut self.medians });
            let colors = &mut self.colors[row * columns..][..columns];
            for column in inside.clone() {
                colors[column][channel] = self.medians[column];
            }
        }
    }
}

/// Medians of the numbers of three rows around each of the middle one but the first and the last.
struct RowMedians<'a> {
    rows: [&'a [f32]; 3],
    medians: &'a mut [f32],
}

impl Kernel for RowMedians<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let last = self.medians.len() - 1;
        for (block, medians) in self.medians[1..last].chunks_exact_mut(LANES).enumerate() {
            let near = |row: &[f32], dx: usize| {
                std::array::from_fn::<f32, LANES, _>(|lane| row[block * LANES + dx..][..LANES][lane])
            };
            let [above, here, below] = self.rows.map(|row| [0, 1, 2].map(|dx| near(row, dx)));
            let [[a, b, c], [d, e, f], [g, h, i]] = [above, here, below];
            medians.copy_from_slice(&median_of_nine([a, b, c, d, e, f, g, h, i]));
        }
    }
}

/// Medians of nine numbers, side by side, by minima and maxima alone (Paeth 1990).
#[inline(always)]
fn median_of_nine(mut x: [[f32; LANES]; 9]) -> [f32; LANES] {
    let mut order = |a: usize, b: usize| {
        let (first, second) = (x[a], x[b]);
        for lane in 0..LANES {
            let is_ordered = first[lane] < second[lane];
            x[a][lane] = if is_ordered { first[lane] } else { second[lane] };
            x[b][lane] = if is_ordered { second[lane] } else { first[lane] };
        }
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
    fn each_color_is_the_median_of_nine_means() {
        [1, 2, 3, 9, 10, 65, 76].into_iter().for_each(colors_are_medians);
    }

    /// Compares the colors of a picture of noise, a pixel in each cell, with medians of sorted lists.
    fn colors_are_medians(width: usize) {
        let height = 12;
        let mut seed = 1_u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 24) as u8
        };
        let pixels: Vec<u8> = (0..3 * width * height).map(|_| noise()).collect();
        let mut image = CellImage::new(width, height);
        assert!(
            image.fill(Picture::Color(RgbView::new(&pixels, width, height, 3 * width).expect("an image")))
        );
        assert_eq!(image.size(), [width, height], "a cell for each pixel");
        let mean = |column: usize, row: usize, channel: usize| {
            let at = 3 * (row * width + column);
            image.tables.lab_of_rgb([0, 1, 2].map(|channel| f32::from(pixels[at + channel])))[channel]
        };
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let is_border = row == 0 || column == 0 || row == height - 1 || column == width - 1;
            for channel in 0..3 {
                let mut near: Vec<f32> = if is_border {
                    vec![mean(column, row, channel)]
                } else {
                    (0..9).map(|i| mean(column + i % 3 - 1, row + i / 3 - 1, channel)).collect()
                };
                near.sort_by(f32::total_cmp);
                let color = image.row(row)[column][channel];
                assert_eq!(color, near[near.len() / 2], "column {column}, row {row}");
            }
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
