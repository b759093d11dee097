//! What a localised picture tells: things on the map, whether the way is clear, and where a passage is.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::Reason;
use yamabico_core::time::Time;

use crate::halt_state_machine::{Look, State};
use crate::safe_passage::{Interval, PLANE_M, region_on_plane};
use crate::way::{Surroundings, aim, is_clear, place_on};
use crate::{Localised, MEMORY_S, StationaryObstacleAvoider};

/// The path is steered for so far ahead, metres.
const LOOK_AHEAD_M: f64 = 1.2;
/// A goal that lies farther to the side of the plane is taken for this, metres.
const WIDEST_GOAL_M: f64 = 1.0;
/// Something left behind by less is still beside the robot, metres.
const BESIDE_M: f64 = 0.4;
/// A passage on the side that was begun may be farther from the goal by this, metres.
const LEAN_M: f64 = 0.3;
/// Nothing is taken to be narrower than twice this, metres.
const SMALLEST_M: f64 = 0.14;
/// A thing may reach so far beyond its outermost edge, metres.
const EDGE_M: f64 = 0.06;
/// Another passage than the one that is driven to must be the better one in so many pictures, one after the other.
const DOUBTS: u32 = 3;
/// Passages whose directions differ by more are not the same one, rad.
pub(crate) const SAME_PASSAGE_RAD: f64 = 0.35;
/// Pixels of an obstacle that tell where its foot is.
const FOOT_PX: u32 = 4;

impl StationaryObstacleAvoider {
    /// Looks at the picture that a pose rests on.
    pub(crate) fn look(&mut self, localised: &Localised, now: Time) {
        let Some(at_picture) = self.odometry.pose_at(localised.evidence) else { return };
        let robot = localised.pose * localised.odometry.relative(&at_picture);
        let result = self.detect(localised, &robot, now);
        self.trouble = result.err();
        self.looked = Some(localised.evidence);
        if self.order.state == State::Search && !self.search.is_shown(localised.evidence) {
            return;
        }
        let look =
            Look { image_s: localised.evidence.as_secs_f64(), valid: false, clear: false, bearing: None };
        self.pending = Some(match result {
            Ok(()) => self.judge(look),
            // Turned aside, the robot finds its way back by what it remembers.
            Err(Reason::NoThreshold) if self.order.state == State::Avoid => {
                Look { clear: false, ..self.judge(look) }
            }
            Err(_) => look,
        });
    }

    /// Finds what stands in the way in a picture taken at `robot`.
    fn detect(&mut self, localised: &Localised, robot: &Pose2, now: Time) -> Result<(), Reason> {
        let picture = self.pictures.of(localised.evidence).ok_or(Reason::NoInput)?;
        let table = self.table.as_ref().ok_or(Reason::NoThreshold)?;
        let place = table.at(robot, picture.exposure).ok_or(Reason::NoThreshold)?;
        let image = picture.image.view().map_err(|_| Reason::MalformedInput)?;
        self.detector.look(image, robot, localised.heading_sigma, &place)?;
        self.floor.look(now, robot);
        self.things.begin();
        let pan = self.detector.mount().pan;
        let camera = Pose2::new(0.0, 0.0, pan);
        for region in 0..self.detector.regions().count() {
            let Some(foot) = self.detector.foot(region, FOOT_PX) else { continue };
            let ahead_m = self.depth(foot).map_or(PLANE_M, |depth_m| depth_m.clamp(0.6, 3.5));
            let across = self.across(region, ahead_m);
            let middle = Point2::new(ahead_m, 0.5 * (across.low + across.high));
            let at = robot.transform_point(camera.transform_point(middle));
            let radius_m = (0.5 * across.width()).clamp(SMALLEST_M, 0.3);
            self.things.see(robot.position(), at, radius_m, now, MEMORY_S.0);
        }
        let (floor, map) = (&self.floor, self.detector.map());
        self.things.end(|place| floor.is_in_view(robot, place) && map.is_open(robot.position(), place));
        Ok(())
    }

    /// What the thing in a region covers across the camera's axis where it stands `ahead_m` ahead, metres: on the sides where
    /// the next region is empty no more than its edges bear out.
    fn across(&self, region: usize, ahead_m: f64) -> Interval {
        let count = self.detector.regions().count();
        let half_view = (0.5 * self.detector.camera().intrinsics().horizontal_fov()).tan();
        let whole = region_on_plane(region, count, half_view);
        let whole = Interval::new(whole.low * ahead_m, whole.high * ahead_m);
        let (columns, k) = (self.detector.extent(region, FOOT_PX), self.detector.camera().intrinsics());
        let place = |u: usize| (k.cx - u as f64) / k.fx * ahead_m;
        let is_held = |next: Option<usize>| {
            next.is_none_or(|next| self.detector.sights().get(next).is_none_or(|sight| sight.is_obstacle))
        };
        let (goes_left, goes_right) = (is_held(region.checked_sub(1)), is_held(Some(region + 1)));
        let high = if goes_left { whole.high } else { whole.high.min(place(columns.start) + EDGE_M) };
        let low = if goes_right { whole.low } else { whole.low.max(place(columns.end) - EDGE_M) };
        match (goes_left, goes_right) {
            _ if high - low >= 2.0 * SMALLEST_M => Interval::new(low, high),
            (true, false) => Interval::new(low, low + 2.0 * SMALLEST_M),
            (false, true) => Interval::new(high - 2.0 * SMALLEST_M, high),
            // One edge does not tell on which side of it the thing is.
            _ => whole,
        }
    }

    /// Distance ahead of the camera of the floor at a pixel, metres; `None` above the horizon.
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
        let ahead = self.along_path(&robot);
        let goal_m = self.goal_on_plane(&ahead);
        let beside = self.things.confirmed().any(|thing| {
            let at = ahead.inverse().transform_point(thing.at);
            at.x > -BESIDE_M && at.x < 2.0 && at.y.abs() < 2.0 * self.room.half_width_m + thing.radius_m
        });
        let around = Surroundings {
            robot: &ahead,
            map: self.detector.map(),
            things: &self.things,
            floor: &self.floor,
            path: &self.path,
        };
        let is_avoiding = self.order.state == State::Avoid;
        let clear = is_clear(&around, goal_m, &self.room) && !(is_avoiding && beside);
        let aim = aim(&around, goal_m, self.lean_m, &self.room, &mut self.passage);
        let heading = aim.map(|aim| ahead.theta + aim.bearing());
        if is_avoiding && self.is_doubtful(heading) {
            return look;
        }
        if !clear && let Some(aim) = aim.filter(|aim| aim.deviates) {
            self.lean_m = LEAN_M.copysign(aim.lateral_m - goal_m);
        }
        let bearing = heading.map(|heading| angle_difference(heading, robot.theta));
        Look { valid: true, clear, bearing, ..look }
    }

    /// Whether a passage in the direction `heading` (rad) on the map, or none, is too new to give up for it the one that is
    /// driven to.
    fn is_doubtful(&mut self, heading: Option<f64>) -> bool {
        let is_same = match (heading, self.order.target_heading) {
            (Some(heading), Some(target)) => angle_difference(heading, target).abs() <= SAME_PASSAGE_RAD,
            _ => false,
        };
        self.doubts = if is_same { 0 } else { self.doubts + 1 };
        !is_same && self.doubts < DOUBTS
    }

    /// The robot as if it were turned along its path, so that what is free does not depend on where it looks just now.
    pub(crate) fn along_path(&self, robot: &Pose2) -> Pose2 {
        let on_path = place_on(&self.path, self.station.progress_m, LOOK_AHEAD_M);
        Pose2::new(robot.x, robot.y, on_path.map_or(robot.theta, |(_, heading)| heading))
    }

    /// Where the path leads from `ahead`, on the plane one metre ahead, metres; while avoiding, straight on.
    fn goal_on_plane(&self, ahead: &Pose2) -> f64 {
        let on_path = place_on(&self.path, self.station.progress_m, LOOK_AHEAD_M);
        let bearing = match (on_path, self.order.state) {
            (None, _) | (_, State::Avoid) => 0.0,
            (Some((place, _)), _) => {
                let at = ahead.inverse().transform_point(place);
                at.y.atan2(at.x)
            }
        };
        let widest = WIDEST_GOAL_M.atan2(PLANE_M);
        bearing.clamp(-widest, widest).tan() * PLANE_M
    }
}
