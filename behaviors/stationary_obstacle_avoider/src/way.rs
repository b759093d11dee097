//! Where the robot can go: directions free of walls, of things and of places that nobody has looked at, and the one among them
//! that leads to the goal.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::PathPoint;
use yamabico_vision::map::WireFrame;

use crate::safe_passage::{Aim, Interval, PLANE_M, SafePassage};
use crate::seen_floor::SeenFloor;
use crate::things::Things;

/// How far to either side directions are looked at, on the plane, meters.
const WIDEST_M: f64 = 1.2;
/// Distance of two directions on the plane, meters.
const STEP_M: f64 = 0.04;
/// No farther from its path than this (m) does a robot go to pass something: a side corridor is no way around.
const FARTHEST_ASIDE_M: f64 = 1.0;
/// Things farther ahead are not avoided yet, meters.
const REACH_M: f64 = 2.0;

/// What the robot needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Half the width of what passes: the robot's radius and a margin, meters.
    pub half_width_m: f64,
    /// Distance to keep from the ends of a gap where it is wide enough, meters.
    pub gap_margin_m: f64,
}

/// What is around.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// The robot on the map.
    pub robot: &'a Pose2,
    /// The building.
    pub map: &'a WireFrame,
    /// What stands in it besides.
    pub things: &'a Things,
    /// What was looked at.
    pub floor: &'a SeenFloor,
    /// The path that is to be come back to; empty where there is none.
    pub path: &'a [PathPoint],
}

/// Whether the way straight to the place `goal_m` on the plane is clear of things.
#[must_use]
pub fn is_clear(around: &Surroundings<'_>, goal_m: f64, room: &Room) -> bool {
    around.things.is_free(around.robot, goal_m.atan2(PLANE_M), REACH_M, room.half_width_m)
}

/// The free place on the plane one meter ahead that is nearest to `goal_m`, of the gap that is nearest to `lean_m` to the left
/// of it; `None` where nothing is free.
#[must_use]
pub fn aim(
    around: &Surroundings<'_>,
    goal_m: f64,
    lean_m: f64,
    room: &Room,
    passage: &mut SafePassage,
) -> Option<Aim> {
    passage.begin(Interval::new(-WIDEST_M, WIDEST_M));
    let steps = (2.0 * WIDEST_M / STEP_M).round() as i32;
    for step in 0..=steps {
        let lateral_m = f64::from(step) * STEP_M - WIDEST_M;
        if !is_open(around, lateral_m, room) {
            passage.block(Interval::new(lateral_m, lateral_m).widened(0.5 * STEP_M + 1e-6));
        }
    }
    passage.choose_leaning(goal_m, lean_m, room.gap_margin_m)
}

fn is_open(around: &Surroundings<'_>, lateral_m: f64, room: &Room) -> bool {
    let Surroundings { robot, map, things, floor, path } = around;
    let bearing = lateral_m.atan2(PLANE_M);
    let place = robot.transform_point(Point2::new(PLANE_M, lateral_m));
    let here_m = map.clearance(robot.position());
    let halfway = robot.transform_point(Point2::new(0.5 * PLANE_M, 0.5 * lateral_m));
    // Somebody who stands nearer to a wall than that may leave it.
    let min_m = room.half_width_m.min(here_m + 0.02);
    map.clearance(place) >= room.half_width_m
        && map.clearance(halfway) >= min_m
        && map.is_open(robot.position(), place)
        && aside(path, place) <= FARTHEST_ASIDE_M.max(aside(path, robot.position()))
        && floor.is_known(place, map)
        && things.is_free(robot, bearing, REACH_M, room.half_width_m)
}

/// Distance of a place from a path, meters; zero where there is none.
fn aside(path: &[PathPoint], place: Point2<f64>) -> f64 {
    let pieces = path.windows(2).map(|pair| {
        let (from, to) = (Point2::new(pair[0].x, pair[0].y), Point2::new(pair[1].x, pair[1].y));
        let (run, off) = (to - from, place - from);
        let along = (off.dot(&run) / run.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        (off - run * along).norm()
    });
    pieces.reduce(f64::min).unwrap_or(0.0)
}

/// The place `ahead_m` beyond the progress `progress_m` (m) on a path, on its last piece beyond its end; and the path's heading
/// there (rad). `None` for less than two points.
#[must_use]
pub fn place_on(path: &[PathPoint], progress_m: f64, ahead_m: f64) -> Option<(Point2<f64>, f64)> {
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

    const ROOM: Room = Room { half_width_m: 0.23, gap_margin_m: 0.08 };

    fn corridor() -> WireFrame {
        let wall = |y: f64| Wall { from: Point2::new(-5.0, y), to: Point2::new(20.0, y) };
        WireFrame::new(Vec::new(), vec![wall(1.0), wall(-1.0)])
    }

    /// The aim of a robot that came along the middle, with a thing seen at a place.
    fn choose(robot: Pose2, thing: Option<[f64; 2]>, goal_m: f64) -> Option<Aim> {
        let (map, mut things, mut floor) = (corridor(), Things::default(), SeenFloor::new(0.577, 0.0));
        for step in 0..12 {
            floor.look(Time::ZERO, &Pose2::new(-2.4 + 0.2 * f64::from(step), 0.0, 0.0));
        }
        if let Some([x, y]) = thing {
            for _ in 0..2 {
                things.begin();
                things.see(Point2::new(x, y), 0.17, None, Time::ZERO);
                things.end(|_| false);
            }
        }
        let around = Surroundings { robot: &robot, map: &map, things: &things, floor: &floor, path: &[] };
        aim(&around, goal_m, 0.0, &ROOM, &mut SafePassage::default())
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
    fn a_side_corridor_is_no_way_around() {
        let wall = |y: f64, from: f64, to: f64| Wall { from: Point2::new(from, y), to: Point2::new(to, y) };
        let open_right = [wall(1.0, -5.0, 20.0), wall(-1.0, -5.0, 0.2), wall(-1.0, 4.0, 20.0)];
        let map = WireFrame::new(Vec::new(), open_right.to_vec());
        let (things, mut floor) = (Things::default(), SeenFloor::new(5.0, 0.0));
        let robot = Pose2::new(0.5, -0.5, -0.6);
        floor.look(Time::ZERO, &robot);
        let path = [[0.0, 0.0], [10.0, 0.0]].map(|[x, y]| PathPoint { x, y });
        let aims = |path: &[PathPoint]| {
            let around = Surroundings { robot: &robot, map: &map, things: &things, floor: &floor, path };
            let aim = aim(&around, -0.3, 0.0, &ROOM, &mut SafePassage::default());
            robot.transform_point(Point2::new(PLANE_M, aim.expect("free").lateral_m)).y
        };
        assert!(aims(&[]) < -1.1, "there is room in it");
        assert!(aims(&path) > -1.01);
    }

    #[test]
    fn what_fills_the_corridor_leaves_no_way() {
        let (map, mut things, floor) = (corridor(), Things::default(), SeenFloor::new(5.0, 0.0));
        for y in [-0.7, -0.35, 0.0, 0.35, 0.7] {
            things.hear(Point2::new(1.2, y), 0.17, Time::ZERO);
        }
        let robot = Pose2::IDENTITY;
        let around = Surroundings { robot: &robot, map: &map, things: &things, floor: &floor, path: &[] };
        assert_eq!(aim(&around, 0.0, 0.0, &ROOM, &mut SafePassage::default()), None);
        assert!(!is_clear(&around, 0.0, &ROOM));
    }

    #[test]
    fn a_path_goes_on_beyond_its_end() {
        let path = [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]].map(|[x, y]| PathPoint { x, y });
        let (place, heading) = place_on(&path, 1.5, 1.0).expect("a path");
        assert!(
            (place - Point2::new(2.0, 0.5)).norm() < 1e-12
                && (heading - std::f64::consts::FRAC_PI_2).abs() < 1e-12
        );
        assert!((place_on(&path, 4.5, 1.0).expect("a path").0 - Point2::new(2.0, 3.5)).norm() < 1e-12);
        assert_eq!(place_on(&path[..1], 0.0, 1.0), None);
    }
}
