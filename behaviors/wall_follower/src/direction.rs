//! Direction of travel: a corridor leads two ways, and the robot keeps its own.

use yamabico_core::geometry::{Pose2, angle_difference};

/// Distance from the place where the corridor was followed last up to which its direction is kept, m: farther away,
/// another behavior has led the robot elsewhere.
const KEPT_M: f64 = 1.5;
/// Angle between directions from which one leads back, rad.
const BACK_RAD: f64 = 1.9;

/// The direction in which the corridor was followed last, by odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    /// Position of the robot, and the heading along the corridor.
    followed: Option<Pose2>,
}

impl Direction {
    /// Keeps the direction of a corridor that the robot at `pose` follows with the heading `heading` relative to its axis.
    pub fn follow(&mut self, pose: &Pose2, heading: f64) {
        self.followed = Some(Pose2 { theta: pose.theta - heading, ..*pose });
    }

    /// Forgets the direction: the robot turns back on purpose.
    pub fn forget(&mut self) {
        self.followed = None;
    }

    /// Heading along the corridor for a robot at `pose`, odometry frame, rad; `None` if it is unknown here.
    #[must_use]
    pub fn heading(&self, pose: &Pose2) -> Option<f64> {
        self.followed.filter(|followed| followed.distance(pose) < KEPT_M).map(|followed| followed.theta)
    }

    /// True if a corridor seen from `pose` with the heading `heading` relative to its axis leads back.
    #[must_use]
    pub fn leads_back(&self, pose: &Pose2, heading: f64) -> bool {
        let along = pose.theta - heading;
        self.heading(pose).is_some_and(|kept| angle_difference(along, kept).abs() > BACK_RAD)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn the_other_way_is_told_from_a_bend_and_forgotten_elsewhere() {
        let mut direction = Direction::default();
        let here = Pose2::new(1.0, 0.5, 0.2);
        assert!(!direction.leads_back(&here, 0.0), "nothing was followed");
        direction.follow(&here, 0.1);
        assert!((direction.heading(&here).expect("known") - 0.1).abs() < 1e-12);
        let turned = Pose2::new(1.2, 0.5, 3.0);
        assert!(direction.leads_back(&turned, 0.0));
        assert!(!direction.leads_back(&turned, PI), "the same axis the right way");
        assert!(!direction.leads_back(&Pose2::new(1.2, 0.5, 1.6), 0.0), "a bend of a right angle");
        assert!(!direction.leads_back(&Pose2::new(2.8, 0.5, 3.0), 0.0), "elsewhere");
        direction.forget();
        assert!(!direction.leads_back(&turned, 0.0));
    }
}
