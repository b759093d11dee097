//! Passages for the robot: directions clear of walls, obstacles and unobserved places, and the one that leads to the
//! goal.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::PathPoint;
use yamabico_vision::map::WireFrame;

use crate::obstacle_memory::ObstacleMemory;
use crate::safe_passage::{Aim, Interval, PLANE_M, SafePassage};
use crate::view_history::ViewHistory;

/// Maximum lateral distance of a direction on the plane, m.
const MAX_LATERAL_M: f64 = 1.2;
/// Lateral distance of two directions on the plane, m.
const STEP_M: f64 = 0.04;
/// Maximum distance from the path at which the robot passes an obstacle, m: keeps it out of side corridors.
const MAX_PATH_OFFSET_M: f64 = 1.0;
/// Distance ahead up to which obstacles are avoided, m.
pub(crate) const AVOIDANCE_RANGE_M: f64 = 2.0;

/// Clearances of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearances {
    /// Half the width of a passage: the radius of the robot plus a margin, m.
    pub half_width_m: f64,
    /// Distance kept from the ends of a gap if it is wide enough, m.
    pub gap_margin_m: f64,
}

/// Surroundings of the robot.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// Pose of the robot, map frame.
    pub robot: &'a Pose2,
    /// Map of the building.
    pub map: &'a WireFrame,
    /// Known obstacles.
    pub obstacles: &'a ObstacleMemory,
    /// Recent views of the camera.
    pub views: &'a ViewHistory,
    /// Path to return to; empty if there is none.
    pub path: &'a [PathPoint],
}

/// Returns true if no obstacle is on the straight line toward `goal_m` (m, on the plane one meter ahead).
#[must_use]
pub fn is_clear(around: &Surroundings<'_>, goal_m: f64, clearances: &Clearances) -> bool {
    around.obstacles.is_free(around.robot, goal_m.atan2(PLANE_M), AVOIDANCE_RANGE_M, clearances.half_width_m)
}

/// Returns the free point on the plane one meter ahead that is nearest to `goal_m` (m), in the gap nearest to a
/// position `lean_m` (m) to the left of it; `None` if no direction is free.
#[must_use]
pub fn aim(
    around: &Surroundings<'_>,
    goal_m: f64,
    lean_m: f64,
    clearances: &Clearances,
    passage: &mut SafePassage,
) -> Option<Aim> {
    passage.begin(Interval::new(-MAX_LATERAL_M, MAX_LATERAL_M));
    let steps = (2.0 * MAX_LATERAL_M / STEP_M).round() as i32;
    for step in 0..=steps {
        let lateral_m = f64::from(step) * STEP_M - MAX_LATERAL_M;
        if !is_open(around, lateral_m, clearances) {
            passage.block(Interval::new(lateral_m, lateral_m).widened(0.5 * STEP_M + 1e-6));
        }
    }
    passage.choose_leaning(goal_m, lean_m, clearances.gap_margin_m)
}

fn is_open(around: &Surroundings<'_>, lateral_m: f64, clearances: &Clearances) -> bool {
    let Surroundings { robot, map, obstacles, views, path } = around;
    let bearing = lateral_m.atan2(PLANE_M);
    let place = robot.transform_point(Point2::new(PLANE_M, lateral_m));
    let here_m = map.clearance(robot.position());
    let halfway = robot.transform_point(Point2::new(0.5 * PLANE_M, 0.5 * lateral_m));
    // A robot that is already closer to a wall may leave it.
    let min_m = clearances.half_width_m.min(here_m + 0.02);
    map.clearance(place) >= clearances.half_width_m
        && map.clearance(halfway) >= min_m
        && map.is_open(robot.position(), place)
        && distance_from(path, place) <= MAX_PATH_OFFSET_M.max(distance_from(path, robot.position()))
        && views.was_in_view(place, map)
        && obstacles.is_free(robot, bearing, AVOIDANCE_RANGE_M, clearances.half_width_m)
}

/// Returns the distance of a point from a path, m; zero for an empty path.
fn distance_from(path: &[PathPoint], place: Point2<f64>) -> f64 {
    let pieces = path.windows(2).map(|pair| {
        let (from, to) = (Point2::new(pair[0].x, pair[0].y), Point2::new(pair[1].x, pair[1].y));
        let (run, off) = (to - from, place - from);
        let along = (off.dot(&run) / run.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        (off - run * along).norm()
    });
    pieces.reduce(f64::min).unwrap_or(0.0)
}

/// Returns the point `ahead_m` (m) ahead of the progress `progress_m` (m) on a path, and the heading of the path
/// there (rad); past the end of the path its last segment is extended. `None` for fewer than two points.
#[must_use]
pub fn point_on_path(path: &[PathPoint], progress_m: f64, ahead_m: f64) -> Option<(Point2<f64>, f64)> {
    let mut left_m = progress_m + ahead_m;
    let mut last = None;
    for pair in path.windows(2) {
        let (from, to) = (Point2::new(pair[0].x, pair[0].y), Point2::new(pair[1].x, pair[1].y));
        let run = to - from;
        let length_m = run.norm();
        if length_m < 1e-6 {
            continue;
        }
        let at = |along_m: f64| (from + run * (along_m / length_m), run.y.atan2(run.x));
        if left_m <= length_m {
            return Some(at(left_m.max(0.0)));
        }
        last = Some(at(left_m));
        left_m -= length_m;
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::time::Time;
    use yamabico_vision::map::Wall;

    const CLEARANCES: Clearances = Clearances { half_width_m: 0.23, gap_margin_m: 0.08 };

    fn corridor() -> WireFrame {
        let wall = |y: f64| Wall { from: Point2::new(-5.0, y), to: Point2::new(20.0, y) };
        WireFrame::new(Vec::new(), vec![wall(1.0), wall(-1.0)])
    }

    /// Aim of a robot that came along the middle, with an obstacle at `obstacle`.
    fn choose(robot: Pose2, obstacle: Option<[f64; 2]>, goal_m: f64) -> Option<Aim> {
        let (map, mut obstacles, mut views) =
            (corridor(), ObstacleMemory::default(), ViewHistory::new(0.577, 0.0));
        for step in 0..12 {
            views.add(Time::ZERO, &Pose2::new(-2.4 + 0.2 * f64::from(step), 0.0, 0.0));
        }
        if let Some([x, y]) = obstacle {
            for _ in 0..2 {
                obstacles.begin_frame();
                obstacles.add_detection(Point2::new(x, y), 0.17, None, Time::ZERO);
                obstacles.end_frame(|_| false);
            }
        }
        let around =
            Surroundings { robot: &robot, map: &map, obstacles: &obstacles, views: &views, path: &[] };
        aim(&around, goal_m, 0.0, &CLEARANCES, &mut SafePassage::default())
    }

    #[test]
    fn a_thing_is_passed_on_the_wider_side() {
        let straight = choose(Pose2::IDENTITY, None, 0.0).expect("free");
        assert!(!straight.deviates);
        let left = choose(Pose2::IDENTITY, Some([1.5, -0.2]), 0.0).expect("free");
        let right = choose(Pose2::IDENTITY, Some([1.5, 0.2]), 0.0).expect("free");
        assert!(left.lateral_m > 0.1 && right.lateral_m < -0.1, "{left:?} {right:?}");
    }

    #[test]
    fn no_aim_leads_into_a_wall() {
        for y in [-0.7, -0.4, 0.0, 0.5, 0.75] {
            for goal_m in [-1.2, -0.5, 0.0, 0.8, 1.2] {
                let robot = Pose2::new(0.0, y, 0.1);
                if let Some(aim) = choose(robot, None, goal_m) {
                    let place = robot.transform_point(Point2::new(PLANE_M, aim.lateral_m));
                    assert!(place.y.abs() < 0.79, "{y} {goal_m}: {place:?}");
                }
            }
        }
    }

    #[test]
    fn a_side_corridor_is_no_detour() {
        let wall = |y: f64, from: f64, to: f64| Wall { from: Point2::new(from, y), to: Point2::new(to, y) };
        let open_right = [wall(1.0, -5.0, 20.0), wall(-1.0, -5.0, 0.2), wall(-1.0, 4.0, 20.0)];
        let map = WireFrame::new(Vec::new(), open_right.to_vec());
        let (obstacles, mut views) = (ObstacleMemory::default(), ViewHistory::new(5.0, 0.0));
        let robot = Pose2::new(0.5, -0.5, -0.6);
        views.add(Time::ZERO, &robot);
        let path = [[0.0, 0.0], [10.0, 0.0]].map(|[x, y]| PathPoint { x, y });
        let aims = |path: &[PathPoint]| {
            let around =
                Surroundings { robot: &robot, map: &map, obstacles: &obstacles, views: &views, path };
            let aim = aim(&around, -0.3, 0.0, &CLEARANCES, &mut SafePassage::default());
            robot.transform_point(Point2::new(PLANE_M, aim.expect("free").lateral_m)).y
        };
        assert!(aims(&[]) < -1.1, "without a path the side corridor is used");
        assert!(aims(&path) > -1.01);
    }

    #[test]
    fn a_blocked_corridor_has_no_passage() {
        let (map, mut obstacles, views) = (corridor(), ObstacleMemory::default(), ViewHistory::new(5.0, 0.0));
        for y in [-0.7, -0.35, 0.0, 0.35, 0.7] {
            obstacles.add_echo(Point2::new(1.2, y), 0.17, Time::ZERO);
        }
        let robot = Pose2::IDENTITY;
        let around =
            Surroundings { robot: &robot, map: &map, obstacles: &obstacles, views: &views, path: &[] };
        assert_eq!(aim(&around, 0.0, 0.0, &CLEARANCES, &mut SafePassage::default()), None);
        assert!(!is_clear(&around, 0.0, &CLEARANCES));
    }

    #[test]
    fn a_path_is_extended_past_its_end() {
        let path = [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]].map(|[x, y]| PathPoint { x, y });
        let (place, heading) = point_on_path(&path, 1.5, 1.0).expect("a path");
        assert!(
            (place - Point2::new(2.0, 0.5)).norm() < 1e-12
                && (heading - std::f64::consts::FRAC_PI_2).abs() < 1e-12
        );
        assert!((point_on_path(&path, 4.5, 1.0).expect("a path").0 - Point2::new(2.0, 3.5)).norm() < 1e-12);
        assert_eq!(point_on_path(&path[..1], 0.0, 1.0), None);
    }
}
