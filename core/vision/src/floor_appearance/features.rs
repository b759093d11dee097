//! Blocks of an image and their features.

use std::sync::LazyLock;

use yamabico_geometry::image::{ImageView, RgbView};

/// Look of a block: chromaticity of red and of green (shares of the sum of the channels), mean log intensity, and log of
/// the mean gradient of the log intensity (texture).
pub type Feature = [f32; 4];

/// Number of blocks along the longer side of an image, approximately.
const BLOCKS: usize = 36;
/// Level from which on a channel saturates.
const SATURATED: u8 = 251;
/// Share of saturated pixels above which a block has no look of its own.
const SATURATED_SHARE: f32 = 0.25;
/// Added to gray levels before the logarithm, so that the noise of dark pixels stays small.
const DARK_OFFSET: f32 = 8.0;
/// Added to the channels of a chromaticity, so that the noise of dark pixels stays small.
const CHROMA_OFFSET: f32 = 10.0;
/// Added to the gradient before the logarithm.
const GRADIENT_OFFSET: f32 = 0.01;

/// Unit of logarithms in integer arithmetic.
const UNIT: f32 = 1.0 / 4096.0;

/// A gray or color image.
#[derive(Clone, Copy, Debug)]
pub enum Picture<'a> {
    /// Gray levels only.
    Gray(ImageView<'a>),
    /// Red, green and blue.
    Color(RgbView<'a>),
}

impl Picture<'_> {
    /// Returns width and height, pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        match self {
            Picture::Gray(image) => (image.width(), image.height()),
            Picture::Color(image) => (image.width(), image.height()),
        }
    }
}

/// Position of the blocks in an image: square, aligned with its bottom and centered across; pixels beyond the outermost blocks
/// are not examined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockGrid {
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// Side of a block, pixels, a multiple of 4: 8 at 256x240, 16 at 640x480.
    pub side_px: usize,
    /// First column of pixels.
    pub left_px: usize,
    /// First row of pixels.
    pub top_px: usize,
}

impl BlockGrid {
    /// Returns the grid of an image of this size, pixels.
    #[must_use]
    pub fn of(width: usize, height: usize) -> Self {
        let side_px = 4 * ((width.max(height) + 2 * BLOCKS) / (4 * BLOCKS)).max(1);
        let (columns, rows) = (width / side_px, height / side_px);
        let (left_px, top_px) = ((width - columns * side_px) / 2, height - rows * side_px);
        Self { columns, rows, side_px, left_px, top_px }
    }

    /// Number of blocks.
    #[must_use]
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the center of a block, pixels.
    #[must_use]
    pub fn center(&self, column: usize, row: usize) -> (f64, f64) {
        let middle = |first: usize, block: usize| {
            (first + block * self.side_px) as f64 + 0.5 * (self.side_px - 1) as f64
        };
        (middle(self.left_px, column), middle(self.top_px, row))
    }
}

/// Features of the blocks of an image. Reuses its buffers: allocates for the first image of a size only.
#[derive(Clone, Debug, Default)]
pub struct Blocks {
    grid: BlockGrid,
    is_color: bool,
    features: Vec<Feature>,
    is_saturated: Vec<bool>,
    /// Mean log intensity of quarter blocks, row by row, two columns and two rows a block.
    quarters: Vec<f32>,
    /// Log intensity of the row above, and of the row at hand, in units of [`UNIT`].
    above: Vec<i32>,
    here: Vec<i32>,
    /// Sums of the log intensity over quarter blocks of the row of half blocks at hand, in units of [`UNIT`].
    halves: Vec<i32>,
    /// Sums over a row of blocks.
    sums: Vec<Sums>,
}

/// Sums over the pixels of a block.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    channels: [u32; 3],
    gradient: i32,
    saturated: u32,
}

impl Blocks {
    /// Measures the blocks of an image.
    pub fn measure(&mut self, picture: Picture) {
        let (width, height) = picture.size();
        let grid = BlockGrid::of(width, height);
        self.grid = grid;
        self.is_color = matches!(picture, Picture::Color(_));
        self.features.clear();
        self.is_saturated.clear();
        self.quarters.clear();
        for buffer in [&mut self.above, &mut self.here] {
            buffer.resize(grid.columns * grid.side_px, 0);
        }
        self.halves.clear();
        self.halves.resize(2 * grid.columns, 0);
        for row in 0..grid.rows {
            self.sums.clear();
            self.sums.resize(grid.columns, Sums::default());
            for line in 0..grid.side_px {
                let v = grid.top_px + row * grid.side_px + line;
                self.read(picture, v);
                self.add_gradients(row + line == 0);
                self.add_halves(line);
                std::mem::swap(&mut self.above, &mut self.here);
            }
            self.finish(row);
        }
    }

    /// Reads a row of pixels: sums of the channels, and log intensity.
    fn read(&mut self, picture: Picture, v: usize) {
        let BlockGrid { side_px, left_px, columns, .. } = self.grid;
        let pixels = left_px..left_px + columns * side_px;
        let table: &[i32; 256] = &LOGS;
        let logs = self.here.chunks_exact_mut(side_px).zip(&mut self.sums);
        match picture {
            Picture::Color(image) => {
                for ((logs, sums), colors) in logs.zip(image.row(v)[pixels].chunks_exact(side_px)) {
                    for (log, &[red, green, blue]) in logs.iter_mut().zip(colors) {
                        let [r, g, b] = [red, green, blue].map(u32::from);
                        sums.channels[0] += r;
                        sums.channels[1] += g;
                        sums.channels[2] += b;
                        sums.saturated += u32::from(red.max(green).max(blue) >= SATURATED);
                        *log = table[((77 * r + 150 * g + 29 * b + 127) >> 8) as usize & 255];
                    }
                }
            }
            Picture::Gray(image) => {
                for ((logs, sums), levels) in logs.zip(image.row(v)[pixels].chunks_exact(side_px)) {
                    for (log, &level) in logs.iter_mut().zip(levels) {
                        sums.saturated += u32::from(level >= SATURATED);
                        *log = table[usize::from(level)];
                    }
                }
            }
        }
    }

    /// Adds the gradients between the pixels of a row and those to the left and above.
    fn add_gradients(&mut self, is_first: bool) {
        let side_px = self.grid.side_px;
        let mut left = self.here.first().copied().unwrap_or_default();
        let rows = self.here.chunks_exact(side_px).zip(self.above.chunks_exact(side_px));
        for (sums, (here, above)) in self.sums.iter_mut().zip(rows) {
            let across = here[1..].iter().zip(here).map(|(here, left)| (here - left).abs()).sum::<i32>();
            let down = here.iter().zip(above).map(|(here, above)| (here - above).abs()).sum::<i32>();
            sums.gradient += (here[0] - left).abs() + across + if is_first { 0 } else { down };
            left = here[side_px - 1];
        }
    }

    /// Adds a row of pixels to the quarter blocks, and stores their means after the last row of a half.
    fn add_halves(&mut self, line: usize) {
        let half = self.grid.side_px / 2;
        for (sum, logs) in self.halves.iter_mut().zip(self.here.chunks_exact(half)) {
            *sum += logs.iter().sum::<i32>();
        }
        if (line + 1).is_multiple_of(half) {
            let unit = UNIT / (half * half) as f32;
            self.quarters.extend(self.halves.iter().map(|&sum| sum as f32 * unit));
            self.halves.fill(0);
        }
    }

    fn finish(&mut self, row: usize) {
        let pixels = (self.grid.side_px * self.grid.side_px) as f32;
        let width = 2 * self.grid.columns;
        let (upper, lower) = self.quarters[2 * row * width..][..2 * width].split_at(width);
        let intensities = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
        for (sums, (upper, lower)) in self.sums.iter().zip(intensities) {
            let means = sums.channels.map(|sum| sum as f32 / pixels + CHROMA_OFFSET);
            let all: f32 = means.iter().sum();
            let intensity = 0.25 * (upper[0] + upper[1] + lower[0] + lower[1]);
            let texture = (sums.gradient as f32 * UNIT / pixels + GRADIENT_OFFSET).ln();
            self.features.push([means[0] / all, means[1] / all, intensity, texture]);
            self.is_saturated.push(sums.saturated as f32 > SATURATED_SHARE * pixels);
        }
    }

    /// Returns the position of the blocks in the image.
    #[must_use]
    pub fn grid(&self) -> BlockGrid {
        self.grid
    }

    /// Returns true if the last image had colors.
    #[must_use]
    pub fn is_color(&self) -> bool {
        self.is_color
    }

    /// Features, row by row from the top.
    #[must_use]
    pub fn features(&self) -> &[Feature] {
        &self.features
    }

    /// True for blocks of which more than a quarter saturates, row by row from the top.
    #[must_use]
    pub fn is_saturated(&self) -> &[bool] {
        &self.is_saturated
    }

    /// Mean log intensity of the quarter blocks in a row of half blocks from the top.
    #[must_use]
    pub fn quarter_row(&self, half_row: usize) -> &[f32] {
        &self.quarters[half_row * 2 * self.grid.columns..][..2 * self.grid.columns]
    }
}

/// Logarithms of gray levels, in units of [`UNIT`].
static LOGS: LazyLock<[i32; 256]> =
    LazyLock::new(|| std::array::from_fn(|level| ((level as f32 + DARK_OFFSET).ln() / UNIT).round() as i32));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_align_with_the_bottom() {
        let grid = BlockGrid::of(340, 181);
        assert_eq!(grid, BlockGrid { columns: 42, rows: 22, side_px: 8, left_px: 2, top_px: 5 });
        assert_eq!([(256, 240), (640, 480), (60, 40)].map(|(w, h)| BlockGrid::of(w, h).side_px), [8, 16, 4]);
        assert_eq!((BlockGrid::of(3, 3).count(), grid.center(0, 0)), (0, (5.5, 8.5)));
    }

    #[test]
    fn a_uniform_block_has_its_color_and_no_texture() {
        let data = [90, 60, 30].repeat(64 * 32);
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Color(RgbView::new(&data, 64, 32, 192).unwrap()));
        let grid = blocks.grid();
        assert_eq!((grid.columns, grid.rows, blocks.features().len()), (16, 8, 128));
        let [red, green, intensity, texture] = blocks.features()[17];
        assert!((red - 100.0 / 210.0).abs() < 1e-6 && (green - 70.0 / 210.0).abs() < 1e-6);
        assert!((intensity - (66.0_f32 + 8.0).ln()).abs() < 0.01 && (texture - 0.01_f32.ln()).abs() < 1e-5);
        assert!(blocks.is_color() && !blocks.is_saturated()[17]);
    }

    #[test]
    fn stripes_are_texture_and_white_saturates() {
        let pixel = |u: usize, v: usize| if v < 16 { 255 } else { 100 + 60 * (u % 2) as u8 };
        let data: Vec<u8> = (0..64 * 32).map(|i| pixel(i % 64, i / 64)).collect();
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Gray(ImageView::new(&data, 64, 32, 64).unwrap()));
        let at = |column: usize, row: usize| row * 16 + column;
        assert!(blocks.is_saturated()[at(3, 3)] && !blocks.is_saturated()[at(3, 5)]);
        let texture = |i: usize| blocks.features()[i][3];
        assert!(texture(at(3, 6)) > texture(at(3, 1)) + 3.0);
        assert!((blocks.features()[at(3, 6)][0] - 1.0 / 3.0).abs() < 1e-6, "gray has no chromaticity");
    }
}
