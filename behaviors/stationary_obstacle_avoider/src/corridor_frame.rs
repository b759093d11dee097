//! The frame of a corridor without a map: x along the corridor by odometry, y across it, the heading and the walls by the
//! messages of a behavior that sees the corridor.
//!
//! A Kalman filter estimates the robot's lateral position, its heading, and the lateral positions of both walls, which
//! are straight and almost parallel. The lateral position at the start is zero by definition.

use nalgebra::{Matrix4, Point2, Point3, Vector4};
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};
use yamabico_core::message::{Corridor, PathPoint};
use yamabico_vision::map::{Edge, Wall, WireFrame};

/// Minimum probability of a corridor that is used.
const MIN_PROBABILITY: f64 = 0.5;
/// Standard deviations that the odometry gains per meter: lateral position (m), heading (rad), lateral positions of the
/// walls (m).
const SIGMA_PER_M: [f64; 3] = [0.02, 0.02, 0.05];
/// Standard deviation of the heading that the odometry gains per radian of turning.
const SIGMA_PER_RAD: f64 = 0.05;
/// Minimum standard deviations of a measured heading (rad) and of a measured distance (m): errors of consecutive frames
/// are correlated.
const MIN_SIGMA: (f64, f64) = (0.005, 0.03);
/// Distance to a wall before the first measurement, and its standard deviation, m.
const UNKNOWN_WALL_M: f64 = 3.0;
/// Maximum standard deviation of the position of a known wall, m.
const MAX_WALL_SIGMA_M: f64 = 0.3;
/// Deviation from the prediction above which a measurement is rejected, standard deviations.
const MAX_DEVIATION: f64 = 4.0;
/// Number of rejections in a row after which the heading or a wall starts anew from the measurements.
const MAX_REJECTIONS: u32 = 10;
/// Length of the walls behind and ahead of the robot, m.
const WALL_REACH_M: (f64, f64) = (5.0, 25.0);
/// Ends of the path along the corridor, m.
const PATH_M: (f64, f64) = (-100.0, 1e4);

/// Robot and walls in the frame of a corridor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "SavedFrame", into = "SavedFrame")]
pub struct CorridorFrame {
    /// Position along the corridor, m.
    along_m: f64,
    /// Lateral position of the robot (m, positive left), heading (rad), lateral positions of the left and the right wall.
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
    /// Odometry at the state.
    odometry: Pose2,
    /// Numbers of rejections in a row: of the heading, the left, and the right wall.
    rejections: [u32; 3],
    /// True for the left and the right wall if they are left out.
    refuted: [bool; 2],
}

impl CorridorFrame {
    /// Creates the frame of a robot with unknown heading, where the odometry has the pose `odometry`.
    #[must_use]
    pub fn new(odometry: Pose2) -> Self {
        let wall = UNKNOWN_WALL_M * UNKNOWN_WALL_M;
        Self {
            along_m: 0.0,
            state: Vector4::new(0.0, 0.0, UNKNOWN_WALL_M, -UNKNOWN_WALL_M),
            covariance: Matrix4::from_diagonal(&Vector4::new(0.0, 1.0, wall, wall)),
            odometry,
            rejections: [0; 3],
            refuted: [false; 2],
        }
    }

    /// Moves the robot to where the odometry has the pose `odometry`, and takes in the corridor seen there. Returns false,
    /// and ignores it, if its heading is not finite, the standard deviation of that is NaN, or it is improbable.
    pub fn update(&mut self, corridor: &Corridor, odometry: Pose2) -> bool {
        let has_heading = corridor.heading_rad.is_finite() && !corridor.heading_sigma_rad.is_nan();
        let is_usable = has_heading && corridor.probability >= MIN_PROBABILITY;
        if !is_usable || !odometry.is_finite() {
            return false;
        }
        self.predict(odometry);
        let heading_sigma = corridor.heading_sigma_rad.max(MIN_SIGMA.0);
        let heading = angle_difference(corridor.heading_rad, self.state[1]);
        let is_rejected = !self.correct(Vector4::new(0.0, 1.0, 0.0, 0.0), heading, heading_sigma);
        self.count(0, is_rejected, 1.0);
        let sides = [
            (Vector4::new(-1.0, 0.0, 1.0, 0.0), corridor.left_m, corridor.left_sigma_m),
            (Vector4::new(1.0, 0.0, 0.0, -1.0), corridor.right_m, corridor.right_sigma_m),
        ];
        for (i, (row, distance_m, sigma_m)) in sides.into_iter().enumerate() {
            let deviation = distance_m - row.dot(&self.state);
            if deviation.is_finite() && !sigma_m.is_nan() {
                let is_rejected = !self.correct(row, deviation, sigma_m.max(MIN_SIGMA.1));
                self.count(i + 1, is_rejected, UNKNOWN_WALL_M * UNKNOWN_WALL_M);
            }
        }
        true
    }

    /// Returns the pose of the robot at the last update, corridor frame.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        Pose2::new(self.along_m, self.state[0], self.state[1])
    }

    /// Returns the standard deviation of the heading, rad.
    #[must_use]
    pub fn heading_sigma(&self) -> f64 {
        self.covariance[(1, 1)].max(0.0).sqrt()
    }

    /// Returns the lateral position of the left and of the right wall, m, positive left; `None` if it is unknown or
    /// left out.
    #[must_use]
    pub fn walls_m(&self) -> [Option<f64>; 2] {
        let walls = self.seen_walls_m();
        [0, 1].map(|side| walls[side].filter(|_| !self.refuted[side]))
    }

    /// Leaves out the left and the right wall where `walls` is true, until the next call: they are something else.
    pub fn refute(&mut self, walls: [bool; 2]) {
        self.refuted = walls;
    }

    /// Returns the same as [`walls_m`](Self::walls_m), with the walls that are left out.
    #[must_use]
    pub fn seen_walls_m(&self) -> [Option<f64>; 2] {
        [2, 3].map(|i| {
            // Relative to the robot: the common lateral drift does not matter.
            let between = self.covariance[(i, i)] + self.covariance[(0, 0)] - 2.0 * self.covariance[(0, i)];
            (between.max(0.0).sqrt() <= MAX_WALL_SIGMA_M).then(|| self.state[i])
        })
    }

    /// Writes the map of the empty corridor around the robot: its walls, with their floor lines as edges.
    pub fn draw(&self, map: &mut WireFrame) {
        let (from_x, to_x) = (self.along_m - WALL_REACH_M.0, self.along_m + WALL_REACH_M.1);
        let [left, right] = self.walls_m();
        let wall = |y: f64| Wall { from: Point2::new(from_x, y), to: Point2::new(to_x, y) };
        let edge = |y: f64| Edge::between(Point3::new(from_x, y, 0.0), Point3::new(to_x, y, 0.0));
        match (left, right) {
            (Some(left), Some(right)) => map.replace(&[edge(left), edge(right)], &[wall(left), wall(right)]),
            (Some(y), None) | (None, Some(y)) => map.replace(&[edge(y)], &[wall(y)]),
            (None, None) => map.replace(&[], &[]),
        }
    }

    /// Returns the path along the centerline, as two points in the corridor frame, and the lateral distance of the robot
    /// from it, m. Without both walls the path leads along y = 0.
    #[must_use]
    pub fn path(&self) -> ([PathPoint; 2], f64) {
        let center_m = match self.walls_m() {
            [Some(left), Some(right)] => 0.5 * (left + right),
            _ => 0.0,
        };
        ([PATH_M.0, PATH_M.1].map(|x| PathPoint { x, y: center_m }), self.state[0] - center_m)
    }

    /// Returns the progress of the robot along that path, m.
    #[must_use]
    pub fn progress_m(&self) -> f64 {
        self.along_m - PATH_M.0
    }

    fn predict(&mut self, odometry: Pose2) {
        let step = self.odometry.relative(&odometry);
        self.odometry = odometry;
        let moved = self.pose().compose(&step);
        let mut transition = Matrix4::identity();
        transition[(0, 1)] = moved.x - self.along_m;
        let (distance_m, turn) = (step.position().coords.norm(), step.theta.abs());
        let [lateral, heading, wall] = SIGMA_PER_M.map(|sigma| sigma * sigma * distance_m);
        let heading = heading + SIGMA_PER_RAD * SIGMA_PER_RAD * turn;
        let noise = Matrix4::from_diagonal(&Vector4::new(lateral, heading, wall, wall));
        self.covariance = transition * self.covariance * transition.transpose() + noise;
        self.along_m = moved.x;
        self.state[0] = moved.y;
        self.state[1] = moved.theta;
    }

    /// Counts whether a measurement of the heading (0), the left (1) or the right wall (2) was rejected; after too many in a row adds
    /// `variance` to the estimate, so that the next one is believed.
    fn count(&mut self, measured: usize, is_rejected: bool, variance: f64) {
        let rejections = &mut self.rejections[measured];
        *rejections = if is_rejected { *rejections + 1 } else { 0 };
        if *rejections > MAX_REJECTIONS {
            *rejections = 0;
            self.covariance[(measured + 1, measured + 1)] += variance;
        }
    }

    /// Corrects the state by a measurement that deviates by `deviation` from `row` times the state. Returns false if it
    /// is rejected.
    fn correct(&mut self, row: Vector4<f64>, deviation: f64, sigma: f64) -> bool {
        let gain = self.covariance * row;
        let variance = row.dot(&gain) + sigma * sigma;
        if deviation * deviation > MAX_DEVIATION * MAX_DEVIATION * variance {
            return false;
        }
        self.state += gain * (deviation / variance);
        self.state[1] = wrap_angle(self.state[1]);
        self.covariance -= gain * gain.transpose() / variance;
        true
    }
}

/// The frame as it is saved.
#[derive(Serialize, Deserialize)]
struct SavedFrame {
    along_m: f64,
    state: [f64; 4],
    covariance: [[f64; 4]; 4],
    odometry: Pose2,
    rejections: [u32; 3],
}

impl From<SavedFrame> for CorridorFrame {
    fn from(saved: SavedFrame) -> Self {
        let SavedFrame { along_m, state, covariance, odometry, rejections } = saved;
        Self {
            along_m,
            state: state.into(),
            covariance: covariance.into(),
            odometry,
            rejections,
            refuted: [false; 2],
        }
    }
}

impl From<CorridorFrame> for SavedFrame {
    fn from(frame: CorridorFrame) -> Self {
        let CorridorFrame { along_m, state, covariance, odometry, rejections, .. } = frame;
        Self { along_m, state: state.into(), covariance: covariance.into(), odometry, rejections }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corridor seen by a robot at lateral position `y` and heading `theta`, between walls at 1.0 and -0.8 m.
    fn seen(y: f64, theta: f64) -> Corridor {
        Corridor {
            heading_rad: theta,
            heading_sigma_rad: 0.01,
            left_m: 1.0 - y,
            left_sigma_m: 0.05,
            right_m: y + 0.8,
            right_sigma_m: 0.05,
            probability: 0.95,
            ..Corridor::default()
        }
    }

    #[test]
    fn the_robot_and_the_walls_are_found_and_followed() {
        let mut frame = CorridorFrame::new(Pose2::IDENTITY);
        assert_eq!(frame.walls_m(), [None, None]);
        // The odometry turns 3 degrees in 5 m that the robot does not.
        for i in 0..=50 {
            let x = 0.1 * f64::from(i);
            let odometry = Pose2::new(x, 0.0, 0.01 * x);
            assert!(frame.update(&seen(0.0, 0.0), odometry));
        }
        let (pose, [left, right]) = (frame.pose(), frame.walls_m());
        assert!((pose.x - 5.0).abs() < 0.02 && pose.theta.abs() < 0.01, "{pose:?}");
        let (left, right) = (left.expect("left") - pose.y, pose.y - right.expect("right"));
        assert!((left - 1.0).abs() < 0.03 && (right - 0.8).abs() < 0.03, "{left} {right}");
        let (path, lateral_m) = frame.path();
        assert!((lateral_m + 0.1).abs() < 0.03, "{lateral_m}");
        assert!((path[0].y - pose.y - 0.1).abs() < 0.03);
        assert!(frame.heading_sigma() < 0.01);
    }

    #[test]
    fn an_outlier_does_not_move_the_frame_but_a_new_corridor_does() {
        let mut frame = CorridorFrame::new(Pose2::IDENTITY);
        for _ in 0..20 {
            frame.update(&seen(0.0, 0.1), Pose2::IDENTITY);
        }
        let before = frame.clone();
        frame.update(&Corridor { left_m: 0.2, ..seen(0.0, 0.9) }, Pose2::IDENTITY);
        assert!((frame.pose().theta - before.pose().theta).abs() < 1e-9);
        for _ in 0..20 {
            frame.update(&seen(0.0, 0.9), Pose2::IDENTITY);
        }
        assert!((frame.pose().theta - 0.9).abs() < 0.01, "{:?}", frame.pose());
    }

    #[test]
    fn a_wall_that_steps_aside_does_not_put_the_heading_in_doubt() {
        let mut frame = CorridorFrame::new(Pose2::IDENTITY);
        for i in 0..20 + MAX_REJECTIONS {
            let left_m = if i < 20 { 1.0 } else { 2.5 };
            frame.update(&Corridor { left_m, ..seen(0.0, 0.1) }, Pose2::IDENTITY);
        }
        frame.update(&Corridor { left_m: 2.5, ..seen(0.0, 0.9) }, Pose2::IDENTITY);
        assert!((frame.pose().theta - 0.1).abs() < 0.01, "{:?}", frame.pose());
        frame.update(&Corridor { left_m: 2.5, ..seen(0.0, 0.1) }, Pose2::IDENTITY);
        let left_m = frame.walls_m()[0].expect("the wall") - frame.pose().y;
        assert!((left_m - 2.5).abs() < 0.1, "{left_m}");
    }

    #[test]
    fn a_wall_that_is_left_out_bounds_nothing_until_it_is_one_again() {
        let mut frame = CorridorFrame::new(Pose2::IDENTITY);
        for _ in 0..20 {
            frame.update(&seen(0.0, 0.0), Pose2::IDENTITY);
        }
        let (both, mut map) = (frame.walls_m(), WireFrame::default());
        frame.refute([false, true]);
        assert_eq!((frame.walls_m(), frame.seen_walls_m()), ([both[0], None], both));
        frame.draw(&mut map);
        assert_eq!((map.walls().len(), frame.path().0[0].y), (1, 0.0), "the path leads on from the start");
        frame.update(&seen(0.0, 0.0), Pose2::IDENTITY);
        assert!(frame.walls_m()[1].is_none());
        frame.refute([false; 2]);
        assert!(frame.walls_m()[1].is_some());
    }

    #[test]
    fn improbable_and_incomplete_corridors() {
        let mut frame = CorridorFrame::new(Pose2::IDENTITY);
        assert!(!frame.update(&Corridor { probability: 0.3, ..seen(0.0, 0.1) }, Pose2::IDENTITY));
        assert!(!frame.update(&Corridor { heading_rad: f64::NAN, ..seen(0.0, 0.1) }, Pose2::IDENTITY));
        assert!(!frame.update(&Corridor { heading_sigma_rad: f64::NAN, ..seen(0.0, 0.1) }, Pose2::IDENTITY));
        assert!(!frame.update(&Corridor { probability: f64::NAN, ..seen(0.0, 0.1) }, Pose2::IDENTITY));
        let one_sided = Corridor { left_m: f64::NAN, left_sigma_m: f64::NAN, ..seen(0.0, 0.1) };
        for _ in 0..5 {
            assert!(frame.update(&one_sided, Pose2::IDENTITY));
        }
        assert!(frame.walls_m()[0].is_none() && frame.walls_m()[1].is_some());
        let mut map = WireFrame::default();
        frame.draw(&mut map);
        assert_eq!((map.walls().len(), map.edges().len()), (1, 1));
        assert_eq!(frame.path().1, 0.0);
    }
}
