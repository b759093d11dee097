//! Frames, angles, planar poses and twists: every sign convention of the project, stated once.
//!
//! - World, map, odometry, corridor and robot (body) frames follow REP-103: x forward (or along the corridor), y left,
//!   z up, floor at z = 0. A positive angle turns left, seen from above.
//! - The camera's optical frame is x right, y down, z forward (see [`crate::camera`]).
//! - A transform `a_from_b` takes the coordinates of a point from frame b to frame a; a point is named `point_in_a`.
//! - Lengths are metres, angles radians, times seconds. Angles are wrapped to (-pi, pi] by [`wrap_angle`] alone.

pub use crate::message::Twist;
use bytemuck::{Pod, Zeroable};
use nalgebra::{Matrix3, Point2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::ops::Mul;

/// Below this turn (rad) the arc's sine and cosine quotients are taken from their series.
const SMALL_TURN_RAD: f64 = 1e-4;

/// The same direction as `angle_rad`, wrapped to (-pi, pi]. A number that is not finite gives NaN.
#[must_use]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// The signed turn (rad, in (-pi, pi]) that leads from `from_rad` to `to_rad`; positive turns left.
#[must_use]
pub fn angle_difference(to_rad: f64, from_rad: f64) -> f64 {
    wrap_angle(to_rad - from_rad)
}

/// A planar pose: position and heading of frame b in frame a, which is also the transform `a_from_b`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Pod, Zeroable)]
#[serde(deny_unknown_fields)]
pub struct Pose2 {
    /// Position along x of the outer frame, metres.
    pub x: f64,
    /// Position along y of the outer frame, metres, positive to the left.
    pub y: f64,
    /// Heading, radians, positive to the left of the outer frame's x axis.
    pub theta: f64,
}

impl Pose2 {
    /// The pose at the origin with heading zero; the transform that changes nothing.
    pub const IDENTITY: Self = Self { x: 0.0, y: 0.0, theta: 0.0 };

    /// A pose from its position (m) and heading (rad, wrapped to (-pi, pi]).
    #[must_use]
    pub fn new(x: f64, y: f64, theta: f64) -> Self {
        Self { x, y, theta: wrap_angle(theta) }
    }

    /// `a_from_c` of `self` = `a_from_b` and the given `b_from_c`: the second pose seen from the first one's outer frame.
    #[must_use]
    pub fn compose(&self, b_from_c: &Self) -> Self {
        let p = self.transform_point(Point2::new(b_from_c.x, b_from_c.y));
        Self::new(p.x, p.y, self.theta + b_from_c.theta)
    }

    /// `b_from_a` of `self` = `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (sin, cos) = self.theta.sin_cos();
        Self::new(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, -self.theta)
    }

    /// The pose `other` (in the same outer frame) as seen from `self`: `self.inverse() * other`.
    #[must_use]
    pub fn relative(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// The point's coordinates in the outer frame, given those in this pose's frame.
    #[must_use]
    pub fn transform_point(&self, point_in_b: Point2<f64>) -> Point2<f64> {
        let (sin, cos) = self.theta.sin_cos();
        Point2::new(
            self.x + cos * point_in_b.x - sin * point_in_b.y,
            self.y + sin * point_in_b.x + cos * point_in_b.y,
        )
    }

    /// A free vector turned from this pose's frame into the outer frame (no translation).
    #[must_use]
    pub fn rotate_vector(&self, vector_in_b: Vector2<f64>) -> Vector2<f64> {
        let (sin, cos) = self.theta.sin_cos();
        Vector2::new(cos * vector_in_b.x - sin * vector_in_b.y, sin * vector_in_b.x + cos * vector_in_b.y)
    }

    /// Position in the outer frame, metres.
    #[must_use]
    pub fn position(&self) -> Point2<f64> {
        Point2::new(self.x, self.y)
    }

    /// Distance between the two origins, metres, never negative.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }

    /// The pose after moving with the constant body twist for `duration_s` (may be negative): the exact arc, not an
    /// Euler step.
    #[must_use]
    pub fn integrate(&self, twist: &Twist, duration_s: f64) -> Self {
        self.compose(&twist.exponential(duration_s))
    }

    /// The homogeneous 3x3 matrix of this transform, acting on (x, y, 1).
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        let (sin, cos) = self.theta.sin_cos();
        Matrix3::new(cos, -sin, self.x, sin, cos, self.y, 0.0, 0.0, 1.0)
    }

    /// Whether all three numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.theta.is_finite()
    }
}

impl Mul for Pose2 {
    type Output = Self;

    fn mul(self, b_from_c: Self) -> Self {
        self.compose(&b_from_c)
    }
}

impl Twist {
    /// A body twist from vx (m/s), vy (m/s, left) and omega (rad/s, left).
    #[must_use]
    pub const fn new(linear: f64, lateral: f64, angular: f64) -> Self {
        Self { linear, lateral, angular }
    }

    /// The motion `start_from_end` made by holding this twist for `duration_s`: the exponential map of SE(2), an arc.
    #[must_use]
    pub fn exponential(&self, duration_s: f64) -> Pose2 {
        let turn = self.angular * duration_s;
        let (along, across) = arc_quotients(turn);
        let (dx, dy) = (self.linear * duration_s, self.lateral * duration_s);
        Pose2::new(along * dx - across * dy, across * dx + along * dy, turn)
    }

    /// The constant twist that makes the motion `start_from_end` in `duration_s` > 0 along the shortest arc: the
    /// logarithm of SE(2), inverse of [`Twist::exponential`] for turns below pi.
    #[must_use]
    pub fn logarithm(start_from_end: &Pose2, duration_s: f64) -> Self {
        let (along, across) = arc_quotients(start_from_end.theta);
        let det = along * along + across * across;
        let dx = (along * start_from_end.x + across * start_from_end.y) / det;
        let dy = (along * start_from_end.y - across * start_from_end.x) / det;
        Self::new(dx / duration_s, dy / duration_s, start_from_end.theta / duration_s)
    }

    /// Speed of translation, m/s, never negative.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.linear.hypot(self.lateral)
    }
}

/// sin(a)/a and (1 - cos(a))/a, by their series near zero.
fn arc_quotients(turn_rad: f64) -> (f64, f64) {
    if turn_rad.abs() < SMALL_TURN_RAD {
        let square = turn_rad * turn_rad;
        return (1.0 - square / 6.0, turn_rad * (0.5 - square / 24.0));
    }
    let (sin, cos) = turn_rad.sin_cos();
    (sin / turn_rad, (1.0 - cos) / turn_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    pub use crate::message::Twist;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn close(a: &Pose2, b: &Pose2, tolerance: f64) -> bool {
        a.distance(b) < tolerance && angle_difference(a.theta, b.theta).abs() < tolerance
    }

    #[test]
    fn wrap_keeps_plus_pi_and_moves_minus_pi() {
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
        assert_eq!(wrap_angle(0.0), 0.0);
        assert!((wrap_angle(3.0 * FRAC_PI_2) + FRAC_PI_2).abs() < 1e-15);
        assert!(wrap_angle(f64::NAN).is_nan() && wrap_angle(f64::INFINITY).is_nan());
    }

    #[test]
    fn positive_angle_turns_left() {
        let left = Pose2::new(0.0, 0.0, FRAC_PI_2).transform_point(Point2::new(1.0, 0.0));
        assert!((left - Point2::new(0.0, 1.0)).norm() < 1e-15);
        let end = Pose2::IDENTITY.integrate(&Twist::new(1.0, 0.0, 0.5), 1.0);
        assert!(end.y > 0.0 && end.theta > 0.0);
        assert!((angle_difference(-3.0, 3.0) - (TAU - 6.0)).abs() < 1e-15);
    }

    #[test]
    fn quarter_circle_is_exact() {
        let end = Pose2::IDENTITY.integrate(&Twist::new(2.0, 0.0, 1.0), FRAC_PI_2);
        assert!(close(&end, &Pose2::new(2.0, 2.0, FRAC_PI_2), 1e-14));
        let sideways = Pose2::IDENTITY.integrate(&Twist::new(0.0, 2.0, 1.0), FRAC_PI_2);
        assert!(close(&sideways, &Pose2::new(-2.0, 2.0, FRAC_PI_2), 1e-14));
    }

    #[test]
    fn relative_pose_is_seen_from_self() {
        let robot = Pose2::new(1.0, 2.0, FRAC_PI_2);
        let ahead = robot.relative(&Pose2::new(1.0, 5.0, FRAC_PI_2));
        assert!(close(&ahead, &Pose2::new(3.0, 0.0, 0.0), 1e-14));
    }

    proptest! {
        #[test]
        fn inverse_undoes(x in -50.0..50.0, y in -50.0..50.0, theta in -4.0..4.0) {
            let pose = Pose2::new(x, y, theta);
            prop_assert!(close(&(pose * pose.inverse()), &Pose2::IDENTITY, 1e-12));
            prop_assert!((pose.matrix() * pose.inverse().matrix() - Matrix3::identity()).norm() < 1e-12);
        }

        #[test]
        fn wrap_is_the_same_direction(angle in -1e3..1e3) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-10);
            prop_assert!((wrapped.cos() - angle.cos()).abs() < 1e-10);
        }

        #[test]
        fn two_half_arcs_make_one(v in -2.0..2.0, w in -2.0..2.0, omega in -3.0..3.0, t in 0.0..2.0) {
            let twist = Twist::new(v, w, omega);
            let halves = Pose2::IDENTITY.integrate(&twist, t / 2.0).integrate(&twist, t / 2.0);
            // Where the series ends, 1 - cos(a) has lost half its digits: 3e-12 was the worst of 1.2e8 samples.
            prop_assert!(close(&halves, &Pose2::IDENTITY.integrate(&twist, t), 1e-11));
        }

        #[test]
        fn logarithm_inverts_the_exponential(v in -2.0..2.0, w in -2.0..2.0, omega in -3.0..3.0) {
            let back = Twist::logarithm(&Twist::new(v, w, omega).exponential(1.0), 1.0);
            prop_assert!((back.linear - v).abs() + (back.lateral - w).abs() + (back.angular - omega).abs() < 1e-9);
        }

        #[test]
        fn series_meets_the_closed_form(v in -2.0..2.0, sign in prop::bool::ANY) {
            let omega = if sign { SMALL_TURN_RAD } else { -SMALL_TURN_RAD };
            let below = Twist::new(v, 0.0, omega * 0.999_999).exponential(1.0);
            let above = Twist::new(v, 0.0, omega * 1.000_001).exponential(1.0);
            prop_assert!(close(&below, &above, 1e-9));
        }
    }
}
