//! The way that the robot has just come, which is known to be free.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::Pose2;

/// Largest length that is remembered, m, and the length that is lost per radian of a turn, m: a turn leaves the way.
const MAX_M: f64 = 0.5;
const TURN_LOSS_M: f64 = 0.5;
/// Step of the odometry between two updates above which it has jumped, m.
const JUMP_M: f64 = 0.2;

/// Pose by odometry at the last update, and length of the way forward to it, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct WayBack {
    last: Option<Pose2>,
    length_m: f64,
}

impl WayBack {
    /// Takes in a pose by odometry.
    pub fn update(&mut self, odometry: &Pose2) {
        let Some(last) = self.last.replace(*odometry) else { return };
        let step = last.relative(odometry);
        self.length_m = if Vector2::new(step.x, step.y).norm() > JUMP_M {
            0.0
        } else {
            (self.length_m + step.x - TURN_LOSS_M * step.theta.abs()).clamp(0.0, MAX_M)
        };
    }

    /// Length that the robot can back off, m.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length_m(poses: impl IntoIterator<Item = (f64, f64)>) -> f64 {
        let mut way = WayBack::default();
        for (x, theta) in poses {
            way.update(&Pose2::new(x, 0.0, theta));
        }
        way.length_m()
    }

    #[test]
    fn only_the_way_that_it_came_is_known_to_be_free_behind() {
        let ahead = || (0..=30).map(|i| (0.02 * f64::from(i), 0.0));
        assert_eq!(length_m(ahead()), MAX_M);
        let then = |poses: &[(f64, f64)]| length_m(ahead().chain(poses.iter().copied()));
        assert!(then(&[(0.6, 0.4), (0.6, 0.8), (0.6, 1.2)]) < 1e-9, "a turn in place leaves the way");
        assert!((then(&[(0.5, 0.0)]) - 0.4).abs() < 1e-9, "backing off uses it up");
        assert_eq!(then(&[(1.6, 0.0)]), 0.0, "odometry that jumps tells nothing");
        let curve = length_m((0..=20).map(|i| (0.02 * f64::from(i), 0.02 * f64::from(i))));
        assert!(curve > 0.15, "a gentle curve does not: {curve}");
    }
}
