//! The route of a verification drive: past every surface of a new map whose state is unknown.

use std::path::Path;

use nalgebra::{Point2, Vector2};
use yamabico_host::config::Task;
use yamabico_vision::azimuth_map::{EdgeMap, Inflation, MapSurface, SurfaceState, VisibilityGraph, inflate};
use yamabico_vision::polygon::{contains, nearest_on_segment};

use crate::robot_track::pose_publisher;

/// Minimum width of a surface that a sonar beam fits, m.
const MIN_WIDTH_M: f64 = 0.4;
/// Distances from which a surface is approached, m; the first one with enough room is used.
const FAR_M: [f64; 5] = [1.3, 1.15, 1.0, 0.85, 0.7];
/// Distance at which an approach ends, m.
const NEAR_M: f64 = 0.45;
/// Clearance on either side of the robot, m.
const MARGIN_M: f64 = 0.05;
/// Look-ahead distance of the path follower, m: the robot leaves each approach that far before its end.
const LOOK_AHEAD_M: f64 = 0.2;
/// Maximum number of surfaces in one drive: a path has a limited number of corners.
const MAX_SURFACES: usize = 16;
/// Minimum average speed, m/s, below which the drive times out.
const MIN_AVERAGE_MPS: f64 = 0.03;
/// Time allowed besides driving, s.
const EXTRA_S: f64 = 60.0;

/// Overrides of the verification drive: it localizes on the map in `file` and drives from `start` past every surface of unknown
/// state. `None` if there is no such surface, no localizer, or no surface can be reached.
pub(super) fn settings(task: &Task, map: &EdgeMap, start: Point2<f64>, file: &Path) -> Option<Vec<String>> {
    let localizer = pose_publisher(task)?.0;
    let route = route(map, start, task.robot.robot.radius_m + MARGIN_M)?;
    let length_m: f64 = route.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let end = route.last()?;
    let (goal, duration_s) = ([end.x, end.y], EXTRA_S + length_m / MIN_AVERAGE_MPS);
    let route: Vec<[f64; 2]> = route[1..].iter().map(|at| [at.x, at.y]).collect();
    let file = std::fs::canonicalize(file).ok()?;
    Some(vec![
        format!("behaviors.{localizer}.method=\"azimuth\""),
        format!("behaviors.{localizer}.edge_map={:?}", file.display().to_string()),
        format!("behaviors.{localizer}.route={route:?}"),
        format!("behaviors.{localizer}.look_ahead_m={LOOK_AHEAD_M:?}"),
        format!("run.goal={{ x_m = {:?}, y_m = {:?}, tolerance_m = 0.15 }}", goal[0], goal[1]),
        format!("run.duration_s={duration_s:?}"),
    ])
}

/// The path from `start` past every reachable surface of unknown state: straight at its center, from far to near.
fn route(map: &EdgeMap, start: Point2<f64>, clearance_m: f64) -> Option<Vec<Point2<f64>>> {
    let free: Vec<_> = map.free_m.iter().map(|&corner| Point2::from(corner)).collect();
    let inflation = Inflation { radius_m: clearance_m, sides: 8 };
    let wall = |i: usize| {
        let (mut corners, mut wall) = (Vec::new(), Vec::new());
        inflate([free[i], free[(i + 1) % free.len()]], &inflation, &mut corners, &mut wall);
        wall
    };
    let walls: Vec<_> = (0..free.len()).map(wall).collect();
    let unknown = map.surfaces.iter().filter(|surface| surface.state == SurfaceState::Unknown);
    let mut approaches: Vec<_> = unknown
        .filter_map(|surface| approach(map, surface, &walls))
        .filter(|approach| approach.iter().all(|&point| contains(&free, point)))
        .take(MAX_SURFACES)
        .collect();
    // The run ends as soon as the robot is near the goal: take the approach farthest from all others as the last one.
    let clearance = |i: usize| {
        let others = approaches.iter().enumerate().filter(|(j, _)| *j != i);
        let distances =
            others.map(|(_, other)| (nearest_on_segment(*other, approaches[i][1]) - approaches[i][1]).norm());
        distances.fold((approaches[i][1] - start).norm(), f64::min)
    };
    let last = (0..approaches.len()).max_by(|&a, &b| clearance(a).total_cmp(&clearance(b)))?;
    let last = approaches.swap_remove(last);
    let (mut route, mut graph) = (vec![start], VisibilityGraph::default());
    let mut append = |route: &mut Vec<Point2<f64>>, [far, near]: [Point2<f64>; 2]| {
        let here = VisibilityGraph::nearest_exit(*route.last().unwrap_or(&start), &walls);
        if let Ok((path, _)) = graph.shortest(here, far, &walls) {
            route.extend_from_slice(&path[1..]);
            route.push(near);
        }
    };
    while !approaches.is_empty() {
        let here = *route.last()?;
        let distance = |i: usize| (approaches[i][0] - here).norm();
        let next = (0..approaches.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        append(&mut route, approaches.swap_remove(next));
    }
    append(&mut route, last);
    (route.len() > 1).then_some(route)
}

/// The far and the near end of the approach to a surface; `None` if it is too narrow or there is no room in front of it.
fn approach(map: &EdgeMap, surface: &MapSurface, walls: &[Vec<Point2<f64>>]) -> Option<[Point2<f64>; 2]> {
    let end = |number| map.edge(number).map(|edge| Point2::from(edge.at_m));
    let (right, left) = (end(surface.right)?, end(surface.left)?);
    let along = left - right;
    let towards_robot = Vector2::new(-along.y, along.x).normalize();
    let in_front = |distance_m: f64| nalgebra::center(&right, &left) + towards_robot * distance_m;
    let near = in_front(NEAR_M);
    let candidates = FAR_M.iter().map(|&distance_m| in_front(distance_m));
    let mut open = candidates.filter(|&far| {
        VisibilityGraph::nearest_exit(far, walls) == far && VisibilityGraph::is_open([far, near], walls)
    });
    open.next().filter(|_| along.norm() >= MIN_WIDTH_M).map(|far| [far, near])
}
