//! History of camera views, to find out if a place was in view recently.

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::time::Time;
use yamabico_vision::map::WireFrame;

/// Maximum number of remembered views.
const MAX_VIEWS: usize = 24;
/// Minimum distance (m) and turn (rad) from all remembered views for a new one.
const MIN_SEPARATION: (f64, f64) = (0.15, 0.14);
/// Time after which a view is forgotten, s.
const VIEW_LIFETIME_S: f64 = 10.0;
/// Minimum and maximum forward distance from the camera at which a place counts as in view, m.
const DEPTH_RANGE_M: (f64, f64) = (0.7, 3.2);

/// Poses of the robot from which the camera observed the floor recently.
#[derive(Clone, Debug)]
pub struct ViewHistory {
    half_view: f64,
    pan: f64,
    views: Vec<(Time, Pose2)>,
}

impl ViewHistory {
    /// Creates the history for a camera. `half_view`: tangent of half its horizontal field of view; `pan`: its angle
    /// to the left of the robot's heading, rad.
    #[must_use]
    pub fn new(half_view: f64, pan: f64) -> Self {
        Self { half_view, pan, views: Vec::with_capacity(MAX_VIEWS) }
    }

    /// Adds a view from `map_from_robot`, or refreshes a remembered one that is close to it.
    pub fn add(&mut self, now: Time, map_from_robot: &Pose2) {
        self.views.retain(|(then, _)| now.seconds_after(*then) <= VIEW_LIFETIME_S);
        let is_known = |view: &Pose2| {
            view.distance(map_from_robot) < MIN_SEPARATION.0
                && angle_difference(view.theta, map_from_robot.theta).abs() < MIN_SEPARATION.1
        };
        let view = match self.views.iter().position(|(_, view)| is_known(view)) {
            Some(known) => self.views.remove(known).1,
            None => *map_from_robot,
        };
        // The one that was refreshed longest ago is the first.
        if self.views.len() == MAX_VIEWS {
            self.views.remove(0);
        }
        self.views.push((now, view));
    }

    /// Returns true if the camera shows `place` (m, map frame) from `map_from_robot`. Does not consider walls.
    #[must_use]
    pub fn is_in_view(&self, map_from_robot: &Pose2, place: Point2<f64>) -> bool {
        let camera = Pose2::new(map_from_robot.x, map_from_robot.y, map_from_robot.theta + self.pan);
        let at = camera.inverse().transform_point(place);
        (DEPTH_RANGE_M.0..=DEPTH_RANGE_M.1).contains(&at.x) && at.y.abs() <= self.half_view * at.x
    }

    /// Returns true if `place` (m, map frame) was in view recently and no wall of `map` hid it.
    #[must_use]
    pub fn was_in_view(&self, place: Point2<f64>, map: &WireFrame) -> bool {
        self.views.iter().any(|(_, view)| self.is_in_view(view, place) && map.is_open(view.position(), place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_counts_as_in_view_for_a_while() {
        let mut history = ViewHistory::new(0.577, 0.0);
        let map = WireFrame::default();
        let beside = Point2::new(2.0, 0.9);
        history.add(Time::ZERO, &Pose2::IDENTITY);
        assert!(history.was_in_view(beside, &map) && !history.was_in_view(Point2::new(0.2, 0.9), &map));
        for step in 1..8 {
            history.add(Time::from_secs_f64(f64::from(step)), &Pose2::new(0.2 * f64::from(step), 0.0, 0.0));
        }
        assert!(history.was_in_view(beside, &map), "a view must last ten seconds");
        history.add(Time::from_secs_f64(30.0), &Pose2::new(1.6, 0.0, 0.0));
        assert!(!history.was_in_view(beside, &map));
    }

    #[test]
    fn of_too_many_views_the_one_that_was_refreshed_longest_ago_goes() {
        let mut history = ViewHistory::new(0.577, 0.0);
        let view = |i: usize| Pose2::new(10.0 * i as f64, 0.0, 0.0);
        (0..MAX_VIEWS).for_each(|i| history.add(Time::from_secs_f64(0.1 * i as f64), &view(i)));
        history.add(Time::from_secs_f64(3.0), &view(0));
        history.add(Time::from_secs_f64(3.1), &view(MAX_VIEWS));
        let was_in_view =
            |i: usize| history.was_in_view(Point2::new(10.0 * i as f64 + 2.0, 0.0), &WireFrame::default());
        assert!(was_in_view(0) && !was_in_view(1) && was_in_view(2) && was_in_view(MAX_VIEWS));
    }
}
