//! The path on which the robot came, from odometry.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;

const CAPACITY: usize = 32;
/// Distance between two points of the trail, m.
const SPACING_M: f64 = 0.05;

/// The last 1.6 m of the robot's path, odometry frame. Never allocates.
#[derive(Clone, Debug)]
pub struct Trail {
    points: [Point2<f64>; CAPACITY],
    len: usize,
}

impl Default for Trail {
    fn default() -> Self {
        Self { points: [Point2::origin(); CAPACITY], len: 0 }
    }
}

impl Trail {
    /// Adds the robot's position if it has moved by one spacing.
    pub fn push(&mut self, pose: &Pose2) {
        let position = pose.position();
        let has_moved = self.last().is_none_or(|last| (position - last).norm() >= SPACING_M);
        if !has_moved {
            return;
        }
        if self.len == CAPACITY {
            self.points.rotate_left(1);
            self.len -= 1;
        }
        self.points[self.len] = position;
        self.len += 1;
    }

    /// Forgets the points at the end of the trail within `reach_m` of the robot, and returns the one before them: where to drive
    /// when it drives back. `None` at the beginning of the trail.
    pub fn pop_reached(&mut self, pose: &Pose2, reach_m: f64) -> Option<Point2<f64>> {
        while let Some(last) = self.last() {
            if (last - pose.position()).norm() > reach_m {
                return Some(last);
            }
            self.len -= 1;
        }
        None
    }

    fn last(&self) -> Option<Point2<f64>> {
        self.len.checked_sub(1).map(|last| self.points[last])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trail_leads_back_to_its_beginning() {
        let mut trail = Trail::default();
        for i in 0..100 {
            trail.push(&Pose2::new(0.01 * f64::from(i), 0.0, 0.0));
        }
        let back = trail.pop_reached(&Pose2::new(0.99, 0.0, 0.0), 0.12).unwrap();
        assert!((back.x - 0.85).abs() < 0.03, "{back}");
        assert_eq!(trail.pop_reached(&Pose2::new(0.05, 0.0, 0.0), 2.0), None);
    }

    #[test]
    fn a_long_way_is_remembered_in_part() {
        let mut trail = Trail::default();
        for i in 0..1000 {
            trail.push(&Pose2::new(0.1 * f64::from(i), 0.0, 0.0));
        }
        let here = Pose2::new(99.9, 0.0, 0.0);
        assert!(trail.pop_reached(&here, 3.0).is_some());
        assert_eq!(trail.pop_reached(&here, 4.0), None);
    }
}
