//! The floor as a camera sees it: where the cells of its pictures lie on it.

use nalgebra::{Point2, Vector2};
use yamabico_geometry::camera::{Mount, Pinhole};

use super::cells::CellImage;

/// Floor in the cells of a camera's pictures.
#[derive(Clone, Debug)]
pub(super) struct FloorView {
    columns: usize,
    /// Floor points of the cells, robot frame, m; NaN beyond the range.
    floor: Vec<Point2<f64>>,
    /// First row from above within the range.
    pub top: usize,
    /// Rows that an obstacle covers at least whose foot is in a row.
    pub height_rows: Vec<usize>,
    /// Row as far above the horizon as the top is below it; `None` beyond the picture.
    pub sky: Option<usize>,
    /// Camera on the floor, and direction of its view, robot frame.
    pub camera: Point2<f64>,
    forward: Vector2<f64>,
    /// Nearest floor that is seen in each column, camera frame: slope to the left, rising, and distance ahead, m.
    border: Vec<[f64; 2]>,
}

impl FloorView {
    /// Creates the view of a camera whose pictures have these cells, up to `max_range_m` (m), for obstacles from `min_height_m` (m) on.
    pub fn new(
        cells: &CellImage,
        pinhole: &Pinhole,
        mount: &Mount,
        max_range_m: f64,
        min_height_m: f64,
    ) -> Self {
        let [columns, rows] = cells.size();
        let rotation = mount.rotation_body_from_camera();
        let forward = Vector2::new(mount.pan.cos(), mount.pan.sin());
        let mut floor = vec![Point2::new(f64::NAN, f64::NAN); columns * rows];
        let mut height_rows = vec![usize::MAX; rows];
        let mut top = rows;
        for row in (0..rows).rev() {
            let mut nearest_m = f64::INFINITY;
            for column in 0..columns {
                let [u, v] = cells.middle(column, row);
                let Some(ray) = pinhole.ray_from_pixel(Vector2::new(u, v)) else { continue };
                let in_body = rotation * ray;
                let reach = mount.z / -in_body.z;
                let point = Point2::new(mount.x + reach * in_body.x, mount.y + reach * in_body.y);
                let ahead_m = forward.dot(&(point - Point2::new(mount.x, mount.y)));
                if in_body.z < -1e-6 && ahead_m > 0.0 && ahead_m <= max_range_m {
                    floor[row * columns + column] = point;
                    nearest_m = nearest_m.min(ahead_m);
                }
            }
            if nearest_m.is_finite() {
                top = row;
                let focal_rows =
                    pinhole.intrinsics().fy / (f64::from(pinhole.intrinsics().height) / rows as f64);
                height_rows[row] = ((min_height_m * focal_rows / nearest_m) as usize).max(2);
            } else {
                break;
            }
        }
        let middle = columns / 2;
        let rises = |row: usize| {
            let [u, v] = cells.middle(middle, row);
            pinhole.ray_from_pixel(Vector2::new(u, v)).is_some_and(|ray| (rotation * ray).z >= 0.0)
        };
        let horizon = (0..top).rev().find(|&row| rises(row));
        let camera = Point2::new(mount.x, mount.y);
        let left = Vector2::new(-forward.y, forward.x);
        let nearest = (0..columns).rev().map(|column| floor[(rows - 1) * columns + column] - camera);
        let border = nearest.map(|off| [left.dot(&off) / forward.dot(&off), forward.dot(&off)]).collect();
        Self {
            columns,
            floor,
            top,
            height_rows,
            sky: horizon.and_then(|row| (2 * row).checked_sub(top)),
            camera,
            forward,
            border,
        }
    }

    /// Place of a cell on the floor, robot frame, m; NaN beyond the range.
    pub fn place(&self, column: usize, row: usize) -> Point2<f64> {
        self.floor[row * self.columns + column]
    }

    /// True if the camera sees the floor at `place` (robot frame, m) where nothing hides it: it lies between the borders of the view,
    /// and not below it.
    pub fn shows(&self, place: Point2<f64>) -> bool {
        let off = place - self.camera;
        let ahead_m = self.forward.dot(&off);
        let slope = self.forward.perp(&off) / ahead_m;
        let column = self.border.partition_point(|[border, _]| *border < slope);
        let is_beside = column == 0 || column == self.border.len();
        ahead_m > 0.0 && !is_beside && ahead_m > self.border[column][1]
    }
}

#[cfg(test)]
mod tests {
    use yamabico_geometry::camera::Intrinsics;

    use super::*;

    fn view(tilt_rad: f64) -> FloorView {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.1));
        FloorView::new(&CellImage::new(256, 240), &pinhole, &Mount::tilted(0.5, tilt_rad), 5.0, 0.14)
    }

    #[test]
    fn the_view_begins_below_the_picture_and_ends_at_its_sides() {
        let view = view(0.15);
        let is_in_view = |x, y| view.shows(Point2::new(x, y));
        assert!(is_in_view(0.7, 0.0) && is_in_view(2.0, 0.8) && is_in_view(2.0, -0.8));
        // The lower border of the picture is at 0.63 m.
        assert!(
            !is_in_view(0.6, 0.0)
                && !is_in_view(1.0, 0.8)
                && !is_in_view(1.0, -0.8)
                && !is_in_view(-1.0, 0.0)
        );
    }

    #[test]
    fn the_sky_is_as_far_above_the_horizon_as_the_top_is_below_it() {
        // Rows of two pixels; the focal length is 209 pixels: the horizon is 31.6 pixels above the middle, and 5 m of range 20.9 below it.
        let seen = view(0.15);
        assert!((seen.top as i64 - 55).abs() <= 1, "{}", seen.top);
        let sky = seen.sky.expect("inside of the picture");
        assert!((sky as i64 - 33).abs() <= 3, "{sky}");
        assert_eq!(view(0.6).sky, None, "the horizon is above the picture");
    }
}
