//! Looking around where the robot stands.

use yamabico_core::geometry::{Twist, angle_difference};

use crate::pursuit::turn_towards;

/// Headings from where the search began that the robot looks from, rad: ahead, left, right, and back.
const LOOKS_RAD: [f64; 4] = [0.0, 0.7, -0.7, 0.0];
/// The robot has turned far enough when it is this near, rad.
const THERE_RAD: f64 = 0.05;
/// Pictures that are looked at from one heading.
const PICTURES: u32 = 3;
/// Turn rate, rad/s.
const TURN_RADPS: f64 = 0.5;

/// A search: some headings, some pictures from each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookAround {
    began_at: f64,
    look: usize,
    pictures: u32,
}

impl LookAround {
    /// Begins at the odometry's heading, rad.
    #[must_use]
    pub fn begin(heading: f64) -> Self {
        Self { began_at: heading, look: 0, pictures: 0 }
    }

    /// Whether all headings have been looked from in vain.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.look >= LOOKS_RAD.len()
    }

    /// Takes a picture in vain.
    pub fn picture(&mut self, heading: f64) {
        if self.error(heading).abs() <= THERE_RAD {
            self.pictures += 1;
        }
        if self.pictures >= PICTURES {
            self.pictures = 0;
            self.look += 1;
        }
    }

    /// The turn towards the next heading to look from; `None` when the search is over.
    #[must_use]
    pub fn turn(&self, heading: f64) -> Option<Twist> {
        let target = self.began_at + LOOKS_RAD.get(self.look)?;
        Some(turn_towards(heading, target, TURN_RADPS))
    }

    fn error(&self, heading: f64) -> f64 {
        let target = self.began_at + LOOKS_RAD.get(self.look).copied().unwrap_or(0.0);
        angle_difference(target, heading)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_headings_are_looked_from() {
        let mut look = LookAround::begin(3.0);
        let (mut heading, mut widest, mut steps) = (3.0_f64, 0.0_f64, 0);
        while let Some(twist) = look.turn(heading) {
            assert_eq!(twist.linear, 0.0);
            for _ in 0..5 {
                heading += 0.02 * look.turn(heading).map_or(0.0, |twist| twist.angular);
            }
            look.picture(heading);
            widest = widest.max((heading - 3.0).abs());
            steps += 1;
            assert!(steps < 1000);
        }
        assert!((0.6..0.75).contains(&widest) && look.is_over());
    }
}
