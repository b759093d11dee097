//! Geometry of a mobile robot: frames, angles, planar poses and twists, camera models and images.
//!
//! All sign conventions of the project are stated here:
//!
//! - World, map, odometry, corridor and robot (body) frames follow REP-103: x forward (or along the corridor), y left,
//!   z up, floor at z = 0. A positive angle turns to the left, viewed from above.
//! - The optical frame of a camera is x right, y down, z forward (see [`camera`]).
//! - A transform `a_from_b` maps the coordinates of a point from frame b to frame a; a point is named `point_in_a`.
//! - Lengths are in meters, angles in radians, times in seconds. [`wrap_angle`] wraps angles to (-pi, pi].
//!
//! | Item | Contents |
//! |---|---|
//! | [`Pose2`], [`Twist`], [`Axis`] | Planar poses and velocities, with the exponential map of SE(2) |
//! | [`camera`] | [`Pinhole`](camera::Pinhole), [`MirrorCamera`](camera::MirrorCamera), [`Mount`](camera::Mount) |
//! | [`image`] | [`ImageView`](image::ImageView), [`GrayImage`](image::GrayImage), [`RgbView`](image::RgbView) |
//!
//! ```
//! use nalgebra::Point3;
//! use yamabico_geometry::camera::{Intrinsics, Mount, Pinhole};
//! use yamabico_geometry::{Pose2, Twist};
//!
//! // One second on an arc to the left.
//! let end = Pose2::IDENTITY.integrate(&Twist::planar(0.5, 0.2), 1.0);
//! assert!(end.x < 0.5 && end.y > 0.0 && end.theta == 0.2);
//!
//! // A point on the floor, 3 m ahead and 0.5 m to the left, in a camera 0.6 m above the floor.
//! let camera = Pinhole::ideal(Intrinsics::from_horizontal_fov(640, 480, 60_f64.to_radians()));
//! let camera_from_body = Mount::tilted(0.6, 0.1).body_from_camera().inverse();
//! let pixel = camera.project(&(camera_from_body * Point3::new(3.0, 0.5, 0.0)))?;
//! assert!(pixel.x < 319.5 && pixel.y > 239.5, "left of and below the image center");
//! # Ok::<(), yamabico_geometry::camera::ProjectionError>(())
//! ```

pub mod camera;
mod hypotenuse;
pub mod image;
mod pose;
mod twist;

use std::f64::consts::{PI, TAU};

pub use hypotenuse::Hypotenuse;
pub use pose::Pose2;
pub use twist::{Axis, Twist};

/// Wraps an angle to (-pi, pi]. A non-finite angle gives NaN.
#[must_use]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// Returns the signed rotation from `from_rad` to `to_rad`, rad in (-pi, pi], positive to the left.
#[must_use]
pub fn angle_difference(to_rad: f64, from_rad: f64) -> f64 {
    wrap_angle(to_rad - from_rad)
}
