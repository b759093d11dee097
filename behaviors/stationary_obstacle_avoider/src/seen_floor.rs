//! Which places were in view a moment ago: what the camera does not show now need not be unknown.

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::time::Time;
use yamabico_vision::map::WireFrame;

/// How many views are remembered.
const MOST: usize = 24;
/// Moved or turned by more than this (m, rad), the robot has a new view.
const APART: (f64, f64) = (0.15, 0.14);
/// Views are remembered for so long, seconds.
const LIFETIME_S: f64 = 10.0;
/// What is nearer or farther ahead (m) is not looked at.
const DEPTH_M: (f64, f64) = (0.7, 3.2);

/// The views.
#[derive(Clone, Debug)]
pub struct SeenFloor {
    half_view: f64,
    pan: f64,
    views: Vec<(Time, Pose2)>,
}

impl SeenFloor {
    /// For a camera whose half view has this tangent and that is turned to the left by `pan` (rad).
    #[must_use]
    pub fn new(half_view: f64, pan: f64) -> Self {
        Self { half_view, pan, views: Vec::with_capacity(MOST) }
    }

    /// Takes a view from `map_from_robot`.
    pub fn look(&mut self, now: Time, map_from_robot: &Pose2) {
        self.views.retain(|(then, _)| now.seconds_after(*then) <= LIFETIME_S);
        let is_known = |view: &Pose2| {
            view.distance(map_from_robot) < APART.0
                && angle_difference(view.theta, map_from_robot.theta).abs() < APART.1
        };
        if let Some(known) = self.views.iter_mut().find(|(_, view)| is_known(view)) {
            known.0 = now;
        } else {
            if self.views.len() == MOST {
                self.views.remove(0);
            }
            self.views.push((now, *map_from_robot));
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.views.clear();
    }

    /// Whether the camera sees a place on the map from `map_from_robot`, walls apart.
    #[must_use]
    pub fn is_in_view(&self, map_from_robot: &Pose2, place: Point2<f64>) -> bool {
        let camera = Pose2::new(map_from_robot.x, map_from_robot.y, map_from_robot.theta + self.pan);
        let at = camera.inverse().transform_point(place);
        (DEPTH_M.0..=DEPTH_M.1).contains(&at.x) && at.y.abs() <= self.half_view * at.x
    }

    /// Whether a place on the map was in view a moment ago.
    #[must_use]
    pub fn is_known(&self, place: Point2<f64>, map: &WireFrame) -> bool {
        self.views.iter().any(|(_, view)| self.is_in_view(view, place) && map.is_open(view.position(), place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_seen_stays_known_for_a_while() {
        let mut floor = SeenFloor::new(0.577, 0.0);
        let map = WireFrame::default();
        let beside = Point2::new(2.0, 0.9);
        floor.look(Time::ZERO, &Pose2::IDENTITY);
        assert!(floor.is_known(beside, &map) && !floor.is_known(Point2::new(0.2, 0.9), &map));
        for step in 1..8 {
            floor.look(Time::from_secs_f64(f64::from(step)), &Pose2::new(0.2 * f64::from(step), 0.0, 0.0));
        }
        assert!(floor.is_known(beside, &map), "though it is out of view now");
        floor.look(Time::from_secs_f64(30.0), &Pose2::new(1.6, 0.0, 0.0));
        assert!(!floor.is_known(beside, &map));
    }
}
