//! Detection of obstacle cells by the floor's learned look.
//!
//! Differs from \[1\], which knows brightness only: floors that are not brighter than everything else, and walls as bright as the
//! floor.

use nalgebra::Point2;
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_vision::floor_appearance::{
    AppearanceError, FloorAppearance, FloorPlace, FloorSamples, LearnedLook, Picture,
};

use super::cells::{Cells, GridSize};

/// Number of points examined along either side of a cell.
const POINTS: usize = 5;
/// Log odds above which a point of a cell counts as floor: a probability of 0.57.
const FLOOR_LOG_ODDS: f32 = 0.3;

/// Detector of obstacle cells by the floor's look. Allocates for the first image only.
#[derive(Clone, Debug)]
pub struct LookCells {
    appearance: FloorAppearance,
    place: FloorPlace,
    samples: FloorSamples,
    cells: Cells,
}

impl LookCells {
    /// Creates a detector with a grid for a mounted camera; `look` is what was learned before.
    #[must_use]
    pub fn new(size: GridSize, camera: &Pinhole, mount: &Mount, look: LearnedLook) -> Self {
        Self {
            appearance: FloorAppearance::with_look(look),
            place: FloorPlace::of_camera(camera, mount),
            samples: FloorSamples::new(camera, mount),
            cells: Cells::new(size),
        }
    }

    /// Marks the cells of an image: a cell in which more than a quarter of the points are not likely floor is an obstacle.
    ///
    /// # Errors
    /// The image is too small, or its foreground is dark or overexposed; the cells are then unchanged.
    pub fn mark(&mut self, picture: Picture) -> Result<&Cells, AppearanceError> {
        let (width, height) = picture.size();
        let votes = self.appearance.observe(picture, &self.place)?;
        let GridSize { columns, rows, cell_px } = self.cells.size();
        let pixels_per_point = (cell_px * cell_px) as f64 / (POINTS * POINTS) as f64;
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        self.cells.mark(cells.map(|(column, row)| {
            let at = |index: usize, point: usize, count: usize, size: usize| {
                (2 * (index * POINTS + point) + 1) * size / (2 * POINTS * count)
            };
            let points = (0..POINTS * POINTS)
                .map(|i| (at(column, i % POINTS, columns, width), at(row, i / POINTS, rows, height)));
            let other =
                points.filter(|&(u, v)| votes.block_log_odds_at_pixel(u, v) <= FLOOR_LOG_ODDS).count();
            (other as f64 * pixels_per_point).round() as u32
        }));
        Ok(&self.cells)
    }

    /// Learns from the last image, taken at pose `seen_from`, what the robot (a circle of `radius_m`) covers now, at pose
    /// `now`, after `elapsed_s`; poses in the odometry frame.
    pub fn learn(&mut self, seen_from: &Pose2, now: &Pose2, radius_m: f64, elapsed_s: f64) {
        self.samples.remember(self.appearance.blocks(), seen_from);
        let is_covered = |place: Point2<f64>| nalgebra::distance(&place, &now.position()) < radius_m;
        if self.samples.confirm(is_covered, self.appearance.look_mut()) > 0 {
            self.appearance.look_mut().fade(elapsed_s);
        }
    }

    /// Returns the observer of the floor's look.
    #[must_use]
    pub fn appearance(&self) -> &FloorAppearance {
        &self.appearance
    }

    /// Returns the cells as last marked.
    #[must_use]
    pub fn marked(&self) -> &Cells {
        &self.cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::Intrinsics;
    use yamabico_core::image::RgbView;

    #[test]
    fn a_box_of_the_floor_s_brightness_is_found() {
        let camera = Pinhole::ideal(Intrinsics::from_horizontal_fov(340, 180, 90_f64.to_radians()));
        let mount = Mount::tilted(0.4, 28_f64.to_radians());
        let color = |u: usize, v: usize| match (u, v) {
            (140..220, 60..120) => [150, 110, 60],
            (_, 0..40) => [110, 120, 140],
            _ => [118, 118, 118],
        };
        let data: Vec<u8> = (0..340 * 180).flat_map(|i| color(i % 340, i / 340)).collect();
        let mut detector = LookCells::new(GridSize::PAPER, &camera, &mount, LearnedLook::default());
        let picture = Picture::Color(RgbView::new(&data, 340, 180, 3 * 340).unwrap());
        let cells = detector.mark(picture).unwrap();
        let is_obstacle = |column, row| cells.is_obstacle(column, row);
        assert!(is_obstacle(8, 4) && is_obstacle(9, 5) && cells.is_foreground_free());
        assert!(!is_obstacle(2, 1) && !is_obstacle(14, 2), "{cells:?}");
        let dark = vec![0; 3 * 340 * 180];
        let picture = Picture::Color(RgbView::new(&dark, 340, 180, 3 * 340).unwrap());
        assert!(detector.mark(picture).is_err() && detector.marked().is_obstacle(8, 4));
    }
}
