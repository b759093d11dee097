//! The robot's pose on the map during a drive: odometry, corrected by the published pose estimates.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Message, Odometry, Pose, RawMessage, View};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::topics;

/// The recent trajectory of the robot in the map frame.
pub(crate) struct RobotTrack {
    odometry_topic: String,
    pose_topic: Option<String>,
    odometry: OdometryTrack,
    /// `None` before the first pose estimate.
    map_from_odometry: Option<Pose2>,
}

impl RobotTrack {
    /// Creates an empty track for the robot of `task`; `None` without odometry. Without a behavior that publishes poses, the
    /// map frame is the odometry frame.
    pub fn new(task: &Task) -> Option<RobotTrack> {
        let mut sensors = task.behaviors.iter().flat_map(|behavior| &behavior.setup.sensors);
        let (_, odometry) = sensors.find(|(_, sensor)| sensor.message == Odometry::NAME)?;
        let pose_topic = pose_publisher(task).map(|(_, topic)| topic);
        Some(RobotTrack {
            odometry_topic: topics::sensor(&odometry.name),
            map_from_odometry: pose_topic.is_none().then_some(Pose2::IDENTITY),
            pose_topic,
            odometry: OdometryTrack::default(),
        })
    }

    /// Returns true if a behavior publishes poses.
    pub fn is_localized(&self) -> bool {
        self.pose_topic.is_some()
    }

    /// Takes in a message received at `time`; returns true if it changed what [`RobotTrack::pose_at`] returns for the past.
    pub fn take(&mut self, topic: &str, message: RawMessage<'_>, time: Time) -> bool {
        if topic == self.odometry_topic {
            if let Some(odometry) = View::<Odometry>::of(message) {
                self.odometry.push(odometry.header, time);
            }
            return !self.is_localized();
        }
        if self.pose_topic.as_deref() == Some(topic)
            && let Some(pose) = View::<Pose>::of(message)
            && let Some(then) = self.odometry.pose_at(Time(pose.header.stamp_ns))
        {
            let Pose { x, y, theta, .. } = *pose.header;
            self.map_from_odometry = Some(Pose2::new(x, y, theta).compose(&then.inverse()));
            return true;
        }
        false
    }

    /// Pose of the robot at an instant, map frame; `None` outside the recent track.
    pub fn pose_at(&self, stamp: Time) -> Option<Pose2> {
        Some(self.map_from_odometry?.compose(&self.odometry.pose_at(stamp)?))
    }
}

/// Name of the behavior that publishes poses, and its topic.
pub(crate) fn pose_publisher(task: &Task) -> Option<(String, String)> {
    task.behaviors.iter().find_map(|behavior| {
        let output =
            behavior.factory.info().outputs.iter().find(|output| output.message.name == Pose::NAME)?;
        Some((behavior.name.clone(), topics::output(&behavior.name, &output.name)))
    })
}
