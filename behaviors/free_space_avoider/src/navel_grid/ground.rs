//! Projection of the grid onto the floor in front of the robot.

use nalgebra::{Point2, Vector2, Vector3};
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::message::FreeDirection;

use super::cells::GridSize;

/// Distance reported for floor that is free up to the horizon, m.
const FARTHEST_M: f64 = 20.0;

/// Maximum length by which an obstacle extends from marked cells into free ones, cells: a free cell may be covered by a
/// quarter.
const OVERHANG: f64 = 0.25;

/// Grid of a camera, projected onto the floor plane; body frame, m.
#[derive(Clone, Debug)]
pub struct GroundGrid {
    size: GridSize,
    /// Row by row from the bottom, left to right; `None` for a cell that shows no floor.
    floor: Vec<Option<CellFloor>>,
    /// Ends of free floor: for each column from the left, one for each number of free cells from 0 to all.
    ends: Vec<FreeDirection>,
}

/// Near edge of the floor on which an obstacle in a cell may stand; on each side a quarter of a cell larger than the
/// cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CellFloor {
    near_m: f64,
    left_m: f64,
    right_m: f64,
}

/// Rectangle of floor straight ahead of the robot's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swath {
    /// Length from the robot's center, m.
    pub length_m: f64,
    /// Half of the width, m.
    pub half_width_m: f64,
}

impl Swath {
    /// Returns a swath that is longer by `length_m` and wider by `side_m` on either side.
    #[must_use]
    pub fn enlarged(&self, length_m: f64, side_m: f64) -> Self {
        Self { length_m: self.length_m + length_m, half_width_m: self.half_width_m + side_m }
    }
}

impl GroundGrid {
    /// Projects a grid over the whole image of a camera.
    #[must_use]
    pub fn new(size: GridSize, camera: &Pinhole, mount: &Mount) -> Self {
        let projection = FloorProjection { camera, mount, size };
        let row_cells = |row| (0..size.columns).map(move |column| (column, row));
        Self {
            size,
            floor: (0..size.rows)
                .flat_map(row_cells)
                .map(|(column, row)| projection.floor(column, row))
                .collect(),
            ends: (0..size.columns)
                .flat_map(|column| (0..=size.rows).map(move |free| (column, free)))
                .map(|(column, free)| projection.end(column, free))
                .collect(),
        }
    }

    /// Returns the number of cells from the bottom that cover the visible part of the swath, for each column from the
    /// left. An obstacle in a higher cell stands outside the swath.
    #[must_use]
    pub fn cells_of(&self, swath: &Swath) -> Vec<u32> {
        let covers = |column: usize, row: usize| {
            self.floor[row * self.size.columns + column].is_some_and(|floor| {
                floor.near_m <= swath.length_m
                    && floor.right_m <= swath.half_width_m
                    && floor.left_m >= -swath.half_width_m
            })
        };
        (0..self.size.columns)
            .map(|column| {
                let highest = (0..self.size.rows).rev().find(|&row| covers(column, row));
                highest.map_or(0, |row| row as u32 + 1)
            })
            .collect()
    }

    /// Returns the distance ahead at which the bottom of the image's middle column shows the floor, m from the robot's
    /// center. `None` if it shows no floor.
    #[must_use]
    pub fn nearest_m(&self) -> Option<f64> {
        let floor = self.floor.get(self.size.columns / 2)?.as_ref()?;
        floor.near_m.is_finite().then_some(floor.near_m)
    }

    /// Returns the end of free floor of a column with `free` free cells from the bottom, as direction and distance from
    /// the robot's center: the near edge of the first cell that is not free, less the quarter of a cell by which an
    /// obstacle across the column may extend from it. A narrower obstacle may extend further. `None` for a column
    /// outside the grid.
    #[must_use]
    pub fn end(&self, column: usize, free: u32) -> Option<FreeDirection> {
        let free = (free as usize).min(self.size.rows);
        (column < self.size.columns).then(|| self.ends[column * (self.size.rows + 1) + free])
    }
}

impl GroundGrid {
    /// Returns the azimuths of the right and the left border of a column's farthest floor, rad, from the robot's center; `None`
    /// for a column outside the grid.
    #[must_use]
    pub fn borders(&self, column: usize) -> Option<(f64, f64)> {
        let azimuth = |column: usize| Some(self.end(column, self.size.rows as u32)?.azimuth_rad);
        let middle = azimuth(column)?;
        let to_left = column.checked_sub(1).and_then(azimuth).map(|left| left - middle);
        let to_right = azimuth(column + 1).map(|right| middle - right);
        let to_left = to_left.or(to_right)?;
        Some((middle - 0.5 * to_right.unwrap_or(to_left), middle + 0.5 * to_left))
    }
}

struct FloorProjection<'a> {
    camera: &'a Pinhole,
    mount: &'a Mount,
    size: GridSize,
}

impl FloorProjection<'_> {
    /// Returns the direction (body frame) through a point of the image, in cells from its left and from its bottom
    /// edge.
    fn ray(&self, from_left: f64, from_bottom: f64) -> Option<Vector3<f64>> {
        let k = self.camera.intrinsics();
        let u = f64::from(k.width) * from_left / self.size.columns as f64 - 0.5;
        let v = f64::from(k.height) * (1.0 - from_bottom / self.size.rows as f64) - 0.5;
        let ray = self.camera.normalized_from_pixel(Vector2::new(u, v))?.push(1.0);
        Some(self.mount.rotation_body_from_camera() * ray)
    }

    /// Returns the floor point at a point of the image; `None` at and above the horizon.
    fn point(&self, from_left: f64, from_bottom: f64) -> Option<Point2<f64>> {
        let ray = self.ray(from_left, from_bottom)?;
        if ray.z >= 0.0 || self.mount.z <= 0.0 {
            return None;
        }
        let share = self.mount.z / -ray.z;
        let point = Point2::new(self.mount.x + share * ray.x, self.mount.y + share * ray.y);
        point.coords.iter().all(|coordinate| coordinate.is_finite()).then_some(point)
    }

    fn floor(&self, column: usize, row: usize) -> Option<CellFloor> {
        let (column, bottom) = (column as f64, row as f64 - OVERHANG);
        let left = self.point(column - OVERHANG, bottom)?;
        let right = self.point(column + 1.0 + OVERHANG, bottom)?;
        // If the lower edge of a cell shows no floor, the whole cell shows none.
        self.point(column + 0.5, row as f64)?;
        Some(CellFloor {
            near_m: left.x.min(right.x),
            left_m: left.y.max(right.y),
            right_m: left.y.min(right.y),
        })
    }

    fn end(&self, column: usize, free: usize) -> FreeDirection {
        let column = column as f64;
        let bottom = free as f64 - OVERHANG;
        let along = [column, column + 0.5, column + 1.0].map(|from_left| self.point(from_left, bottom));
        let distance_m = along
            .iter()
            .map(|point| point.map_or(FARTHEST_M, |point| point.coords.norm()))
            .fold(FARTHEST_M, f64::min);
        let azimuth_rad = match along[1] {
            Some(point) => point.y.atan2(point.x),
            None => self.ray(column + 0.5, bottom).map_or(0.0, |ray| ray.y.atan2(ray.x)),
        };
        FreeDirection { azimuth_rad, distance_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::Intrinsics;

    fn grid(tilt_deg: f64) -> GroundGrid {
        let camera = Pinhole::ideal(Intrinsics::from_horizontal_fov(340, 180, 90_f64.to_radians()));
        GroundGrid::new(GridSize::PAPER, &camera, &Mount::tilted(0.6, tilt_deg.to_radians()))
    }

    #[test]
    fn distances_lie_on_the_ground_plane() {
        let grid = grid(28.0);
        // The lower edge of the third row from the bottom lies (139.5 - 89.5) px below the center; a quarter of a cell
        // is 5 px.
        let angle = 28_f64.to_radians() + (55.0_f64 / 170.0).atan();
        let end = grid.end(8, 2).unwrap();
        assert!((end.distance_m - 0.6 / angle.tan()).abs() < 1e-9 && end.azimuth_rad.abs() < 1e-9);
        assert!(grid.end(0, 2).unwrap().azimuth_rad > 0.5 && grid.end(16, 2).unwrap().azimuth_rad < -0.5);
        assert_eq!(grid.end(17, 0), None);
        let nearer = |free| grid.end(8, free).unwrap().distance_m < grid.end(8, free + 1).unwrap().distance_m;
        assert!((0..9).all(nearer));
    }

    #[test]
    fn a_swath_is_a_trapezoid_in_the_image() {
        let grid = grid(28.0);
        let swath = Swath { length_m: 1.6, half_width_m: 0.5 };
        let cells = grid.cells_of(&swath);
        let mut mirrored = cells.clone();
        mirrored.reverse();
        assert_eq!(cells, mirrored);
        assert!(cells[..9].is_sorted() && cells[8] == 6 && cells[0] == 0, "{cells:?}");
        let wider = grid.cells_of(&swath.enlarged(0.3, 0.3));
        assert!(wider.iter().zip(&cells).all(|(wide, narrow)| wide >= narrow), "{wider:?}");
        assert!(grid.cells_of(&Swath { length_m: 0.2, half_width_m: 0.5 }).iter().all(|&cells| cells == 0));
    }

    #[test]
    fn a_camera_that_looks_up_shows_no_floor() {
        assert_eq!(grid(-40.0).nearest_m(), None);
        assert!(grid(28.0).nearest_m().is_some_and(|near_m| near_m < 0.42));
        assert_eq!(grid(-40.0).end(3, 9).unwrap().distance_m, FARTHEST_M);
    }
}
