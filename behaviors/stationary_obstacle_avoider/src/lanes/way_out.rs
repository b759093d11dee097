//! The way around what blocks all lanes: the shortest route over a small grid to a place farther along the path.
//!
//! Lanes only veer beside the path. Where they end, the robot may have to turn away from it, or drive across it, first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Point2, Rotation2, Vector2};

use super::planner::{APPROACH_M, Scene, distance_to_nearest};

/// Side of a cell, m, and cells of the grid along the path and across it; the robot's cell in it.
const CELL_M: f64 = 0.08;
const CELLS: [usize; 2] = [42, 43];
const ROBOT: [usize; 2] = [12, 21];
/// Station of the path that the route leads to, 1.65 m ahead, and the distance from the path at which it may end, m.
const GOAL_STATION: usize = 20;
const GOAL_M: [f64; 2] = [0.1, 0.9];
/// Distance from the robot within which places count that it is too near to something at, m: it is there.
const LEAVING_M: f64 = 0.4;
/// Room beside the route that is worth a detour, m, and the cost per meter of route without it.
const ROOM_M: f64 = 0.12;
const ROOM_COST: f64 = 1.0;
/// Shortest and longest first leg, m.
const LEG_M: (f64, f64) = (0.12, 0.9);
/// Costs are integers: steps of 0.1 mm.
const COST_PER_M: f64 = 1e4;

/// First straight leg of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Direction, robot frame, rad.
    pub bearing: f64,
    /// Length, m.
    pub length_m: f64,
}

/// Finds routes. Allocates when it is created.
#[derive(Clone, Debug)]
pub struct WayFinder {
    /// Cost of the route to each cell, and the cell before it.
    costs: Vec<u32>,
    before: Vec<u16>,
    /// Cost factor of each cell that was looked at; not finite if the robot cannot be there.
    factors: Vec<Option<f64>>,
    open: BinaryHeap<Reverse<(u32, u16)>>,
    route: Vec<u16>,
}

impl Default for WayFinder {
    fn default() -> Self {
        let cells = CELLS[0] * CELLS[1];
        Self {
            costs: vec![u32::MAX; cells],
            before: vec![0; cells],
            factors: vec![None; cells],
            open: BinaryHeap::with_capacity(8 * cells),
            route: Vec::with_capacity(cells),
        }
    }
}

impl WayFinder {
    /// Returns the first leg of the cheapest route; `None` if no place farther along the path can be reached.
    pub fn find(&mut self, scene: &Scene<'_>) -> Option<Leg> {
        let start = index(ROBOT);
        self.costs.fill(u32::MAX);
        self.factors.fill(None);
        self.open.clear();
        self.costs[start] = 0;
        self.open.push(Reverse((0, start as u16)));
        let near = Near::of(scene);
        while let Some(Reverse((cost, cell))) = self.open.pop() {
            let cell = usize::from(cell);
            if cost > self.costs[cell] {
                continue;
            }
            if near.is_goal(near.place(cell)) {
                return self.first_leg(cell, &near);
            }
            for (next, length_m) in neighbors(cell) {
                let factor = *self.factors[next].get_or_insert_with(|| near.factor(near.place(next)));
                if factor.is_finite() {
                    let next_cost = cost + (length_m * factor * COST_PER_M) as u32;
                    if next_cost < self.costs[next] {
                        self.costs[next] = next_cost;
                        self.before[next] = cell as u16;
                        self.open.push(Reverse((next_cost, next as u16)));
                    }
                }
            }
        }
        None
    }

    /// First straight leg of the route to the cell `goal`: to the farthest place that is reached in a straight line.
    fn first_leg(&mut self, goal: usize, near: &Near<'_>) -> Option<Leg> {
        self.route.clear();
        let mut cell = goal;
        while cell != index(ROBOT) {
            self.route.push(cell as u16);
            cell = usize::from(self.before[cell]);
        }
        let places = self.route.iter().rev().map(|&cell| near.place(usize::from(cell)));
        let mut leg = None;
        for place in places {
            let length_m = place.coords.norm();
            if length_m > LEG_M.1 || !near.is_straight(place) {
                break;
            }
            leg = Some(Leg { bearing: place.y.atan2(place.x), length_m });
        }
        leg.filter(|leg| leg.length_m > LEG_M.0)
    }
}

/// Surroundings of the robot. Places are in the robot frame, m.
struct Near<'a> {
    scene: &'a Scene<'a>,
    /// Rotation from the direction of the path.
    along: Rotation2<f64>,
    /// Distances that the robot keeps from obstacles and walls, and those that it has, m.
    keeps_m: [f64; 2],
    has_m: [f64; 2],
}

impl<'a> Near<'a> {
    fn of(scene: &'a Scene<'a>) -> Self {
        let mut near = Self {
            scene,
            along: Rotation2::new(scene.path.heading()),
            keeps_m: [scene.clearance_m, scene.wall_clearance_m],
            has_m: [0.0; 2],
        };
        near.has_m = near.distances(Point2::origin());
        near
    }

    /// Middle of a cell.
    fn place(&self, cell: usize) -> Point2<f64> {
        let [column, row] = [cell % CELLS[0], cell / CELLS[0]];
        let off = |at: usize, robot: usize| (at as f64 - robot as f64) * CELL_M;
        self.along * Point2::new(off(column, ROBOT[0]), off(row, ROBOT[1]))
    }

    fn is_goal(&self, place: Point2<f64>) -> bool {
        let station = &self.scene.path.stations[GOAL_STATION];
        let off = place - station.place;
        let ahead = Vector2::new(station.left.y, -station.left.x);
        off.dot(&ahead).abs() < GOAL_M[0] && off.dot(&station.left).abs() < GOAL_M[1]
    }

    /// Distances to the nearest obstacle and the nearest wall.
    fn distances(&self, place: Point2<f64>) -> [f64; 2] {
        let obstacle_m = distance_to_nearest(self.scene.obstacles, place.cast());
        [f64::from(obstacle_m), (self.scene.wall_m)(place)]
    }

    /// Cost per meter at a place; infinite where the robot cannot be.
    fn factor(&self, place: Point2<f64>) -> f64 {
        let distances_m = self.distances(place);
        let is_leaving = place.coords.norm() < LEAVING_M;
        let may_be = |i: usize| {
            let needs_m =
                if is_leaving { self.keeps_m[i].min(self.has_m[i] - APPROACH_M) } else { self.keeps_m[i] };
            distances_m[i] >= needs_m
        };
        if !(may_be(0) && may_be(1)) {
            return f64::INFINITY;
        }
        let room_m = (distances_m[0] - self.keeps_m[0]).min(distances_m[1] - self.keeps_m[1]);
        1.0 + ROOM_COST * ((ROOM_M - room_m) / ROOM_M).clamp(0.0, 1.0)
    }

    /// True if the robot can drive straight to a place.
    fn is_straight(&self, place: Point2<f64>) -> bool {
        let steps = (place.coords.norm() / (0.5 * CELL_M)).ceil();
        (1..=steps as usize).all(|step| self.factor(place * (step as f64 / steps)).is_finite())
    }
}

fn index([column, row]: [usize; 2]) -> usize {
    row * CELLS[0] + column
}

/// The cells around a cell, with their distances, m.
fn neighbors(cell: usize) -> impl Iterator<Item = (usize, f64)> {
    const STEPS: [i32; 3] = [-1, 0, 1];
    let [column, row] = [(cell % CELLS[0]) as i32, (cell / CELLS[0]) as i32];
    let around = STEPS.into_iter().flat_map(|across| STEPS.map(|along| (along, across)));
    around.filter(|&step| step != (0, 0)).filter_map(move |(along, across)| {
        let [next_column, next_row] = [column + along, row + across];
        let is_inside =
            (0..CELLS[0] as i32).contains(&next_column) && (0..CELLS[1] as i32).contains(&next_row);
        let length_m = if along == 0 || across == 0 { CELL_M } else { CELL_M * std::f64::consts::SQRT_2 };
        is_inside.then(|| (index([next_column as usize, next_row as usize]), length_m))
    })
}

#[cfg(test)]
mod tests {
    use super::super::stations::{PathAhead, Station, station_m};
    use super::*;
    use crate::lanes::unseen::UnseenGround;

    /// First leg of a robot at `lateral_m` in a straight corridor, 2.4 m wide, whose heading to it is `heading`, with obstacles
    /// along lines from one place to another, in the frame of the corridor.
    fn leg(lateral_m: f64, heading: f64, lines: &[[f64; 4]]) -> Option<Leg> {
        let to_robot = |x: f64, y: f64| Rotation2::new(-heading) * Point2::new(x, y - lateral_m);
        let stations = std::array::from_fn(|i| Station {
            place: to_robot(station_m(i), 0.0),
            left: Rotation2::new(-heading) * Vector2::y(),
        });
        let path = PathAhead { stations, lateral_m };
        let mut obstacles = Vec::new();
        for &[x0, y0, x1, y1] in lines {
            for i in 0..=40 {
                let share = f64::from(i) / 40.0;
                obstacles.push(to_robot(x0 + share * (x1 - x0), y0 + share * (y1 - y0)).cast());
            }
        }
        let wall_m = |place: Point2<f64>| 1.2 - ((Rotation2::new(heading) * place).y + lateral_m).abs();
        let scene = Scene {
            path: &path,
            unseen: &UnseenGround::default(),
            walkway: None,
            obstacles: &obstacles,
            wall_m: &wall_m,
            clearance_m: 0.27,
            wall_clearance_m: 0.26,
            touch_m: 0.215,
            wall_touch_m: 0.23,
        };
        WayFinder::default().find(&scene)
    }

    #[test]
    fn a_free_path_is_taken_straight() {
        for heading in [0.0, 1.2, -2.5] {
            let leg = leg(0.0, heading, &[]).expect("a route");
            assert!((leg.bearing + heading).abs() < 0.05 && leg.length_m > 0.8, "{heading}: {leg:?}");
        }
    }

    #[test]
    fn the_route_leads_across_the_path_to_the_gap() {
        for heading in [0.0, 0.9] {
            let leg = leg(0.8, heading, &[[0.5, 1.2, 0.5, -0.3]]).expect("a route");
            assert!((-1.9..-1.0).contains(&(leg.bearing + heading)), "{heading}: {leg:?}");
        }
    }

    #[test]
    fn a_pocket_is_left_backward() {
        let leg = leg(0.0, 0.0, &[[0.4, 0.4, 0.4, -0.4], [-0.2, 0.4, 0.4, 0.4], [-0.2, -0.4, 0.4, -0.4]]);
        assert!(leg.expect("a route").bearing.abs() > 2.4, "{leg:?}");
    }

    #[test]
    fn a_closed_corridor_has_no_route() {
        assert_eq!(leg(0.0, 0.0, &[[0.9, 1.2, 0.9, -1.0]]), None);
        assert!(leg(0.0, 0.0, &[[0.9, 1.2, 0.9, -0.6]]).is_some(), "a gap of 0.6 m");
    }

    #[test]
    fn a_robot_that_is_too_near_to_something_leaves_it() {
        let leg = leg(0.0, 0.0, &[[0.24, 0.3, 0.24, -0.3]]).expect("a route");
        assert!(leg.bearing.abs() > 1.2, "{leg:?}");
    }
}
