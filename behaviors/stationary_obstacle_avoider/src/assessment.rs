//! Evaluates a localized frame: updates the obstacle memory, and finds out if the path is clear and which passage
//! leads on.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::Reason;
use yamabico_core::time::Time;

use crate::halt_state_machine::{State, VisionResult};
use crate::obstacle_memory::Cut;
use crate::passage_finder::{Surroundings, aim, is_clear, point_on_path};
use crate::safe_passage::{Interval, PLANE_M, region_on_plane};
use crate::{Localized, StationaryObstacleAvoider};

/// Distance ahead along the path of the point that the robot steers for, m.
const LOOK_AHEAD_M: f64 = 1.2;
/// Maximum lateral distance of the goal on the plane one meter ahead, m; a goal farther aside is clamped to it.
const MAX_GOAL_LATERAL_M: f64 = 1.0;
/// Distance behind the robot's center up to which an obstacle still counts as beside the robot, m.
const BESIDE_M: f64 = 0.4;
/// Extra distance from the goal that a passage on the side already chosen may have, m: prevents changing sides.
const LEAN_M: f64 = 0.3;
/// Number of edge pixels, counted from the bottom, that locate the foot of an obstacle.
const FOOT_PX: u32 = 4;

impl StationaryObstacleAvoider {
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
        let unusable = VisionResult {
            image_s: localized.evidence.as_secs_f64(),
            valid: false,
            clear: false,
            bearing: None,
        };
        self.pending = Some(match result {
            Ok(()) if self.known_obstacles.is_settled() => self.assess(unusable),
            Ok(()) => unusable,
            // No thresholds apply to this heading: steer by the remembered obstacles.
            Err(Reason::NoThreshold) if self.order.state == State::Avoid => {
                VisionResult { clear: false, ..self.assess(unusable) }
            }
            Err(_) => unusable,
        });
    }

    /// Detects the obstacles in a frame captured at `robot` (map frame), and adds them to the obstacle memory.
    fn detect(&mut self, localized: &Localized, robot: &Pose2, now: Time) -> Result<(), Reason> {
        let frame = self.frames.taken_at(localized.evidence).ok_or(Reason::NoInput)?;
        let table = self.table.as_ref().ok_or(Reason::NoThreshold)?;
        let place = table.at(robot, frame.exposure).ok_or(Reason::NoThreshold)?;
        let image = frame.image.view().map_err(|_| Reason::MalformedInput)?;
        self.detector.detect(image, robot, localized.heading_sigma, &place)?;
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
            let at = robot.transform_point(camera.transform_point(middle));
            let radius_m = (0.5 * (high - low) * ahead_m).clamp(0.12, 0.3);
            let is_cut = region == 0 || region + 1 == count;
            let cut = is_cut.then(|| Cut { from: robot.position(), is_left: region == 0 });
            self.known_obstacles.add_detection(at, radius_m, cut, now);
        }
        let (views, map) = (&self.views, self.detector.map());
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
        let beside = self.known_obstacles.confirmed().any(|obstacle| {
            let at = robot.inverse().transform_point(obstacle.at);
            at.x > -BESIDE_M
                && at.x < 2.0
                && at.y.abs() < 2.0 * self.clearances.half_width_m + obstacle.radius_m
        });
        let around = Surroundings {
            robot: &robot,
            map: self.detector.map(),
            obstacles: &self.known_obstacles,
            views: &self.views,
            path: &self.path,
        };
        let is_avoiding = self.order.state == State::Avoid;
        let clear = is_clear(&around, goal_m, &self.clearances) && !(is_avoiding && beside);
        let aim = aim(&around, goal_m, self.lean_m, &self.clearances, &mut self.passage);
        if !clear && let Some(aim) = aim.filter(|aim| aim.deviates) {
            self.lean_m = LEAN_M.copysign(aim.lateral_m - goal_m);
        }
        let bearing = aim.map(|aim| aim.bearing());
        VisionResult { valid: true, clear, bearing, ..unusable }
    }

    /// Returns the lateral position of the goal on the plane one meter ahead, m, positive left: toward the path
    /// ahead, and while avoiding parallel to the path.
    fn goal_on_plane(&self, robot: &Pose2) -> f64 {
        let on_path = point_on_path(&self.path, self.path_header.progress_m, LOOK_AHEAD_M);
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
