//! Which surfaces of a new map are solid: a second drive, localized on that map, faces each of them with a sonar.

use std::path::Path;

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Message, MessageType, RangeScanHeader, RawMessage, View};
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::record::Tap;
use yamabico_vision::azimuth_map::{
    EdgeMap, Inflation, MapSurface, RangeReading, SurfaceCheck, SurfaceCheckRule, SurfaceState,
    VisibilityGraph, inflate,
};
use yamabico_vision::polygon::{contains, nearest_on_segment};

use super::whereabouts::{Whereabouts, pose_publisher};

/// Narrower surfaces (m) hold no beam.
const MIN_WIDTH_M: f64 = 0.4;
/// Each surface is approached from one of these distances (m), the first that there is room for ...
const FAR_M: [f64; 5] = [1.3, 1.15, 1.0, 0.85, 0.7];
/// ... to this near, meters.
const NEAR_M: f64 = 0.45;
/// Room on either side of the robot, meters.
const MARGIN_M: f64 = 0.05;
/// The point that is steered for lies so far ahead, meters.
const LOOK_AHEAD_M: f64 = 0.2;
/// So many surfaces are faced in one drive: a path has only so many corners.
const MAX_SURFACES: usize = 16;
/// The drive is given up when it is slower on the whole, m/s.
const SLOWEST_MPS: f64 = 0.03;
/// Standard deviation of the distance to a surface, meters.
const SIGMA_M: f64 = 0.03;

/// The settings of the second drive: on the new map, from the start past every surface that is to be faced. `None` where there
/// is none, or none can be faced.
pub fn settings(task: &Task, map: &EdgeMap, start: Point2<f64>, file: &Path) -> Option<Vec<String>> {
    let localizer = pose_publisher(task)?.0;
    let route = route(map, start, task.robot.robot.radius_m + MARGIN_M)?;
    let length_m: f64 = route.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let end = route.last()?;
    let (goal, duration_s) = ([end.x, end.y], 60.0 + length_m / SLOWEST_MPS);
    let route: Vec<[f64; 2]> = route[1..].iter().map(|at| [at.x, at.y]).collect();
    let file = std::fs::canonicalize(file).ok()?;
    Some(vec![
        format!("behaviors.{localizer}.method=\"azimuth\""),
        format!("behaviors.{localizer}.edge_map={:?}", file.display().to_string()),
        format!("behaviors.{localizer}.route={route:?}"),
        // It turns back that much before the end of each approach.
        format!("behaviors.{localizer}.look_ahead_m={LOOK_AHEAD_M:?}"),
        format!("run.goal={{ x_m = {:?}, y_m = {:?}, tolerance_m = 0.15 }}", goal[0], goal[1]),
        format!("run.duration_s={duration_s:?}"),
    ])
}

/// The way past every surface that is to be faced: straight at its middle, from afar and from near.
fn route(map: &EdgeMap, start: Point2<f64>, clearance_m: f64) -> Option<Vec<Point2<f64>>> {
    let free: Vec<_> = map.free_m.iter().map(|&corner| Point2::from(corner)).collect();
    let inflation = Inflation { radius_m: clearance_m, sides: 8 };
    let wall = |i: usize| {
        let (mut corners, mut wall) = (Vec::new(), Vec::new());
        inflate([free[i], free[(i + 1) % free.len()]], &inflation, &mut corners, &mut wall);
        wall
    };
    let walls: Vec<_> = (0..free.len()).map(wall).collect();
    let doubtful = map.surfaces.iter().filter(|surface| surface.state == SurfaceState::Unknown);
    let mut approaches: Vec<_> = doubtful
        .filter_map(|surface| approach(map, surface, &walls))
        .filter(|approach| approach.iter().all(|&place| contains(&free, place)))
        .take(MAX_SURFACES)
        .collect();
    // The drive ends at the last one: at that which is farthest from all the others, so that it does not end before.
    let apart = |i: usize| {
        let others = approaches.iter().enumerate().filter(|(j, _)| *j != i);
        let ways =
            others.map(|(_, other)| (nearest_on_segment(*other, approaches[i][1]) - approaches[i][1]).norm());
        ways.fold((approaches[i][1] - start).norm(), f64::min)
    };
    let last = (0..approaches.len()).max_by(|&a, &b| apart(a).total_cmp(&apart(b)))?;
    let last = approaches.swap_remove(last);
    let (mut route, mut graph) = (vec![start], VisibilityGraph::default());
    let mut go = |route: &mut Vec<Point2<f64>>, [far, near]: [Point2<f64>; 2]| {
        let here = VisibilityGraph::way_out(*route.last().unwrap_or(&start), &walls);
        if let Ok((way, _)) = graph.shortest(here, far, &walls) {
            route.extend_from_slice(&way[1..]);
            route.push(near);
        }
    };
    while !approaches.is_empty() {
        let here = *route.last()?;
        let distance = |i: usize| (approaches[i][0] - here).norm();
        let next = (0..approaches.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        go(&mut route, approaches.swap_remove(next));
    }
    go(&mut route, last);
    (route.len() > 1).then_some(route)
}

/// From where a surface is faced, from afar and from near; `None` where there is no room before it, or it is too narrow.
fn approach(map: &EdgeMap, surface: &MapSurface, walls: &[Vec<Point2<f64>>]) -> Option<[Point2<f64>; 2]> {
    let end = |number| map.edge(number).map(|edge| Point2::from(edge.at_m));
    let (right, left) = (end(surface.right)?, end(surface.left)?);
    let along = left - right;
    let towards_robot = Vector2::new(-along.y, along.x).normalize();
    let before = |away_m: f64| nalgebra::center(&right, &left) + towards_robot * away_m;
    let near = before(NEAR_M);
    let from_afar = FAR_M.iter().map(|&away_m| before(away_m));
    let mut open = from_afar.filter(|&far| {
        VisibilityGraph::way_out(far, walls) == far && VisibilityGraph::is_open([far, near], walls)
    });
    open.next().filter(|_| along.norm() >= MIN_WIDTH_M).map(|far| [far, near])
}

/// Listens to the second drive.
pub struct Verifier {
    whereabouts: Whereabouts,
    checks: Vec<SurfaceCheck>,
}

impl Verifier {
    /// For this task and map.
    ///
    /// # Errors
    /// Without a sonar, odometry or a localizer in the task, in words.
    pub fn new(task: &Task, map: &EdgeMap) -> Result<Self, String> {
        let sensors = || task.behaviors.iter().flat_map(|behavior| &behavior.setup.sensors);
        let with = |message: &str| sensors().find(|(_, sensor)| sensor.message == message);
        let sonar = with(RangeScanHeader::NAME).map(|(_, sensor)| &sensor.kind);
        let Some(&SensorKind::Range { max_m, .. }) = sonar else {
            return Err("--verify needs a sonar in the task: add a sonar-halt".into());
        };
        let rule = SurfaceCheckRule { farthest_m: max_m, ..SurfaceCheckRule::default() };
        let whereabouts = Whereabouts::of(task).ok_or("--verify needs odometry")?;
        if !whereabouts.is_localized() {
            return Err("--verify needs a map-localizer in the task".into());
        }
        let check = |surface: &MapSurface| {
            let end = |number| map.edge(number).map_or(Point2::origin(), |edge| Point2::from(edge.at_m));
            SurfaceCheck::new([end(surface.right), end(surface.left)], rule)
        };
        Ok(Self { whereabouts, checks: map.surfaces.iter().map(check).collect() })
    }

    /// Writes what was found out into the map; how many surfaces are told now.
    pub fn tell(&self, map: &mut EdgeMap) -> usize {
        for (surface, check) in map.surfaces.iter_mut().zip(&self.checks) {
            if check.state() != SurfaceState::Unknown {
                surface.state = check.state();
            }
        }
        self.checks.iter().filter(|check| check.state() != SurfaceState::Unknown).count()
    }

    fn scan(&mut self, scan: &View<'_, RangeScanHeader>) {
        let Some(robot) = self.whereabouts.at(Time(scan.header.stamp_ns)) else { return };
        for beam in scan.items {
            let on_robot = Pose2::new(beam.x_m, beam.y_m, beam.azimuth_rad);
            let sensor = robot.compose(&on_robot);
            let reading = RangeReading { sensor, range_m: beam.echo_m(), sigma_m: SIGMA_M };
            for check in &mut self.checks {
                check.take(&reading);
            }
        }
    }
}

impl Tap for Verifier {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        self.whereabouts.hear(topic, raw, time);
        if message.name == RangeScanHeader::NAME
            && let Some(scan) = View::<RangeScanHeader>::of(raw)
        {
            self.scan(&scan);
        }
    }
}
