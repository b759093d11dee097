//! Texture of the floor: what is plain where the floor is speckled is no floor, whatever its color.
//!
//! Texture is the mean difference of pixels that lie one cell apart, over 3 x 3 cells. That of the floor is learned for each row, since it
//! grows finer with the distance: by a low quantile, so that joints between plain tiles are none. Rows in which the whole picture is
//! plain, as motion blurs it, say nothing.

use crate::floor_appearance::Picture;

/// Quantile of the texture of a row that stands for its floor, and the one that tells whether the row is sharp.
const FLOOR: f64 = 0.2;
const SHARP: f64 = 0.8;
/// Share of the texture of the floor below which a cell is plain.
const PLAIN: f32 = 0.5;
/// Share by which the texture of the floor follows what is seen, and the number of pictures from which it is known.
const LEARN: f32 = 0.03;
const MIN_PICTURES: u32 = 10;
/// Share of the cells of a row that must show floor for its texture to be learned.
const MIN_SHARE: f64 = 0.5;

/// Texture of the cells of a picture, and of the floor in the last ones. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub(super) struct FloorTexture {
    columns: usize,
    /// Texture of each cell alone, of three rows of cells together, and of three columns of these, gray levels.
    own: Vec<f32>,
    rows: Vec<f32>,
    cells: Vec<f32>,
    /// Per row: texture of the floor, number of pictures it was learned from, and true if the picture is sharp there.
    floor: Vec<f32>,
    pictures: Vec<u32>,
    is_sharp: Vec<bool>,
    sorted: Vec<f32>,
}

impl FloorTexture {
    /// Prepares for pictures of so many cells, columns and rows; nothing is learned yet.
    pub fn new([columns, rows]: [usize; 2]) -> Self {
        Self {
            columns,
            own: vec![0.0; columns * rows],
            rows: vec![0.0; columns],
            cells: vec![0.0; columns * rows],
            floor: vec![0.0; rows],
            pictures: vec![0; rows],
            is_sharp: vec![false; rows],
            sorted: Vec::with_capacity(columns),
        }
    }

    /// Takes in a picture, in cells of so many pixels, columns and rows; of a color picture the green channel.
    pub fn look(&mut self, picture: Picture, [across, down]: [usize; 2]) {
        let columns = self.columns;
        let share = 1.0 / (9 * across * down) as f32;
        for (row, own) in self.own.chunks_exact_mut(columns).enumerate() {
            own.fill(0.0);
            for v in row * down..(row + 1) * down {
                match picture {
                    Picture::Gray(image) => add_differences(own, image.row(v), across, |pixel| *pixel),
                    Picture::Color(image) => add_differences(own, image.row(v), across, |pixel| pixel[1]),
                }
            }
            own.iter_mut().for_each(|sum| *sum *= share);
            own[columns - 1] = own[columns - 2];
        }
        let last = self.floor.len() - 1;
        for row in 0..=last {
            let line = |row: usize| &self.own[row * columns..][..columns];
            let (above, below) = (line(row.saturating_sub(1)), line((row + 1).min(last)));
            for (sum, ((above, own), below)) in
                self.rows.iter_mut().zip(above.iter().zip(line(row)).zip(below))
            {
                *sum = above + own + below;
            }
            let cells = &mut self.cells[row * columns..][..columns];
            for (cell, sums) in cells[1..].iter_mut().zip(self.rows.windows(3)) {
                *cell = sums[0] + sums[1] + sums[2];
            }
            (cells[0], cells[columns - 1]) = (cells[1], cells[columns - 2]);
            self.is_sharp[row] = self.pictures[row] >= MIN_PICTURES && {
                self.sorted.clear();
                self.sorted.extend_from_slice(cells);
                quantile(&mut self.sorted, SHARP) >= self.floor[row]
            };
        }
    }

    /// True if a cell is much plainer than the floor in its row.
    pub fn is_plain(&self, column: usize, row: usize) -> bool {
        self.is_sharp[row] && self.cells[row * self.columns + column] < PLAIN * self.floor[row]
    }

    /// Learns from the columns in which the floor reaches beyond a row: `ends` are the rows of its end.
    pub fn learn(&mut self, ends: &[usize]) {
        let lines = self.cells.chunks_exact(self.columns).zip(self.floor.iter_mut().zip(&mut self.pictures));
        for (row, (cells, (floor, pictures))) in lines.enumerate() {
            self.sorted.clear();
            self.sorted
                .extend(cells.iter().zip(ends).filter(|&(_, &end)| end + 1 < row).map(|(cell, _)| cell));
            if self.sorted.len() as f64 >= MIN_SHARE * self.columns as f64 {
                *pictures = pictures.saturating_add(1);
                let share = LEARN.max(1.0 / *pictures as f32);
                *floor += share * (quantile(&mut self.sorted, FLOOR) - *floor);
            }
        }
    }
}

/// Adds the differences of a line's pixels from those one cell to the right, cells of `across` pixels; the last cell has none.
fn add_differences<P>(sums: &mut [f32], line: &[P], across: usize, level: impl Fn(&P) -> u8) {
    let pairs = line.chunks_exact(across).zip(line[across..].chunks_exact(across));
    for (sum, (here, there)) in sums.iter_mut().zip(pairs) {
        let pixels =
            here.iter().zip(there).map(|(here, there)| u32::from(level(here).abs_diff(level(there))));
        *sum += pixels.sum::<u32>() as f32;
    }
}

/// Value that is larger than a share of the others; there is at least one.
fn quantile(values: &mut [f32], share: f64) -> f32 {
    let at = ((values.len() - 1) as f64 * share) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use yamabico_geometry::image::{ImageView, RgbView};

    use super::*;

    const SIZE: (usize, usize) = (256, 240);
    const CELLS: [usize; 2] = [64, 120];

    /// Speckles of this contrast, and a plain area in columns 100 to 139 from row 60 on.
    fn picture(contrast: u32, has_thing: bool) -> Vec<u8> {
        let speckle = |u: usize, v: usize| {
            (u as u32 / 3 * 7919 + v as u32 / 3 * 104_729).wrapping_mul(2_654_435_761) >> 26
        };
        let level = |u: usize, v: usize| match (u, v) {
            (100..140, 60..) if has_thing => 110,
            (u, v) => (110 + contrast * speckle(u, v) / 64) as u8,
        };
        (0..SIZE.0 * SIZE.1).map(|i| level(i % SIZE.0, i / SIZE.0)).collect()
    }

    fn look(texture: &mut FloorTexture, pixels: &[u8]) {
        let image = ImageView::new(pixels, SIZE.0, SIZE.1, SIZE.0).expect("an image");
        texture.look(Picture::Gray(image), [4, 2]);
    }

    /// Texture learned from ten pictures of an empty floor.
    fn learned(pixels: &[u8]) -> FloorTexture {
        let mut texture = FloorTexture::new(CELLS);
        for _ in 0..MIN_PICTURES {
            look(&mut texture, pixels);
            assert!(!texture.is_plain(30, 100), "nothing is known yet");
            texture.learn(&[20; CELLS[0]]);
        }
        texture
    }

    #[test]
    fn a_plain_thing_on_a_speckled_floor_of_its_color_is_found() {
        let mut texture = learned(&picture(40, false));
        look(&mut texture, &picture(40, true));
        let plain: Vec<usize> = (0..CELLS[0]).filter(|&column| texture.is_plain(column, 80)).collect();
        assert!(plain.first() >= Some(&25) && plain.last() <= Some(&34) && plain.len() >= 7, "{plain:?}");
        assert!((0..CELLS[0]).all(|column| !texture.is_plain(column, 15)), "no floor was learned there");
        look(&mut texture, &picture(10, true));
        assert!((0..CELLS[0]).all(|column| !texture.is_plain(column, 80)), "a blurred picture says nothing");
    }

    #[test]
    fn on_plain_tiles_with_joints_nothing_is_plain() {
        let tiles: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|i| if i % 64 < 2 { 60 } else { 110 }).collect();
        let mut texture = learned(&tiles);
        look(&mut texture, &tiles);
        assert!((0..CELLS[0]).all(|column| !texture.is_plain(column, 80)));
    }

    #[test]
    fn a_color_picture_counts_like_a_gray_one() {
        let mut gray = learned(&picture(40, false));
        let mut color = gray.clone();
        look(&mut gray, &picture(40, true));
        let pixels: Vec<u8> = picture(40, true).iter().flat_map(|&level| [0, level, 255]).collect();
        let image = RgbView::new(&pixels, SIZE.0, SIZE.1, 3 * SIZE.0).expect("an image");
        color.look(Picture::Color(image), [4, 2]);
        assert_eq!(gray.cells, color.cells);
    }
}
