//! Evaluates a localized frame: updates the obstacle memory, and finds out if the path is clear and which passage
//! leads on.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::Reason;
use yamabico_core::time::Time;

use crate::guidance::Localized;
use crate::halt_state_machine::{State, VisionResult};
use crate::obstacle_memory::{Border, KnownObstacle};
use crate::passage_avoider::PassageAvoider;
use crate::passage_finder::{AVOIDANCE_RANGE_M, Surroundings, aim, is_clear, is_crossed, point_on_path};
use crate::safe_passage::{Aim, Interval, PLANE_M, region_on_plane};
use crate::threshold_table::Place;

/// Distance ahead along the path of the point that the robot steers for, m.
const LOOK_AHEAD_M: f64 = 1.2;
/// Maximum lateral distance of the goal on the plane one meter ahead, m; a goal farther aside is clamped to it.
const MAX_GOAL_LATERAL_M: f64 = 1.0;
/// Distance behind the robot's center up to which an obstacle still counts as beside the robot, m.
const BESIDE_M: f64 = 0.4;
/// Extra distance from the goal that a passage on the side already chosen may have, m: prevents changing sides.
const LEAN_M: f64 = 0.3;
/// Maximum standard deviation of the heading with which the floor between the walls is found, rad.
const MAX_FLOOR_SIGMA_RAD: f64 = 0.02;
/// Distance from a wall of the map within which evidence from motion is assigned to the wall, m.
const WALL_M: f64 = 0.3;
/// Number of edge pixels, counted from the bottom, that locate the foot of an obstacle.
const FOOT_PX: u32 = 4;

impl PassageAvoider {
    /// Evaluates the frame that a pose was estimated from, and stores the result for the next step of the state
    /// machine.
    pub(crate) fn evaluate(&mut self, localized: &Localized, now: Time) {
        let Some(at_capture) = self.odometry.pose_at(localized.evidence) else { return };
        let robot = localized.pose * localized.odometry.relative(&at_capture);
        let result = self.detect(localized, &robot, now);
        self.failure = result.err();
        self.evaluated = Some(localized.evidence);
        if self.order.state == State::Search && !self.search.advance_if_shown(localized.evidence) {
            return;
        }
        let unusable = self.unusable(localized.evidence);
        self.pending = Some(match result {
            Ok(()) if self.known_obstacles.is_settled() => self.assess(unusable),
            Ok(()) => VisionResult { clear: false, ..unusable },
            // No thresholds apply to this heading: steer by the remembered obstacles.
            Err(Reason::NoThreshold) if self.order.state == State::Avoid => {
                VisionResult { clear: false, ..self.assess(unusable) }
            }
            Err(_) => unusable,
        });
    }

    /// Returns the result of a frame captured at `capture` that could not be evaluated: the path counts as clear if no
    /// remembered obstacle is on it.
    pub(crate) fn unusable(&self, capture: Time) -> VisionResult {
        let clear = self.robot().is_some_and(|robot| {
            is_clear(&self.surroundings(&robot), self.goal_on_plane(&robot), &self.clearances)
        });
        VisionResult { image_s: capture.as_secs_f64(), valid: false, clear, bearing: None }
    }

    /// Returns true if a confirmed obstacle is beside the robot or ahead of its side: it is not passed yet.
    pub(crate) fn is_beside_obstacle(&self, robot: &Pose2) -> bool {
        let inverse = robot.inverse();
        self.known_obstacles.confirmed().any(|obstacle| {
            let at = inverse.transform_point(obstacle.at);
            (-BESIDE_M..AVOIDANCE_RANGE_M).contains(&at.x)
                && at.y.abs() < 2.0 * self.clearances.half_width_m + obstacle.radius_m
        })
    }

    /// Detects the obstacles in a frame captured at `robot` (map frame), and adds them to the obstacle memory.
    fn detect(&mut self, localized: &Localized, robot: &Pose2, now: Time) -> Result<(), Reason> {
        let frame = self.frames.taken_at(localized.evidence).ok_or(Reason::NoInput)?;
        let image = frame.image.view().map_err(|_| Reason::MalformedInput)?;
        if let (Some(evidence), Some(odometry)) =
            (&mut self.motion_evidence, self.odometry.pose_at(localized.evidence))
        {
            evidence.look(image, odometry, localized.evidence);
            let scanned = self.sonar.newest().and_then(|stamp| self.odometry.pose_at(stamp));
            evidence.add_scan(self.sonar.beams(), self.sonar.newest(), scanned.unwrap_or(odometry));
        }
        let learned = self.table.as_ref().and_then(|table| table.at(robot, frame.exposure));
        self.is_learned = learned.is_some();
        // Near a learned place, turned aside or in other light, remembered obstacles are more reliable.
        let is_near = self.table.as_ref().is_some_and(|table| table.is_near(robot));
        let place = match learned {
            None if is_near || self.config.requires_thresholds => return Err(Reason::NoThreshold),
            learned => learned.unwrap_or(Place::unlearned()),
        };
        // Edges on the floor are not compared with the map one by one.
        let is_precise = !self.is_learned && localized.heading_sigma <= MAX_FLOOR_SIGMA_RAD;
        let heading_sigma = if is_precise { 0.0 } else { localized.heading_sigma };
        self.detector.detect(image, robot, heading_sigma, &place)?;
        self.views.add(now, robot);
        self.known_obstacles.begin_frame();
        let half_view = (0.5 * self.detector.camera().intrinsics().horizontal_fov()).tan();
        let pan = self.detector.mount().pan;
        let camera = Pose2::new(0.0, 0.0, pan);
        let count = self.detector.regions().count();
        for region in 0..count {
            let Some(foot) = self.detector.foot(region, FOOT_PX) else { continue };
            let ahead_m = self.depth(foot).map_or(PLANE_M, |depth_m| depth_m.clamp(0.6, 3.5));
            let Interval { low, high } = region_on_plane(region, count, half_view);
            let middle = Point2::new(ahead_m, 0.5 * (low + high) * ahead_m);
            let in_robot = camera.transform_point(middle);
            if self.motion_evidence.as_mut().is_some_and(|evidence| !evidence.accept_edges(in_robot)) {
                continue;
            }
            let at = robot.transform_point(in_robot);
            let radius_m = (0.5 * (high - low) * ahead_m).clamp(0.12, 0.3);
            let is_cut = region == 0 || region + 1 == count;
            let cut = is_cut.then_some(if region == 0 { Border::Left } else { Border::Right });
            self.known_obstacles.add_detection(at, radius_m, robot.position(), cut, now);
        }
        let (views, map) = (&self.views, self.detector.map());
        if let Some(evidence) = &mut self.motion_evidence {
            let is_open = |at: Point2<f64>| map.clearance(robot.transform_point(at)) > WALL_M;
            for (at, radius_m) in evidence.things(is_open) {
                let at = robot.transform_point(at);
                // Already detected by its edges in this frame.
                let is_same = |known: &KnownObstacle| {
                    known.seen == now && (known.at - at).norm() < known.radius_m + radius_m + WALL_M
                };
                if !self.known_obstacles.all().iter().any(is_same) {
                    self.known_obstacles.add_detection(at, radius_m, robot.position(), None, now);
                }
            }
        }
        self.known_obstacles
            .end_frame(|place| views.is_in_view(robot, place) && map.is_open(robot.position(), place));
        Ok(())
    }

    /// Returns the forward distance from the camera to the floor at a pixel, m; `None` if the pixel is not below the
    /// horizon.
    fn depth(&self, pixel: Vector2<f64>) -> Option<f64> {
        let ray = self.detector.camera().ray_from_pixel(pixel)?;
        let (mount, in_body) =
            (self.detector.mount(), self.detector.mount().rotation_body_from_camera() * ray);
        let ahead = in_body.x * mount.pan.cos() + in_body.y * mount.pan.sin();
        (in_body.z < -1e-3).then(|| ahead * mount.z / -in_body.z)
    }

    /// Completes a vision result: whether the path is clear, and the bearing of the best passage.
    fn assess(&mut self, unusable: VisionResult) -> VisionResult {
        let Some(robot) = self.robot() else { return unusable };
        let goal_m = self.goal_on_plane(&robot);
        let beside = self.order.state == State::Avoid && self.is_beside_obstacle(&robot);
        let around = self.surroundings(&robot);
        if is_crossed(&around, goal_m, &self.clearances) {
            // A detour would lead where a person walks to: wait.
            return VisionResult { valid: true, clear: false, bearing: None, ..unusable };
        }
        let clear = is_clear(&around, goal_m, &self.clearances) && !beside;
        let aim = self.aim(&robot, goal_m);
        if !clear && let Some(aim) = aim.filter(|aim| aim.deviates) {
            self.lean_m = LEAN_M.copysign(aim.lateral_m - goal_m);
        }
        let bearing = aim.map(|aim| aim.bearing());
        VisionResult { valid: true, clear, bearing, ..unusable }
    }

    /// Returns the point of the best passage for a goal at `goal_m` (m, on the plane one meter ahead); `None` without a
    /// passage.
    pub(crate) fn aim(&mut self, robot: &Pose2, goal_m: f64) -> Option<Aim> {
        let mut passage = std::mem::take(&mut self.passage);
        let aim = aim(&self.surroundings(robot), goal_m, self.lean_m, &self.clearances, &mut passage);
        self.passage = passage;
        aim
    }

    fn surroundings<'a>(&'a self, robot: &'a Pose2) -> Surroundings<'a> {
        Surroundings {
            robot,
            map: self.detector.map(),
            obstacles: &self.known_obstacles,
            views: &self.views,
            path: self.guidance.path(),
        }
    }

    /// Returns the lateral position of the goal on the plane one meter ahead, m, positive left: toward the path
    /// ahead, and while avoiding parallel to the path.
    fn goal_on_plane(&self, robot: &Pose2) -> f64 {
        let on_path =
            point_on_path(self.guidance.path(), self.guidance.path_header().progress_m, LOOK_AHEAD_M);
        let bearing = match (on_path, self.order.state) {
            (None, _) => 0.0,
            (Some((_, heading)), State::Avoid) => angle_difference(heading, robot.theta),
            (Some((place, _)), _) => {
                let at = robot.inverse().transform_point(place);
                at.y.atan2(at.x)
            }
        };
        let max_bearing = MAX_GOAL_LATERAL_M.atan2(PLANE_M);
        bearing.clamp(-max_bearing, max_bearing).tan() * PLANE_M
    }
}
