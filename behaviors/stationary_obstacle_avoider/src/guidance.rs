//! The robot's pose and path: on the map by a localizer and a path follower, or in the frame of a corridor.

use yamabico_core::behavior::Inputs;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Corridor, PathHeader, PathPoint, Pose, PoseStatus, Reason};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::time::Time;
use yamabico_vision::map::WireFrame;

use crate::corridor_frame::CorridorFrame;
use crate::{CORRIDOR, PATH, POSE};

/// Age above which a pose estimate, or the odometry in a corridor, is stale, s.
const POSE_STALE_S: f64 = 0.5;
/// Maximum number of points of the path that are kept.
const MAX_PATH_POINTS: usize = 64;

/// Pose estimate, with the odometry at its stamp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Localized {
    pub stamp: Time,
    pub evidence: Time,
    pub pose: Pose2,
    pub odometry: Pose2,
    pub heading_sigma: f64,
    pub is_usable: bool,
    /// True if it rests on newer evidence than the one before.
    pub is_new: bool,
}

/// Pose and path, in the map frame or in that of a corridor.
#[derive(Clone, Debug)]
pub(crate) struct Guidance {
    localized: Option<Localized>,
    is_in_corridor: bool,
    corridor: Option<CorridorFrame>,
    path: Vec<PathPoint>,
    header: PathHeader,
}

impl Guidance {
    /// Creates guidance by a map, or by a corridor if `is_in_corridor` is set.
    pub fn new(is_in_corridor: bool) -> Self {
        Self {
            localized: None,
            is_in_corridor,
            corridor: None,
            path: Vec::with_capacity(MAX_PATH_POINTS),
            header: PathHeader::default(),
        }
    }

    /// True if the robot follows a corridor without a map.
    pub fn is_in_corridor(&self) -> bool {
        self.is_in_corridor
    }

    /// Latest pose estimate.
    pub fn localized(&self) -> Option<&Localized> {
        self.localized.as_ref()
    }

    /// Frame of the corridor, without a map.
    pub fn corridor(&self) -> Option<&CorridorFrame> {
        self.corridor.as_ref()
    }

    /// Frame of the corridor, without a map, to change.
    pub fn corridor_mut(&mut self) -> Option<&mut CorridorFrame> {
        self.corridor.as_mut()
    }

    /// Continues from a saved frame of the corridor.
    pub fn restore(&mut self, corridor: Option<CorridorFrame>) {
        self.corridor = corridor;
    }

    /// Corners of the path; empty if there is none.
    pub fn path(&self) -> &[PathPoint] {
        &self.path
    }

    /// Errors relative to the path, and progress along it.
    pub fn path_header(&self) -> &PathHeader {
        &self.header
    }

    /// Returns the current pose, from the latest pose estimate and the odometry since.
    pub fn robot(&self, odometry: &OdometryTrack) -> Option<Pose2> {
        let localized = self.localized?;
        let newest = odometry.newest()?;
        Some(localized.pose * localized.odometry.relative(&newest.pose))
    }

    /// Returns true if the pose is known. In a corridor that is out of view for a while, the odometry suffices.
    pub fn is_localized(&self, odometry: &OdometryTrack, now: Time) -> bool {
        let Some(localized) = self.localized.filter(|localized| localized.is_usable) else { return false };
        let stamp = match self.is_in_corridor {
            true => odometry.newest().map(|newest| newest.stamp),
            false => Some(localized.stamp),
        };
        stamp.is_some_and(|stamp| now.seconds_after(stamp) <= POSE_STALE_S)
    }

    /// Returns why the pose is not known, where it is not.
    pub fn lost_reason(&self) -> Reason {
        match self.localized {
            None => Reason::NoInput,
            Some(localized) if !localized.is_usable => Reason::Lost,
            Some(_) => Reason::StaleInput,
        }
    }

    /// Takes in the newest pose and path, or the newest corridor. Returns the new pose estimate if there is one.
    ///
    /// # Errors
    /// The pose or the corridor cannot be used.
    pub fn update(
        &mut self,
        inputs: &Inputs<'_>,
        odometry: &OdometryTrack,
    ) -> Result<Option<Localized>, Reason> {
        let now = inputs.now();
        if self.is_in_corridor {
            return match inputs.latest(&CORRIDOR).filter(|_| inputs.is_fresh(&CORRIDOR)) {
                Some(corridor) => self.take_corridor(corridor.header, odometry, now),
                None => Ok(None),
            };
        }
        self.take_path(inputs);
        match inputs.latest(&POSE).filter(|_| inputs.is_fresh(&POSE)) {
            Some(pose) => self.take_pose(pose.header, odometry, now),
            None => Ok(None),
        }
    }

    /// Writes the walls of the corridor into `map`; leaves a map of the building as it is.
    pub fn draw(&self, map: &mut WireFrame) {
        if let Some(corridor) = &self.corridor {
            corridor.draw(map);
        }
    }

    fn take_path(&mut self, inputs: &Inputs<'_>) {
        let Some(path) = inputs.latest(&PATH).filter(|_| inputs.is_fresh(&PATH)) else { return };
        let numbers = [path.header.lateral_error_m, path.header.heading_error_rad, path.header.progress_m];
        if numbers.iter().all(|x| x.is_finite()) {
            self.header = *path.header;
            let points = path.items.iter().filter(|p| p.x.is_finite() && p.y.is_finite());
            self.path.clear();
            self.path.extend(points.take(MAX_PATH_POINTS));
        }
    }

    fn take_pose(
        &mut self,
        pose: &Pose,
        odometry: &OdometryTrack,
        now: Time,
    ) -> Result<Option<Localized>, Reason> {
        let on_map = Pose2::new(pose.x, pose.y, pose.theta);
        let is_usable = matches!(
            pose.status(),
            Some(PoseStatus::Tracking | PoseStatus::Coasting | PoseStatus::Inconsistent)
        );
        let (stamp, evidence) = (Time(pose.stamp_ns), Time(pose.evidence_ns));
        let Some(odometry) = self.odometry_at(stamp, odometry) else { return Ok(None) };
        if !on_map.is_finite() || stamp.is_future(now) {
            return Err(Reason::MalformedInput);
        }
        let heading_sigma = pose.covariance[8].sqrt();
        Ok(Some(self.locate(Localized {
            stamp,
            evidence,
            pose: on_map,
            odometry,
            heading_sigma,
            is_usable,
            is_new: false,
        })))
    }

    /// Moves the frame of the corridor, and takes in the corridor.
    fn take_corridor(
        &mut self,
        corridor: &Corridor,
        odometry: &OdometryTrack,
        now: Time,
    ) -> Result<Option<Localized>, Reason> {
        let (stamp, evidence) = (Time(corridor.stamp_ns), Time(corridor.evidence_ns));
        let Some(odometry) = self.odometry_at(stamp, odometry) else { return Ok(None) };
        if stamp.is_future(now) {
            return Err(Reason::MalformedInput);
        }
        let frame = self.corridor.get_or_insert_with(|| CorridorFrame::new(odometry));
        if !frame.update(corridor, odometry) {
            return Err(Reason::Lost);
        }
        let (pose, (points, lateral_error_m)) = (frame.pose(), frame.path());
        let (progress_m, heading_sigma) = (frame.progress_m(), frame.heading_sigma());
        self.path.clear();
        self.path.extend_from_slice(&points);
        self.header =
            PathHeader { lateral_error_m, heading_error_rad: pose.theta, progress_m, ..self.header };
        Ok(Some(self.locate(Localized {
            stamp,
            evidence,
            pose,
            odometry,
            heading_sigma,
            is_usable: true,
            is_new: false,
        })))
    }

    /// Returns the odometry at `stamp`; `None` if it is unknown, or if a newer pose has been taken in.
    fn odometry_at(&self, stamp: Time, odometry: &OdometryTrack) -> Option<Pose2> {
        let is_old = self.localized.is_some_and(|last| stamp < last.stamp);
        odometry.pose_at(stamp).filter(|_| !is_old)
    }

    fn locate(&mut self, localized: Localized) -> Localized {
        let is_new = self.localized.is_none_or(|last| localized.evidence > last.evidence);
        *self.localized.insert(Localized { is_new, ..localized })
    }
}
