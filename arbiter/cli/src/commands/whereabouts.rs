//! Where the robot was in a run: its odometry, laid onto the map by the poses that a behavior told.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Message, Odometry, Pose, RawMessage, View};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::topics;

/// Where the robot was lately.
pub struct Whereabouts {
    odometry_topic: String,
    pose_topic: Option<String>,
    odometry: OdometryTrack,
    /// `None` before the first pose.
    map_from_odometry: Option<Pose2>,
}

impl Whereabouts {
    /// Of the robot of this task; `None` without odometry. Where no behavior tells poses, its odometry is the map's frame.
    pub fn of(task: &Task) -> Option<Whereabouts> {
        let mut sensors = task.behaviors.iter().flat_map(|behavior| &behavior.setup.sensors);
        let (_, odometry) = sensors.find(|(_, sensor)| sensor.message == Odometry::NAME)?;
        let pose_topic = pose_publisher(task).map(|(_, topic)| topic);
        Some(Whereabouts {
            odometry_topic: topics::sensor(&odometry.name),
            map_from_odometry: pose_topic.is_none().then_some(Pose2::IDENTITY),
            pose_topic,
            odometry: OdometryTrack::default(),
        })
    }

    /// Whether a behavior tells poses.
    pub fn is_localized(&self) -> bool {
        self.pose_topic.is_some()
    }

    /// Hears a message that was recorded at `time`; whether it changes what [`Whereabouts::at`] says of the past.
    pub fn hear(&mut self, topic: &str, message: RawMessage<'_>, time: Time) -> bool {
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

    /// Where the robot was at an instant, map frame; `None` where that is not known, or not known any more.
    pub fn at(&self, stamp: Time) -> Option<Pose2> {
        Some(self.map_from_odometry?.compose(&self.odometry.pose_at(stamp)?))
    }
}

/// The name of the behavior that publishes poses, and its topic.
pub fn pose_publisher(task: &Task) -> Option<(String, String)> {
    task.behaviors.iter().find_map(|behavior| {
        let output =
            behavior.factory.info().outputs.iter().find(|output| output.message.name == Pose::NAME)?;
        Some((behavior.name.clone(), topics::output(&behavior.name, &output.name)))
    })
}
