//! Paths of straight legs between corners, path planning by waypoints, and the robot's progress along a path.

use nalgebra::Point2;
use thiserror::Error;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::map::WireFrame;

/// Length below which a leg is skipped, m.
const MIN_LEG_M: f64 = 1e-6;
/// Spacing of the points at which the clearance of a leg is checked, m.
const SAMPLE_M: f64 = 0.05;
/// Maximum distance behind the robot's previous progress in which its position on the path is searched, m.
const MAX_BACKWARD_M: f64 = 0.5;
/// Maximum distance ahead of the robot's previous progress in which its position on the path is searched, m.
const MAX_FORWARD_M: f64 = 0.5;
/// Maximum number of corners of a path.
pub const MAX_CORNERS: usize = 64;

/// Reason why there is no path.
// The texts are part of proposal notes, which the digests of recordings cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RouteError {
    /// All paths cross a wall or pass too close to one.
    #[error("every way to the goal is blocked by a wall of the map")]
    Blocked,
    /// The start or the goal is not finite.
    #[error("the goal is no place")]
    NotFinite,
}

/// Path given by its corners, map frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Route {
    corners: Vec<Point2<f64>>,
    /// Distance at which the goal is reached, m.
    pub tolerance_m: f64,
}

/// Robot's position relative to a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathProgress {
    /// Path length from the start to the robot, m.
    pub progress_m: f64,
    /// Path length from the robot to the end, m.
    pub to_go_m: f64,
    /// Distance of the robot from the path, m, positive to the left.
    pub lateral_error_m: f64,
    /// Robot's heading minus the path's heading, rad.
    pub heading_error_rad: f64,
    /// Heading of the path at the robot, rad.
    pub heading_rad: f64,
    /// Straight-line distance to the end, m.
    pub distance_m: f64,
}

/// Planner of paths that keep a distance from the walls.
#[derive(Clone, Copy, Debug)]
pub struct Planner<'a> {
    /// Map with the walls.
    pub map: &'a WireFrame,
    /// Minimum distance of a path from a wall, m.
    pub clearance_m: f64,
}

impl Route {
    /// Creates a path along these corners.
    #[must_use]
    pub fn new(corners: Vec<Point2<f64>>, tolerance_m: f64) -> Self {
        Self { corners, tolerance_m }
    }

    /// Returns the corners.
    #[must_use]
    pub fn corners(&self) -> &[Point2<f64>] {
        &self.corners
    }

    /// Returns the robot's progress at the nearest point of the path; `None` without a path. If the maximum progress so
    /// far is given (m), only points close to it are considered, since a path may cross itself.
    #[must_use]
    pub fn progress(&self, pose: &Pose2, max_progress_m: Option<f64>) -> Option<PathProgress> {
        let at = pose.position();
        let min_m = max_progress_m.map_or(0.0, |max| (max - MAX_BACKWARD_M).max(0.0));
        let max_m = max_progress_m.map_or(f64::INFINITY, |max| max + MAX_FORWARD_M);
        let total_m = self.length_m();
        let mut begin_m = 0.0;
        let mut best: Option<(f64, PathProgress)> = None;
        for pair in self.corners.windows(2) {
            let run = pair[1] - pair[0];
            let length = run.norm();
            if length <= MIN_LEG_M {
                continue;
            }
            let [min, max] = [min_m, max_m].map(|limit| ((limit - begin_m) / length).clamp(0.0, 1.0));
            let fraction = (run.dot(&(at - pair[0])) / (length * length)).clamp(min, max);
            let distance = (at - (pair[0] + run * fraction)).norm();
            let is_near = begin_m <= max_m && begin_m + length >= min_m;
            if is_near && best.as_ref().is_none_or(|(nearest, _)| distance < *nearest) {
                let heading_rad = run.y.atan2(run.x);
                let progress_m = begin_m + fraction * length;
                best = Some((
                    distance,
                    PathProgress {
                        progress_m,
                        to_go_m: total_m - progress_m,
                        lateral_error_m: run.perp(&(at - pair[0])) / length,
                        heading_error_rad: angle_difference(pose.theta, heading_rad),
                        heading_rad,
                        distance_m: self.corners.last().map_or(0.0, |end| (end - at).norm()),
                    },
                ));
            }
            begin_m += length;
        }
        best.map(|(_, progress)| progress)
    }

    /// Returns the point at this distance along the path (m), clamped to its ends; `None` without corners.
    #[must_use]
    pub fn point_at(&self, progress_m: f64) -> Option<Point2<f64>> {
        let mut rest = progress_m.max(0.0);
        for pair in self.corners.windows(2) {
            let run = pair[1] - pair[0];
            let length = run.norm();
            if rest <= length && length > MIN_LEG_M {
                return Some(pair[0] + run * (rest / length));
            }
            rest -= length;
        }
        self.corners.last().copied()
    }

    /// Returns the corners after this distance along the path (m), at least the last one.
    #[must_use]
    pub fn corners_after(&self, progress_m: f64) -> &[Point2<f64>] {
        let mut length_m = 0.0;
        for (i, pair) in self.corners.windows(2).enumerate() {
            length_m += (pair[1] - pair[0]).norm();
            if length_m > progress_m {
                return &self.corners[i + 1..];
            }
        }
        &self.corners[self.corners.len().saturating_sub(1)..]
    }

    /// Returns the length of the path, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.corners.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
    }
}

impl Planner<'_> {
    /// Returns true if the straight leg keeps its distance from all walls. It may start closer to a wall if it leads
    /// away.
    #[must_use]
    pub fn is_free(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        if !self.map.is_open(from, to) {
            return false;
        }
        let run = to - from;
        let steps = (run.norm() / SAMPLE_M).ceil().clamp(1.0, 1e5) as usize;
        let mut allowed = self.map.clearance(from).min(self.clearance_m);
        (1..=steps).all(|i| {
            let clearance = self.map.clearance(from + run * (i as f64 / steps as f64));
            let is_free = clearance >= allowed - 1e-9;
            allowed = clearance.min(self.clearance_m).max(allowed);
            is_free
        })
    }

    /// Finds the shortest path of free legs from `from` to `goal`, through any of the waypoints.
    ///
    /// # Errors
    /// There is no path, or a coordinate is not finite.
    pub fn path(
        &self,
        from: Point2<f64>,
        waypoints: &[Point2<f64>],
        goal: Point2<f64>,
    ) -> Result<Vec<Point2<f64>>, RouteError> {
        if ![from.x, from.y, goal.x, goal.y].iter().all(|value| value.is_finite()) {
            return Err(RouteError::NotFinite);
        }
        let mut nodes = vec![from];
        nodes.extend_from_slice(waypoints);
        nodes.push(goal);
        let last = nodes.len() - 1;
        let mut lengths = vec![f64::INFINITY; nodes.len()];
        let mut previous = vec![0; nodes.len()];
        let mut is_done = vec![false; nodes.len()];
        lengths[0] = 0.0;
        // Dijkstra's algorithm; the legs from a node are checked only when the node is reached.
        while let Some(here) = (0..nodes.len())
            .filter(|&i| !is_done[i] && lengths[i].is_finite())
            .min_by(|&a, &b| lengths[a].total_cmp(&lengths[b]))
        {
            is_done[here] = true;
            if here == last {
                break;
            }
            for there in 1..nodes.len() {
                let length = lengths[here] + (nodes[there] - nodes[here]).norm();
                if !is_done[there] && length < lengths[there] && self.is_free(nodes[here], nodes[there]) {
                    lengths[there] = length;
                    previous[there] = here;
                }
            }
        }
        if !lengths[last].is_finite() {
            return Err(RouteError::Blocked);
        }
        let mut path = vec![goal];
        let mut here = last;
        while here != 0 {
            here = previous[here];
            path.push(nodes[here]);
        }
        path.reverse();
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_vision::map::Wall;

    fn point(x: f64, y: f64) -> Point2<f64> {
        Point2::new(x, y)
    }

    fn wall_across() -> WireFrame {
        WireFrame::new(Vec::new(), vec![Wall { from: point(2.0, -5.0), to: point(2.0, 1.0) }])
    }

    #[test]
    fn progress_contains_lateral_error_heading_error_and_distance() {
        let route = Route::new(vec![point(0.0, 0.0), point(2.0, 0.0), point(2.0, 3.0)], 0.1);
        let progress = route.progress(&Pose2::new(1.0, 0.2, 0.1), None).unwrap();
        assert!((progress.progress_m - 1.0).abs() < 1e-12 && (progress.lateral_error_m - 0.2).abs() < 1e-12);
        assert!((progress.heading_error_rad - 0.1).abs() < 1e-12 && (progress.to_go_m - 4.0).abs() < 1e-12);
        let progress = route.progress(&Pose2::new(2.3, 1.0, 0.0), None).unwrap();
        assert!((progress.progress_m - 3.0).abs() < 1e-12 && (progress.lateral_error_m + 0.3).abs() < 1e-12);
        let progress = route.progress(&Pose2::new(1.0, 0.0, 0.0), Some(3.0)).unwrap();
        assert!((progress.progress_m - 2.5).abs() < 1e-12, "limited backward search");
        assert!(Route::default().progress(&Pose2::IDENTITY, None).is_none());
        assert_eq!(route.point_at(2.5), Some(point(2.0, 0.5)));
        assert_eq!(route.point_at(99.0), Some(point(2.0, 3.0)));
    }

    #[test]
    fn a_robot_stays_on_its_leg_at_a_self_intersection() {
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (1.0, -2.0)];
        let route = Route::new(corners.map(|(x, y)| point(x, y)).to_vec(), 0.1);
        let mut farthest = None;
        for i in 0..=20 {
            // Slightly closer to the crossing leg.
            let progress = route.progress(&Pose2::new(0.1 * f64::from(i), 0.01, 0.0), farthest).unwrap();
            assert!((progress.progress_m - 0.1 * f64::from(i)).abs() < 0.011, "{}", progress.progress_m);
            farthest = Some(progress.progress_m);
        }
        let lost = route.progress(&Pose2::new(1.01, 0.2, 0.0), None).unwrap();
        assert!((lost.progress_m - 6.8).abs() < 1e-9, "the whole path: {}", lost.progress_m);
    }

    #[test]
    fn a_path_around_a_wall_uses_a_waypoint() {
        let map = wall_across();
        let planner = Planner { map: &map, clearance_m: 0.3 };
        let (from, goal) = (point(0.0, 0.0), point(4.0, 0.0));
        assert_eq!(planner.path(from, &[], goal), Err(RouteError::Blocked));
        assert_eq!(planner.path(from, &[point(2.0, 1.1)], goal), Err(RouteError::Blocked), "too close");
        let path = planner.path(from, &[point(2.0, 1.5), point(2.0, 3.0)], goal).unwrap();
        assert_eq!(path, [from, point(2.0, 1.5), goal]);
        assert_eq!(planner.path(from, &[], point(f64::NAN, 0.0)), Err(RouteError::NotFinite));
    }

    #[test]
    fn a_robot_close_to_a_wall_may_drive_away() {
        let map = wall_across();
        let planner = Planner { map: &map, clearance_m: 0.3 };
        assert!(planner.is_free(point(1.9, 0.0), point(0.0, 0.0)));
        assert!(!planner.is_free(point(0.0, 0.0), point(1.9, 0.0)));
    }
}
