//! Gaussian belief of the robot's pose and its Kalman updates.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, RowVector3, Vector2, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};

use crate::wire_frame::projected_line::Residual;

/// Pose in the map frame with the covariance of (x, y, theta), m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Mean: pose of the robot in the map frame.
    pub pose: Pose2,
    /// Covariance of (x, y, theta).
    pub covariance: Matrix3<f64>,
}

/// Outcome of one measurement update, with the squared Mahalanobis distance of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// The measurement was within the gate and updated the belief.
    Applied(f64),
    /// The measurement was outside of the gate or not finite, and the belief is unchanged.
    Gated(f64),
}

impl Belief {
    /// Creates a belief with independent standard deviations (m, m, rad).
    #[must_use]
    pub fn new(pose: Pose2, sigma_xy_m: f64, sigma_theta_rad: f64) -> Self {
        let variances = [sigma_xy_m.powi(2), sigma_xy_m.powi(2), sigma_theta_rad.powi(2)];
        Self { pose, covariance: Matrix3::from_diagonal(&Vector3::from(variances)) }
    }

    /// Returns true if all numbers are finite and no variance is negative.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.pose.is_finite()
            && self.covariance.iter().all(|value| value.is_finite())
            && (0..3).all(|i| self.covariance[(i, i)] >= 0.0)
    }

    /// Returns the maximum standard deviation of the position over all directions, m.
    #[must_use]
    pub fn sigma_xy_m(&self) -> f64 {
        let [a, b, c] = [self.covariance[(0, 0)], self.covariance[(0, 1)], self.covariance[(1, 1)]];
        (0.5 * (a + c) + (0.25 * (a - c).powi(2) + b * b).sqrt()).max(0.0).sqrt()
    }

    /// Returns the standard deviation of the heading, rad.
    #[must_use]
    pub fn sigma_theta_rad(&self) -> f64 {
        self.covariance[(2, 2)].max(0.0).sqrt()
    }

    /// Returns the squared Mahalanobis distance of another pose, with three degrees of freedom; infinite for a singular
    /// covariance.
    #[must_use]
    pub fn distance_squared(&self, other: &Pose2) -> f64 {
        let error = difference(other, &self.pose);
        self.covariance.try_inverse().map_or(f64::INFINITY, |inverse| error.dot(&(inverse * error)))
    }

    /// Gates and applies the distances of two image points from a line, with the covariance `noise` (px²). A Kalman
    /// update in Joseph form. The gate is a maximum squared Mahalanobis distance.
    #[inline]
    pub fn update(&mut self, residual: &Residual, noise: &Matrix2<f64>, gate: f64) -> Update {
        let h = &residual.jacobian;
        let cross = self.covariance * h.transpose();
        let innovation = h * cross + noise;
        let Some(inverse) = inverse_of(&innovation) else { return Update::Gated(f64::INFINITY) };
        let distance = residual.distance_px.dot(&(inverse * residual.distance_px));
        if distance.is_nan() || distance > gate {
            return Update::Gated(distance);
        }
        let gain = cross * inverse;
        self.shift(-(gain * residual.distance_px));
        // (I - KH) P (I - KH)' + K R K', multiplied out from the left.
        let kept = self.covariance - gain * cross.transpose();
        self.covariance = kept - (kept * h.transpose() - gain * noise) * gain.transpose();
        self.symmetrize();
        Update::Applied(distance)
    }

    /// Gates and applies a measured pose with errors independent of this belief. In Joseph form.
    pub fn update_pose(&mut self, measured: &Belief, gate: f64) -> Update {
        let innovation = difference(&measured.pose, &self.pose);
        let Some(inverse) = (self.covariance + measured.covariance).try_inverse() else {
            return Update::Gated(f64::INFINITY);
        };
        let distance = innovation.dot(&(inverse * innovation));
        if distance.is_nan() || distance > gate {
            return Update::Gated(distance);
        }
        let gain = self.covariance * inverse;
        self.shift(gain * innovation);
        let keep = Matrix3::identity() - gain;
        self.covariance =
            keep * self.covariance * keep.transpose() + gain * measured.covariance * gain.transpose();
        self.symmetrize();
        Update::Applied(distance)
    }

    /// Returns the belief of a part that is mounted on the robot at this pose in the robot frame.
    #[must_use]
    pub fn of_mounted(&self, mount: &Pose2) -> Self {
        let arm = self.pose.compose(mount).position() - self.pose.position();
        let jacobian = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
        Self { pose: self.pose.compose(mount), covariance: jacobian * self.covariance * jacobian.transpose() }
    }

    /// Returns the belief with this additional standard deviation of the heading, rad, caused by sway of the mast.
    #[must_use]
    pub fn with_sway(&self, sigma_rad: f64) -> Self {
        let mut covariance = self.covariance;
        covariance[(2, 2)] += sigma_rad * sigma_rad;
        Self { covariance, ..*self }
    }

    /// Returns this belief after a correction of the belief that includes the sway, see [`Belief::with_sway`], from
    /// `before` to
    /// `after`: applies the part of the correction due to the robot, not to the sway. Exact for small corrections.
    #[must_use]
    pub fn corrected_without_sway(&self, before: &Belief, after: &Belief) -> Self {
        let Some(inverse) = before.covariance.try_inverse() else { return *self };
        let gain = self.covariance * inverse;
        let mut belief = *self;
        belief.shift(gain * difference(&after.pose, &before.pose));
        belief.covariance -= gain * (before.covariance - after.covariance) * gain.transpose();
        belief.symmetrize();
        belief
    }

    /// Gates and applies a measured heading (rad) with its standard deviation (rad, > 0).
    pub fn update_heading(&mut self, heading: f64, sigma_rad: f64, gate: f64) -> Update {
        let error = angle_difference(heading, self.pose.theta);
        self.update_scalar(error, &RowVector3::new(0.0, 0.0, 1.0), sigma_rad * sigma_rad, gate)
    }

    /// Gates and applies a scalar measurement: the innovation (measurement minus prediction), the Jacobian of the
    /// prediction with respect to (x, y, theta), and the variance of the measurement, > 0. In Joseph form.
    pub fn update_scalar(
        &mut self,
        innovation: f64,
        jacobian: &RowVector3<f64>,
        noise: f64,
        gate: f64,
    ) -> Update {
        let cross: Vector3<f64> = self.covariance * jacobian.transpose();
        let variance = (jacobian * cross).x + noise;
        let distance = innovation * innovation / variance;
        if distance.is_nan() || distance > gate {
            return Update::Gated(distance);
        }
        let gain = cross / variance;
        self.shift(gain * innovation);
        let keep = Matrix3::identity() - gain * jacobian;
        self.covariance = keep * self.covariance * keep.transpose() + gain * gain.transpose() * noise;
        self.symmetrize();
        Update::Applied(distance)
    }

    /// Raises the variances of (x, y, theta) to at least these, m², m², rad², so that later measurements can correct
    /// the belief.
    pub fn raise_variances(&mut self, min: [f64; 3]) {
        for (i, min) in min.into_iter().enumerate() {
            self.covariance[(i, i)] = self.covariance[(i, i)].max(min);
        }
    }

    fn shift(&mut self, by: Vector3<f64>) {
        let Pose2 { x, y, theta } = self.pose;
        self.pose = Pose2 { x: x + by.x, y: y + by.y, theta: wrap_angle(theta + by.z) };
    }

    fn symmetrize(&mut self) {
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
    }
}

/// Returns `to` minus `from` as (x, y, theta), with the angle wrapped.
#[must_use]
pub fn difference(to: &Pose2, from: &Pose2) -> Vector3<f64> {
    Vector3::new(to.x - from.x, to.y - from.y, angle_difference(to.theta, from.theta))
}

/// Returns the squared Mahalanobis distance of a residual, with two degrees of freedom; infinite if undefined.
#[must_use]
pub fn gate_distance(residual: &Residual, covariance: &Matrix3<f64>, noise: &Matrix2<f64>) -> f64 {
    let h: &Matrix2x3<f64> = &residual.jacobian;
    let innovation = h * covariance * h.transpose() + noise;
    let inverse = inverse_of(&innovation);
    inverse.map_or(f64::INFINITY, |inverse| {
        let r: &Vector2<f64> = &residual.distance_px;
        r.dot(&(inverse * r))
    })
}

/// Returns the inverse in closed form; `None` if the determinant is not positive and finite.
fn inverse_of(m: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let determinant = m.m11 * m.m22 - m.m12 * m.m21;
    (determinant > 0.0 && determinant.is_finite())
        .then(|| Matrix2::new(m.m22, -m.m12, -m.m21, m.m11) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_measurement_is_the_scalar_filter() {
        let mut belief = Belief::new(Pose2::new(1.0, 2.0, 3.1), 0.1, 0.2);
        assert!(matches!(belief.update_heading(-3.1, 0.2, 9.0), Update::Applied(_)));
        // Halfway across the wrap, with half the variance.
        let middle = 3.1 + 0.5 * angle_difference(-3.1, 3.1);
        assert!(angle_difference(belief.pose.theta, middle).abs() < 1e-12);
        assert!((belief.covariance[(2, 2)] - 0.02).abs() < 1e-12);
        let before = belief;
        assert!(matches!(belief.update_heading(0.0, 0.01, 9.0), Update::Gated(_)));
        assert_eq!(belief, before);
    }

    #[test]
    fn an_update_that_is_not_finite_changes_nothing() {
        let mut belief = Belief::new(Pose2::IDENTITY, 0.1, 0.1);
        let before = belief;
        let residual =
            Residual { distance_px: Vector2::new(f64::NAN, 0.0), jacobian: Matrix2x3::from_element(1.0) };
        assert!(matches!(belief.update(&residual, &Matrix2::identity(), 9.2), Update::Gated(_)));
        let flat = Residual { distance_px: Vector2::zeros(), jacobian: Matrix2x3::zeros() };
        assert!(matches!(belief.update(&flat, &Matrix2::zeros(), 9.2), Update::Gated(_)));
        assert_eq!(belief, before);
    }

    #[test]
    fn the_maximum_deviation_is_along_the_major_axis() {
        let mut belief = Belief::new(Pose2::IDENTITY, 0.0, 0.1);
        let (sin, cos) = 0.7_f64.sin_cos();
        let axes = Matrix2::new(cos, -sin, sin, cos);
        let covariance = axes * Matrix2::new(0.09, 0.0, 0.0, 0.01) * axes.transpose();
        belief.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance);
        assert!((belief.sigma_xy_m() - 0.3).abs() < 1e-12);
    }
}
