//! The top view: poses, path, ranges, obstacles and free space.

use std::collections::BTreeMap;

use nalgebra::Matrix2;
use serde::Serialize;
use yamabico_core::message::{
    Beam, FreeDirection, FreeSpaceHeader, Goal, Message, MessageType, Obstacle, ObstaclesHeader, Odometry,
    PathHeader, PathPoint, Pose, PoseStatus, RangeScanHeader, Truth, WallPoint, WallsHeader,
};
use yamabico_core::time::Time;

use super::read::{header, items};

/// Age above which a pose, scan, path or obstacle is no longer shown, s.
const MAX_AGE_S: f64 = 2.0;
/// Maximum number of publishers of each kind.
const MAX_PUBLISHERS: usize = 16;

/// Estimated or true position of the robot on the map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseView {
    /// X, m.
    pub x: f64,
    /// Y, m.
    pub y: f64,
    /// Heading, rad.
    pub theta: f64,
    /// Half axes, m, and direction, rad, of the ellipse of one standard deviation; `None` if it is not finite.
    pub ellipse: Option<[f64; 3]>,
    /// Reliability; empty for the true pose.
    pub status: &'static str,
    /// Topic that it comes from.
    pub topic: String,
}

/// One scan in the robot frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScanView {
    /// Topic.
    pub topic: String,
    /// Maximum range, m.
    pub max_m: f64,
    /// Beams: azimuth, opening angle, range (-1 without an echo), x and y of the sensor; rad and m.
    pub beams: Vec<[f32; 5]>,
}

/// One obstacle in the robot frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ObstacleView {
    /// Forward position, m.
    pub x: f64,
    /// Left position, m.
    pub y: f64,
    /// Radius, m.
    pub radius_m: f64,
    /// Probability that it exists.
    pub confidence: f64,
}

/// Everything in the top view that changes from message to message.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SceneView {
    /// Estimated pose.
    pub pose: Option<PoseView>,
    /// True pose in a simulation.
    pub truth: Option<PoseView>,
    /// Distance to the nearest obstacle in a simulation, m.
    pub clearance_m: Option<f64>,
    /// Pose by odometry alone: x, y, heading.
    pub odometry: Option<[f64; 3]>,
    /// Measured twist: forward, left, turn rate.
    pub twist: Option<[f64; 3]>,
    /// Goal: x, y, tolerance.
    pub goal: Option<[f64; 3]>,
    /// Planned path on the map.
    pub path: Vec<[f64; 2]>,
    /// Newest scan of each range sensor.
    pub scans: Vec<ScanView>,
    /// Obstacles of all behaviors, robot frame.
    pub obstacles: Vec<ObstacleView>,
    /// End of the free floor by direction, robot frame: x and y.
    pub free_space: Vec<[f64; 2]>,
}

/// A message with the time of its data.
#[derive(Clone, Debug)]
struct Stamped<T> {
    at: Time,
    value: T,
}

/// Newest message of each publisher, by topic.
type ByTopic<T> = BTreeMap<String, Stamped<T>>;

/// Newest messages that the top view shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scene {
    poses: ByTopic<Pose>,
    odometry: ByTopic<Odometry>,
    truth: Option<Stamped<Truth>>,
    goal: Option<Goal>,
    paths: ByTopic<Vec<[f64; 2]>>,
    scans: ByTopic<ScanView>,
    obstacles: ByTopic<Vec<ObstacleView>>,
    free_space: ByTopic<Vec<[f64; 2]>>,
    walls: BTreeMap<String, Vec<Vec<[f64; 2]>>>,
    walls_version: u64,
}

impl Scene {
    /// Takes in a message.
    pub fn message(&mut self, topic: &str, message: &MessageType, time: Time, bytes: &[u8], list: &[u8]) {
        match message.name {
            Pose::NAME => put(&mut self.poses, topic, time, header(bytes)),
            Odometry::NAME => put(&mut self.odometry, topic, time, header(bytes)),
            Truth::NAME => self.truth = header(bytes).map(|value| Stamped { at: time, value }),
            Goal::NAME => self.goal = header(bytes),
            PathHeader::NAME => {
                let corners = items::<PathPoint>(list).map(|point| [point.x, point.y]);
                put(&mut self.paths, topic, time, Some(corners.filter(is_finite).collect()));
            }
            RangeScanHeader::NAME => {
                let Some(scan) = header::<RangeScanHeader>(bytes) else { return };
                let beams = items::<Beam>(list).map(beam).collect();
                let view = ScanView { topic: topic.to_owned(), max_m: scan.max_m, beams };
                put(&mut self.scans, topic, time, Some(view));
            }
            ObstaclesHeader::NAME => {
                let obstacles =
                    items::<Obstacle>(list).filter(|obstacle| is_finite(&[obstacle.x, obstacle.y]));
                let view = obstacles.map(|Obstacle { x, y, radius_m, confidence, .. }| ObstacleView {
                    x,
                    y,
                    radius_m,
                    confidence,
                });
                put(&mut self.obstacles, topic, time, Some(view.collect()));
            }
            FreeSpaceHeader::NAME => {
                let ends = items::<FreeDirection>(list).map(|direction| {
                    let (sin, cos) = direction.azimuth_rad.sin_cos();
                    [direction.distance_m * cos, direction.distance_m * sin]
                });
                put(&mut self.free_space, topic, time, Some(ends.filter(is_finite).collect()));
            }
            WallsHeader::NAME => {
                let Some(walls) = header::<WallsHeader>(bytes) else { return };
                let (device, lines) = (walls.device.as_str(), polylines(list));
                if self.walls.get(device) != Some(&lines) {
                    self.walls.insert(device.to_owned(), lines);
                    self.walls_version += 1;
                }
            }
            _ => {}
        }
    }

    /// Walls of simulated worlds: polylines on the map.
    pub fn walls(&self) -> impl Iterator<Item = &Vec<[f64; 2]>> {
        self.walls.values().flatten()
    }

    /// Number that grows when the walls change.
    pub fn walls_version(&self) -> u64 {
        self.walls_version
    }

    /// Estimated position for the strips.
    pub fn position(&self) -> Option<[f32; 2]> {
        self.poses.values().max_by_key(|pose| pose.at).map(|pose| [pose.value.x as f32, pose.value.y as f32])
    }

    /// True position for the strips.
    pub fn true_position(&self) -> Option<[f32; 2]> {
        self.truth.as_ref().map(|truth| [truth.value.x as f32, truth.value.y as f32])
    }

    /// Top view at `now`; messages older than two seconds are left out.
    pub fn view(&self, now: Time) -> SceneView {
        let pose = self.poses.iter().filter(|(_, pose)| is_fresh(pose, now));
        let pose = pose.max_by_key(|(_, pose)| pose.at);
        let truth = self.truth.as_ref().filter(|truth| is_fresh(truth, now)).map(|truth| &truth.value);
        let odometry = newest(&self.odometry, now);
        SceneView {
            pose: pose.and_then(|(topic, pose)| estimated(topic, &pose.value)),
            truth: truth.filter(|truth| is_finite(&[truth.x, truth.y])).map(|truth| PoseView {
                x: truth.x,
                y: truth.y,
                theta: truth.theta,
                ellipse: None,
                status: "",
                topic: String::new(),
            }),
            clearance_m: truth.map(|truth| truth.clearance_m).filter(|clearance| clearance.is_finite()),
            odometry: odometry.map(|odometry| [odometry.x, odometry.y, odometry.theta]),
            twist: odometry.map(|odometry| [odometry.vx, odometry.vy, odometry.omega]),
            goal: self
                .goal
                .map(|goal| [goal.x, goal.y, goal.tolerance_m])
                .filter(|goal| goal.iter().all(|n| n.is_finite())),
            path: newest(&self.paths, now).cloned().unwrap_or_default(),
            scans: fresh(&self.scans, now).cloned().collect(),
            obstacles: fresh(&self.obstacles, now).flatten().copied().collect(),
            free_space: newest(&self.free_space, now).cloned().unwrap_or_default(),
        }
    }
}

fn put<T>(map: &mut ByTopic<T>, topic: &str, at: Time, value: Option<T>) {
    if let Some(value) = value
        && (map.len() < MAX_PUBLISHERS || map.contains_key(topic))
    {
        map.insert(topic.to_owned(), Stamped { at, value });
    }
}

fn is_fresh<T>(stamped: &Stamped<T>, now: Time) -> bool {
    now.seconds_after(stamped.at) < MAX_AGE_S
}

fn fresh<T>(map: &ByTopic<T>, now: Time) -> impl Iterator<Item = &T> {
    map.values().filter(move |stamped| is_fresh(stamped, now)).map(|stamped| &stamped.value)
}

fn newest<T>(map: &ByTopic<T>, now: Time) -> Option<&T> {
    let fresh = map.values().filter(|stamped| is_fresh(stamped, now));
    fresh.max_by_key(|stamped| stamped.at).map(|stamped| &stamped.value)
}

fn is_finite(point: &[f64; 2]) -> bool {
    point.iter().all(|number| number.is_finite())
}

fn beam(beam: Beam) -> [f32; 5] {
    let range_m = beam.echo_m().filter(|range_m| range_m.is_finite()).unwrap_or(-1.0);
    [beam.azimuth_rad, beam.cone_rad, range_m, beam.x_m, beam.y_m].map(|number| number as f32)
}

fn estimated(topic: &str, pose: &Pose) -> Option<PoseView> {
    is_finite(&[pose.x, pose.y]).then(|| PoseView {
        x: pose.x,
        y: pose.y,
        theta: pose.theta,
        ellipse: ellipse(&pose.covariance),
        status: pose.status().map_or("unknown", PoseStatus::as_str),
        topic: topic.to_owned(),
    })
}

/// Half axes and direction of the ellipse of one standard deviation of the position.
fn ellipse(covariance: &[f64; 9]) -> Option<[f64; 3]> {
    let position = Matrix2::new(covariance[0], covariance[1], covariance[3], covariance[4]);
    if position.iter().any(|number| !number.is_finite()) {
        return None;
    }
    let eigen = position.symmetric_eigen();
    let half_axes = eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt());
    let major = eigen.eigenvectors.column(0);
    Some([half_axes[0], half_axes[1], major[1].atan2(major[0])])
}

fn polylines(list: &[u8]) -> Vec<Vec<[f64; 2]>> {
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut current = None;
    for point in items::<WallPoint>(list).filter(|point| is_finite(&[point.x, point.y])) {
        match lines.last_mut().filter(|_| current == Some(point.line)) {
            Some(line) => line.push([point.x, point.y]),
            None => lines.push(vec![[point.x, point.y]]),
        }
        current = Some(point.line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ellipse_has_the_axes_of_the_covariance() {
        let mut covariance = [0.0; 9];
        (covariance[0], covariance[4]) = (0.04, 0.01);
        let [a, b, direction] = ellipse(&covariance).unwrap();
        let (long, short) = if a > b { (a, b) } else { (b, a) };
        assert!((long - 0.2).abs() < 1e-12 && (short - 0.1).abs() < 1e-12);
        assert!(direction.is_finite());
        covariance[1] = f64::NAN;
        assert_eq!(ellipse(&covariance), None);
    }

    #[test]
    fn old_and_hostile_messages_are_not_shown() {
        let mut scene = Scene::default();
        let pose = Pose { x: 1.0, ..Pose::default() };
        let put = |scene: &mut Scene, pose: &Pose| {
            let message = MessageType::of::<Pose>();
            scene.message("behaviors/localizer/pose", &message, Time::ZERO, bytemuck::bytes_of(pose), &[]);
        };
        put(&mut scene, &pose);
        assert_eq!(scene.view(Time::from_secs_f64(0.5)).pose.unwrap().x, 1.0);
        assert_eq!(scene.view(Time::from_secs_f64(3.0)).pose, None);
        put(&mut scene, &Pose { x: f64::NAN, ..pose });
        assert_eq!(scene.view(Time::ZERO).pose, None);
        scene.message("p", &MessageType::of::<Pose>(), Time::ZERO, &[1, 2, 3], &[]);
    }

    #[test]
    fn walls_are_polylines_and_their_version_grows_with_a_change() {
        let mut scene = Scene::default();
        let corner = |x, line| WallPoint { x, y: 0.0, line };
        let corners = [corner(0.0, 0), corner(1.0, 0), corner(2.0, 1), corner(3.0, 1)];
        let message = MessageType::of::<WallsHeader>();
        for _ in 0..2 {
            let header = WallsHeader::default();
            scene.message(
                "w",
                &message,
                Time::ZERO,
                bytemuck::bytes_of(&header),
                bytemuck::cast_slice(&corners),
            );
        }
        assert_eq!((scene.walls().count(), scene.walls_version()), (2, 1));
    }
}
