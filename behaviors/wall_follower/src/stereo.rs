//! Height and lateral position of a wall's floor line from its slopes in two aligned pictures.
//!
//! Kweon et al. (1991), section 3.4. Differs from \[1\]: cotangents instead of tangents, so that a line under a camera is
//! no singular case.

use nalgebra::Vector2;
use thiserror::Error;

use yamabico_vision::corridor::heading::CameraAttitude;
use yamabico_vision::corridor::wall_distance::distance_over_height;

/// Smallest difference of the two cotangents that still tells a height.
pub const SMALLEST_PARALLAX: f64 = 1e-3;

/// A line along the corridor, placed by two cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoWall {
    /// Of the left camera above the line, meters, positive.
    pub height_m: f64,
    /// From the left camera to the line, meters, positive to the left.
    pub lateral_m: f64,
    /// Derivatives of the height with respect to the left and the right cotangent.
    pub height_gradient: Vector2<f64>,
    /// Derivatives of the lateral position with respect to the left and the right cotangent.
    pub lateral_gradient: Vector2<f64>,
}

/// Why two slopes give no wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum StereoError {
    /// The slopes hardly differ: a line at infinity, or two different lines.
    #[error("the two views do not differ")]
    NoParallax,
    /// The line lies above the cameras, or the slopes belong to two different lines.
    #[error("the line lies above the cameras")]
    NegativeHeight,
}

/// The line whose lateral-to-height ratios (cotangents, positive to the left) are `left` and `right` as seen by two
/// cameras, the second one `baseline_m` to the right of the first.
///
/// # Errors
/// `NoParallax` below [`SMALLEST_PARALLAX`] or for numbers that are not finite, `NegativeHeight` for a line above the cameras.
pub fn stereo_wall(left: f64, right: f64, baseline_m: f64) -> Result<StereoWall, StereoError> {
    let parallax = right - left;
    if parallax.abs() < SMALLEST_PARALLAX || !parallax.is_finite() {
        return Err(StereoError::NoParallax);
    }
    let height_m = baseline_m / parallax;
    if height_m <= 0.0 {
        return Err(StereoError::NegativeHeight);
    }
    let slope = height_m * height_m / baseline_m;
    Ok(StereoWall {
        height_m,
        lateral_m: height_m * left,
        height_gradient: Vector2::new(slope, -slope),
        lateral_gradient: Vector2::new(height_m + left * slope, -left * slope),
    })
}

/// The cotangent for [`stereo_wall`] from an inverse slope seen by a camera that is not aligned with the corridor.
#[must_use]
pub fn cotangent(inverse_slope: f64, attitude: CameraAttitude) -> f64 {
    distance_over_height(inverse_slope, attitude)
}

/// The part of the baseline (m) that lies across the corridor, for [`stereo_wall`] with cameras that share a heading.
#[must_use]
pub fn lateral_baseline(baseline_m: f64, attitude: CameraAttitude) -> f64 {
    baseline_m * attitude.heading.cos()
}

/// Whether the wall's line lies on the floor: its height within `tolerance_m` of the calibrated camera height.
#[must_use]
pub fn is_floor_line(wall: &StereoWall, camera_height_m: f64, tolerance_m: f64) -> bool {
    (wall.height_m - camera_height_m).abs() < tolerance_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_pair_sees_the_same_wall() {
        let attitude = CameraAttitude { heading: 0.15, tilt: 0.1 };
        let baseline = lateral_baseline(0.12, attitude);
        let (height, lateral) = (0.6, 0.9);
        let slope_of = |d: f64| {
            -(d / height + attitude.heading.sin() * attitude.tilt.tan()) * attitude.tilt.cos()
                / attitude.heading.cos()
        };
        let left = cotangent(slope_of(lateral), attitude);
        let right = cotangent(slope_of(lateral + baseline), attitude);
        let wall = stereo_wall(left, right, baseline).unwrap();
        assert!((wall.height_m - height).abs() < 1e-12 && (wall.lateral_m - lateral).abs() < 1e-12);
        assert!(is_floor_line(&wall, 0.55, 0.08) && !is_floor_line(&wall, 0.7, 0.08));
    }

    #[test]
    fn failures_are_named() {
        assert_eq!(stereo_wall(1.5, 1.5, 0.12), Err(StereoError::NoParallax));
        assert_eq!(stereo_wall(f64::NAN, 1.5, 0.12), Err(StereoError::NoParallax));
        assert_eq!(stereo_wall(1.5, 1.4, 0.12), Err(StereoError::NegativeHeight));
    }
}
