//! Motion since an image was taken.

use nalgebra::{Matrix2, Matrix3};
use yamabico_core::geometry::Pose2;

use crate::belief::Belief;
use crate::motion::{Increment, MotionNoise};

/// Accumulated motion since an image was taken, which propagates a correction in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotionSince {
    /// Prior pose at the capture time.
    pub before: Pose2,
    /// Current pose, propagated from `before`.
    pub pose: Pose2,
    /// Distance driven since the capture time, m.
    pub driven_m: f64,
    /// Covariance added by the motion.
    pub noise: Matrix3<f64>,
}

impl MotionSince {
    /// Appends a motion.
    pub fn advance(&mut self, increment: &Increment, noise: &MotionNoise) {
        self.noise = increment.move_covariance(&self.noise, self.pose.theta, self.driven_m, noise);
        self.driven_m += increment.forward_m.abs();
        self.pose = increment.move_pose(&self.pose);
    }

    /// Returns the current belief, given the posterior at the capture time.
    pub fn propagate(&self, posterior: &Belief) -> Belief {
        let turn = posterior.pose.theta - self.before.theta;
        let (sin, cos) = turn.sin_cos();
        let moved = (self.pose.x - self.before.x, self.pose.y - self.before.y);
        let moved = (cos * moved.0 - sin * moved.1, sin * moved.0 + cos * moved.1);
        let state = Matrix3::new(1.0, 0.0, -moved.1, 0.0, 1.0, moved.0, 0.0, 0.0, 1.0);
        let mut turned = Matrix3::identity();
        turned.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(cos, -sin, sin, cos));
        Belief {
            pose: Pose2::new(posterior.pose.x + moved.0, posterior.pose.y + moved.1, self.pose.theta + turn),
            covariance: state * posterior.covariance * state.transpose()
                + turned * self.noise * turned.transpose(),
        }
    }
}
