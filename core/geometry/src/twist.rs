//! Planar velocities and their exponential map.

use bytemuck::{Pod, Zeroable};
use serde::Serialize;

use crate::Hypotenuse;
use crate::Pose2;

/// Rotation, rad, below which sin(a)/a and (1 - cos(a))/a are computed from their series.
const SMALL_TURN_RAD: f64 = 1e-4;

/// An axis of motion in the robot frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum Axis {
    /// Forward speed, m/s.
    Linear = 0,
    /// Speed to the left, m/s.
    Lateral = 1,
    /// Turn rate, rad/s, positive to the left.
    Angular = 2,
}

impl Axis {
    /// All axes, in the order of [`Twist`].
    pub const ALL: [Axis; 3] = [Axis::Linear, Axis::Lateral, Axis::Angular];

    /// Name, lower case.
    pub const fn as_str(self) -> &'static str {
        match self {
            Axis::Linear => "linear",
            Axis::Lateral => "lateral",
            Axis::Angular => "angular",
        }
    }
}

/// A planar velocity in the robot frame (REP-103).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize)]
pub struct Twist {
    /// Forward speed, m/s.
    pub linear: f64,
    /// Speed to the left, m/s.
    pub lateral: f64,
    /// Turn rate, rad/s, positive to the left.
    pub angular: f64,
}

impl Twist {
    /// No motion.
    pub const ZERO: Twist = Twist { linear: 0.0, lateral: 0.0, angular: 0.0 };

    /// Creates a twist without lateral motion, as a differential drive has it.
    pub const fn planar(linear: f64, angular: f64) -> Twist {
        Twist { linear, lateral: 0.0, angular }
    }

    /// Returns the component along `axis`.
    pub const fn get(&self, axis: Axis) -> f64 {
        match axis {
            Axis::Linear => self.linear,
            Axis::Lateral => self.lateral,
            Axis::Angular => self.angular,
        }
    }

    /// Sets the component along `axis`.
    pub fn set(&mut self, axis: Axis, value: f64) {
        match axis {
            Axis::Linear => self.linear = value,
            Axis::Lateral => self.lateral = value,
            Axis::Angular => self.angular = value,
        }
    }

    /// Returns true if all components are finite.
    pub fn is_finite(&self) -> bool {
        self.linear.is_finite() && self.lateral.is_finite() && self.angular.is_finite()
    }
}

impl Twist {
    /// Creates a twist from forward speed (m/s), speed to the left (m/s) and turn rate (rad/s, positive to the left).
    #[must_use]
    pub const fn new(linear: f64, lateral: f64, angular: f64) -> Self {
        Self { linear, lateral, angular }
    }

    /// Returns the motion `start_from_end` of holding this twist for `duration_s`: the exponential map of SE(2), an
    /// arc.
    #[must_use]
    pub fn exponential(&self, duration_s: f64) -> Pose2 {
        let turn = self.angular * duration_s;
        let (along, across) = arc_quotients(turn);
        let (dx, dy) = (self.linear * duration_s, self.lateral * duration_s);
        Pose2::new(along * dx - across * dy, across * dx + along * dy, turn)
    }

    /// Returns the constant twist that makes the motion `start_from_end` in `duration_s` > 0: the logarithm of SE(2),
    /// inverse of [`Twist::exponential`] for rotations below pi.
    #[must_use]
    pub fn logarithm(start_from_end: &Pose2, duration_s: f64) -> Self {
        let (along, across) = arc_quotients(start_from_end.theta);
        let det = along * along + across * across;
        let dx = (along * start_from_end.x + across * start_from_end.y) / det;
        let dy = (along * start_from_end.y - across * start_from_end.x) / det;
        Self::new(dx / duration_s, dy / duration_s, start_from_end.theta / duration_s)
    }

    /// Returns the speed of translation, m/s, not negative.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.linear.hypotenuse(self.lateral)
    }
}

/// Returns sin(a)/a and (1 - cos(a))/a, from their series near zero.
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
    use nalgebra::{Matrix3, Point2};
    use std::f64::consts::{PI, TAU};

    use super::*;
    use crate::{angle_difference, wrap_angle};
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
