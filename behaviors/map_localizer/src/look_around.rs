//! Search for a lost pose by turning in place.

use yamabico_core::geometry::{Twist, angle_difference};

use crate::pursuit::turn_toward;

/// Headings of the search relative to its initial heading, rad: ahead, left, right, ahead again.
const HEADINGS_RAD: [f64; 4] = [0.0, 0.7, -0.7, 0.0];
/// Heading error at which a heading counts as reached, rad.
const HEADING_TOLERANCE_RAD: f64 = 0.05;
/// Number of images evaluated at each heading.
const IMAGES_PER_HEADING: u32 = 3;
/// Maximum turn rate of a search, rad/s: images stay sharp.
const MAX_TURN_RADPS: f64 = 0.5;

/// Progress of a search over several headings, with several images at each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookAround {
    /// Odometry heading at which the search began, rad.
    start_rad: f64,
    /// Index into [`HEADINGS_RAD`].
    step: usize,
    /// Number of images evaluated at the current heading.
    images: u32,
}

impl LookAround {
    /// Begins a search at the current odometry heading, rad.
    #[must_use]
    pub fn begin(heading: f64) -> Self {
        Self { start_rad: heading, step: 0, images: 0 }
    }

    /// Counts an image in which the pose was not found, taken at this odometry heading (rad).
    pub fn count_failure(&mut self, heading: f64) {
        if self.error(heading).abs() <= HEADING_TOLERANCE_RAD {
            self.images += 1;
        }
        if self.images >= IMAGES_PER_HEADING {
            self.images = 0;
            self.step += 1;
        }
    }

    /// Returns the turn in place from this odometry heading (rad) toward the next heading of the search, at most this fast
    /// (rad/s); `None` if the search is over.
    #[must_use]
    pub fn next_turn(&self, heading: f64, max_turn_radps: f64) -> Option<Twist> {
        let target = self.start_rad + HEADINGS_RAD.get(self.step)?;
        Some(turn_toward(heading, target, max_turn_radps.min(MAX_TURN_RADPS)))
    }

    fn error(&self, heading: f64) -> f64 {
        let target = self.start_rad + HEADINGS_RAD.get(self.step).copied().unwrap_or(0.0);
        angle_difference(target, heading)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_headings_are_visited() {
        let mut search = LookAround::begin(3.0);
        let (mut heading, mut widest, mut steps) = (3.0_f64, 0.0_f64, 0);
        while let Some(twist) = search.next_turn(heading, 0.8) {
            assert_eq!(twist.linear, 0.0);
            for _ in 0..5 {
                heading += 0.02 * search.next_turn(heading, 0.8).map_or(0.0, |twist| twist.angular);
            }
            search.count_failure(heading);
            widest = widest.max((heading - 3.0).abs());
            steps += 1;
            assert!(steps < 1000);
        }
        assert!((0.6..0.75).contains(&widest));
    }
}
