//! The robot's pose and path: on the map by a localizer and a path follower, or in the frame of a corridor.

use yamabico_core::behavior::{Inputs, Outputs};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Corridor, PathHeader, Pose, PoseStatus, Reason};
use yamabico_core::odometry_track::FUTURE_TOLERANCE_S;
use yamabico_core::time::Time;

use crate::corridor_frame::CorridorFrame;
use crate::{CORRIDOR, PATH, POSE, StationaryObstacleAvoider};

/// Age above which a pose estimate, or the odometry in a corridor, is stale, s.
const POSE_STALE_S: f64 = 0.5;
/// Maximum number of points of the path that are kept.
const MAX_PATH_POINTS: usize = 64;

/// Latest pose estimate, with the odometry at its stamp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Localized {
    pub stamp: Time,
    pub evidence: Time,
    pub pose: Pose2,
    pub odometry: Pose2,
    pub heading_sigma: f64,
    pub is_usable: bool,
}

impl StationaryObstacleAvoider {
    /// Returns the current pose in the map frame, from the latest pose estimate and the odometry since.
    pub(crate) fn robot(&self) -> Option<Pose2> {
        let localized = self.localized?;
        let newest = self.odometry.newest()?;
        Some(localized.pose * localized.odometry.relative(&newest.pose))
    }

    /// Returns true if the pose is known. In a corridor that is out of view for a while, the odometry suffices.
    pub(crate) fn is_localized(&self, now: Time) -> bool {
        let Some(localized) = self.localized.filter(|localized| localized.is_usable) else { return false };
        let stamp = match self.is_in_corridor {
            true => self.odometry.newest().map(|newest| newest.stamp),
            false => Some(localized.stamp),
        };
        stamp.is_some_and(|stamp| now.seconds_after(stamp) <= POSE_STALE_S)
    }

    /// Takes in the newest pose and path, or the newest corridor.
    pub(crate) fn localize(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let now = inputs.now();
        if self.is_in_corridor {
            if let Some(corridor) = inputs.latest(&CORRIDOR).filter(|_| inputs.is_fresh(&CORRIDOR)) {
                self.take_corridor(corridor.header, now, outputs);
            }
            return;
        }
        self.take_path(inputs);
        if let Some(pose) = inputs.latest(&POSE).filter(|_| inputs.is_fresh(&POSE)) {
            self.take_pose(pose.header, now, outputs);
        }
    }

    fn take_path(&mut self, inputs: &Inputs<'_>) {
        let Some(path) = inputs.latest(&PATH).filter(|_| inputs.is_fresh(&PATH)) else { return };
        let numbers = [path.header.lateral_error_m, path.header.heading_error_rad, path.header.progress_m];
        if numbers.iter().all(|x| x.is_finite()) {
            self.path_header = *path.header;
            let points = path.items.iter().filter(|p| p.x.is_finite() && p.y.is_finite());
            self.path.clear();
            self.path.extend(points.take(MAX_PATH_POINTS));
        }
    }

    /// Stores a pose estimate; if it was estimated from a frame that was not evaluated yet, evaluates that frame.
    fn take_pose(&mut self, pose: &Pose, now: Time, outputs: &mut Outputs<'_>) {
        let on_map = Pose2::new(pose.x, pose.y, pose.theta);
        let is_usable = matches!(
            pose.status(),
            Some(PoseStatus::Tracking | PoseStatus::Coasting | PoseStatus::Inconsistent)
        );
        let (stamp, evidence) = (Time(pose.stamp_ns), Time(pose.evidence_ns));
        let Some(odometry) = self.odometry_at(stamp) else { return };
        if !on_map.is_finite() || stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.failure = Some(Reason::MalformedInput);
            return;
        }
        let heading_sigma = pose.covariance[8].sqrt();
        self.locate(
            Localized { stamp, evidence, pose: on_map, odometry, heading_sigma, is_usable },
            now,
            outputs,
        );
    }

    /// Moves the frame of the corridor; if the corridor was seen in a frame that was not evaluated yet, evaluates it.
    fn take_corridor(&mut self, corridor: &Corridor, now: Time, outputs: &mut Outputs<'_>) {
        let (stamp, evidence) = (Time(corridor.stamp_ns), Time(corridor.evidence_ns));
        let Some(odometry) = self.odometry_at(stamp) else { return };
        if stamp.seconds_after(now) > FUTURE_TOLERANCE_S {
            self.failure = Some(Reason::MalformedInput);
            return;
        }
        let frame = self.corridor.get_or_insert_with(|| CorridorFrame::new(odometry));
        if !frame.update(corridor, odometry) {
            self.failure = Some(Reason::Lost);
            return;
        }
        frame.draw(self.detector.map_mut());
        let (pose, (points, lateral_error_m)) = (frame.pose(), frame.path());
        let (progress_m, heading_sigma) = (frame.progress_m(), frame.heading_sigma());
        self.path.clear();
        self.path.extend_from_slice(&points);
        self.path_header =
            PathHeader { lateral_error_m, heading_error_rad: pose.theta, progress_m, ..self.path_header };
        let is_usable = true;
        self.locate(Localized { stamp, evidence, pose, odometry, heading_sigma, is_usable }, now, outputs);
    }

    /// Returns the odometry at `stamp`; `None` if it is unknown, or if a newer pose has been taken in.
    fn odometry_at(&self, stamp: Time) -> Option<Pose2> {
        let is_old = self.localized.is_some_and(|last| stamp < last.stamp);
        self.odometry.pose_at(stamp).filter(|_| !is_old)
    }

    fn locate(&mut self, localized: Localized, now: Time, outputs: &mut Outputs<'_>) {
        let is_new = self.localized.is_none_or(|last| localized.evidence > last.evidence);
        self.localized = Some(localized);
        if is_new && localized.is_usable && self.frames.taken_at(localized.evidence).is_some() {
            self.evaluate(&localized, now);
            self.publish(now, outputs);
        }
    }
}
