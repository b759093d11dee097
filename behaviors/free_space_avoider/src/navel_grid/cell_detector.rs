//! Detection of obstacle cells in an image.

use crate::navel_grid::area_average::AreaAverage;
use crate::navel_grid::dark_cells::DarkCells;
use crate::navel_grid::isodata::{
    IsodataError, Threshold, Tone, halves_of_class, threshold_of_class, threshold_of_pixels,
};
use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_vision::median::Median3;

use super::cells::{Cells, GridSize, foreground};

/// Brightness of the floor relative to the threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Polarity {
    /// Obstacles are darker than the floor, as in the paper.
    BrightFloor,
    /// Obstacles are brighter.
    DarkFloor,
}

/// Detector of obstacle cells. Reuses its buffers and allocates only for the first image.
#[derive(Clone, Debug)]
pub struct CellDetector {
    min_contrast: f64,
    floor_evenness: f64,
    average: AreaAverage,
    scaled: GrayImage,
    median: Median3,
    filtered: GrayImage,
    dark: DarkCells,
    counts: Vec<u32>,
    cells: Cells,
    threshold: Option<Threshold>,
    floor_level: Option<f64>,
}

impl CellDetector {
    /// Creates a detector with a grid. Images in which the means of dark and bright pixels differ by less than
    /// `min_contrast` gray levels are rejected. If the mean of the floor's darker part is below `floor_evenness` (0 to
    /// 1) times the mean of its brighter part, the parts are different surfaces; 0 disables this test.
    #[must_use]
    pub fn new(size: GridSize, min_contrast: f64, floor_evenness: f64) -> Self {
        Self {
            min_contrast,
            floor_evenness,
            threshold: None,
            floor_level: None,
            average: AreaAverage::default(),
            scaled: GrayImage::new(size.width_px(), size.height_px()),
            median: Median3::default(),
            filtered: GrayImage::default(),
            dark: DarkCells::default(),
            counts: vec![0; size.cells()],
            cells: Cells::new(size),
        }
    }

    /// Scales an image of any size to the grid, filters it and computes its threshold.
    ///
    /// # Errors
    /// [`IsodataError::LowContrast`] if floor and obstacles cannot be distinguished, [`IsodataError::Empty`] for a grid
    /// without cells.
    pub fn measure(&mut self, image: ImageView) -> Result<Threshold, IsodataError> {
        self.threshold = None;
        let size = self.cells.size();
        let image = if (image.width(), image.height()) == (size.width_px(), size.height_px()) {
            image
        } else {
            self.average.scale(image, &mut self.scaled);
            self.scaled.view().map_err(|_| IsodataError::Empty)?
        };
        self.median.filter(image, &mut self.filtered);
        let pixels = self.filtered.pixels();
        let threshold = threshold_of_pixels(pixels)?;
        if threshold.contrast() < self.min_contrast {
            let all = threshold.dark.sum + threshold.bright.sum;
            return Err(IsodataError::LowContrast { mean: all as f64 / pixels.len() as f64 });
        }
        self.threshold = Some(threshold);
        Ok(threshold)
    }

    /// Returns the cells of the last measured image for a floor of this polarity; unchanged if it had no threshold.
    ///
    /// Differs from \[1\]: if the class of the floor consists of two surfaces, such as a floor and a gray wall among
    /// black objects, only the brighter one (for a dark floor, the darker one) is floor, unless the learned floor level
    /// is in the other one.
    pub fn cells(&mut self, polarity: Polarity) -> &Cells {
        if let Some(threshold) = self.threshold {
            let whole = threshold.first_bright();
            let split = self.split(&threshold, polarity).filter(|parts| match (self.floor_level, polarity) {
                (None, _) => true,
                (Some(floor), Polarity::BrightFloor) => floor >= parts.level,
                (Some(floor), Polarity::DarkFloor) => floor < parts.level,
            });
            self.mark(split.map_or(whole, |parts| parts.first_bright()), polarity);
            if split.is_some() && self.floor_level.is_none() && !self.cells.is_foreground_free() {
                // Without a floor level, the foreground is assumed to be floor.
                self.mark(whole, polarity);
            }
        }
        &self.cells
    }

    /// Stores the mean gray level of the foreground of the last measured image as the level of the floor.
    pub fn learn_floor(&mut self) {
        let GridSize { columns, rows, cell_px } = self.cells.size();
        let (across, up) = foreground(columns, rows);
        let (mut sum, mut count) = (0, 0);
        if let Ok(filtered) = self.filtered.view() {
            for v in (rows - up.end) * cell_px..rows * cell_px {
                let row = &filtered.row(v)[across.start * cell_px..across.end * cell_px];
                sum += row.iter().map(|&pixel| u32::from(pixel)).sum::<u32>();
                count += row.len();
            }
            self.floor_level = (count > 0).then(|| f64::from(sum) / count as f64);
        }
    }

    /// Returns the two parts of the floor's class if they are too uneven for one surface.
    fn split(&self, threshold: &Threshold, polarity: Polarity) -> Option<Threshold> {
        let floor = match polarity {
            Polarity::BrightFloor => Tone::Bright,
            Polarity::DarkFloor => Tone::Dark,
        };
        let pixels = self.filtered.pixels();
        let halves = halves_of_class(pixels, threshold, floor).ok()?;
        if halves.dark.mean() < self.floor_evenness * halves.bright.mean() {
            threshold_of_class(pixels, threshold, floor).ok()
        } else {
            None
        }
    }

    fn mark(&mut self, first_bright: u8, polarity: Polarity) {
        let Ok(filtered) = self.filtered.view() else { return };
        let side = self.cells.size().cell_px;
        self.dark.count(filtered, first_bright, side, &mut self.counts);
        let dark = self.counts.iter().copied();
        match polarity {
            Polarity::BrightFloor => self.cells.mark(dark),
            Polarity::DarkFloor => self.cells.mark(dark.map(|dark| (side * side) as u32 - dark)),
        }
    }

    /// Returns the cells as last marked.
    #[must_use]
    pub fn marked(&self) -> &Cells {
        &self.cells
    }

    /// Returns the size of the grid.
    #[must_use]
    pub fn size(&self) -> GridSize {
        self.cells.size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an image of a floor of level 200 with a box of level 40 in columns 7 to 9 and rows 3 to 5 from the
    /// bottom.
    fn image_with_box(width: usize, height: usize) -> GrayImage {
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
    fn a_box_is_found_in_images_of_any_size() {
        for (width, height) in [(340, 180), (640, 480), (170, 90), (1920, 1080)] {
            let mut detector = CellDetector::new(GridSize::PAPER, 25.0, 0.7);
            let threshold = detector.measure(image_with_box(width, height).view().unwrap()).unwrap();
            assert!((100.0..140.0).contains(&threshold.level));
            let cells = detector.cells(Polarity::BrightFloor);
            for column in 0..17 {
                for row in 0..9 {
                    let is_box = (7..10).contains(&column) && (3..6).contains(&row);
                    assert_eq!(cells.is_obstacle(column, row), is_box, "{width}: {column}, {row}");
                }
            }
            assert!(!detector.cells(Polarity::DarkFloor).is_obstacle(8, 4));
            assert!(detector.cells(Polarity::DarkFloor).is_obstacle(0, 0));
        }
    }

    #[test]
    fn a_gray_wall_is_no_floor_beside_a_black_one() {
        let mut image = GrayImage::new(340, 180);
        for v in 0..180 {
            for u in 0..340 {
                let level = if v >= 120 {
                    200
                } else if u < 200 {
                    20
                } else {
                    110
                };
                image.pixels_mut()[v * 340 + u] = level;
            }
        }
        for (floor_evenness, is_obstacle) in [(0.0, false), (0.7, true)] {
            let mut detector = CellDetector::new(GridSize::PAPER, 25.0, floor_evenness);
            assert!(detector.measure(image.view().unwrap()).unwrap().level < 110.0);
            let cells = detector.cells(Polarity::BrightFloor);
            assert!(cells.is_obstacle(2, 5) && !cells.is_obstacle(2, 1) && !cells.is_obstacle(15, 1));
            assert_eq!(cells.is_obstacle(15, 5), is_obstacle);
            detector.learn_floor();
            assert_eq!(detector.cells(Polarity::BrightFloor).is_obstacle(15, 5), is_obstacle);
        }
    }

    #[test]
    fn a_gray_floor_stays_floor_beside_white_objects() {
        let mut image = GrayImage::new(340, 180);
        for v in 0..180 {
            for u in 0..340 {
                let level = match (v, u) {
                    (0..60, 0..200) => 20,
                    (0..60, 320..) => 255,
                    _ => 120,
                };
                image.pixels_mut()[v * 340 + u] = level;
            }
        }
        let mut detector = CellDetector::new(GridSize::PAPER, 25.0, 0.7);
        for frame in 0..3 {
            detector.measure(image.view().unwrap()).unwrap();
            let cells = detector.cells(Polarity::BrightFloor);
            assert!(cells.is_foreground_free() && cells.is_obstacle(2, 7), "frame {frame}");
            detector.learn_floor();
        }
    }

    #[test]
    fn uniform_images_have_low_contrast() {
        let mut detector = CellDetector::new(GridSize::PAPER, 25.0, 0.7);
        for (low, high) in [(0, 0), (255, 255), (120, 128), (100, 120)] {
            let mut image = GrayImage::new(340, 180);
            let (upper, lower) = image.pixels_mut().split_at_mut(170 * 180);
            upper.fill(low);
            lower.fill(high);
            let seen = detector.measure(image.view().unwrap());
            assert!(matches!(seen, Err(IsodataError::LowContrast { .. })), "{low}, {high}: {seen:?}");
        }
    }
}
