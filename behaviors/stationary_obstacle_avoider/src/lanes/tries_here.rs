//! Count of the tries to leave a place that have not led away from it.

use serde::{Deserialize, Serialize};
use yamabico_core::geometry::Pose2;

/// Distance within which tries are tries to leave the same place, m.
const SAME_PLACE_M: f64 = 0.7;

/// Pose at the first of the tries, odometry frame, and their number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TriesHere {
    first: Option<(Pose2, u32)>,
}

impl TriesHere {
    /// Counts a try of a robot at `odometry`.
    pub fn count(&mut self, odometry: &Pose2) {
        let tries = self.number(odometry) + 1;
        let place = self.first.filter(|_| tries > 1).map_or(*odometry, |(place, _)| place);
        self.first = Some((place, tries));
    }

    /// Number of tries to leave the place where the robot is at `odometry`.
    pub fn number(&self, odometry: &Pose2) -> u32 {
        self.first.filter(|(place, _)| place.distance(odometry) < SAME_PLACE_M).map_or(0, |(_, tries)| tries)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tries_count_at_the_place_of_the_first() {
        let mut tries = TriesHere::default();
        let numbers = [0.0, 0.3, 0.6, 0.8, 0.9].map(|x| {
            let robot = Pose2::new(x, 0.1, 0.0);
            tries.count(&robot);
            tries.number(&robot)
        });
        assert_eq!(numbers, [1, 2, 3, 1, 2]);
        assert_eq!(tries.number(&Pose2::new(3.0, 0.0, 0.0)), 0, "elsewhere");
    }
}
