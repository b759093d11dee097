//! The lane beside the path that leads on: lateral offsets from the path, rated by how far they are free.

use nalgebra::Point2;

use super::crossing::Walkway;
use super::lane::{FREE_M, Lane, ROOM_M};
use super::stations::{PathAhead, STATIONS, station_m};
use super::unseen::UnseenGround;

/// Distance along the path in which the robot changes to another lane, m.
const CHANGE_M: f64 = 0.8;
/// Distance of two lanes, m, and their number on each side: a box in the middle of a corridor of 2.5 m needs 0.7 m.
const LANE_M: f64 = 0.05;
const LANES_ASIDE: usize = 18;
/// Length of the lane whose room limits the speed, m: three seconds of driving.
const NEAR_M: f64 = 1.0;
/// Costs: per meter of offset, of change from the last lane, of room that is missing, of room that is missing on both sides between an
/// obstacle and a wall, and of free length that is missing. A passage that is hardly wider than the robot outweighs the way around on
/// the other side.
const OFFSET_COST: f64 = 0.5;
const CHANGE_COST: f64 = 0.35;
const ROOM_COST: f64 = 2.5;
const SQUEEZE_COST: f64 = 12.0;
const LENGTH_COST: f64 = 3.0;
/// Cost per meter of a lane over ground that was not seen as floor, which outweighs the room that is missing beside it, and the length that
/// costs nothing, m: single places.
const UNSEEN_COST: f64 = 8.0;
const UNSEEN_FREE_M: f64 = 0.03;
/// Cost of a lane before what walks across the path: also if it pauses, it is passed behind.
const BEFORE_COST: f64 = 2.0;
/// Cost of a lane on the other side of the path than the last one, and the offset from which a lane is on a side, m. An
/// obstacle in the middle leaves both sides nearly as good, so that a robot without it wavers until it is too near.
const SIDE_COST: f64 = 1.5;
const SIDE_M: f64 = 0.15;
/// Distance by which the robot may come nearer to an obstacle or a wall that it is already too near to, m; more to an
/// obstacle that keeps most of the clearance, since a robot that veers away comes nearer at first.
pub(super) const APPROACH_M: f64 = 0.01;
const VEER_M: f64 = 0.05;

/// Length of the arc ahead that is looked at, m, and the number of its places.
pub const ARC_M: f64 = 0.4;
const ARC_STEPS: usize = 10;

/// The best lane, and that of the path itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plan {
    /// Lane with the lowest cost.
    pub best: Lane,
    /// Lane that other behaviors follow.
    pub nominal: Lane,
}

/// Surroundings of a robot on its path. Positions are in the robot frame, m.
pub struct Scene<'a> {
    /// Path ahead.
    pub path: &'a PathAhead,
    /// Places that are occupied.
    pub obstacles: &'a [Point2<f32>],
    /// Ground beside the path that was not seen as floor.
    pub unseen: &'a UnseenGround,
    /// Side of the path on which something walks on.
    pub walkway: Option<Walkway>,
    /// Distance from a place to the nearest wall, m.
    pub wall_m: &'a dyn Fn(Point2<f64>) -> f64,
    /// Distance that the robot's center must keep from obstacles, m.
    pub clearance_m: f64,
    /// Distance that the robot's center must keep from walls, m.
    pub wall_clearance_m: f64,
    /// Distance of the robot's center at which it nearly touches an obstacle, m: along its arc it comes no nearer.
    pub touch_m: f64,
    /// Distance of the robot's center at which it may touch a wall, whose place is not exact, m: it comes no nearer.
    pub wall_touch_m: f64,
}

impl Scene<'_> {
    /// Chooses a lane; `last_m` is the offset of the last one, m.
    #[must_use]
    pub fn plan(&self, last_m: f64) -> Plan {
        let min_wall_m = self.min_wall_m();
        let nominal = self.rate(0.0, min_wall_m);
        let mut best = (f64::INFINITY, nominal);
        for i in 0..=2 * LANES_ASIDE {
            let lane = self.rate((i as f64 - LANES_ASIDE as f64) * LANE_M, min_wall_m);
            let missing_room_m = (self.clearance_m + ROOM_M - lane.gap_m).max(0.0);
            let missing_length_m = (FREE_M - lane.free_m).max(0.0);
            let unseen_m = self.unseen.length_m(|ahead_m| self.lateral_m(lane.offset_m, ahead_m));
            let cost = OFFSET_COST * lane.offset_m.abs()
                + CHANGE_COST * (lane.offset_m - last_m).abs()
                + if is_other_side(lane.offset_m, last_m) { SIDE_COST } else { 0.0 }
                + if self.is_before(lane.offset_m) { BEFORE_COST } else { 0.0 }
                + ROOM_COST * missing_room_m
                + SQUEEZE_COST * lane.squeeze_m
                + LENGTH_COST * missing_length_m
                + UNSEEN_COST * (unseen_m - UNSEEN_FREE_M).max(0.0);
            if cost < best.0 {
                best = (cost, lane);
            }
        }
        Plan { best: best.1, nominal }
    }

    /// Share of the places within one meter to the left (`side` 1) or right (-1) of the path, in the next meter, where the
    /// robot could stand.
    #[must_use]
    pub fn room(&self, side: f64) -> f64 {
        const STEPS: usize = 10;
        const AHEAD: [usize; 3] = [4, 8, 12];
        let is_free = |place: Point2<f64>| {
            let at = place.cast::<f32>();
            (self.wall_m)(place) > self.wall_clearance_m
                && self.obstacles.iter().all(|cell| (cell - at).norm() > self.clearance_m as f32)
        };
        let beside = |step: usize| side * (step + 1) as f64 / STEPS as f64;
        let places = (0..STEPS).flat_map(|step| AHEAD.map(|i| self.path.stations[i].beside(beside(step))));
        places.filter(|&place| is_free(place)).count() as f64 / (STEPS * AHEAD.len()) as f64
    }

    /// Distance that the robot can drive straight ahead before it comes nearer to an obstacle or a wall than walls are kept away, m;
    /// infinite without either on the length of the path.
    #[must_use]
    pub fn straight_m(&self) -> f64 {
        let reach = |obstacle: &Point2<f32>| {
            let (ahead_m, aside_m) = (f64::from(obstacle.x), f64::from(obstacle.y));
            let before_m = self.wall_clearance_m * self.wall_clearance_m - aside_m * aside_m;
            (ahead_m > 0.0 && before_m > 0.0).then(|| ahead_m - before_m.sqrt())
        };
        let to_obstacle_m = self.obstacles.iter().filter_map(reach).fold(f64::INFINITY, f64::min);
        let mut walls_m =
            (0..STATIONS).map(|i| (station_m(i), (self.wall_m)(Point2::new(station_m(i), 0.0))));
        let min_wall_m = self.min_wall_m();
        let to_wall_m = walls_m.find(|&(_, wall_m)| wall_m < min_wall_m);
        to_wall_m.map_or(to_obstacle_m, |(ahead_m, _)| to_obstacle_m.min(ahead_m - station_m(0)))
    }

    /// Distance that the robot can drive along an arc of this curvature (1/m, positive left) before it nearly touches something, m; at
    /// most [`ARC_M`].
    #[must_use]
    pub fn arc_m(&self, curvature: f64) -> f64 {
        let min_wall_m = self.min_wall_m().min(self.wall_touch_m);
        let is_blocked = |place: Point2<f64>| {
            let near = |obstacle: &&Point2<f32>| (obstacle.cast::<f64>() - place).norm() < self.touch_m;
            (self.wall_m)(place) < min_wall_m
                || self.obstacles.iter().filter(near).any(|obstacle| {
                    let obstacle = obstacle.cast::<f64>();
                    (obstacle - place).norm() < nearer(obstacle.coords.norm(), self.touch_m)
                })
        };
        let step_m = ARC_M / ARC_STEPS as f64;
        let mut along = (0..ARC_STEPS).map(|i| i as f64 * step_m);
        along.find(|&along_m| is_blocked(on_arc(curvature, along_m + step_m))).unwrap_or(ARC_M)
    }

    /// True if a lane leads past what walks across the path on the side to which that walks.
    fn is_before(&self, offset_m: f64) -> bool {
        self.walkway.is_some_and(|walkway| walkway.is_before(offset_m))
    }

    /// Smallest distance to a wall on the way, m.
    fn min_wall_m(&self) -> f64 {
        let here_m = (self.wall_m)(Point2::origin());
        self.wall_clearance_m.min(nearer(here_m, self.wall_touch_m))
    }

    /// Distance to the left of the path at which a robot that changes to the lane with an offset is `ahead_m` farther on, m.
    fn lateral_m(&self, offset_m: f64, ahead_m: f64) -> f64 {
        let share = (ahead_m / CHANGE_M).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        self.path.lateral_m + share * (offset_m - self.path.lateral_m)
    }

    /// Rates the lane with an offset: how far it is free, and how near obstacles are. Walls are at least `min_wall_m` away on it.
    fn rate(&self, offset_m: f64, min_wall_m: f64) -> Lane {
        let clearance = self.clearance_m as f32;
        let (mut gap, mut near_gap) = (f32::INFINITY, f32::INFINITY);
        let (mut free_m, mut squeeze_m) = (None, 0.0_f64);
        for (i, station) in self.path.stations.iter().enumerate() {
            let ahead_m = station_m(i);
            let place = station.beside(self.lateral_m(offset_m, ahead_m));
            let at = place.cast::<f32>();
            let nearest = distance_to_nearest(self.obstacles, at);
            gap = gap.min(nearest);
            if ahead_m < NEAR_M {
                near_gap = gap;
            }
            let is_hit = nearest < clearance
                && self.obstacles.iter().any(|obstacle| {
                    let distance = (obstacle - at).norm();
                    let may_approach_m =
                        if distance < clearance - VEER_M as f32 { APPROACH_M } else { VEER_M };
                    distance < clearance && distance < obstacle.coords.norm() - may_approach_m as f32
                });
            let wall_m = (self.wall_m)(place);
            if free_m.is_none() && (is_hit || wall_m < min_wall_m) {
                free_m = Some(ahead_m);
            }
            let [to_obstacle_m, to_wall_m] =
                [self.clearance_m - f64::from(nearest), self.wall_clearance_m - wall_m];
            squeeze_m = squeeze_m.max(ROOM_M + to_obstacle_m.min(to_wall_m));
        }
        let free_m = free_m.unwrap_or(station_m(STATIONS));
        Lane { offset_m, free_m, gap_m: f64::from(gap), near_gap_m: f64::from(near_gap), squeeze_m }
    }
}

/// Distance to which the robot may come nearer from `distance_m` to what it is too near to, but not nearer than `touch_m`, m.
fn nearer(distance_m: f64, touch_m: f64) -> f64 {
    (distance_m - APPROACH_M).max(touch_m.min(distance_m))
}

/// Place at `along_m` (m) on an arc from the origin straight ahead.
fn on_arc(curvature: f64, along_m: f64) -> Point2<f64> {
    let half = 0.5 * curvature * along_m;
    let chord_m = if half.abs() < 1e-6 { along_m } else { along_m * half.sin() / half };
    Point2::new(chord_m * half.cos(), chord_m * half.sin())
}

/// Distance from `place` to the nearest obstacle, m; infinite without any.
pub(super) fn distance_to_nearest(obstacles: &[Point2<f32>], place: Point2<f32>) -> f32 {
    // Several minima side by side: the processor takes them at once.
    const SIDE_BY_SIDE: usize = 8;
    let smaller = |a: f32, b: f32| if b < a { b } else { a };
    let mut squares = [f32::INFINITY; SIDE_BY_SIDE];
    let mut chunks = obstacles.chunks_exact(SIDE_BY_SIDE);
    for chunk in &mut chunks {
        for (square, obstacle) in squares.iter_mut().zip(chunk) {
            *square = smaller(*square, (obstacle - place).norm_squared());
        }
    }
    let rest = chunks.remainder().iter().map(|obstacle| (obstacle - place).norm_squared());
    squares.into_iter().chain(rest).fold(f32::INFINITY, smaller).sqrt()
}

/// True if two lanes lie on different sides of the path.
fn is_other_side(a_m: f64, b_m: f64) -> bool {
    a_m * b_m < 0.0 && a_m.abs().min(b_m.abs()) > SIDE_M
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::lanes::stations::Station;

    /// Plan of a robot at `lateral_m` in a straight corridor, 1.8 m wide, with obstacles of a few cells.
    fn plan(lateral_m: f64, boxes: &[[f32; 2]], last_m: f64) -> Plan {
        plan_over(lateral_m, boxes, last_m, None, |_| true)
    }

    /// The same plan beside what walks, where `is_floor` tells which places were seen as floor.
    fn plan_over(
        lateral_m: f64,
        boxes: &[[f32; 2]],
        last_m: f64,
        walkway: Option<Walkway>,
        is_floor: impl Fn(Point2<f64>) -> bool,
    ) -> Plan {
        let stations = std::array::from_fn(|i| Station {
            place: Point2::new(station_m(i), -lateral_m),
            left: Vector2::new(0.0, 1.0),
        });
        let path = PathAhead { stations, lateral_m };
        let mut obstacles = Vec::new();
        for &[x, y] in boxes {
            for i in -3..=3 {
                obstacles.push(Point2::new(x, y + 0.05 * i as f32));
            }
        }
        let wall_m = |place: Point2<f64>| 0.9 - (place.y + lateral_m).abs();
        let scene = Scene {
            path: &path,
            obstacles: &obstacles,
            unseen: &UnseenGround::of(&path, is_floor),
            walkway,
            wall_m: &wall_m,
            clearance_m: 0.29,
            wall_clearance_m: 0.23,
            touch_m: 0.21,
            wall_touch_m: 0.21,
        };
        scene.plan(last_m)
    }

    #[test]
    fn an_empty_path_is_followed() {
        for lateral_m in [-0.5, 0.0, 0.3] {
            let plan = plan(lateral_m, &[], 0.0);
            assert!(plan.best.offset_m.abs() < 1e-9 && plan.nominal.is_open(0.29), "{plan:?}");
        }
    }

    #[test]
    fn a_box_is_passed_on_the_wider_side() {
        for side in [1.0, -1.0] {
            let plan = plan(0.0, &[[1.5, 0.25 * side]], 0.0);
            assert!(!plan.nominal.is_open(0.29));
            assert!(plan.best.is_open(0.29), "{plan:?}");
            assert!((-0.6..-0.15).contains(&(plan.best.offset_m * f64::from(side))), "{plan:?}");
        }
    }

    #[test]
    fn the_side_once_chosen_is_kept() {
        for side in [1.0, -1.0] {
            for off in [-0.08, 0.0, 0.08] {
                let plan = plan(0.0, &[[1.5, off]], 0.3 * side);
                assert!(plan.best.offset_m * side > 0.3, "obstacle at {off}: {plan:?}");
            }
            let blocked = plan(0.0, &[[0.9, 0.35 * side as f32], [0.9, 0.0]], 0.3 * side);
            assert!(blocked.best.offset_m * side < 0.0, "a side that is blocked is left: {blocked:?}");
        }
    }

    #[test]
    fn a_passage_hardly_wider_than_the_robot_is_left_for_the_way_around() {
        for side in [1.0, -1.0] {
            let passed = |off: f32| plan(0.0, &[[1.5, off * side as f32]], 0.3 * side).best;
            assert!(passed(0.05).offset_m * side > 0.3, "0.7 m between the box and the wall");
            assert!(passed(0.2).offset_m * side < 0.0, "0.55 m: {:?}", passed(0.2));
            assert!(passed(0.2).squeeze_m == 0.0);
        }
    }

    #[test]
    fn what_walks_across_is_passed_behind_if_there_is_room() {
        for side in [1.0, -1.0] {
            let walkway = Some(Walkway { from_m: 0.0, side });
            let beside = |boxes: &[[f32; 2]]| plan_over(0.0, boxes, 0.4 * side, walkway, |_| true).best;
            let lane = beside(&[[1.5, 0.0]]);
            assert!(lane.offset_m * side < -0.3 && lane.free_m >= FREE_M, "{lane:?}");
            let lane = beside(&[[1.5, 0.0], [1.5, -0.35 * side as f32], [1.5, -0.7 * side as f32]]);
            assert!(lane.offset_m * side > 0.3 && lane.free_m >= FREE_M, "{lane:?}");
        }
    }

    #[test]
    fn floor_that_was_seen_is_better_and_other_ground_is_driven_over_where_there_is_no_other() {
        // The flank of a box whose foot is below the picture, and of which its far side alone is known.
        let is_floor =
            |place: Point2<f64>| !((0.4..0.7).contains(&place.x) && (-0.05..0.3).contains(&place.y));
        let known = [[0.55, 0.45]];
        let [without, with] = [plan(0.0, &known, 0.0), plan_over(0.0, &known, 0.0, None, is_floor)];
        assert!((-0.25..0.0).contains(&without.best.offset_m), "{without:?}");
        assert!((-0.6..-0.3).contains(&with.best.offset_m) && with.best.free_m >= FREE_M, "{with:?}");
        let dark = plan_over(0.0, &[], 0.0, None, |_| false);
        assert!(dark.best.offset_m.abs() < 1e-9 && dark.nominal.is_open(0.29), "{dark:?}");
    }

    #[test]
    fn a_blocked_corridor_has_no_free_lane() {
        let plan = plan(0.0, &[[1.5, 0.6], [1.5, 0.3], [1.5, 0.0], [1.5, -0.3], [1.5, -0.6]], 0.0);
        assert!(plan.best.free_m < 1.4, "{plan:?}");
    }

    #[test]
    fn an_arc_ends_before_what_it_would_touch() {
        let path = PathAhead::default();
        let arc_m = |obstacles: &[Point2<f32>], wall_m: &dyn Fn(Point2<f64>) -> f64, curvature: f64| {
            let scene = Scene {
                path: &path,
                obstacles,
                unseen: &UnseenGround::default(),
                walkway: None,
                wall_m,
                clearance_m: 0.29,
                wall_clearance_m: 0.26,
                touch_m: 0.215,
                wall_touch_m: 0.25,
            };
            scene.arc_m(curvature)
        };
        let open = |_: Point2<f64>| f64::INFINITY;
        let beside = [Point2::new(0.35, 0.2)];
        assert!(arc_m(&[], &open, 0.0) == ARC_M && arc_m(&beside, &open, -3.0) == ARC_M);
        let [straight_m, toward_m] = [0.0, 3.0].map(|curvature| arc_m(&beside, &open, curvature));
        assert!(toward_m > 0.1 && toward_m < straight_m && straight_m < 0.3, "{toward_m} {straight_m}");
        let wall = |place: Point2<f64>| 0.22 - place.y;
        assert!(arc_m(&[], &wall, 2.0) < 0.1 && arc_m(&[], &wall, -2.0) == ARC_M, "away from the wall");
        let wall = |place: Point2<f64>| 0.3 - place.y;
        let [along_m, nearer_m] = [0.5, 0.75].map(|curvature| arc_m(&[], &wall, curvature));
        assert!(
            along_m == ARC_M && nearer_m < ARC_M,
            "the place of the wall is not exact: {along_m} {nearer_m}"
        );
    }

    #[test]
    fn a_robot_near_a_wall_comes_no_nearer() {
        let mut lateral_m = 0.66;
        for _ in 0..50 {
            let stations = std::array::from_fn(|i| Station {
                place: Point2::new(station_m(i), -lateral_m),
                left: Vector2::y(),
            });
            let path = PathAhead { stations, lateral_m };
            let wall_m = |place: Point2<f64>| 0.9 - (place.y + lateral_m);
            let scene = Scene {
                path: &path,
                obstacles: &[],
                unseen: &UnseenGround::default(),
                walkway: None,
                wall_m: &wall_m,
                clearance_m: 0.29,
                wall_clearance_m: 0.25,
                touch_m: 0.21,
                wall_touch_m: 0.23,
            };
            let is_free = |lane_m: &f64| scene.rate(*lane_m, scene.min_wall_m()).free_m >= FREE_M;
            let lanes = (0..40).map(|i| lateral_m + 0.002 * f64::from(i));
            lateral_m = lanes.take_while(is_free).last().unwrap_or(lateral_m);
        }
        assert!((0.66..0.6701).contains(&lateral_m), "step by step to {lateral_m} m, with the wall at 0.9 m");
    }

    #[test]
    fn a_robot_beside_an_obstacle_may_leave_it() {
        let near = plan(0.3, &[[0.0, 0.41], [0.1, 0.41]], 0.0);
        assert!(near.best.free_m >= FREE_M, "{near:?}");
        let into = plan(0.3, &[[0.35, 0.0]], 0.3);
        assert!(into.best.free_m < 0.4, "{into:?}");
    }

    #[test]
    fn only_what_is_near_slows_the_robot_down() {
        for (ahead_m, room) in [(0.8, 0.0), (1.9, 1.0)] {
            let lane = plan(0.0, &[[ahead_m, 0.0], [ahead_m, 0.6], [ahead_m, -0.6]], 0.0).best;
            assert!(
                lane.room(0.29) == room && lane.gap_m < 0.29,
                "end of the corridor at {ahead_m} m: {lane:?}"
            );
        }
    }
}
