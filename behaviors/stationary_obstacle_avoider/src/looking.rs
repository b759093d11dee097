//! What a localized picture tells: things on the map, whether the way is clear, and where a passage is.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::Reason;
use yamabico_core::time::Time;

use crate::halt_state_machine::{Look, State};
use crate::safe_passage::{Interval, PLANE_M, region_on_plane};
use crate::things::Cut;
use crate::way::{Surroundings, aim, is_clear, place_on};
use crate::{Localized, StationaryObstacleAvoider};

/// The path is steered for so far ahead, meters.
const LOOK_AHEAD_M: f64 = 1.2;
/// A goal that lies farther to the side of the plane is taken for this, meters.
const WIDEST_GOAL_M: f64 = 1.0;
/// Something left behind by less is still beside the robot, meters.
const BESIDE_M: f64 = 0.4;
/// A passage on the side that was begun may be farther from the goal by this, meters.
const LEAN_M: f64 = 0.3;
/// Pixels of an obstacle that tell where its foot is.
const FOOT_PX: u32 = 4;

impl StationaryObstacleAvoider {
    /// Looks at the picture that a pose rests on.
    pub(crate) fn look(&mut self, localized: &Localized, now: Time) {
        let Some(at_picture) = self.odometry.pose_at(localized.evidence) else { return };
        let robot = localized.pose * localized.odometry.relative(&at_picture);
        let result = self.detect(localized, &robot, now);
        self.trouble = result.err();
        self.looked = Some(localized.evidence);
        if self.order.state == State::Search && !self.search.is_shown(localized.evidence) {
            return;
        }
        let look =
            Look { image_s: localized.evidence.as_secs_f64(), valid: false, clear: false, bearing: None };
        self.pending = Some(match result {
            Ok(()) if self.things.is_settled() => self.judge(look),
            Ok(()) => look,
            // Turned aside, the robot finds its way back by what it remembers.
            Err(Reason::NoThreshold) if self.order.state == State::Avoid => {
                Look { clear: false, ..self.judge(look) }
            }
            Err(_) => look,
        });
    }

    /// Finds what stands in the way in a picture taken at `robot`.
    fn detect(&mut self, localized: &Localized, robot: &Pose2, now: Time) -> Result<(), Reason> {
        let picture = self.pictures.of(localized.evidence).ok_or(Reason::NoInput)?;
        let table = self.table.as_ref().ok_or(Reason::NoThreshold)?;
        let place = table.at(robot, picture.exposure).ok_or(Reason::NoThreshold)?;
        let image = picture.image.view().map_err(|_| Reason::MalformedInput)?;
        self.detector.look(image, robot, localized.heading_sigma, &place)?;
        self.floor.look(now, robot);
        self.things.begin();
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
            self.things.see(at, radius_m, cut, now);
        }
        let (floor, map) = (&self.floor, self.detector.map());
        self.things.end(|place| floor.is_in_view(robot, place) && map.is_open(robot.position(), place));
        Ok(())
    }

    /// Distance ahead of the camera of the floor at a pixel, meters; `None` above the horizon.
    fn depth(&self, pixel: Vector2<f64>) -> Option<f64> {
        let ray = self.detector.camera().ray_from_pixel(pixel)?;
        let (mount, in_body) =
            (self.detector.mount(), self.detector.mount().rotation_body_from_camera() * ray);
        let ahead = in_body.x * mount.pan.cos() + in_body.y * mount.pan.sin();
        (in_body.z < -1e-3).then(|| ahead * mount.z / -in_body.z)
    }

    /// Whether the way is clear, and where a passage is.
    fn judge(&mut self, look: Look) -> Look {
        let Some(robot) = self.robot() else { return look };
        let goal_m = self.goal_on_plane(&robot);
        let beside = self.things.confirmed().any(|thing| {
            let at = robot.inverse().transform_point(thing.at);
            at.x > -BESIDE_M && at.x < 2.0 && at.y.abs() < 2.0 * self.room.half_width_m + thing.radius_m
        });
        let around = Surroundings {
            robot: &robot,
            map: self.detector.map(),
            things: &self.things,
            floor: &self.floor,
            path: &self.path,
        };
        let is_avoiding = self.order.state == State::Avoid;
        let clear = is_clear(&around, goal_m, &self.room) && !(is_avoiding && beside);
        let aim = aim(&around, goal_m, self.lean_m, &self.room, &mut self.passage);
        if !clear && let Some(aim) = aim.filter(|aim| aim.deviates) {
            self.lean_m = LEAN_M.copysign(aim.lateral_m - goal_m);
        }
        let bearing = aim.map(|aim| aim.bearing());
        Look { valid: true, clear, bearing, ..look }
    }

    /// Where the path leads, on the plane one meter ahead, meters; while avoiding, where it runs, leaning to the passage that
    /// was chosen.
    fn goal_on_plane(&self, robot: &Pose2) -> f64 {
        let on_path = place_on(&self.path, self.station.progress_m, LOOK_AHEAD_M);
        let bearing = match (on_path, self.order.state) {
            (None, _) => 0.0,
            (Some((_, heading)), State::Avoid) => angle_difference(heading, robot.theta),
            (Some((place, _)), _) => {
                let at = robot.inverse().transform_point(place);
                at.y.atan2(at.x)
            }
        };
        let widest = WIDEST_GOAL_M.atan2(PLANE_M);
        bearing.clamp(-widest, widest).tan() * PLANE_M
    }
}
