//! Faint vertical steps of brightness on the floor, such as the sides of a box nearly as bright as the floor.
//!
//! A step is averaged over the height of a box in the image. Only bare floor, according to the map, is searched.

use crate::plumb_lines::{HALF_WIDTH_PX, PlumbLines};
use crate::regions::Regions;
use nalgebra::{Point2, Vector2, Vector3};
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::map::Wall;

/// Minimum and maximum distance of the foot of a step from the camera, m.
const FOOT_RANGE_M: (f64, f64) = (0.7, 3.6);
/// Height over which a step is averaged, m.
const HEIGHT_M: f64 = 0.3;
/// Minimum fraction of that height that must be in front of bare floor.
const MIN_SHARE: f64 = 0.5;
/// Minimum number of rows that a step is averaged over.
const MIN_ROWS: usize = 8;
/// Distance beyond the sides of the image up to which walls are considered, px: vertical lines may be inclined in the
/// image.
const BESIDE_PX: usize = 32;
/// Margin around the foot of a wall that is not searched, px.
const WALL_MARGIN_PX: f64 = 3.0;
/// Maximum position error of the pose when walls are projected, m.
const WALL_MARGIN_M: f64 = 0.06;
/// Distance at which the floor meets the horizon, m.
const HORIZON_M: f64 = 1e6;
/// Maximum margin along a ray that meets a wall at a small angle, m.
const MAX_MARGIN_M: f64 = 1.5;

/// Vertical step of brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FloorStep {
    /// Difference of brightness, gray levels, not negative.
    pub contrast: f64,
    /// Foot, px.
    pub foot: Vector2<f64>,
    /// Row of the upper end, px.
    pub top_v: f64,
}

/// Finder of the strongest step in each region, with its tables and buffers.
#[derive(Clone, Debug)]
pub struct FloorStepFinder {
    width: usize,
    height: usize,
    /// First row that is searched.
    first: usize,
    lines: PlumbLines,
    /// Row of the upper end of a step with its foot in each row from `first`; `None` if no foot is expected there.
    tops: Vec<Option<usize>>,
    /// Ray of each vertical line.
    rays: Vec<Ray>,
    position: Point2<f64>,
    focal_px: f64,
    eroded: Vec<usize>,
    feet: Vec<(usize, usize)>,
}

/// Ray on the floor that a vertical image line corresponds to: its direction (robot frame), and the row of its point
/// at distance r, (a + b r) / (c + d r).
#[derive(Clone, Copy, Debug)]
struct Ray {
    direction: Vector2<f64>,
    numerator: (f64, f64),
    denominator: (f64, f64),
}

impl Ray {
    fn row(&self, distance_m: f64) -> f64 {
        let denominator = self.denominator.0 + self.denominator.1 * distance_m;
        if denominator <= 0.0 {
            return f64::INFINITY;
        }
        (self.numerator.0 + self.numerator.1 * distance_m) / denominator
    }
}

impl FloorStepFinder {
    /// Creates the finder for a camera and its mount. Ignores lens distortion.
    #[must_use]
    pub fn new(camera: &Pinhole, mount: &Mount) -> Self {
        let k = camera.intrinsics();
        let (width, height) = (k.width as usize, k.height as usize);
        let body_from_camera = mount.rotation_body_from_camera();
        let camera_from_body = body_from_camera.transpose();
        let last = height as f64 - 1.0;
        let ray = |c: f64| {
            let pixel = k.normalized_from_pixel(Vector2::new(c, last));
            let direction = (body_from_camera * pixel.push(1.0)).xy();
            let direction = direction / direction.norm().max(1e-9);
            let ahead = camera_from_body * direction.push(0.0);
            let below = camera_from_body * Vector3::new(0.0, 0.0, -mount.z);
            Ray {
                direction,
                numerator: (k.fy * below.y + k.cy * below.z, k.fy * ahead.y + k.cy * ahead.z),
                denominator: (below.z, ahead.z),
            }
        };
        let rays: Vec<Ray> = (0..width + 2 * BESIDE_PX).map(|c| ray(c as f64 - BESIDE_PX as f64)).collect();
        let middle = rays[rays.len() / 2];
        let raised = |distance_m: f64| {
            let ahead = camera_from_body * middle.direction.push(0.0) * distance_m;
            let point = ahead + camera_from_body * Vector3::new(0.0, 0.0, HEIGHT_M - mount.z);
            k.cy + k.fy * point.y / point.z
        };
        let row_at = |distance_m: f64| middle.row(distance_m).clamp(0.0, last);
        let first = raised(FOOT_RANGE_M.1).clamp(0.0, last) as usize;
        let feet = row_at(FOOT_RANGE_M.1).ceil() as usize..=row_at(FOOT_RANGE_M.0).floor() as usize;
        let top = |v: usize| {
            // Distance of the floor in this row, and the row of the raised point there.
            let (n, d) = (middle.numerator, middle.denominator);
            let distance_m = (n.0 - v as f64 * d.0) / (v as f64 * d.1 - n.1);
            let is_foot = feet.contains(&v) && distance_m > 0.0;
            is_foot
                .then(|| (raised(distance_m).round().max(first as f64)) as usize)
                .filter(|&top| top + MIN_ROWS <= v)
        };
        Self {
            width,
            height,
            first,
            lines: PlumbLines::new(camera, mount, first),
            tops: (first..height).map(top).collect(),
            rays,
            position: Point2::new(mount.x, mount.y),
            focal_px: k.fx,
            eroded: vec![height; width],
            feet: vec![(0, 0); width],
        }
    }

    /// Writes the strongest step of each region to `strongest`, for a robot at `map_from_robot` among `walls` (map
    /// frame).
    pub fn find(
        &mut self,
        image: ImageView,
        walls: &[Wall],
        map_from_robot: &Pose2,
        regions: &Regions,
        strongest: &mut Vec<FloorStep>,
    ) {
        strongest.clear();
        strongest.resize(regions.count(), FloorStep::default());
        if (image.width(), image.height()) != (self.width, self.height) {
            return;
        }
        self.find_floor(walls, map_from_robot);
        let eroded = &self.eroded;
        self.lines.sum(image, |line| eroded[line]);
        // Smallest of the strongest steps found so far: a weaker step cannot replace any of them.
        let mut weakest = 0.0;
        for (i, top) in self.tops.iter().enumerate() {
            let Some(top) = *top else { continue };
            let v = self.first + i;
            let min_rows = (MIN_SHARE * (v - top) as f64).max(MIN_ROWS as f64) as usize;
            for c in 0..self.width {
                let from = top.max(self.eroded[c]);
                if from + min_rows > v {
                    continue;
                }
                let contrast = self.lines.mean(c, from, v).abs();
                if contrast <= weakest {
                    continue;
                }
                let u = self.lines.column(c, v);
                let best = &mut strongest[regions.of_column(u)];
                if contrast > best.contrast {
                    let foot = Vector2::new(u as f64, v as f64);
                    *best = FloorStep { contrast, foot, top_v: from as f64 };
                    weakest = strongest.iter().map(|step| step.contrast).fold(f64::INFINITY, f64::min);
                }
            }
        }
    }

    /// Returns the pixels (column, row) at the upper boundary of the floor searched last.
    pub fn floor(&self) -> impl Iterator<Item = (usize, usize)> {
        let lines = self.eroded.iter().enumerate().filter(|&(_, &v)| v < self.height);
        lines.map(|(c, &v)| (self.lines.column(c, v), v))
    }

    /// Returns the pixels (column, row) of the feet of the walls found last.
    pub fn feet(&self) -> impl Iterator<Item = (usize, usize)> {
        self.feet.iter().copied()
    }

    /// Sets the pixels of `mask` that show no bare floor, after the walls found last, or floor farther away than a foot is
    /// searched.
    pub fn cover_walls(&self, mask: &mut BitImage) {
        let farthest = self.tops.iter().position(Option::is_some).unwrap_or(self.tops.len());
        for v in 0..self.first + farthest {
            mask.row_mut(v).fill(u64::MAX);
        }
        for i in farthest..self.height - self.first {
            let columns = self.lines.columns(self.first + i);
            for (&u, _) in columns.iter().zip(&self.eroded).filter(|&(_, &floor)| self.first + i < floor) {
                mask.set(usize::from(u), self.first + i);
            }
        }
    }

    /// Finds the first row of bare floor of each vertical line, the lowest one among its neighbors.
    fn find_floor(&mut self, walls: &[Wall], map_from_robot: &Pose2) {
        let camera = map_from_robot.transform_point(self.position);
        self.eroded.fill(self.first);
        for (c, ray) in self.rays.iter().enumerate() {
            let direction = map_from_robot.rotate_vector(ray.direction);
            let meetings = walls.iter().filter_map(|wall| meeting(camera, direction, wall));
            let (nearest_m, margin_m) =
                meetings.fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a });
            let (floor, reach) = if nearest_m.is_finite() {
                let reach_px = self.focal_px * WALL_MARGIN_M / nearest_m.max(0.3);
                (ray.row((nearest_m - margin_m).max(0.0)) + WALL_MARGIN_PX, reach_px.ceil() as usize)
            } else {
                (ray.row(2.0 * FOOT_RANGE_M.1), 0)
            };
            // A finite distance: without a wall the row is that of the horizon.
            let foot =
                ray.row(nearest_m.min(HORIZON_M)).clamp(self.first as f64, self.height as f64 - 1.0) as usize;
            if let Some(place) = c.checked_sub(BESIDE_PX).and_then(|c| Some((c, self.feet.get_mut(c)?))) {
                let (c, kept) = place;
                *kept = (self.lines.column(c, foot), foot);
            }
            let floor = floor.clamp(self.first as f64, self.height as f64) as usize;
            let reach = HALF_WIDTH_PX + 2 + reach;
            let (first, end) =
                (c.saturating_sub(reach + BESIDE_PX), (c + reach + 1).saturating_sub(BESIDE_PX));
            for near in &mut self.eroded[first.min(self.width)..end.min(self.width)] {
                *near = floor.max(*near);
            }
        }
    }
}

/// Returns the distance from `camera` along the unit vector `direction` to a wall, and the decrease of that distance
/// if the wall were [`WALL_MARGIN_M`] nearer, m; `None` if the ray does not meet the wall.
fn meeting(camera: Point2<f64>, direction: Vector2<f64>, wall: &Wall) -> Option<(f64, f64)> {
    let run = wall.to - wall.from;
    let cross = direction.perp(&run);
    let between = wall.from - camera;
    let (t, s) = (between.perp(&run) / cross, between.perp(&direction) / cross);
    let margin_m = (WALL_MARGIN_M * run.norm() / cross.abs()).min(MAX_MARGIN_M);
    (t > 0.0 && (0.0..=1.0).contains(&s)).then_some((t, margin_m))
}
