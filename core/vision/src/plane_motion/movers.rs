//! Things that walk: columns of points that fit no static place, tracked with constant velocity.

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Point2, Vector2, Vector4};
use yamabico_geometry::Pose2;

use super::floor_view::FloorView;
use super::motion_point::MotionPoint;
use super::sequential_test::PointClass;

/// Width of a strip of columns, px at a width of 256 px.
const STRIP_PX: f64 = 12.0;
const MAX_STRIPS: usize = 128;
/// Fewest points of a column that fit nothing.
const MIN_POINTS: u32 = 8;
/// Share of a column's points that fit nothing.
const MIN_SHARE: f64 = 0.5;
/// Widths of a walker at its foot, m.
const WIDTH_M: std::ops::Range<f64> = 0.2..0.8;
/// Distance up to which a walker is tracked, m.
const RANGE_M: f64 = 5.0;
/// White acceleration of a walker, m/s^2.
const ACCELERATION: f64 = 1.0;
/// Standard deviation of an unknown velocity, m/s.
const START_SPEED: f64 = 1.0;
/// Squared Mahalanobis distance up to which a sighting belongs to a track, 99 %.
const GATE: f64 = 9.21;
/// Sightings after which a track counts.
const CONFIRMED: u32 = 3;
/// Time without sighting after which a track ends, s.
const LOST_S: f64 = 1.0;
/// Smallest speed of a mover, m/s, and in standard deviations.
const MIN_SPEED: f64 = 0.2;
const MIN_SPEED_SIGMAS: f64 = 3.0;
const MAX_TRACKS: usize = 8;

/// Something that walks, odometry frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mover {
    /// Position (m) and velocity (m/s).
    pub state: Vector4<f64>,
    /// Covariance of `state`.
    pub covariance: Matrix4<f64>,
    /// Number of pictures that showed it.
    pub sightings: u32,
    /// Time of the last one, s.
    pub seen_s: f64,
}

impl Mover {
    /// Position, m.
    #[must_use]
    pub fn position(&self) -> Point2<f64> {
        self.state.xy().into()
    }

    /// Velocity, m/s.
    #[must_use]
    pub fn velocity(&self) -> Vector2<f64> {
        Vector2::new(self.state.z, self.state.w)
    }

    /// True if it was seen often enough and moves.
    #[must_use]
    pub fn is_confirmed(&self) -> bool {
        let speed = self.velocity().norm();
        let variance = self.covariance[(2, 2)].max(self.covariance[(3, 3)]);
        self.sightings >= CONFIRMED && speed > MIN_SPEED && speed > MIN_SPEED_SIGMAS * variance.sqrt()
    }

    /// Time until it comes within `radius_m` of a robot at `robot` that moves with `velocity` (odometry frame); `None`
    /// if it never does.
    #[must_use]
    pub fn time_to_contact(&self, robot: Point2<f64>, velocity: Vector2<f64>, radius_m: f64) -> Option<f64> {
        time_to_contact(self.position() - robot, self.velocity() - velocity, radius_m)
    }

    fn predict(&mut self, dt_s: f64) {
        let mut step = Matrix4::identity();
        (step[(0, 2)], step[(1, 3)]) = (dt_s, dt_s);
        self.state = step * self.state;
        self.covariance = step * self.covariance * step.transpose();
        let q = ACCELERATION * ACCELERATION;
        for axis in 0..2 {
            let (p, v) = (axis, axis + 2);
            self.covariance[(p, p)] += q * dt_s.powi(4) / 4.0;
            self.covariance[(p, v)] += q * dt_s.powi(3) / 2.0;
            self.covariance[(v, p)] += q * dt_s.powi(3) / 2.0;
            self.covariance[(v, v)] += q * dt_s * dt_s;
        }
    }

    /// Squared Mahalanobis distance of a sighting, with the gain of its update.
    fn innovation(&self, sighting: &Sighting) -> Option<(f64, Vector2<f64>, Matrix2<f64>)> {
        let residual = sighting.at.coords - self.state.xy();
        let spread = self.covariance.fixed_view::<2, 2>(0, 0) + sighting.covariance;
        let inverse = spread.try_inverse()?;
        Some((residual.dot(&(inverse * residual)), residual, inverse))
    }

    fn update(&mut self, sighting: &Sighting, at_s: f64) {
        let Some((_, residual, inverse)) = self.innovation(sighting) else { return };
        let gain = self.covariance.fixed_columns::<2>(0) * inverse;
        self.state += gain * residual;
        self.covariance -= gain * Matrix2x4::from(self.covariance.fixed_rows::<2>(0));
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
        self.sightings += 1;
        self.seen_s = at_s;
    }
}

/// First time, s, at which a point at `offset` (m) that moves with `velocity` (m/s) is within `radius_m` of the origin;
/// 0 if it already is, `None` if it never is.
#[must_use]
pub fn time_to_contact(offset: Vector2<f64>, velocity: Vector2<f64>, radius_m: f64) -> Option<f64> {
    let (a, b) = (velocity.norm_squared(), offset.dot(&velocity));
    let c = offset.norm_squared() - radius_m * radius_m;
    if c <= 0.0 {
        return Some(0.0);
    }
    let discriminant = b * b - a * c;
    (b < 0.0 && discriminant >= 0.0).then(|| c / (discriminant.sqrt() - b))
}

/// Foot of a column that fits nothing, odometry frame.
#[derive(Clone, Copy, Debug)]
struct Sighting {
    at: Point2<f64>,
    covariance: Matrix2<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Strip {
    unfit: u32,
    all: u32,
    /// Two lowest rows of points that fit nothing.
    lowest: [f32; 2],
}

/// Tracks walkers. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub struct MoverTracker {
    view: FloorView,
    strips: Vec<Strip>,
    sightings: Vec<Sighting>,
    tracks: Vec<Mover>,
    time_s: f64,
}

impl MoverTracker {
    /// Creates a tracker for a camera.
    #[must_use]
    pub fn new(view: FloorView) -> Self {
        Self {
            view,
            strips: Vec::with_capacity(MAX_STRIPS),
            sightings: Vec::with_capacity(MAX_STRIPS),
            tracks: Vec::with_capacity(MAX_TRACKS),
            time_s: 0.0,
        }
    }

    /// Adds the points of a picture taken at `odometry` and `at_s` (s); returns all tracks, confirmed or not.
    pub fn update(&mut self, points: &[MotionPoint], odometry: &Pose2, at_s: f64) -> &[Mover] {
        let dt_s = (at_s - self.time_s).clamp(0.0, LOST_S);
        self.time_s = at_s;
        self.tracks.iter_mut().for_each(|track| track.predict(dt_s));
        self.find_columns(points, odometry);
        for sighting in &self.sightings {
            let distance = |track: &Mover| track.innovation(sighting).map_or(f64::INFINITY, |found| found.0);
            let has_room = self.tracks.len() < MAX_TRACKS;
            let best = self.tracks.iter_mut().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            match best.filter(|track| distance(track) < GATE) {
                Some(track) => track.update(sighting, at_s),
                None if has_room => self.tracks.push(start(sighting, at_s)),
                None => {}
            }
        }
        self.tracks.retain(|track| at_s - track.seen_s <= LOST_S);
        &self.tracks
    }

    /// All tracks, confirmed or not.
    #[must_use]
    pub fn tracks(&self) -> &[Mover] {
        &self.tracks
    }

    /// Forgets all tracks.
    pub fn clear(&mut self) {
        self.tracks.clear();
    }

    fn find_columns(&mut self, points: &[MotionPoint], odometry: &Pose2) {
        self.sightings.clear();
        let width = f64::from(self.view.intrinsics().width);
        let strip_px = STRIP_PX * width / 256.0;
        self.strips.clear();
        self.strips.resize(((width / strip_px).ceil() as usize).min(MAX_STRIPS), Strip::default());
        for point in points {
            let Some(strip) = self.strips.get_mut((f64::from(point.pixel.x) / strip_px) as usize) else {
                continue;
            };
            strip.all += 1;
            if point.class == PointClass::Moving {
                strip.unfit += 1;
                let row = point.pixel.y;
                let [low, next] = strip.lowest;
                strip.lowest = if row > low { [row, low] } else { [low, next.max(row)] };
            }
        }
        let is_unfit =
            |strip: &Strip| strip.unfit >= 2 && f64::from(strip.unfit) >= MIN_SHARE * f64::from(strip.all);
        let mut begin = 0;
        for column in self.strips.chunk_by(|a, b| is_unfit(a) == is_unfit(b)) {
            let end = begin + column.len();
            let count: u32 = column.iter().map(|strip| strip.unfit).sum();
            if column.first().is_some_and(is_unfit) && count >= MIN_POINTS {
                let middle = 0.5 * (begin + end) as f64 * strip_px;
                // The second lowest point: a single one may be chance.
                let row = column.iter().map(|strip| strip.lowest[1]).fold(0.0, f32::max);
                let pixel = Vector2::new(middle, f64::from(row));
                let width_px = column.len() as f64 * strip_px;
                self.sightings.extend(sighting(&self.view, pixel, width_px, odometry));
            }
            begin = end;
        }
    }
}

fn sighting(view: &FloorView, pixel: Vector2<f64>, width_px: f64, odometry: &Pose2) -> Option<Sighting> {
    let foot = view.floor_point(pixel)?;
    let way = foot.coords - view.position().xy();
    let range_m = way.norm();
    let width_m = range_m * width_px / view.intrinsics().fx;
    if range_m > RANGE_M || !WIDTH_M.contains(&width_m) {
        return None;
    }
    // Rows tell the distance badly, columns the bearing well.
    let (along, across) = (0.05 + 0.1 * range_m, 0.05 + 0.02 * range_m);
    let sight = odometry.rotate_vector(way / range_m);
    let aside = Vector2::new(-sight.y, sight.x);
    let covariance =
        sight * sight.transpose() * (along * along) + aside * aside.transpose() * (across * across);
    Some(Sighting { at: odometry.transform_point(foot), covariance })
}

fn start(sighting: &Sighting, at_s: f64) -> Mover {
    let mut covariance = Matrix4::identity() * (START_SPEED * START_SPEED);
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&sighting.covariance);
    Mover {
        state: Vector4::new(sighting.at.x, sighting.at.y, 0.0, 0.0),
        covariance,
        sightings: 1,
        seen_s: at_s,
    }
}
