//! Paths along straight lines between way-points, and where the robot stands on one.

use nalgebra::Point2;
use thiserror::Error;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::map::WireFrame;

/// Corners nearer to each other (m) are one.
const SAME_PLACE_M: f64 = 1e-6;
/// Distance between the places of a way whose clearance is looked at, meters.
const SAMPLE_M: f64 = 0.05;
/// The robot may be pushed back along its path by this, meters; farther back it is not looked for ...
const SLIP_BACK_M: f64 = 0.5;
/// ... nor farther ahead than this at once, meters.
const STEP_AHEAD_M: f64 = 0.5;
/// Most corners of a path.
pub const MAX_CORNERS: usize = 64;

/// Why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RouteError {
    /// Every way crosses a wall or passes too near to one.
    #[error("every way to the goal is blocked by a wall of the map")]
    Blocked,
    /// The goal is no place.
    #[error("the goal is no place")]
    NotFinite,
}

/// A path: corners, map frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Route {
    corners: Vec<Point2<f64>>,
    /// The goal is reached within this distance, meters.
    pub tolerance_m: f64,
}

/// Where the robot stands on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Path length behind, meters.
    pub progress_m: f64,
    /// Path length ahead, meters.
    pub to_go_m: f64,
    /// Robot left of the path, meters.
    pub lateral_error_m: f64,
    /// Robot's heading less the path's, rad.
    pub heading_error_rad: f64,
    /// The path's heading here, rad.
    pub heading_rad: f64,
    /// Straight distance to the end, meters.
    pub distance_m: f64,
}

/// What a way must keep from the walls.
#[derive(Clone, Copy, Debug)]
pub struct Planner<'a> {
    /// The map.
    pub map: &'a WireFrame,
    /// Least distance of a way from a wall, meters.
    pub clearance_m: f64,
}

impl Route {
    /// A path along these corners.
    #[must_use]
    pub fn new(corners: Vec<Point2<f64>>, tolerance_m: f64) -> Self {
        Self { corners, tolerance_m }
    }

    /// Its corners.
    #[must_use]
    pub fn corners(&self) -> &[Point2<f64>] {
        &self.corners
    }

    /// Whether it leads anywhere.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.corners.len() < 2
    }

    /// Where a robot stands: the nearest place of the path; of a robot that had come this far (m) already, the nearest one
    /// thereabouts, for a path may cross itself. `None` without a path.
    #[must_use]
    pub fn station(&self, pose: &Pose2, farthest_m: Option<f64>) -> Option<Station> {
        let at = pose.position();
        let min_m = farthest_m.map_or(0.0, |farthest| (farthest - SLIP_BACK_M).max(0.0));
        let max_m = farthest_m.map_or(f64::INFINITY, |farthest| farthest + STEP_AHEAD_M);
        let total_m = self.length_m();
        let mut begin_m = 0.0;
        let mut best: Option<(f64, Station)> = None;
        for pair in self.corners.windows(2) {
            let run = pair[1] - pair[0];
            let length = run.norm();
            if length <= SAME_PLACE_M {
                continue;
            }
            let [least, most] = [min_m, max_m].map(|limit| ((limit - begin_m) / length).clamp(0.0, 1.0));
            let share = (run.dot(&(at - pair[0])) / (length * length)).clamp(least, most);
            let distance = (at - (pair[0] + run * share)).norm();
            let is_near = begin_m <= max_m && begin_m + length >= min_m;
            if is_near && best.as_ref().is_none_or(|(nearest, _)| distance < *nearest) {
                let heading_rad = run.y.atan2(run.x);
                let progress_m = begin_m + share * length;
                best = Some((
                    distance,
                    Station {
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
        best.map(|(_, station)| station)
    }

    /// The place at this length from the beginning, meters; the ends beyond them.
    #[must_use]
    pub fn place_at(&self, progress_m: f64) -> Option<Point2<f64>> {
        let mut rest = progress_m.max(0.0);
        for pair in self.corners.windows(2) {
            let run = pair[1] - pair[0];
            let length = run.norm();
            if rest <= length && length > SAME_PLACE_M {
                return Some(pair[0] + run * (rest / length));
            }
            rest -= length;
        }
        self.corners.last().copied()
    }

    /// The corners that lie beyond this length from the beginning, meters; the last one always does.
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

    /// Meters from its beginning to its end.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.corners.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
    }
}

impl Planner<'_> {
    /// Whether the straight way keeps its distance from every wall. Where it begins it may be nearer, if it leads away.
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

    /// The shortest path from `from` to `goal` along straight ways, by way of any of `way_points`.
    ///
    /// # Errors
    /// Why there is none.
    pub fn path(
        &self,
        from: Point2<f64>,
        way_points: &[Point2<f64>],
        goal: Point2<f64>,
    ) -> Result<Vec<Point2<f64>>, RouteError> {
        if ![from.x, from.y, goal.x, goal.y].iter().all(|value| value.is_finite()) {
            return Err(RouteError::NotFinite);
        }
        let mut places = vec![from];
        places.extend_from_slice(way_points);
        places.push(goal);
        let last = places.len() - 1;
        let mut lengths = vec![f64::INFINITY; places.len()];
        let mut before = vec![0; places.len()];
        let mut is_done = vec![false; places.len()];
        lengths[0] = 0.0;
        // Dijkstra's algorithm: a place's ways are looked at when it is reached.
        while let Some(here) = (0..places.len())
            .filter(|&i| !is_done[i] && lengths[i].is_finite())
            .min_by(|&a, &b| lengths[a].total_cmp(&lengths[b]))
        {
            is_done[here] = true;
            if here == last {
                break;
            }
            for there in 1..places.len() {
                let length = lengths[here] + (places[there] - places[here]).norm();
                if !is_done[there] && length < lengths[there] && self.is_free(places[here], places[there]) {
                    lengths[there] = length;
                    before[there] = here;
                }
            }
        }
        if !lengths[last].is_finite() {
            return Err(RouteError::Blocked);
        }
        let mut path = vec![goal];
        let mut here = last;
        while here != 0 {
            here = before[here];
            path.push(places[here]);
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
    fn a_station_tells_side_heading_and_progress() {
        let route = Route::new(vec![point(0.0, 0.0), point(2.0, 0.0), point(2.0, 3.0)], 0.1);
        let station = route.station(&Pose2::new(1.0, 0.2, 0.1), None).unwrap();
        assert!((station.progress_m - 1.0).abs() < 1e-12 && (station.lateral_error_m - 0.2).abs() < 1e-12);
        assert!((station.heading_error_rad - 0.1).abs() < 1e-12 && (station.to_go_m - 4.0).abs() < 1e-12);
        let station = route.station(&Pose2::new(2.3, 1.0, 0.0), None).unwrap();
        assert!((station.progress_m - 3.0).abs() < 1e-12 && (station.lateral_error_m + 0.3).abs() < 1e-12);
        let station = route.station(&Pose2::new(1.0, 0.0, 0.0), Some(3.0)).unwrap();
        assert!((station.progress_m - 2.5).abs() < 1e-12, "it does not go far back");
        assert!(Route::default().station(&Pose2::IDENTITY, None).is_none());
        assert_eq!(route.place_at(2.5), Some(point(2.0, 0.5)));
        assert_eq!(route.place_at(99.0), Some(point(2.0, 3.0)));
    }

    #[test]
    fn where_a_path_crosses_itself_the_robot_stays_on_its_piece() {
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (1.0, -2.0)];
        let route = Route::new(corners.map(|(x, y)| point(x, y)).to_vec(), 0.1);
        let mut farthest = None;
        for i in 0..=20 {
            // A little nearer to the piece that crosses.
            let station = route.station(&Pose2::new(0.1 * f64::from(i), 0.01, 0.0), farthest).unwrap();
            assert!((station.progress_m - 0.1 * f64::from(i)).abs() < 0.011, "{}", station.progress_m);
            farthest = Some(station.progress_m);
        }
        let lost = route.station(&Pose2::new(1.01, 0.2, 0.0), None).unwrap();
        assert!((lost.progress_m - 6.8).abs() < 1e-9, "the whole path: {}", lost.progress_m);
    }

    #[test]
    fn a_way_round_a_wall_goes_by_a_way_point() {
        let map = wall_across();
        let planner = Planner { map: &map, clearance_m: 0.3 };
        let (from, goal) = (point(0.0, 0.0), point(4.0, 0.0));
        assert_eq!(planner.path(from, &[], goal), Err(RouteError::Blocked));
        assert_eq!(planner.path(from, &[point(2.0, 1.1)], goal), Err(RouteError::Blocked), "too near");
        let path = planner.path(from, &[point(2.0, 1.5), point(2.0, 3.0)], goal).unwrap();
        assert_eq!(path, [from, point(2.0, 1.5), goal]);
        assert_eq!(planner.path(from, &[], point(f64::NAN, 0.0)), Err(RouteError::NotFinite));
    }

    #[test]
    fn a_robot_near_a_wall_may_leave_it() {
        let map = wall_across();
        let planner = Planner { map: &map, clearance_m: 0.3 };
        assert!(planner.is_free(point(1.9, 0.0), point(0.0, 0.0)));
        assert!(!planner.is_free(point(0.0, 0.0), point(1.9, 0.0)));
    }
}
