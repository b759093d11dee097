//! Joint estimate of the two edges as landmarks in the odometry frame; errors of the odometry are common to both.
//!
//! Kweon et al. (1991), section 4, have no such filter; it predicts the edges for the tracker, and refines their distance by
//! the robot's motion.

use std::ops::AddAssign;

use nalgebra::{
    Matrix2, Matrix2x3, Matrix4, Point2, RowVector2, RowVector4, SMatrix, Vector2, Vector3, Vector4,
};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::odometry_track::travel;

use crate::finder::Side;

/// Variance of the odometry's heading per radian turned (rad) and per meter driven (rad^2/m):
/// wheels that slip by 5 mm in a meter, 0.36 m apart, twist the robot by 0.02 rad.
const HEADING_VARIANCE: [f64; 2] = [1e-3, 4e-4];
/// Variance of the odometry's position per meter driven, m^2/m.
const POSITION_VARIANCE_PER_METER: f64 = 2e-4;
/// Standard deviation of the speeds (m/s, rad/s) of a robot without odometry.
const BLIND_SPEEDS: [f64; 2] = [0.4, 0.3];
/// Standard deviation of a tracked column, pixels.
const COLUMN_SIGMA_PX: f64 = 0.4;
/// Gate of the squared Mahalanobis distance.
const GATE: f64 = 12.25;

/// Motion of the robot since the last frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// From one pose in the odometry frame to another.
    Between(Pose2, Pose2),
    /// Unknown: there is no odometry.
    Unknown {
        /// Time since the last frame, s.
        elapsed_s: f64,
    },
}

/// The intersection relative to the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// Mean bearing of the two edges, rad, positive to the left.
    pub bearing: f64,
    /// Distance from the robot's center to the middle between the edges, along the robot's heading, m.
    pub distance_m: f64,
    /// Standard deviation of the distance, meters.
    pub sigma_m: f64,
}

/// Positions of the left and the right edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmarks {
    /// (x, y) of the left, then of the right edge, odometry frame, m.
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
}

/// Prediction of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Position, undistorted pixels.
    pub pixel: Vector2<f64>,
    /// Standard deviation of the column, pixels.
    pub sigma_px: f64,
    /// Depth along the optical axis, m.
    pub depth_m: f64,
    /// Slope, columns per row.
    pub lean: f64,
    slope: RowVector4<f64>,
}

impl Landmarks {
    /// Returns the estimate from two edges observed from `pose`: points and covariances in the robot frame.
    #[must_use]
    pub fn new(pose: &Pose2, points: [Point2<f64>; 2], covariances: [Matrix2<f64>; 2]) -> Self {
        let mut landmarks = Self { state: Vector4::zeros(), covariance: Matrix4::zeros() };
        for side in Side::BOTH {
            landmarks.place(pose, side, points[side.index()], &covariances[side.index()]);
        }
        landmarks
    }

    /// Replaces one edge, and drops its correlation with the other.
    pub fn place(
        &mut self,
        pose: &Pose2,
        side: Side,
        point_in_robot: Point2<f64>,
        covariance: &Matrix2<f64>,
    ) {
        let at = 2 * side.index();
        let turn = rotation(pose);
        self.state.fixed_rows_mut::<2>(at).copy_from(&pose.transform_point(point_in_robot).coords);
        self.covariance.fixed_view_mut::<2, 4>(at, 0).fill(0.0);
        self.covariance.fixed_view_mut::<4, 2>(0, at).fill(0.0);
        self.covariance.fixed_view_mut::<2, 2>(at, at).copy_from(&(turn * covariance * turn.transpose()));
    }

    /// Adds the uncertainty of the odometry, or of the unknown motion.
    pub fn predict(&mut self, motion: Motion) {
        let (pose, heading_variance, position_variance) = match motion {
            Motion::Between(from, to) => {
                let (meters, turned) = travel(&from, &to);
                let [per_radian, per_meter] = HEADING_VARIANCE;
                (to, per_radian * turned + per_meter * meters, POSITION_VARIANCE_PER_METER * meters)
            }
            Motion::Unknown { elapsed_s } => {
                let [meters, turned] = BLIND_SPEEDS.map(|speed| (speed * elapsed_s).powi(2));
                (Pose2::IDENTITY, turned, meters)
            }
        };
        let [left, right] = Side::BOTH.map(|side| self.point(side) - pose.position());
        let turning = Vector4::new(-left.y, left.x, -right.y, right.x);
        self.covariance += turning * turning.transpose() * heading_variance;
        for (row, column) in [(0, 0), (0, 2), (2, 0), (2, 2), (1, 1), (1, 3), (3, 1), (3, 3)] {
            self.covariance[(row, column)] += position_variance;
        }
    }

    /// Returns the position of an edge in the odometry frame, m.
    #[must_use]
    pub fn point(&self, side: Side) -> Point2<f64> {
        Point2::from(self.state.fixed_rows::<2>(2 * side.index()).into_owned())
    }

    /// Returns the middle between the edges in the frame of a robot at `pose`, m, and the standard deviation of its distance.
    #[must_use]
    pub fn middle(&self, pose: &Pose2) -> (Point2<f64>, f64) {
        let middle = nalgebra::center(&self.point(Side::Left), &self.point(Side::Right));
        let in_robot = pose.inverse().transform_point(middle);
        let (sin, cos) = pose.theta.sin_cos();
        let ahead = RowVector4::new(cos, sin, cos, sin) * 0.5;
        (in_robot, (ahead * self.covariance * ahead.transpose()).x.max(0.0).sqrt())
    }

    /// Returns the bearing of an edge from the camera of a robot at `pose`, in the robot frame, rad, positive to the left.
    #[must_use]
    pub fn bearing(&self, pose: &Pose2, side: Side, mount: &Mount) -> f64 {
        let point = pose.inverse().transform_point(self.point(side));
        (point.y - mount.y).atan2(point.x - mount.x)
    }

    /// Returns the prediction of an edge, `above_m` above the camera, in an image taken from `pose`; `None` behind the camera.
    #[must_use]
    pub fn expected(
        &self,
        pose: &Pose2,
        (side, above_m): (Side, f64),
        mount: &Mount,
        k: &Intrinsics,
    ) -> Option<Expected> {
        let point = pose.inverse().transform_point(self.point(side));
        let camera_from_body = mount.rotation_body_from_camera().transpose();
        let in_camera = camera_from_body * Vector3::new(point.x - mount.x, point.y - mount.y, above_m);
        let depth_m = in_camera.z;
        if depth_m < 0.1 || !depth_m.is_finite() {
            return None;
        }
        // Jacobian of the pixel with respect to the point in the camera frame.
        let by_camera = Matrix2x3::new(
            k.fx / depth_m,
            0.0,
            -k.fx * in_camera.x / (depth_m * depth_m),
            0.0,
            k.fy / depth_m,
            -k.fy * in_camera.y / (depth_m * depth_m),
        );
        let by_height = by_camera * camera_from_body.column(2);
        let by_robot: SMatrix<f64, 2, 2> = by_camera * camera_from_body.fixed_columns::<2>(0);
        let by_point: RowVector2<f64> = by_robot.row(0) * rotation(pose).transpose();
        let mut slope = RowVector4::zeros();
        slope.fixed_columns_mut::<2>(2 * side.index()).copy_from(&by_point);
        let variance = (slope * self.covariance * slope.transpose()).x.max(0.0);
        Some(Expected {
            pixel: k.pixel_from_normalized(in_camera.xy() / depth_m),
            sigma_px: variance.sqrt(),
            depth_m,
            lean: by_height.x / by_height.y,
            slope,
        })
    }

    /// Updates the estimate by the observed column (undistorted pixels) of an edge.
    pub fn observe_column(&mut self, expected: &Expected, column: f64) {
        let slope = expected.slope;
        let spread = self.covariance * slope.transpose();
        let noise = COLUMN_SIGMA_PX * COLUMN_SIGMA_PX;
        let gain = spread / ((slope * spread).x + noise);
        self.state += gain * (column - expected.pixel.x);
        let keep = Matrix4::identity() - gain * slope;
        self.covariance = keep * self.covariance * keep.transpose() + gain * gain.transpose() * noise;
    }

    /// Returns true if an observed point agrees with an edge within 3.5 standard deviations: point and covariance in the frame of
    /// a robot at `pose`.
    #[must_use]
    pub fn agrees(
        &self,
        pose: &Pose2,
        side: Side,
        point_in_robot: Point2<f64>,
        covariance: &Matrix2<f64>,
    ) -> bool {
        let at = 2 * side.index();
        let turn = rotation(pose);
        let total = self.covariance.fixed_view::<2, 2>(at, at) + turn * covariance * turn.transpose();
        let innovation = pose.transform_point(point_in_robot) - self.point(side);
        total.try_inverse().is_some_and(|inverse| (innovation.transpose() * inverse * innovation).x <= GATE)
    }

    /// Updates the estimate by an observed point: point and covariance in the frame of a robot at `pose`. Returns false, without
    /// an update, beyond 3.5 standard deviations.
    pub fn observe_point(
        &mut self,
        pose: &Pose2,
        side: Side,
        point_in_robot: Point2<f64>,
        covariance: &Matrix2<f64>,
    ) -> bool {
        if !self.agrees(pose, side, point_in_robot, covariance) {
            return false;
        }
        let at = 2 * side.index();
        let turn = rotation(pose);
        let noise = turn * covariance * turn.transpose();
        let innovation = pose.transform_point(point_in_robot) - self.point(side);
        let spread = self.covariance.fixed_columns::<2>(at).into_owned();
        let total = spread.fixed_rows::<2>(at) + noise;
        let Some(inverse) = total.try_inverse() else { return false };
        let gain = spread * inverse;
        self.state += gain * innovation;
        let mut keep = Matrix4::identity();
        keep.fixed_columns_mut::<2>(at).add_assign(-gain);
        self.covariance = keep * self.covariance * keep.transpose() + gain * noise * gain.transpose();
        true
    }
}

/// Returns the rotation from the robot frame to the odometry frame.
fn rotation(pose: &Pose2) -> Matrix2<f64> {
    let (sin, cos) = pose.theta.sin_cos();
    Matrix2::new(cos, -sin, sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> (Intrinsics, Mount) {
        (Intrinsics::from_horizontal_fov(640, 480, 1.2), Mount { x: 0.1, ..Mount::tilted(0.6, 0.1) })
    }

    fn landmarks(pose: &Pose2, far_m: f64, sigma_m: f64) -> Landmarks {
        let covariance = Matrix2::identity() * sigma_m * sigma_m;
        Landmarks::new(pose, [Point2::new(far_m, 1.0), Point2::new(far_m, -1.0)], [covariance; 2])
    }

    #[test]
    fn the_slope_matches_differences() {
        let (k, mount) = camera();
        let pose = Pose2::new(2.0, -1.0, 0.7);
        let edges = landmarks(&Pose2::new(1.5, -1.2, 0.6), 5.0, 0.1);
        for side in Side::BOTH {
            let at = edges.expected(&pose, (side, 0.7), &mount, &k).unwrap();
            for i in 0..4 {
                let shifted = |h: f64| {
                    let mut other = edges;
                    other.state[i] += h;
                    other.expected(&pose, (side, 0.7), &mount, &k).unwrap().pixel.x
                };
                let difference = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
                assert!((difference - at.slope[i]).abs() < 1e-5, "{side:?} {i}");
            }
        }
    }

    #[test]
    fn driving_towards_the_edges_tells_their_distance() {
        let (k, mount) = camera();
        let truth = landmarks(&Pose2::IDENTITY, 8.0, 0.0);
        let mut guess = landmarks(&Pose2::IDENTITY, 8.8, 0.6);
        let mut last = Pose2::IDENTITY;
        for step in 1..=100 {
            let pose = Pose2::new(0.04 * f64::from(step), 0.0, 0.0);
            guess.predict(Motion::Between(last, pose));
            for side in Side::BOTH {
                let column = truth.expected(&pose, (side, 0.0), &mount, &k).unwrap().pixel.x;
                let expected = guess.expected(&pose, (side, 0.0), &mount, &k).unwrap();
                guess.observe_column(&expected, column);
            }
            last = pose;
        }
        let (middle, sigma_m) = guess.middle(&last);
        assert!((middle.x - 4.0).abs() < 0.1 && middle.y.abs() < 0.01, "{middle:?}");
        assert!(sigma_m < 0.2 && (middle.x - 4.0).abs() < 3.0 * sigma_m, "{sigma_m}");
    }

    #[test]
    fn an_edge_elsewhere_is_not_taken() {
        let pose = Pose2::new(1.0, 0.0, 0.3);
        let mut edges = landmarks(&pose, 5.0, 0.1);
        let noise = Matrix2::identity() * 0.01;
        assert!(!edges.observe_point(&pose, Side::Right, Point2::new(6.0, -1.0), &noise));
        assert!(edges.observe_point(&pose, Side::Right, Point2::new(5.1, -1.0), &noise));
        let (middle, _) = edges.middle(&pose);
        assert!(middle.x > 5.0 && middle.x < 5.05, "{middle:?}");
    }

    #[test]
    fn edges_lean_towards_the_plumb_point_and_vanish_behind() {
        let (k, mount) = camera();
        let edges = landmarks(&Pose2::IDENTITY, 3.0, 0.1);
        let left = edges.expected(&Pose2::IDENTITY, (Side::Left, 0.0), &mount, &k).unwrap();
        assert!(left.pixel.x < k.cx && left.lean > 0.0, "{left:?}");
        assert!(edges.expected(&Pose2::new(9.0, 0.0, 0.0), (Side::Left, 0.0), &mount, &k).is_none());
    }
}
