//! Ground below the picture that something may stand on: its foot is there, since the lower border of the picture cuts it.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;

use super::occupancy::CELL_M;

/// Distance from the robot's center at which the ground begins, m: nearer is the robot.
const ROBOT_M: f64 = 0.3;
/// Maximum number of columns whose ground is kept.
const MAX_COLUMNS: usize = 128;
/// Maximum number of places that are kept: 64 columns, 1.6 m of each.
pub(super) const MAX_PLACES: usize = 2048;

/// Places that something may stand on by the newest picture, odometry frame, m.
#[derive(Clone, Debug)]
pub(super) struct CoveredGround {
    places: Vec<Point2<f64>>,
    /// Borders that were taken: the columns beside several edges are the same.
    borders: Vec<Point2<f64>>,
}

impl Default for CoveredGround {
    fn default() -> Self {
        Self { places: Vec::with_capacity(MAX_PLACES), borders: Vec::with_capacity(MAX_COLUMNS) }
    }
}

impl CoveredGround {
    /// Takes the ground from the robot at `robot` (odometry frame) to each of `borders` (robot frame, m), the nearest places in view in the
    /// columns that something covers, without what is `free` (robot frame, m).
    pub fn look(
        &mut self,
        robot: Pose2,
        borders: impl Iterator<Item = Point2<f64>>,
        free: impl Fn(Point2<f64>) -> bool,
    ) {
        self.forget();
        self.borders.clear();
        for border in borders {
            if self.borders.len() == MAX_COLUMNS || self.borders.contains(&border) {
                continue;
            }
            self.borders.push(border);
            let range_m = border.coords.norm();
            let cells = ((range_m - ROBOT_M) / CELL_M).ceil().max(0.0) as usize;
            let ray =
                (0..cells).map(|cell| Point2::from(border.coords * (1.0 - cell as f64 * CELL_M / range_m)));
            let covered = ray.filter(|&place| !free(place)).map(|place| robot.transform_point(place));
            self.places.extend(covered.take(MAX_PLACES - self.places.len()));
        }
    }

    /// Forgets all places: no picture shows them any more.
    pub fn forget(&mut self) {
        self.places.clear();
    }

    /// The places, odometry frame, m.
    pub fn places(&self) -> impl Iterator<Item = Point2<f64>> {
        self.places.iter().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ground_up_to_the_border_is_covered_but_for_what_is_free() {
        let mut ground = CoveredGround::default();
        let robot = Pose2::new(1.0, 2.0, std::f64::consts::FRAC_PI_2);
        let border = Point2::new(0.81, 0.0);
        ground.look(robot, [border].into_iter(), |_| false);
        let ahead_m: Vec<f64> = ground.places().map(|place| place.y - 2.0).collect();
        assert_eq!(ahead_m.len(), 11);
        assert!((ahead_m[0] - 0.81).abs() < 1e-9 && (ahead_m[10] - 0.31).abs() < 1e-9, "{ahead_m:?}");
        assert!(ground.places().all(|place| (place.x - 1.0).abs() < 1e-9));
        ground.look(robot, [border].into_iter(), |place| place.x < 0.6);
        assert_eq!(ground.places().count(), 5, "floor that was seen stays free");
        ground.look(robot, [border, Point2::new(0.81, 0.1), border].into_iter(), |_| false);
        assert_eq!(ground.places().count(), 22, "two edges of one thing have the same columns");
        ground.look(robot, [Point2::new(0.2, 0.1)].into_iter(), |_| false);
        assert_eq!(ground.places().count(), 0, "below the robot, and the last picture alone counts");
        ground.look(robot, [border].into_iter(), |_| false);
        ground.forget();
        assert_eq!(ground.places().count(), 0);
    }
}
