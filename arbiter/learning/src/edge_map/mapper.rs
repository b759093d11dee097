//! The tap that maps vertical edges from frames of a mirror camera, odometry and poses.

use std::collections::VecDeque;

use yamabico_core::camera::Mount;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, MessageType, RawMessage, View};
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::topics;
use yamabico_runtime::record::Tap;
use yamabico_vision::azimuth_map::{AdjustmentRule, EdgeMap, Mapper, MapperRule};
use yamabico_vision::azimuth_profile::ProfileRule;
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

use crate::robot_track::RobotTrack;

/// Number of frames kept until the odometry of their instant arrives.
const MAX_FRAMES: usize = 16;
/// Range of the camera's sway, degrees.
const SWAY_DEG: std::ops::RangeInclusive<f64> = 0.01..=10.0;

/// Maps the vertical edges that the mirror camera of a task observes.
pub(super) struct EdgeMapper {
    camera_topic: String,
    track: RobotTrack,
    robot_from_camera: Pose2,
    size: [u32; 2],
    edges: RadialEdges,
    mapper: Mapper,
    recent: VecDeque<(Time, GrayImage)>,
}

impl EdgeMapper {
    /// Creates a mapper for the mirror camera and the odometry of the task.
    ///
    /// # Errors
    /// A sway out of range, no mirror camera or no odometry, for people.
    pub fn new(task: &Task, sway_deg: f64) -> Result<Self, String> {
        if !SWAY_DEG.contains(&sway_deg) {
            let (min, max) = (SWAY_DEG.start(), SWAY_DEG.end());
            return Err(format!("the sway must be {min} to {max} degrees, but is {sway_deg} degrees"));
        }
        let sensors = || task.behaviors.iter().flat_map(|behavior| &behavior.setup.sensors);
        let mirror = sensors().find_map(|(_, sensor)| match &sensor.kind {
            SensorKind::MirrorCamera { camera, mount, .. } => Some((sensor.name.clone(), camera, *mount)),
            _ => None,
        });
        let (camera, mirror, mount) = mirror
            .ok_or("no behavior of the task has a mirror camera as input: edges are mapped with one")?;
        let track = RobotTrack::new(task)
            .ok_or("no behavior of the task has odometry as input: the map gets its scale from it")?;
        let Mount { x, y, pan, .. } = mount;
        let image = mirror.image();
        let adjustment =
            AdjustmentRule { sway_sigma_rad: sway_deg.to_radians(), ..AdjustmentRule::default() };
        Ok(Self {
            camera_topic: topics::sensor(&camera),
            track,
            robot_from_camera: Pose2::new(x, y, pan),
            size: image.size(),
            edges: RadialEdges::new(image, &RadialEdgeRule::within(image), ProfileRule::default()),
            mapper: Mapper::new(MapperRule { adjustment, ..MapperRule::default() }),
            recent: VecDeque::new(),
        })
    }

    /// Poses of the camera at the frames that went into the map, map frame, oldest first.
    pub fn camera_poses(&self) -> &[Pose2] {
        self.mapper.poses()
    }

    /// Computes the map.
    ///
    /// # Errors
    /// Too few edges or frames, for people.
    pub fn finish(&mut self) -> Result<EdgeMap, String> {
        self.mapper.finish().map_err(|error| error.to_string())
    }

    fn keep(&mut self, frame: &View<'_, FrameHeader>) {
        let mut luma = GrayImage::default();
        if let Some(image) = frame.gray(self.size, &mut luma) {
            let mut gray = GrayImage::default();
            gray.copy_from(image);
            self.recent.truncate(MAX_FRAMES - 1);
            self.recent.push_back((Time(frame.header.stamp_ns), gray));
        }
    }

    /// Maps the frames whose pose is known by now.
    fn map(&mut self) {
        while let Some((stamp, gray)) = self.recent.front() {
            let Some(robot) = self.track.pose_at(*stamp) else { return };
            let camera = robot.compose(&self.robot_from_camera);
            if let Ok(image) = gray.view()
                && let Ok(edges) = self.edges.find(image)
            {
                self.mapper.add_frame(edges, &camera);
            }
            self.recent.pop_front();
        }
    }
}

impl Tap for EdgeMapper {
    fn message(&mut self, topic: &str, _: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if topic == self.camera_topic
            && let Some(frame) = View::<FrameHeader>::of(raw)
        {
            self.keep(&frame);
        }
        if self.track.take(topic, raw, time) {
            self.map();
        }
    }
}
