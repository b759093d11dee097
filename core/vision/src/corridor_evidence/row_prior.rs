//! Prior of the vanishing point's row, from what is known of the horizon. The column has no prior.

use super::picture::Picture;
use nalgebra::{Vector2, Vector3};
use yamabico_geometry::Hypotenuse;
use yamabico_geometry::camera::{Calibration, Mount};

/// Standard deviation of a measured mount's tilt, rad.
pub const MOUNT_SIGMA_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;
/// Standard deviation of the horizon of a guessed camera, heights of the image. It only breaks ties, since the frame may be
/// cropped.
pub const GUESSED_SIGMA_HEIGHTS: f64 = 1.0;
/// Weight of all other rows in the prior of a tracked row.
const ANYWHERE: f64 = 0.05;
/// Standard deviation added to a tracked row, heights of the image.
const TRACKED_SIGMA_HEIGHTS: f64 = 0.03;

/// Prior of the horizon in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowPrior {
    /// Row of the horizon at the principal column, px.
    pub row: f64,
    /// Variance of the row, px^2.
    pub variance: f64,
    /// Descent of the horizon line per column: dv/du = -tan(roll).
    pub slope: f64,
    /// True once a vanishing point has been accepted. A tracked row does not exclude other rows.
    pub is_tracked: bool,
}

impl RowPrior {
    /// Prior of the first image, by the mount. `sigma_rad` is the standard deviation of its tilt, where one is stated.
    #[must_use]
    pub fn of_mount(
        picture: &Picture,
        mount: &Mount,
        calibration: Calibration,
        sigma_rad: Option<f64>,
    ) -> Self {
        let by_angle = |sigma: f64| picture.focal * sigma.min(1.5).tan();
        let level = Self { row: picture.center.y, variance: 0.0, slope: 0.0, is_tracked: false };
        match calibration {
            Calibration::Measured => {
                let down = mount.rotation_body_from_camera().transpose() * -Vector3::z();
                // A camera that looks up or down sees no horizon.
                let upright = down.y.max(0.1);
                let sigma = by_angle(sigma_rad.unwrap_or(MOUNT_SIGMA_RAD));
                Self {
                    row: picture.center.y - picture.focal * down.z / upright,
                    variance: sigma * sigma,
                    slope: -down.x / upright,
                    ..level
                }
            }
            Calibration::Guessed => {
                let sigma = sigma_rad.map_or(GUESSED_SIGMA_HEIGHTS * picture.height, by_angle);
                Self { variance: sigma * sigma, ..level }
            }
        }
    }

    /// Combines the prior with an independent measurement of the row, px, by their variances, px^2.
    #[must_use]
    pub fn fused(&self, row: f64, variance: f64) -> Self {
        let gain = self.variance / (self.variance + variance);
        Self { row: self.row + gain * (row - self.row), variance: self.variance * (1.0 - gain), ..*self }
    }

    /// Logarithm of the likelihood of a vanishing point at `point`, up to a constant.
    #[must_use]
    pub fn ln_likelihood(&self, picture: &Picture, point: Vector2<f64>) -> f64 {
        let horizon = self.row + self.slope * (point.x - picture.center.x);
        let off = (point.y - horizon) / self.slope.hypotenuse(1.0);
        if self.is_tracked { self.ln_tracked(picture, off) } else { -0.5 * off * off / self.variance }
    }

    /// Logarithm of the likelihood of a point `off` px from a tracked horizon: a mixture of the track and of any other row.
    #[must_use]
    pub fn ln_tracked(&self, picture: &Picture, off: f64) -> f64 {
        let variance = self.variance + (TRACKED_SIGMA_HEIGHTS * picture.height).powi(2);
        ((1.0 - ANYWHERE) * (-0.5 * off * off / variance).exp() + ANYWHERE).ln()
    }
}
