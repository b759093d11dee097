//! A judged point of a picture.

use nalgebra::{Point2, Vector2};

use super::parallax;
use super::parallax_search::{EXPECTED_COST, SearchResult};
use super::sequential_test::{ClassCosts, PointClass};

/// Log likelihood ratio above which a picture decides a point.
const MIN_ADVANTAGE: f64 = 4.0;
/// Multiple of the expected cost above which nothing fits.
const FIT_LIMIT: f64 = 2.5;
/// Distance of the floor point from which a point may be a thing, m: nearer, the search does not reach mirror images of
/// lamps.
const MIN_THING_FLOOR_M: f64 = 1.3;
/// Heights of things, m: lower ones are floor, higher ones do not stand in the way.
const THING_M: std::ops::Range<f64> = 0.06..0.9;

/// A point of the current picture with its class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPoint {
    /// Pixel of the undistorted picture.
    pub pixel: Vector2<f32>,
    /// Class by this picture and its baselines. `Moving` if nothing fits: it moves, or was hidden before.
    pub class: PointClass,
    /// Costs of the classes.
    pub costs: ClassCosts,
    /// Floor point of the pixel in the robot frame, m.
    pub floor: Point2<f64>,
    /// Foot of the point in the robot frame if it stands above the floor, m.
    pub foot: Point2<f64>,
    /// Standard deviation of the distance from the camera to `foot`, m.
    pub range_sigma_m: f64,
    /// Height if the point stands above the floor, m.
    pub height_m: f64,
    /// Standard deviation of `height_m`, m.
    pub height_sigma_m: f64,
}

impl MotionPoint {
    /// Judges a point with the floor point `floor`, seen from a camera above `camera` at `camera_height_m`.
    #[must_use]
    pub fn new(
        pixel: Vector2<f32>,
        found: &SearchResult,
        floor: Point2<f64>,
        camera: Point2<f64>,
        camera_height_m: f64,
    ) -> Self {
        let [on_floor, above, below] = found.costs.map(f64::from);
        let costs = ClassCosts { floor: on_floor, above, below, expected: f64::from(EXPECTED_COST) };
        let ratio = f64::from(found.ratio).clamp(0.05, 20.0);
        let height_m = parallax::height_m(camera_height_m, ratio);
        let way = (floor - camera) / ratio;
        let fits = |cost: f64| cost <= FIT_LIMIT * costs.expected;
        let [floor_advantage, above_advantage, below_advantage] = costs.advantages();
        let contradicts_floor = found.is_agreed && on_floor > costs.expected;
        let is_thing = THING_M.contains(&height_m)
            && !found.is_at_end
            && contradicts_floor
            && (floor - camera).norm() > MIN_THING_FLOOR_M;
        let class = if above_advantage > MIN_ADVANTAGE && fits(above) && is_thing {
            PointClass::Above
        } else if floor_advantage > MIN_ADVANTAGE && fits(on_floor) {
            PointClass::Floor
        } else if below_advantage > MIN_ADVANTAGE && fits(below) {
            PointClass::Below
        } else if !fits(costs.best()) {
            PointClass::Moving
        } else {
            PointClass::Undecided
        };
        Self {
            pixel,
            class,
            costs,
            floor,
            foot: camera + way,
            range_sigma_m: (way.norm() * f64::from(found.ratio_sigma) / ratio).max(0.03),
            height_m,
            height_sigma_m: camera_height_m * f64::from(found.ratio_sigma) / (ratio * ratio),
        }
    }

    /// Log likelihood ratio of the point's class against the others; 0 if it is undecided or moves.
    #[must_use]
    pub fn advantage(&self) -> f64 {
        let [floor, above, below] = self.costs.advantages();
        match self.class {
            PointClass::Floor => floor,
            PointClass::Above => above,
            PointClass::Below => below,
            PointClass::Moving | PointClass::Undecided => 0.0,
        }
    }
}
