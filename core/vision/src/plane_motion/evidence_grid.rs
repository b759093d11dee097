//! Evidence that a place holds a thing, in a window of cells that rolls along with the robot.
//!
//! Cells lie in the odometry frame. Points of plane motion decide; edges, colors and sonars vote beside them.

use nalgebra::{Point2, Vector2};
use yamabico_geometry::{Hypotenuse, Pose2};

use super::log_odds::CellRules;
use super::motion_point::MotionPoint;
use super::sequential_test::PointClass;
use crate::rolling_window::RollingWindow;

/// Side of a cell, m.
pub const CELL_M: f64 = 0.1;
/// Cells on each side of the window: the robot sees 4 m in each direction.
pub const CELLS: usize = 96;
/// Log odds at or below which plane motion has said floor: votes of edges and colors are then ignored.
pub const FLOOR_SAID: f64 = -1.5;
/// Log odds above which a smoothed cell is a thing: steer around it.
pub const OCCUPIED: f64 = 1.2;
/// Log odds up to which votes of edges and colors alone may raise a cell.
const VOTE_CAP: f64 = 1.0;
/// Vote of an edge count, and of a color.
const VOTE: f64 = 0.3;
/// Log odds of a place of an echo, and of a place nearer than an echo.
const ECHO: f64 = 1.2;
const ECHO_FREE: f64 = -0.4;
/// Range up to which an echo marks its arc, m.
const ECHO_RANGE_M: f64 = 2.0;
/// Distance before an echo that is not free, m.
const ECHO_DEPTH_M: f64 = 0.1;

/// Distance up to which points count, m.
const RANGE_M: f64 = 4.0;
/// Maximum standard deviation of a thing's distance, m.
const MAX_RANGE_SIGMA_M: f64 = 0.35;
/// Weights of a thing's foot at one standard deviation nearer, at it, and at one farther.
const SPREAD: [(f64, f64); 3] = [(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)];

/// A sonar echo in the odometry frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// Pose of the transducer.
    pub sensor: Pose2,
    /// Range, m.
    pub range_m: f64,
    /// Half the opening angle of its cone, rad.
    pub half_cone: f64,
}

/// Rolling window of cells.
#[derive(Clone, Debug)]
pub struct EvidenceGrid {
    rules: CellRules,
    window: RollingWindow,
    /// Log odds by vision, and by sonars, which never clear the evidence of vision.
    vision: Vec<f32>,
    sonar: Vec<f32>,
    hit: Vec<f32>,
    free: Vec<f32>,
    smoothed: Vec<f32>,
    row: Vec<f32>,
}

impl EvidenceGrid {
    /// Creates an empty grid around the origin.
    #[must_use]
    pub fn new(rules: CellRules) -> Self {
        let blank = vec![0.0; CELLS * CELLS];
        Self {
            rules,
            window: RollingWindow::new(CELLS, CELL_M),
            vision: blank.clone(),
            sonar: blank.clone(),
            hit: blank.clone(),
            free: blank.clone(),
            smoothed: blank,
            row: vec![0.0; CELLS],
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.vision.fill(0.0);
        self.sonar.fill(0.0);
        self.smoothed.fill(0.0);
    }

    /// Moves the window to a robot at `position` and fades all evidence by `dt_s` seconds.
    pub fn advance(&mut self, position: Vector2<f64>, dt_s: f64) {
        let (vision, sonar) = (&mut self.vision, &mut self.sonar);
        self.window.advance(Point2::from(position), |slot| {
            vision[slot] = 0.0;
            sonar[slot] = 0.0;
        });
        let factor = self.rules.decay(dt_s.max(0.0)) as f32;
        for log_odds in self.vision.iter_mut().chain(&mut self.sonar) {
            *log_odds *= factor;
        }
    }

    /// Starts a picture.
    pub fn begin_picture(&mut self) {
        self.hit.fill(0.0);
        self.free.fill(0.0);
    }

    /// Adds a point above the floor, with its foot, log likelihood ratio and weight.
    pub fn add_above(&mut self, foot: Point2<f64>, log_ratio: f64, weight: f64) {
        if let Some(slot) = self.window.slot(foot) {
            self.hit[slot] += (weight * self.rules.evidence(self.rules.above, log_ratio)) as f32;
        }
    }

    /// Adds a point of the floor.
    pub fn add_floor(&mut self, point: Point2<f64>, log_ratio: f64) {
        self.add_free(point, self.rules.evidence(self.rules.floor, log_ratio));
    }

    /// Adds a mirror image, at the floor point that shows it.
    pub fn add_below(&mut self, point: Point2<f64>, log_ratio: f64) {
        self.add_free(point, self.rules.evidence(self.rules.below, log_ratio));
    }

    fn add_free(&mut self, point: Point2<f64>, evidence: f64) {
        if let Some(slot) = self.window.slot(point) {
            self.free[slot] += evidence as f32;
        }
    }

    /// Adds the points of a picture taken by a camera above `camera` (robot frame) from a robot at `robot` (odometry
    /// frame): floor and mirror images clear the place that shows them, things mark their feet.
    pub fn add_points(&mut self, points: &[MotionPoint], camera: Point2<f64>, robot: &Pose2) {
        self.begin_picture();
        for point in points {
            let is_near = (point.floor - camera).norm() < RANGE_M;
            match point.class {
                PointClass::Floor if is_near => {
                    self.add_floor(robot.transform_point(point.floor), point.advantage());
                }
                PointClass::Below if is_near => {
                    self.add_below(robot.transform_point(point.floor), point.advantage());
                }
                PointClass::Above if point.range_sigma_m < MAX_RANGE_SIGMA_M => {
                    let way = point.foot - camera;
                    let range_m = way.norm();
                    if range_m >= RANGE_M {
                        continue;
                    }
                    for (deviations, weight) in SPREAD {
                        let share = 1.0 + deviations * point.range_sigma_m / range_m.max(0.1);
                        let foot = robot.transform_point(camera + way * share);
                        self.add_above(foot, point.advantage(), weight);
                    }
                }
                _ => {}
            }
        }
        self.end_picture();
    }

    /// Ends a picture: adds the evidence of its points to the cells.
    pub fn end_picture(&mut self) {
        let rules = self.rules;
        for ((log_odds, &hit), &free) in self.vision.iter_mut().zip(&self.hit).zip(&self.free) {
            if hit > 0.0 || free > 0.0 {
                *log_odds = rules.add(f64::from(*log_odds), f64::from(hit), f64::from(free)) as f32;
            }
        }
    }

    /// Vote of an edge count or a color that `point` is a thing; never enough alone, and ignored where plane motion
    /// has said floor.
    pub fn vote_thing(&mut self, point: Point2<f64>) {
        let Some(slot) = self.window.slot(point) else { return };
        let log_odds = f64::from(self.vision[slot]);
        if log_odds > FLOOR_SAID && log_odds < VOTE_CAP {
            self.vision[slot] = (log_odds + VOTE).min(VOTE_CAP) as f32;
        }
    }

    /// Vote of a color that `point` is floor; never clears a thing.
    pub fn vote_floor(&mut self, point: Point2<f64>) {
        let Some(slot) = self.window.slot(point) else { return };
        let log_odds = f64::from(self.vision[slot]);
        if log_odds > FLOOR_SAID && log_odds < VOTE_CAP {
            self.vision[slot] = (log_odds - VOTE).max(FLOOR_SAID) as f32;
        }
    }

    /// Adds a sonar echo: its arc may hold a thing, and its cone before it is free at the height of the sonar, which
    /// clears no evidence of vision.
    pub fn add_echo(&mut self, echo: &Echo) {
        if !(echo.range_m.is_finite() && echo.range_m > 0.0) {
            return;
        }
        let reach_m = echo.range_m.min(ECHO_RANGE_M);
        let reach = (reach_m / CELL_M).ceil() as i64 + 1;
        let at = [self.window.number(echo.sensor.x), self.window.number(echo.sensor.y)];
        for y in at[1] - reach..=at[1] + reach {
            for x in at[0] - reach..=at[0] + reach {
                let center = self.window.middle([x, y]);
                let seen = echo.sensor.inverse().transform_point(center);
                let (range, bearing) = (seen.x.hypotenuse(seen.y), seen.y.atan2(seen.x));
                let Some(slot) = self.window.slot(center).filter(|_| bearing.abs() <= echo.half_cone) else {
                    continue;
                };
                let change = if range < echo.range_m - ECHO_DEPTH_M {
                    ECHO_FREE
                } else if range <= echo.range_m + 0.5 * CELL_M && echo.range_m < ECHO_RANGE_M {
                    ECHO
                } else {
                    continue;
                };
                let log_odds = f64::from(self.sonar[slot]) + change;
                self.sonar[slot] = log_odds.clamp(self.rules.min, self.rules.max) as f32;
            }
        }
    }

    /// Log odds of the cell at a point by vision and sonar; 0 outside the window.
    #[must_use]
    pub fn log_odds(&self, point: Point2<f64>) -> f64 {
        self.window.slot(point).map_or(0.0, |slot| f64::from(self.vision[slot] + self.sonar[slot].max(0.0)))
    }

    /// True if plane motion has said that there is floor at a point.
    #[must_use]
    pub fn is_floor(&self, point: Point2<f64>) -> bool {
        self.window.slot(point).is_some_and(|slot| f64::from(self.vision[slot]) <= FLOOR_SAID)
    }

    /// Smooths the window over 5 x 5 cells, for [`EvidenceGrid::smoothed`].
    pub fn smooth(&mut self) {
        // Gauss of 0.7 cells at the distances 0, 1 and 2.
        const KERNEL: [f32; 3] = [0.569_9, 0.205_4, 0.009_65];
        const N: usize = CELLS;
        for y in 0..N {
            for x in 0..N {
                let at = self.window.slot_of(x, y);
                self.row[x] = self.vision[at] + self.sonar[at].max(0.0);
            }
            let (row, out) = (&self.row, &mut self.hit[y * N..(y + 1) * N]);
            for (x, out) in out.iter_mut().enumerate() {
                let at = |d: usize| row[x.saturating_sub(d)] + row[(x + d).min(N - 1)];
                *out = KERNEL[0] * row[x] + KERNEL[1] * at(1) + KERNEL[2] * at(2);
            }
        }
        for y in 0..N {
            let row = |y: usize| &self.hit[y * N..(y + 1) * N];
            let (a, b, c) = (row(y.saturating_sub(2)), row(y.saturating_sub(1)), row(y));
            let (d, e) = (row((y + 1).min(N - 1)), row((y + 2).min(N - 1)));
            let out = &mut self.smoothed[y * N..(y + 1) * N];
            for x in 0..N {
                out[x] = KERNEL[0] * c[x] + KERNEL[1] * (b[x] + d[x]) + KERNEL[2] * (a[x] + e[x]);
            }
        }
    }

    /// Smoothed log odds, row by row from the lower corner of the window, as of the last [`EvidenceGrid::smooth`].
    #[must_use]
    pub fn smoothed(&self) -> &[f32] {
        &self.smoothed
    }

    /// Center of the window's cell with this index of [`EvidenceGrid::smoothed`], odometry frame, m.
    #[must_use]
    pub fn center(&self, index: usize) -> Point2<f64> {
        self.window.place(self.window.slot_of(index % CELLS, index / CELLS))
    }
}
