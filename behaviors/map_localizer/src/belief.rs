//! Where the robot is, and how well that is known.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, RowVector3, Vector2, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};

use crate::wire_frame::projected_line::Residual;

/// A pose on the map with its covariance of (x, y, theta), m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Map from robot.
    pub pose: Pose2,
    /// Of (x, y, theta).
    pub covariance: Matrix3<f64>,
}

/// What one measurement did to a belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// It moved the belief; its squared Mahalanobis distance before.
    Applied(f64),
    /// It was farther away than the gate (or no number), and left the belief alone.
    Gated(f64),
}

impl Belief {
    /// A belief with independent standard deviations (m, m, rad).
    #[must_use]
    pub fn new(pose: Pose2, sigma_xy_m: f64, sigma_theta_rad: f64) -> Self {
        let variances = [sigma_xy_m.powi(2), sigma_xy_m.powi(2), sigma_theta_rad.powi(2)];
        Self { pose, covariance: Matrix3::from_diagonal(&Vector3::from(variances)) }
    }

    /// Whether every number is finite and no variance negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.pose.is_finite()
            && self.covariance.iter().all(|value| value.is_finite())
            && (0..3).all(|i| self.covariance[(i, i)] >= 0.0)
    }

    /// The larger standard deviation of the position, meters.
    #[must_use]
    pub fn sigma_xy_m(&self) -> f64 {
        let [a, b, c] = [self.covariance[(0, 0)], self.covariance[(0, 1)], self.covariance[(1, 1)]];
        (0.5 * (a + c) + (0.25 * (a - c).powi(2) + b * b).sqrt()).max(0.0).sqrt()
    }

    /// The standard deviation of the heading, rad.
    #[must_use]
    pub fn sigma_theta_rad(&self) -> f64 {
        self.covariance[(2, 2)].max(0.0).sqrt()
    }

    /// The squared Mahalanobis distance of another pose: three degrees of freedom. Infinite for a singular covariance.
    #[must_use]
    pub fn distance_squared(&self, other: &Pose2) -> f64 {
        let error = difference(other, &self.pose);
        self.covariance.try_inverse().map_or(f64::INFINITY, |inverse| error.dot(&(inverse * error)))
    }

    /// Gates and applies the distances of two image points from a line, with the covariance `noise` (px squared): Kalman's
    /// update in Joseph's form. The gate is on the squared Mahalanobis distance.
    #[inline]
    pub fn update(&mut self, residual: &Residual, noise: &Matrix2<f64>, gate: f64) -> Update {
        let h = &residual.jacobian;
        let spread = self.covariance * h.transpose();
        let innovation = h * spread + noise;
        let Some(inverse) = inverse_of(&innovation) else { return Update::Gated(f64::INFINITY) };
        let distance = residual.distance_px.dot(&(inverse * residual.distance_px));
        if distance.is_nan() || distance > gate {
            return Update::Gated(distance);
        }
        let gain = spread * inverse;
        self.shift(-(gain * residual.distance_px));
        // (I - KH) P (I - KH)' + K R K', multiplied out from the left.
        let kept = self.covariance - gain * spread.transpose();
        self.covariance = kept - (kept * h.transpose() - gain * noise) * gain.transpose();
        self.symmetrize();
        Update::Applied(distance)
    }

    /// Gates and applies a measured pose, whose errors are independent of this belief's. In Joseph's form.
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

    /// The belief of something that is fixed to the robot, at this pose on it.
    #[must_use]
    pub fn carried(&self, on_robot: &Pose2) -> Self {
        let arm = self.pose.compose(on_robot).position() - self.pose.position();
        let jacobian = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
        Self {
            pose: self.pose.compose(on_robot),
            covariance: jacobian * self.covariance * jacobian.transpose(),
        }
    }

    /// With a heading that is less certain by this standard deviation, rad.
    #[must_use]
    pub fn swayed(&self, sigma_rad: f64) -> Self {
        let mut covariance = self.covariance;
        covariance[(2, 2)] += sigma_rad * sigma_rad;
        Self { covariance, ..*self }
    }

    /// What this belief becomes where that of its [`Belief::swayed`] camera, `before`, became `after`: the part of the
    /// correction that is the robot's, and not the sway's. Exact for small corrections.
    #[must_use]
    pub fn without_sway(&self, before: &Belief, after: &Belief) -> Self {
        let Some(inverse) = before.covariance.try_inverse() else { return *self };
        let share = self.covariance * inverse;
        let mut belief = *self;
        belief.shift(share * difference(&after.pose, &before.pose));
        belief.covariance -= share * (before.covariance - after.covariance) * share.transpose();
        belief.symmetrize();
        belief
    }

    /// Gates and applies a measured heading (rad) with its standard deviation (rad, > 0).
    pub fn update_heading(&mut self, heading: f64, sigma_rad: f64, gate: f64) -> Update {
        let error = angle_difference(heading, self.pose.theta);
        self.update_scalar(error, &RowVector3::new(0.0, 0.0, 1.0), sigma_rad * sigma_rad, gate)
    }

    /// Gates and applies a scalar measurement: what was measured less what the pose predicts, the derivatives of the prediction by
    /// (x, y, theta), and the variance of the measurement, > 0. In Joseph's form.
    pub fn update_scalar(
        &mut self,
        innovation: f64,
        jacobian: &RowVector3<f64>,
        noise: f64,
        gate: f64,
    ) -> Update {
        let spread: Vector3<f64> = self.covariance * jacobian.transpose();
        let variance = (jacobian * spread).x + noise;
        let distance = innovation * innovation / variance;
        if distance.is_nan() || distance > gate {
            return Update::Gated(distance);
        }
        let gain = spread / variance;
        self.shift(gain * innovation);
        let keep = Matrix3::identity() - gain * jacobian;
        self.covariance = keep * self.covariance * keep.transpose() + gain * gain.transpose() * noise;
        self.symmetrize();
        Update::Applied(distance)
    }

    /// Raises variances to at least these, m^2, m^2, rad^2: a prior without variance could never be corrected.
    pub fn floor(&mut self, variances: [f64; 3]) {
        for (i, least) in variances.into_iter().enumerate() {
            self.covariance[(i, i)] = self.covariance[(i, i)].max(least);
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

/// (x, y, theta) of `to` less `from`, the angle wrapped.
#[must_use]
pub fn difference(to: &Pose2, from: &Pose2) -> Vector3<f64> {
    Vector3::new(to.x - from.x, to.y - from.y, angle_difference(to.theta, from.theta))
}

/// The squared Mahalanobis distance of a residual: two degrees of freedom. Infinite where that is no number.
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

/// The inverse in closed form; `None` for a matrix that has none.
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
        // Half way across the wrap, with half the variance.
        let middle = 3.1 + 0.5 * angle_difference(-3.1, 3.1);
        assert!(angle_difference(belief.pose.theta, middle).abs() < 1e-12);
        assert!((belief.covariance[(2, 2)] - 0.02).abs() < 1e-12);
        let before = belief;
        assert!(matches!(belief.update_heading(0.0, 0.01, 9.0), Update::Gated(_)));
        assert_eq!(belief, before);
    }

    #[test]
    fn no_number_moves_nothing() {
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
    fn the_larger_deviation_is_that_of_the_long_axis() {
        let mut belief = Belief::new(Pose2::IDENTITY, 0.0, 0.1);
        let (sin, cos) = 0.7_f64.sin_cos();
        let axes = Matrix2::new(cos, -sin, sin, cos);
        let covariance = axes * Matrix2::new(0.09, 0.0, 0.0, 0.01) * axes.transpose();
        belief.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance);
        assert!((belief.sigma_xy_m() - 0.3).abs() < 1e-12);
    }
}
