//! Detector of the ends of a corridor's walls: vertical edges on a floor line that does not continue behind them.
//!
//! Kweon et al. (1991), section 3.5.

use nalgebra::{Matrix2, Point2, Rotation2, Vector2, Vector3};
use yamabico_core::camera::Intrinsics;
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::image::ImageView;
use yamabico_vision::corridor::observer::{CorridorObservation, CorridorObserver};
use yamabico_vision::corridor::wall_distance::CorridorView;
use yamabico_vision::segments::Segment;

use crate::snap::{Brighter, SnapWindow, snap};
use crate::wall_foot::WallFoot;

/// Maximum angle between an edge and the vertical, rad.
const MAX_LEAN_RAD: f64 = 0.1;
/// Maximum height of an edge's lower end above the floor, m: about the height of a baseboard; and for an edge higher than
/// a door, whose lower part may lack contrast.
const MAX_FOOT_M: [f64; 2] = [0.2, 1.6];
/// Maximum distance of its lower end from the floor line, pixels at an image width of 640 px.
const FOOT_AT_640_PX: f64 = 5.0;
/// Minimum length of an edge, pixels at an image width of 640 px.
const MIN_LENGTH_AT_640_PX: f64 = 30.0;
/// Range of heights in which a faint edge is searched at the end of a wall's foot, m.
const FAINT_HEIGHTS_M: [f64; 2] = [0.05, 0.65];
/// Range of columns to either side in which it is searched, at an image width of 640 px.
const FAINT_REACH_AT_640_PX: f64 = 4.0;
/// Minimum height of the end of a wall whose upper end is visible: higher than any door, m.
const DOOR_HEIGHT_M: f64 = 2.15;
/// Maximum distance of a segment to an edge's line at which it belongs to the edge, pixels at an image width of 640 px.
const SAME_EDGE_AT_640_PX: f64 = 2.5;
/// Distance to the upper border at which an edge counts as cut off, pixels.
const UPPER_BORDER_PX: f64 = 3.0;
/// Standard deviation of an edge's column, pixels.
const COLUMN_SIGMA_PX: f64 = 1.0;
/// Maximum depth of a baseboard, as a fraction of the wall's distance.
const BASEBOARD_SHARE: f64 = 0.015;
/// Fraction of the distance between two edges that a floor line must cover to be a wall across the corridor.
const CLOSED_SHARE: f64 = 0.4;
/// Tolerance of the distance of such a line, as a fraction, in addition to two rows.
const CLOSED_TOLERANCE: f64 = 0.04;

/// Left or right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Positive lateral coordinate.
    Left,
    /// Negative lateral coordinate.
    Right,
}

impl Side {
    /// Both, the left one first.
    pub const BOTH: [Side; 2] = [Side::Left, Side::Right];

    /// 0 for the left, 1 for the right.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A vertical edge that may be the end of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallEnd {
    /// Side of the wall.
    pub side: Side,
    /// Base point on the floor line, undistorted pixels.
    pub base: Vector2<f64>,
    /// Position in the robot frame, m.
    pub point_in_robot: Point2<f64>,
    /// Covariance of the position, m^2.
    pub covariance: Matrix2<f64>,
    /// Distance from the camera along the corridor, m.
    pub ahead_m: f64,
    /// Standard deviation of `ahead_m`, meters.
    pub ahead_sigma_m: f64,
    /// True if the edge is visibly higher than a door.
    pub is_high: bool,
    /// Length in the image, pixels.
    pub length_px: f64,
}

/// Conditions for the end of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinderRule {
    /// Minimum and maximum distance along the corridor, m.
    pub range_m: [f64; 2],
    /// Minimum distance to the left and right border of the image, pixels.
    pub border_px: f64,
    /// Maximum difference along the corridor between the two ends of a pair, m; three standard deviations, if larger.
    pub pair_m: f64,
}

impl FinderRule {
    fn belong_together(&self, left: &WallEnd, right: &WallEnd) -> bool {
        let sigma_m = left.ahead_sigma_m.hypotenuse(right.ahead_sigma_m);
        (left.ahead_m - right.ahead_m).abs() < self.pair_m.max(3.0 * sigma_m)
    }
}

/// Finder of the ends of walls; reuses its buffer.
#[derive(Clone, Debug, Default)]
pub struct EndFinder {
    ends: Vec<WallEnd>,
}

/// Geometry of the current image.
struct Scene<'a> {
    sight: &'a CorridorObserver,
    sighting: &'a CorridorObservation,
    view: &'a CorridorView,
    rule: &'a FinderRule,
}

impl EndFinder {
    /// Finds all candidates in `image`, the last image of the observer.
    pub fn find(
        &mut self,
        image: ImageView<'_>,
        sight: &CorridorObserver,
        sighting: &CorridorObservation,
        rule: &FinderRule,
    ) -> &[WallEnd] {
        self.ends.clear();
        let Some(view) = sight.view() else { return &self.ends };
        let scene = Scene { sight, sighting, view, rule };
        for side in Side::BOTH {
            let Some(wall) = scene.wall(side) else { continue };
            let ends = sight.segments().iter().filter_map(|segment| scene.wall_end(segment, side, wall));
            let foot = WallFoot::new(image, sight, view, wall.distance_m);
            let ends = ends.filter(|end| {
                let goes_on = if end.is_high {
                    foot.goes_on_close_behind(end.ahead_m)
                } else {
                    foot.goes_on_behind(end.ahead_m)
                };
                !goes_on && foot.differs_at(end.ahead_m) && !foot.begins_at(end.ahead_m)
            });
            self.ends.extend(ends);
            if let Some(faint) = scene.faint_end(image, &foot, side, wall)
                && !self.ends.iter().any(|end| end.side == side && rule.belong_together(end, &faint))
            {
                self.ends.push(faint);
            }
        }
        self.remove_dead_ends(&scene);
        &self.ends
    }

    /// Returns all pairs of a left and a right end at the same distance along the corridor, with open floor between them.
    pub fn pairs(&self, rule: &FinderRule) -> impl Iterator<Item = [WallEnd; 2]> {
        let on = |side: Side| self.ends.iter().filter(move |end| end.side == side);
        let pairs = on(Side::Left).flat_map(move |left| on(Side::Right).map(move |right| [*left, *right]));
        pairs.filter(|[left, right]| rule.belong_together(left, right))
    }

    /// Returns the nearest of the [pairs](Self::pairs).
    #[must_use]
    pub fn pair(&self, rule: &FinderRule) -> Option<[WallEnd; 2]> {
        let ahead_m = |pair: &[WallEnd; 2]| 0.5 * (pair[0].ahead_m + pair[1].ahead_m);
        self.pairs(rule).min_by(|a, b| ahead_m(a).total_cmp(&ahead_m(b)))
    }

    /// Returns the ends found in the last image.
    #[must_use]
    pub fn ends(&self) -> &[WallEnd] {
        &self.ends
    }

    /// Removes ends with a wall between them, and all ends behind.
    fn remove_dead_ends(&mut self, scene: &Scene<'_>) {
        let closed = self
            .pairs(scene.rule)
            .filter(|[left, right]| scene.is_closed(left, right))
            .map(|[left, right]| left.ahead_m.min(right.ahead_m))
            .min_by(f64::total_cmp);
        if let Some(closed_m) = closed {
            self.ends.retain(|end| end.ahead_m < closed_m);
        }
    }
}

/// A wall relative to the camera.
#[derive(Clone, Copy)]
struct WallAt {
    distance_m: f64,
    sigma_m: f64,
}

/// Visible height of an edge.
enum Reach {
    /// At most as high as a door.
    Door,
    /// Cut off by the upper border, below the height of a door.
    OutOfImage,
    /// Higher than a door.
    High,
}

/// Position of a point on a wall's floor line.
struct Standing {
    point_in_robot: Point2<f64>,
    covariance: Matrix2<f64>,
    ahead_m: f64,
    ahead_sigma_m: f64,
}

/// Observation of an edge.
struct Seen {
    is_high: bool,
    length_px: f64,
}

impl Standing {
    fn end(&self, side: Side, base: Vector2<f64>, Seen { is_high, length_px }: Seen) -> WallEnd {
        let Standing { point_in_robot, covariance, ahead_m, ahead_sigma_m } = *self;
        WallEnd { side, base, point_in_robot, covariance, ahead_m, ahead_sigma_m, is_high, length_px }
    }
}

impl Scene<'_> {
    fn wall(&self, side: Side) -> Option<WallAt> {
        let wall = match side {
            Side::Left => self.sighting.left,
            Side::Right => self.sighting.right,
        }?;
        let mount = &self.sight.camera().mount;
        let (sin, cos) = self.sighting.heading.sin_cos();
        Some(WallAt { distance_m: wall.distance_m - mount.x * sin - mount.y * cos, sigma_m: wall.sigma_m })
    }

    fn wall_end(&self, segment: &Segment, side: Side, wall: WallAt) -> Option<WallEnd> {
        let intrinsics = &self.view.intrinsics;
        let scale = f64::from(intrinsics.width) / 640.0;
        if segment.length < MIN_LENGTH_AT_640_PX * scale || !is_upright(segment, self.view) {
            return None;
        }
        let edge = segment.normal.push(-segment.rho);
        let meeting = edge.cross(&floor_line(self.view, wall.distance_m));
        let base = meeting.xy() / meeting.z;
        let place = self.standing_at(base, wall)?;
        let lower_end = if segment.p0.y > segment.p1.y { segment.p0 } else { segment.p1 };
        let (highest_m, is_high) = match self.reach(segment, &place) {
            Reach::Door => return None,
            Reach::OutOfImage => (MAX_FOOT_M[0], false),
            Reach::High => (MAX_FOOT_M[1], true),
        };
        let highest_px = (highest_m * intrinsics.fy / place.ahead_m).max(FOOT_AT_640_PX * scale);
        let above_px = base.y - lower_end.y;
        if !(-FOOT_AT_640_PX * scale..=highest_px).contains(&above_px) {
            return None;
        }
        Some(place.end(side, base, Seen { is_high, length_px: segment.length }))
    }

    /// Returns the edge at the end of a wall's foot that is too faint to be a segment.
    fn faint_end(
        &self,
        image: ImageView<'_>,
        foot: &WallFoot<'_>,
        side: Side,
        wall: WallAt,
    ) -> Option<WallEnd> {
        let about_m = foot.end(self.rule.range_m[1])?;
        let [lower, upper] = FAINT_HEIGHTS_M.map(|height_m| foot.pixel(about_m, height_m));
        let (lower, upper) = (lower?, upper?);
        let middle = 0.5 * (lower + upper);
        let scale = f64::from(self.view.intrinsics.width) / 640.0;
        let edges = [Brighter::Left, Brighter::Right].map(|brighter| {
            let window = SnapWindow {
                middle,
                reach: (FAINT_REACH_AT_640_PX * scale).round().max(2.0) as usize,
                rows: (lower.y - upper.y).round().max(2.0) as usize,
                lean: (lower.x - upper.x) / (lower.y - upper.y),
                brighter,
            };
            snap(image, &window)
        });
        let edge = edges.into_iter().flatten().max_by(|a, b| a.gradient.total_cmp(&b.gradient))?;
        let pinhole = &self.sight.camera().pinhole;
        let ray = self.ray(pinhole.undistort_pixel(Vector2::new(edge.column, middle.y))?);
        let ahead_m = wall.distance_m * ray.x / ray.y;
        let base = pinhole.undistort_pixel(foot.pixel(ahead_m, 0.0)?)?;
        let is_end = foot.differs_at(ahead_m) && !foot.goes_on_behind(ahead_m) && !foot.begins_at(ahead_m);
        let place = self.standing_at(base, wall).filter(|_| is_end)?;
        Some(place.end(side, base, Seen { is_high: false, length_px: lower.y - upper.y }))
    }

    /// Returns the position of a pixel on a wall's floor line, if it is in view and in range.
    fn standing_at(&self, base: Vector2<f64>, wall: WallAt) -> Option<Standing> {
        let [nearest_m, farthest_m] = self.rule.range_m;
        let width = f64::from(self.view.intrinsics.width);
        let is_in_view = (self.rule.border_px..=width - 1.0 - self.rule.border_px).contains(&base.x);
        let place = self.place(base, wall).filter(|_| is_in_view);
        place.filter(|place| (nearest_m..=farthest_m).contains(&place.ahead_m))
    }

    /// Returns the position of a pixel on a wall's floor line; its bearing is exact, its distance as accurate as the wall's.
    fn place(&self, base: Vector2<f64>, wall: WallAt) -> Option<Standing> {
        let on_floor = self.view.floor_point(base)?;
        let (x, y) = (on_floor.x, wall.distance_m);
        if !x.is_finite() || x <= 0.1 {
            return None;
        }
        let from_camera = Vector2::new(x, y);
        let range_m = from_camera.norm();
        let bearing_sigma = COLUMN_SIGMA_PX / self.view.intrinsics.fx;
        let wall_share = (wall.sigma_m / y).hypotenuse(BASEBOARD_SHARE);
        let turned = bearing_sigma.hypotenuse(self.sighting.heading_sigma) * x / y.abs();
        let along = range_m * wall_share.hypotenuse(turned);
        let across = range_m * bearing_sigma;
        let robot_from_corridor = Rotation2::new(-self.sighting.heading);
        let turn = (robot_from_corridor * Rotation2::new(y.atan2(x))).into_inner();
        let mount = &self.sight.camera().mount;
        Some(Standing {
            point_in_robot: Point2::from(robot_from_corridor * from_camera + Vector2::new(mount.x, mount.y)),
            covariance: turn
                * Matrix2::from_diagonal(&Vector2::new(along * along, across * across))
                * turn.transpose(),
            ahead_m: x,
            ahead_sigma_m: along,
        })
    }

    /// Returns the visible height of an edge with all of its segments.
    fn reach(&self, edge: &Segment, place: &Standing) -> Reach {
        let aside_px = SAME_EDGE_AT_640_PX * f64::from(self.view.intrinsics.width) / 640.0;
        let of_edge = |piece: &&Segment| {
            edge.distance(piece.p0).abs() < aside_px
                && edge.distance(piece.p1).abs() < aside_px
                && is_upright(piece, self.view)
        };
        let upper_end = |piece: &Segment| if piece.p0.y < piece.p1.y { piece.p0 } else { piece.p1 };
        let pieces = self.sight.segments().iter().filter(of_edge);
        let Some(top) = pieces.map(upper_end).min_by(|a, b| a.y.total_cmp(&b.y)) else { return Reach::Door };
        // The whole edge is at the distance of its base.
        let ray = self.ray(top);
        let height_m = self.view.height_m + place.ahead_m * ray.z / ray.x;
        if height_m > DOOR_HEIGHT_M {
            Reach::High
        } else if top.y < UPPER_BORDER_PX {
            Reach::OutOfImage
        } else {
            Reach::Door
        }
    }

    /// Returns the direction of a pixel in the corridor's frame, not normalized.
    fn ray(&self, pixel: Vector2<f64>) -> Vector3<f64> {
        self.view.corridor_from_camera * self.view.intrinsics.normalized_from_pixel(pixel).push(1.0)
    }

    /// Returns true if a wall closes the corridor between the two ends.
    fn is_closed(&self, left: &WallEnd, right: &WallEnd) -> bool {
        let (from, to) = (left.base.x.min(right.base.x), left.base.x.max(right.base.x));
        let ahead_m = 0.5 * (left.ahead_m + right.ahead_m);
        let row_m = ahead_m.powi(2) / (self.view.height_m * self.view.intrinsics.fy);
        let tolerance_m = 2.0 * row_m + CLOSED_TOLERANCE * ahead_m;
        let covered: f64 = self
            .sight
            .segments()
            .iter()
            .filter(|line| line.direction().x.abs() > 0.9)
            .filter(|line| {
                let here =
                    |pixel| self.view.floor_point(pixel).is_some_and(|p| (p.x - ahead_m).abs() < tolerance_m);
                here(line.p0) && here(line.p1)
            })
            .map(|line| {
                let (a, b) = (line.p0.x.min(line.p1.x), line.p0.x.max(line.p1.x));
                (b.min(to) - a.max(from)).max(0.0)
            })
            .sum();
        covered > CLOSED_SHARE * (to - from)
    }
}

/// Returns the floor line of a wall at this signed distance from the camera, as a pixel line with unit normal.
#[must_use]
pub fn floor_line(view: &CorridorView, distance_m: f64) -> Vector3<f64> {
    let normal = Vector3::new(0.0, view.height_m, distance_m);
    let line = inverse_transposed(&view.intrinsics, view.corridor_from_camera.transpose() * normal);
    line / line.xy().norm()
}

/// Returns K^-T n.
fn inverse_transposed(k: &Intrinsics, n: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(n.x / k.fx, n.y / k.fy, n.z - n.x * k.cx / k.fx - n.y * k.cy / k.fy)
}

/// Returns true if the segment points to the vertical vanishing point.
fn is_upright(segment: &Segment, view: &CorridorView) -> bool {
    let plumb = view.intrinsics.matrix() * (view.corridor_from_camera.transpose() * Vector3::z());
    let middle = segment.midpoint();
    let towards = plumb.xy() - middle * plumb.z;
    let sine = segment.normal.dot(&towards) / towards.norm();
    sine.abs() < MAX_LEAN_RAD.sin()
}
