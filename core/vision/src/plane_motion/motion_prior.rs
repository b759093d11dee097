//! Uncertainty of odometry and mount between two pictures.

use nalgebra::{SMatrix, SVector, Vector2};

/// Motion x, y (m) and theta (rad), mount tilt and roll (rad).
pub type CommonMode = SVector<f64, 5>;
/// Covariance of a [`CommonMode`].
pub type CommonCovariance = SMatrix<f64, 5, 5>;

/// Standard deviation of tilt and roll of a calibrated mount, rad.
pub const MOUNT_SIGMA_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;

/// Covariance of wheel odometry over `way_m` and a turn by `theta` (rad), and of the mount.
///
/// The side slip follows from the turn half-way: without this correlation, turn and slip are exchanged freely. `yaw`
/// scales the deviation of the turn; below 1 where a shorter baseline has already corrected it.
#[must_use]
pub fn motion_prior(way_m: f64, theta: f64, yaw: f64) -> CommonCovariance {
    let sigma_theta = (1.5e-3 + 0.012 * way_m + 0.01 * theta.abs()) * yaw;
    // Wheels measure the distance better than images do, which confuse it with tilt.
    let (sigma_x, sigma_y) = (1e-3 + 4e-3 * way_m, 1e-3 + 4e-3 * way_m);
    let mut covariance = CommonCovariance::from_diagonal(&CommonMode::new(
        sigma_x,
        sigma_y,
        sigma_theta,
        MOUNT_SIGMA_RAD,
        MOUNT_SIGMA_RAD,
    ));
    covariance = covariance.map(|sigma| sigma * sigma);
    let half = 0.5 * way_m;
    covariance[(1, 1)] += (half * sigma_theta).powi(2);
    covariance[(1, 2)] = half * sigma_theta * sigma_theta;
    covariance[(2, 1)] = covariance[(1, 2)];
    covariance
}

/// Covariance of the motion between two pictures from a lag of the wheels with the deviation `sigma_s` (s), while the
/// velocity along x (m/s) and about the vertical (rad/s) changed by `change`.
#[must_use]
pub fn lag_covariance(sigma_s: f64, change: Vector2<f64>, way_m: f64) -> CommonCovariance {
    let [along, turn] = [change.x * sigma_s, change.y * sigma_s];
    let slope = CommonMode::new(along, 0.5 * way_m * turn, turn, 0.0, 0.0);
    slope * slope.transpose()
}
