//! The leg of a route that was taken last: it is not tried again from where it began.

use serde::{Deserialize, Serialize};
use yamabico_core::geometry::{Pose2, angle_difference};

use super::way_out::Leg;

/// Distance of their beginnings and angle within which two legs are the same, m and rad.
const SAME_LEG_M: f64 = 0.1;
const SAME_LEG_RAD: f64 = 0.3;

/// Beginning of the leg, with its heading, by odometry; none at first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TakenLeg(Option<Pose2>);

impl TakenLeg {
    /// Creates the leg that begins at `odometry` with a heading (rad).
    pub fn new(odometry: &Pose2, heading: f64) -> Self {
        Self(Some(Pose2 { theta: heading, ..*odometry }))
    }

    /// True if `leg`, taken at `odometry`, is another one.
    pub fn is_new(&self, leg: &Leg, odometry: &Pose2) -> bool {
        self.0.is_none_or(|taken| {
            taken.distance(odometry) > SAME_LEG_M
                || angle_difference(odometry.theta + leg.bearing, taken.theta).abs() > SAME_LEG_RAD
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leg_is_new_from_elsewhere_or_in_another_direction() {
        let leg = |bearing: f64| Leg { bearing, length_m: 0.6 };
        let taken = TakenLeg::new(&Pose2::IDENTITY, 0.8);
        assert!(!taken.is_new(&leg(0.8), &Pose2::IDENTITY));
        assert!(!taken.is_new(&leg(0.0), &Pose2::new(0.05, 0.0, 0.8)), "the robot faces it");
        assert!(
            taken.is_new(&leg(0.0), &Pose2::new(0.3, 0.0, 0.8)) && taken.is_new(&leg(0.0), &Pose2::IDENTITY)
        );
        assert!(TakenLeg::default().is_new(&leg(0.8), &Pose2::IDENTITY));
    }
}
