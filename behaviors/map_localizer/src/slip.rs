//! Test of odometry against motion that the camera observes, and their fusion.
//!
//! If both agree, they are fused by information; if the squared Mahalanobis distance exceeds the gate, the wheels have
//! slipped and the camera's motion alone is used.

use nalgebra::Matrix3;
use yamabico_core::geometry::{angle_difference, wrap_angle};

use crate::belief::{Belief, difference};

/// 99.9 % quantiles of the chi-squared distribution with one and with three degrees of freedom.
pub const SLIP_GATES: SlipGates = SlipGates { yaw: 10.828, motion: 16.266 };

/// Maximum squared Mahalanobis distances at which odometry and camera agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlipGates {
    /// For the angle alone: one degree of freedom.
    pub yaw: f64,
    /// For (x, y, theta): three degrees of freedom.
    pub motion: f64,
}

/// Angle with its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angle {
    /// Mean, rad.
    pub rad: f64,
    /// Variance, > 0, rad².
    pub variance: f64,
}

/// Result of comparing odometry with the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlipTest<T> {
    /// Squared Mahalanobis distance of the two.
    pub distance_squared: f64,
    /// True if the wheels have slipped.
    pub has_slipped: bool,
    /// Fused value, or the camera's alone after a slip.
    pub fused: T,
}

impl SlipGates {
    /// Compares the angle turned by odometry with the one that the camera observed.
    #[must_use]
    pub fn compare_yaw(&self, odometry: &Angle, camera: &Angle) -> SlipTest<Angle> {
        let off = angle_difference(camera.rad, odometry.rad);
        let total = odometry.variance + camera.variance;
        let distance_squared = off * off / total;
        let has_slipped = distance_squared.is_nan() || distance_squared > self.yaw;
        let share = odometry.variance / total;
        let fused = if has_slipped {
            *camera
        } else {
            Angle { rad: wrap_angle(odometry.rad + share * off), variance: share * camera.variance }
        };
        SlipTest { distance_squared, has_slipped, fused }
    }

    /// Compares a motion (x, y, theta) by odometry with the one that the camera observed; `None` if a covariance is
    /// singular.
    #[must_use]
    pub fn compare_motion(&self, odometry: &Belief, camera: &Belief) -> Option<SlipTest<Belief>> {
        let off = difference(&camera.pose, &odometry.pose);
        let inverse: Matrix3<f64> = (odometry.covariance + camera.covariance).try_inverse()?;
        let distance_squared = off.dot(&(inverse * off));
        let has_slipped = distance_squared.is_nan() || distance_squared > self.motion;
        let mut fused = *camera;
        if !has_slipped {
            fused = *odometry;
            fused.update_pose(camera, f64::INFINITY);
        }
        Some(SlipTest { distance_squared, has_slipped, fused })
    }
}
