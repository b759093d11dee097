//! Count of the turns in place that have not led away from a place.

use serde::{Deserialize, Serialize};
use yamabico_core::geometry::Pose2;

/// Distance within which turns in place are tries to leave the same place, m.
const SAME_PLACE_M: f64 = 0.7;
/// Number of turns in which what is remembered comes into doubt, one to each side, and that after which it does again: what has been
/// seen since is used first.
const DOUBTFUL: u32 = 2;
const DOUBTFUL_AGAIN: u32 = 4;

/// Pose at the first of the turns, odometry frame, and their number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TurnsHere {
    first: Option<(Pose2, u32)>,
}

impl TurnsHere {
    /// Counts a turn of a robot at `odometry`; returns true if what is remembered of the surroundings comes into doubt with it.
    pub fn count(&mut self, odometry: &Pose2) -> bool {
        let here = self.first.filter(|(place, _)| place.distance(odometry) < SAME_PLACE_M);
        let (place, turns) = here.map_or((*odometry, 1), |(place, turns)| (place, turns + 1));
        self.first = Some((place, turns));
        turns % DOUBTFUL_AGAIN == DOUBTFUL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_remembered_comes_into_doubt_where_turns_to_both_sides_led_nowhere() {
        let mut turns = TurnsHere::default();
        let doubts: Vec<_> = (0..6).map(|_| turns.count(&Pose2::new(0.3, 0.1, 0.0))).collect();
        assert_eq!(doubts, [false, true, false, false, false, true]);
        assert!((1..6).all(|i| !turns.count(&Pose2::new(f64::from(i), 0.0, 0.0))), "each elsewhere");
    }
}
