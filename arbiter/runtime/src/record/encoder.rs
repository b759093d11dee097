//! Encoder: turns the messages of a run into the records that viewers know.
//!
//! A message on topic `T` becomes JSON under `T`, and, if Foxglove has a schema for it, a record in that schema under
//! `/T/image`, `/T/scan`, `/T/pose`, `/T/path`, `/T/annotations` or `/T/scene`. `/tf` holds the coordinate frames, `/log` the
//! changes as text, `/robot/scene` the outline of the robot, `/map/scene` the map, and `/T/calibration` the lens of a camera.

use foxglove::Encode;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Beam, Command, Control, DecisionHeader, FrameHeader, FreeDirection, FreeSpaceHeader, Goal, Heartbeat,
    Message, MessageType, Obstacle, ObstaclesHeader, Odometry, OverlayHeader, OverlayMark, PathHeader,
    PathPoint, Pose, Proposal, RangeScanHeader, Truth, Verdict, WallPoint, WallsHeader,
};
use yamabico_core::sensor::SensorInfo;
use yamabico_core::time::Time;

use super::channels::{
    CALIBRATION, LOG, MAP_SCENE, OUTLINE, Records, TRANSFORMS, format_of, json_format, under,
};
use super::code_text::ChangeLog;
use super::frames::{self, FrameTree, MAP, ODOM};
use super::images::{ImageFormat, compressed};
use super::incoming::{Incoming, RunClock};
use super::{WHAT_IF, calibration, overlays, ranges, scene, surroundings};

/// Facts about the robot that an encoder needs.
#[derive(Clone, Debug, Default)]
pub struct RobotSetup {
    /// Radius of the footprint, m.
    pub radius_m: f64,
    /// Sensors by topic, for their mounts and lenses.
    pub sensors: Vec<(String, SensorInfo)>,
    /// Lines of the map, m.
    pub map: Vec<[[f64; 2]; 2]>,
}

/// Turns messages into records.
pub struct Encoder {
    setup: RobotSetup,
    images: ImageFormat,
    clock: RunClock,
    frame_tree: FrameTree,
    odometry_topic: Option<String>,
    change_log: ChangeLog,
}

impl Encoder {
    /// Encoder for a run, with images in this format.
    pub fn new(setup: RobotSetup, images: ImageFormat) -> Encoder {
        let cameras = setup.sensors.iter();
        let mounts =
            cameras.filter_map(|(topic, sensor)| Some((topic.clone(), sensor.kind.body_from_camera()?)));
        Encoder {
            frame_tree: FrameTree::new(mounts.collect()),
            setup,
            images,
            clock: RunClock::default(),
            odometry_topic: None,
            change_log: ChangeLog::default(),
        }
    }

    /// Begins the records: `origin` on the clock of the run is `start` in them. Makes the constant ones.
    pub fn begin(&mut self, records: &mut dyn Records, origin: Time, start: Time) {
        self.clock = RunClock { origin, start };
        let (setup, stamp_ns) = (&self.setup, start.0);
        put(records, OUTLINE, start, || Some(scene::footprint(stamp_ns, setup.radius_m)));
        put(records, MAP_SCENE, start, || surroundings::map(stamp_ns, &setup.map));
        put(records, TRANSFORMS, start, || self.frame_tree.cameras(stamp_ns));
        for (topic, sensor) in &setup.sensors {
            let lens = || calibration::calibration(stamp_ns, topic, &sensor.kind);
            put(records, &under(topic, CALIBRATION), start, lens);
        }
    }

    /// Time in the records of a time on the clock of the run.
    #[must_use]
    pub fn time(&self, time: Time) -> Time {
        self.clock.time(time)
    }

    /// Makes the records of one message.
    pub fn message(
        &mut self,
        records: &mut dyn Records,
        topic: &str,
        message: &MessageType,
        time: Time,
        (header, items): (&[u8], &[u8]),
    ) {
        let clock = self.clock;
        let incoming = Incoming { topic, time: clock.time(time), message, header, items, clock };
        if records.wants(topic, incoming.time) {
            let data = incoming.json();
            records.take(topic, incoming.time, &|| json_format(message), data);
        }
        // The poses of a what-if must not move the frames of the recorded run.
        if !topic.starts_with(WHAT_IF) {
            self.standard_forms(records, &incoming);
        }
    }

    fn standard_forms(&mut self, records: &mut dyn Records, incoming: &Incoming) {
        let (topic, time) = (incoming.topic, incoming.time);
        let radius_m = self.setup.radius_m;
        match incoming.message.name {
            FrameHeader::NAME => {
                let image = || compressed(&incoming.header()?, incoming.items, self.images, topic);
                put(records, &under(topic, "image"), time, image);
            }
            RangeScanHeader::NAME => {
                let Some(header) = incoming.header::<RangeScanHeader>() else { return };
                let beams = incoming.items::<Beam>();
                put(records, &under(topic, "scan"), time, || ranges::laser_scan(&header, &beams));
                put(records, &under(topic, "scene"), time, || Some(scene::cones(topic, &header, &beams)));
            }
            Odometry::NAME => self.odometry(records, incoming),
            Pose::NAME => {
                let Some(pose) = incoming.header::<Pose>() else { return };
                let at = Pose2::new(pose.x, pose.y, pose.theta);
                self.frame_tree.localized(&at);
                put_pose(records, incoming, pose.stamp_ns, MAP, &at);
            }
            Truth::NAME => {
                let Some(truth) = incoming.header::<Truth>() else { return };
                let at = Pose2::new(truth.x, truth.y, truth.theta);
                self.frame_tree.truth(&at);
                put_pose(records, incoming, truth.stamp_ns, MAP, &at);
                put(records, &under(topic, "scene"), time, || scene::truth(topic, &truth, radius_m));
            }
            PathHeader::NAME => {
                let Some(header) = incoming.header::<PathHeader>() else { return };
                let path = || Some(frames::path(header.stamp_ns, &incoming.items::<PathPoint>()));
                put(records, &under(topic, "path"), time, path);
            }
            OverlayHeader::NAME => {
                let Some(header) = incoming.header::<OverlayHeader>() else { return };
                let marks = incoming.items::<OverlayMark>();
                put(records, &under(topic, "annotations"), time, || overlays::annotations(&header, &marks));
                put(records, &under(topic, "scene"), time, || overlays::scene(topic, &header, &marks));
            }
            Goal::NAME | ObstaclesHeader::NAME | FreeSpaceHeader::NAME | WallsHeader::NAME => {
                put(records, &under(topic, "scene"), time, || surrounding(incoming));
            }
            Proposal::NAME => {
                let Some(proposal) = incoming.header::<Proposal>() else { return };
                put(records, &under(topic, "scene"), time, || Some(scene::proposal(topic, &proposal)));
                let line = self.change_log.proposal(topic, &proposal);
                put(records, LOG, time, || line);
            }
            Command::NAME => {
                let Some(command) = incoming.header::<Command>() else { return };
                put(records, &under(topic, "scene"), time, || Some(scene::command(topic, &command)));
            }
            DecisionHeader::NAME => {
                let Some(decision) = incoming.header::<DecisionHeader>() else { return };
                let lines = self.change_log.decision(topic, &decision, &incoming.items::<Verdict>());
                lines.into_iter().for_each(|line| put(records, LOG, time, || Some(line)));
            }
            Heartbeat::NAME => {
                let Some(heartbeat) = incoming.header::<Heartbeat>() else { return };
                let line = self.change_log.heartbeat(topic, &heartbeat);
                put(records, LOG, time, || line);
            }
            Control::NAME => {
                let Some(control) = incoming.header::<Control>() else { return };
                let line = self.change_log.control(&control);
                put(records, LOG, time, || Some(line));
            }
            _ => {}
        }
    }

    /// Makes the records of odometry; the first odometry topic also moves the robot's frame.
    fn odometry(&mut self, records: &mut dyn Records, incoming: &Incoming) {
        let Some(odometry) = incoming.header::<Odometry>() else { return };
        let at = Pose2::new(odometry.x, odometry.y, odometry.theta);
        put_pose(records, incoming, odometry.stamp_ns, ODOM, &at);
        if *self.odometry_topic.get_or_insert_with(|| incoming.topic.to_owned()) == incoming.topic {
            let transforms = self.frame_tree.odometry(odometry.stamp_ns, at);
            put(records, TRANSFORMS, incoming.time, || transforms);
        }
    }
}

fn surrounding(incoming: &Incoming) -> Option<foxglove::messages::SceneUpdate> {
    let topic = incoming.topic;
    match incoming.message.name {
        Goal::NAME => surroundings::goal(&incoming.header()?),
        WallsHeader::NAME => Some(surroundings::walls(&incoming.header()?, &incoming.items::<WallPoint>())),
        ObstaclesHeader::NAME => {
            let stamp_ns = incoming.header::<ObstaclesHeader>()?.stamp_ns;
            Some(surroundings::obstacles(topic, stamp_ns, &incoming.items::<Obstacle>()))
        }
        FreeSpaceHeader::NAME => {
            let stamp_ns = incoming.header::<FreeSpaceHeader>()?.stamp_ns;
            Some(surroundings::free_space(topic, stamp_ns, &incoming.items::<FreeDirection>()))
        }
        _ => None,
    }
}

fn put_pose(records: &mut dyn Records, incoming: &Incoming, stamp_ns: u64, frame_id: &str, at: &Pose2) {
    let topic = under(incoming.topic, "pose");
    put(records, &topic, incoming.time, || frames::pose_in_frame(stamp_ns, frame_id, at));
}

/// Makes a record of a message in a standard schema, if it is wanted and there is one.
fn put<T: Encode>(records: &mut dyn Records, topic: &str, time: Time, message: impl FnOnce() -> Option<T>) {
    if !records.wants(topic, time) {
        return;
    }
    let Some(message) = message() else { return };
    let mut data = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    if message.encode(&mut data).is_ok() {
        records.take(topic, time, &format_of::<T>, data);
    }
}
