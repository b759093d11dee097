//! Frames, angles, planar poses and twists: every sign convention of the project, stated once.
//!
//! - World, map, odometry, corridor and robot (body) frames follow REP-103: x forward (or along the corridor), y left,
//!   z up, floor at z = 0. A positive angle turns left, seen from above.
//! - The camera's optical frame is x right, y down, z forward (see [`crate::camera`]).
//! - A transform `a_from_b` takes the coordinates of a point from frame b to frame a; a point is named `point_in_a`.
//! - Lengths are meters, angles radians, times seconds. Angles are wrapped to (-pi, pi] by [`wrap_angle`] alone.

pub mod camera;
pub mod image;
mod pose;
mod twist;

use std::f64::consts::{PI, TAU};

pub use pose::Pose2;
pub use twist::{Axis, Twist};

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
