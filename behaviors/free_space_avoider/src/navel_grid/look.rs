//! From a picture to the cells that hold obstacles.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::vision::area_average::AreaAverage;
use yamabico_core::vision::dark_cells::DarkCells;
use yamabico_core::vision::isodata::{IsodataError, Threshold, threshold_of_pixels};
use yamabico_core::vision::median::Median3;

use super::cells::{Cells, GridSize};

/// Which side of the threshold is floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Polarity {
    /// Obstacles are darker than the floor, as in the paper.
    BrightFloor,
    /// Obstacles are brighter.
    DarkFloor,
}

/// Looks at pictures; keeps its buffers from picture to picture and allocates only with the first.
#[derive(Clone, Debug)]
pub struct Look {
    least_contrast: f64,
    average: AreaAverage,
    scaled: GrayImage,
    median: Median3,
    filtered: GrayImage,
    dark: DarkCells,
    counts: Vec<u32>,
    cells: Cells,
}

impl Look {
    /// A look at pictures through this grid, which refuses those whose dark and bright pixels differ by less than
    /// `least_contrast` grey levels on average.
    #[must_use]
    pub fn new(size: GridSize, least_contrast: f64) -> Self {
        Self {
            least_contrast,
            average: AreaAverage::default(),
            scaled: GrayImage::new(size.width_px(), size.height_px()),
            median: Median3::default(),
            filtered: GrayImage::default(),
            dark: DarkCells::default(),
            counts: vec![0; size.cells()],
            cells: Cells::new(size),
        }
    }

    /// Counts the dark pixels of each cell of a picture of any size, which is scaled to the grid's where it has another.
    ///
    /// # Errors
    /// [`IsodataError::LowContrast`] where floor and obstacles cannot be told apart.
    pub fn measure(&mut self, image: ImageView) -> Result<Threshold, IsodataError> {
        let size = self.cells.size();
        let image = if (image.width(), image.height()) == (size.width_px(), size.height_px()) {
            image
        } else {
            self.average.scale(image, &mut self.scaled);
            // A grid without cells sees nothing.
            self.scaled.view().map_err(|_| IsodataError::Empty)?
        };
        self.median.filter(image, &mut self.filtered);
        let pixels = self.filtered.pixels();
        let threshold = threshold_of_pixels(pixels)?;
        if threshold.contrast() < self.least_contrast {
            let all = threshold.dark.sum + threshold.bright.sum;
            return Err(IsodataError::LowContrast { mean: all as f64 / pixels.len() as f64 });
        }
        let filtered = self.filtered.view().map_err(|_| IsodataError::Empty)?;
        self.dark.count(filtered, threshold.first_bright(), size.cell_px, &mut self.counts);
        Ok(threshold)
    }

    /// The cells of the picture measured last, for a floor of this polarity.
    pub fn cells(&mut self, polarity: Polarity) -> &Cells {
        let pixels = (self.cells.size().cell_px * self.cells.size().cell_px) as u32;
        let dark = self.counts.iter().copied();
        match polarity {
            Polarity::BrightFloor => self.cells.mark(dark),
            Polarity::DarkFloor => self.cells.mark(dark.map(|dark| pixels - dark)),
        }
        &self.cells
    }

    /// The filtered picture that was measured last.
    #[must_use]
    pub fn filtered(&self) -> &GrayImage {
        &self.filtered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Floor of 200 with a box of 40 in the cells of columns 7 to 9 and rows 3 to 5 from below, of a picture of any size.
    fn picture(width: usize, height: usize) -> GrayImage {
        let mut image = GrayImage::new(width, height);
        for v in 0..height {
            for u in 0..width {
                let (column, row) = (u * 17 / width, 8 - v * 9 / height);
                let is_box = (7..10).contains(&column) && (3..6).contains(&row);
                image.pixels_mut()[v * width + u] = if is_box { 40 } else { 200 };
            }
        }
        image
    }

    #[test]
    fn a_box_is_found_in_pictures_of_any_size() {
        for (width, height) in [(340, 180), (640, 480), (170, 90), (1920, 1080)] {
            let mut look = Look::new(GridSize::PAPER, 25.0);
            let threshold = look.measure(picture(width, height).view().unwrap()).unwrap();
            assert!((100.0..140.0).contains(&threshold.level));
            let cells = look.cells(Polarity::BrightFloor);
            for column in 0..17 {
                for row in 0..9 {
                    let is_box = (7..10).contains(&column) && (3..6).contains(&row);
                    assert_eq!(cells.is_obstacle(column, row), is_box, "{width}: {column}, {row}");
                }
            }
            assert!(!look.cells(Polarity::DarkFloor).is_obstacle(8, 4));
            assert!(look.cells(Polarity::DarkFloor).is_obstacle(0, 0));
        }
    }

    #[test]
    fn flat_pictures_have_low_contrast() {
        let mut look = Look::new(GridSize::PAPER, 25.0);
        for (low, high) in [(0, 0), (255, 255), (120, 128), (100, 120)] {
            let mut image = GrayImage::new(340, 180);
            let (upper, lower) = image.pixels_mut().split_at_mut(170 * 180);
            upper.fill(low);
            lower.fill(high);
            let seen = look.measure(image.view().unwrap());
            assert!(matches!(seen, Err(IsodataError::LowContrast { .. })), "{low}, {high}: {seen:?}");
        }
    }
}
