//! The tap that verifies surfaces: a localized robot faces each of them with a sonar.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Message, MessageType, RangeScanHeader, RawMessage, View};
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::record::Tap;
use yamabico_vision::azimuth_map::{
    EdgeMap, MapSurface, RangeReading, SurfaceCheck, SurfaceCheckRule, SurfaceState,
};

use crate::robot_track::RobotTrack;

/// Standard deviation of the distance to a surface, m.
const SIGMA_M: f64 = 0.03;

/// Collects sonar readings of the surfaces of a map.
pub(super) struct SurfaceVerifier {
    track: RobotTrack,
    checks: Vec<SurfaceCheck>,
}

impl SurfaceVerifier {
    /// Creates a verifier for the sonar of `task` and the surfaces of `map`.
    ///
    /// # Errors
    /// No sonar, odometry or localizer in the task, for people.
    pub fn new(task: &Task, map: &EdgeMap) -> Result<Self, String> {
        let mut sensors = task.behaviors.iter().flat_map(|behavior| &behavior.setup.sensors);
        let sonar = sensors.find(|(_, sensor)| sensor.message == RangeScanHeader::NAME);
        let Some(&SensorKind::Range { max_m, .. }) = sonar.map(|(_, sensor)| &sensor.kind) else {
            return Err("--verify needs a sonar in the task: add a sonar-halt".into());
        };
        let rule = SurfaceCheckRule { farthest_m: max_m, ..SurfaceCheckRule::default() };
        let track = RobotTrack::new(task)
            .ok_or("--verify needs odometry in the task: wire it to the map-localizer")?;
        if !track.is_localized() {
            return Err("--verify needs a localizer in the task: add a map-localizer".into());
        }
        let check = |surface: &MapSurface| {
            let end = |number| map.edge(number).map_or(Point2::origin(), |edge| Point2::from(edge.at_m));
            SurfaceCheck::new([end(surface.right), end(surface.left)], rule)
        };
        Ok(Self { track, checks: map.surfaces.iter().map(check).collect() })
    }

    /// Writes the states that are known now into `map`; returns the number of them.
    pub fn apply(&self, map: &mut EdgeMap) -> usize {
        for (surface, check) in map.surfaces.iter_mut().zip(&self.checks) {
            if check.state() != SurfaceState::Unknown {
                surface.state = check.state();
            }
        }
        self.checks.iter().filter(|check| check.state() != SurfaceState::Unknown).count()
    }

    fn take(&mut self, scan: &View<'_, RangeScanHeader>) {
        let Some(robot) = self.track.pose_at(Time(scan.header.stamp_ns)) else { return };
        for beam in scan.items {
            let on_robot = Pose2::new(beam.x_m, beam.y_m, beam.azimuth_rad);
            let sensor = robot.compose(&on_robot);
            let reading = RangeReading { sensor, range_m: beam.echo_m(), sigma_m: SIGMA_M };
            for check in &mut self.checks {
                check.update(&reading);
            }
        }
    }
}

impl Tap for SurfaceVerifier {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        self.track.take(topic, raw, time);
        if message.name == RangeScanHeader::NAME
            && let Some(scan) = View::<RangeScanHeader>::of(raw)
        {
            self.take(&scan);
        }
    }
}
