//! Faint upright steps of brightness on the floor, such as the sides of a box nearly as bright as the floor.
//!
//! A step is averaged over the height that a box has in the picture, where speckle averages out. The derivative is sharpened,
//! so that soft gradients, such as reflections of windows in the floor, give nothing. Only what the map says is bare floor is
//! looked at.

use nalgebra::{Point2, Vector2, Vector3};
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_vision::map::Wall;
use yamabico_vision::vertical_edges::Regions;

/// Nearest and farthest foot of a step that is looked for, meters from the camera.
const REACH_M: (f64, f64) = (0.7, 3.6);
/// Height over which a step is averaged, meters.
const HEIGHT_M: f64 = 0.3;
/// Least share of that height that must lie before the floor, and least rows.
const MIN_SHARE: f64 = 0.5;
const MIN_ROWS: usize = 8;
/// Walls are looked for so far beyond the picture's sides: upright lines lean, columns.
const BESIDE_PX: usize = 32;
/// Half width of the derivative, columns.
const REACH_PX: usize = 4;
/// What a unit step gives in the derivative.
const UNIT: f64 = 3.0;
/// Around the foot of a wall nothing is looked at: this many pixels, and what the pose may be wrong by, meters.
const WALL_MARGIN_PX: f64 = 3.0;
const WALL_MARGIN_M: f64 = 0.06;
/// A ray along a wall keeps this (m) from where it meets it at most.
const LONGEST_MARGIN_M: f64 = 1.5;

/// The strongest step of a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Upright {
    /// Its height, gray levels, never negative.
    pub contrast: f64,
    /// Its foot, pixels.
    pub foot: Vector2<f64>,
    /// Row of its upper end, pixels.
    pub top_v: f64,
}

/// Finds the strongest step of each region; keeps its tables and buffers.
#[derive(Clone, Debug)]
pub struct Uprights {
    width: usize,
    height: usize,
    /// First row of the sums.
    first: usize,
    /// For each row from `first` and each upright line (named by its column in the last row): the column.
    columns: Vec<u16>,
    /// For each row from `first`: the row of the upper end of a step with its foot here; `first` where none is looked for.
    tops: Vec<Option<usize>>,
    /// For each upright line: its direction in plan, robot frame, and the row of a place on the floor at a distance (m).
    rays: Vec<Ray>,
    position: Point2<f64>,
    focal_px: f64,
    sums: Vec<i32>,
    eroded: Vec<usize>,
    feet: Vec<(usize, usize)>,
    derivative: Vec<i16>,
}

/// An upright line of the picture is a direction in plan; a place on the floor at the distance r has the row
/// (a + b r) / (c + d r).
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

impl Uprights {
    /// For a camera with its mount. Lens distortion is not looked at.
    #[must_use]
    pub fn new(camera: &Pinhole, mount: &Mount) -> Self {
        let k = camera.intrinsics();
        let (width, height) = (k.width as usize, k.height as usize);
        let body_from_camera = mount.rotation_body_from_camera();
        let camera_from_body = body_from_camera.transpose();
        let last = height as f64 - 1.0;
        let nadir = k.matrix() * camera_from_body * Vector3::new(0.0, 0.0, -1.0);
        let column = |c: f64, v: f64| {
            let rise = nadir.y - last * nadir.z;
            c + (v - last) * (nadir.x - c * nadir.z) / if rise.abs() < 1e-9 { 1e-9 } else { rise }
        };
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
        let first = raised(REACH_M.1).clamp(0.0, last) as usize;
        let feet = row_at(REACH_M.1).ceil() as usize..=row_at(REACH_M.0).floor() as usize;
        let top = |v: usize| {
            // Where the row's place on the floor is, and from there up.
            let (n, d) = (middle.numerator, middle.denominator);
            let distance_m = (n.0 - v as f64 * d.0) / (v as f64 * d.1 - n.1);
            let is_foot = feet.contains(&v) && distance_m > 0.0;
            is_foot
                .then(|| (raised(distance_m).round().max(first as f64)) as usize)
                .filter(|&top| top + MIN_ROWS <= v)
        };
        let columns = (first..height)
            .flat_map(|v| (0..width).map(move |c| (c, v)))
            .map(|(c, v)| column(c as f64, v as f64).round().clamp(0.0, width as f64 - 1.0) as u16)
            .collect();
        Self {
            width,
            height,
            first,
            columns,
            tops: (first..height).map(top).collect(),
            rays,
            position: Point2::new(mount.x, mount.y),
            focal_px: k.fx,
            sums: vec![0; (height - first) * width],
            eroded: vec![height; width],
            feet: vec![(0, 0); width],
            derivative: vec![0; width],
        }
    }

    /// Writes the strongest step of each region to `strongest`, for a robot at `map_from_robot` among `walls`.
    pub fn find(
        &mut self,
        image: ImageView,
        walls: &[Wall],
        map_from_robot: &Pose2,
        regions: &Regions,
        strongest: &mut Vec<Upright>,
    ) {
        strongest.clear();
        strongest.resize(regions.count(), Upright::default());
        if (image.width(), image.height()) != (self.width, self.height) {
            return;
        }
        self.find_floor(walls, map_from_robot);
        self.sum(image);
        // Of the strongest steps so far.
        let mut weakest = 0.0;
        for (i, top) in self.tops.iter().enumerate() {
            let Some(top) = *top else { continue };
            let v = self.first + i;
            let min_rows = (MIN_SHARE * (v - top) as f64).max(MIN_ROWS as f64) as usize;
            let row = i * self.width;
            for c in 0..self.width {
                let from = top.max(self.eroded[c]);
                if from + min_rows > v {
                    continue;
                }
                let above = (from - self.first) * self.width;
                let sum = self.sums[row + c] - self.sums[above + c];
                let (step, least) = (f64::from(sum.abs()), UNIT * (v - from) as f64);
                if step <= weakest * least {
                    continue;
                }
                let contrast = step / least;
                let u = usize::from(self.columns[row + c]);
                let best = &mut strongest[regions.of_column(u)];
                if contrast > best.contrast {
                    let foot = Vector2::new(u as f64, v as f64);
                    *best = Upright { contrast, foot, top_v: from as f64 };
                    weakest = strongest.iter().map(|step| step.contrast).fold(f64::INFINITY, f64::min);
                }
            }
        }
    }

    /// Columns and rows where the bare floor begins that was looked at last.
    pub fn floor(&self) -> impl Iterator<Item = (usize, usize)> {
        let lines = self.eroded.iter().enumerate().filter(|&(_, &v)| v < self.height);
        lines.map(|(c, &v)| (usize::from(self.columns[(v - self.first) * self.width + c]), v))
    }

    /// Columns and rows where the feet of the walls are that were looked at last.
    pub fn feet(&self) -> impl Iterator<Item = (usize, usize)> {
        self.feet.iter().copied()
    }

    /// The first row of bare floor of each upright line, and the lowest of its neighbors'.
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
                (ray.row(2.0 * REACH_M.1), 0)
            };
            let foot = ray.row(nearest_m).clamp(self.first as f64, self.height as f64 - 1.0) as usize;
            if let Some(place) = c.checked_sub(BESIDE_PX).and_then(|c| Some((c, self.feet.get_mut(c)?))) {
                let (c, kept) = place;
                *kept = (usize::from(self.columns[(foot - self.first) * self.width + c]), foot);
            }
            let floor = floor.clamp(self.first as f64, self.height as f64) as usize;
            let reach = REACH_PX + 2 + reach;
            let (first, end) =
                (c.saturating_sub(reach + BESIDE_PX), (c + reach + 1).saturating_sub(BESIDE_PX));
            for near in &mut self.eroded[first.min(self.width)..end.min(self.width)] {
                *near = floor.max(*near);
            }
        }
    }

    fn sum(&mut self, image: ImageView) {
        let width = self.width;
        self.sums[..width].fill(0);
        for v in self.first + 1..self.height {
            sharpened(image.row(v), &mut self.derivative);
            let at = (v - self.first) * width;
            let columns = &self.columns[at..at + width];
            let (before, here) = self.sums[at - width..at + width].split_at_mut(width);
            for c in 0..width {
                let step = if v > self.eroded[c] { self.derivative[usize::from(columns[c])] } else { 0 };
                here[c] = before[c] + i32::from(step);
            }
        }
    }
}

/// Distance from `camera` along the unit `direction` to a wall and how much of it a wall that is [`WALL_MARGIN_M`] nearer takes
/// away, meters; `None` where the ray does not meet it.
fn meeting(camera: Point2<f64>, direction: Vector2<f64>, wall: &Wall) -> Option<(f64, f64)> {
    let run = wall.to - wall.from;
    let cross = direction.perp(&run);
    let between = wall.from - camera;
    let (t, s) = (between.perp(&run) / cross, between.perp(&direction) / cross);
    let margin_m = (WALL_MARGIN_M * run.norm() / cross.abs()).min(LONGEST_MARGIN_M);
    (t > 0.0 && (0.0..=1.0).contains(&s)).then_some((t, margin_m))
}

/// The step between the neighbors of each pixel, less the slope around it: [`UNIT`] for a unit step, nothing for a slope.
fn sharpened(row: &[u8], out: &mut [i16]) {
    let width = row.len();
    out.fill(0);
    if width <= 2 * REACH_PX {
        return;
    }
    let inner = width - 2 * REACH_PX;
    let [a, b, c, d] = [0, REACH_PX - 1, REACH_PX + 1, 2 * REACH_PX].map(|start| &row[start..start + inner]);
    let out = &mut out[REACH_PX..REACH_PX + inner];
    for u in 0..inner {
        out[u] = 4 * (i16::from(c[u]) - i16::from(b[u])) - (i16::from(d[u]) - i16::from(a[u]));
    }
}
