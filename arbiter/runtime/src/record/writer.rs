//! Writer thread: turns messages into the records of an MCAP file.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::sync::Arc;

use bytemuck::Pod;
use foxglove::{Context, Encode, PartialMetadata, RawChannel, Schema};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Beam, Command, Control, DecisionHeader, FrameHeader, Heartbeat, Layout, Message, MessageType, Odometry,
    OverlayHeader, OverlayMark, Pose, Proposal, RangeScanHeader, Truth, Verdict,
};
use yamabico_core::sensor::{Robot, SensorInfo};
use yamabico_core::time::Time;

use super::code_text::ChangeLog;
use super::frames::{self, FrameTree, MAP, ODOM};
use super::images::{ImageFormat, compressed};
use super::queue::{Batch, Entry, Queue};
use super::run_file::RunFile;
use super::{WHAT_IF, overlays, ranges, scene, schema};

/// Channel of the coordinate frames.
const TRANSFORMS: &str = "/tf";
/// Channel of changes as text.
const LOG: &str = "/log";
/// Field of every header with a stamp.
const STAMP: &str = "stamp_ns";

/// Turns messages into records and passes them to the channels of a context.
pub(super) struct Writer {
    context: Arc<Context>,
    format: ImageFormat,
    radius_m: f64,
    channels: HashMap<String, Arc<RawChannel>>,
    buffer: Vec<u8>,
    frame_tree: FrameTree,
    odometry_topic: Option<Arc<str>>,
    change_log: ChangeLog,
    counts: BTreeMap<String, u64>,
}

impl Writer {
    pub fn new(context: Arc<Context>, format: ImageFormat, robot: &Robot) -> Writer {
        Writer {
            context,
            format,
            radius_m: robot.radius_m,
            channels: HashMap::new(),
            buffer: Vec::new(),
            frame_tree: FrameTree::default(),
            odometry_topic: None,
            change_log: ChangeLog::default(),
            counts: BTreeMap::new(),
        }
    }

    /// Writes everything from the queue to `file` until it ends or `has_failed` returns true; returns the number of messages
    /// written on each topic. Times count from the first message.
    pub fn run(
        mut self,
        queue: &Queue,
        file: &mut RunFile,
        sensors: &[(String, SensorInfo)],
        has_failed: impl Fn() -> bool,
    ) -> BTreeMap<String, u64> {
        let mut batch = Batch::default();
        let mut origin = None;
        while queue.take(&mut batch) {
            for entry in batch.entries() {
                let origin = *origin.get_or_insert_with(|| {
                    file.begin(entry.time);
                    self.begin(sensors);
                    entry.time
                });
                self.write(&Entry { time: after(origin, entry.time), origin, ..entry });
                if has_failed() {
                    return self.counts;
                }
            }
            file.save_if_due();
        }
        if origin.is_none() {
            file.begin(Time::ZERO);
        }
        self.counts
    }

    /// Writes the constant records: the robot's outline and the mounts of its cameras.
    fn begin(&mut self, sensors: &[(String, SensorInfo)]) {
        self.standard("/robot/scene", Time::ZERO, &scene::footprint(self.radius_m));
        for (topic, sensor) in sensors {
            if let Some(body_from_camera) = sensor.kind.body_from_camera() {
                self.standard(TRANSFORMS, Time::ZERO, &frames::mounted(topic, &body_from_camera));
            }
        }
    }

    /// Writes one message: as JSON under its own topic, and in the standard schemas under `/topic/...`.
    fn write(&mut self, entry: &Entry) {
        let (topic, time) = (&**entry.topic, entry.time);
        self.json(entry);
        if topic.starts_with(WHAT_IF) {
            // Its poses must not move the frames of the recorded run.
            return;
        }
        match entry.message.name {
            FrameHeader::NAME => {
                let Some(header) = header::<FrameHeader>(entry) else { return };
                if let Some(image) = compressed(&header, entry.items, self.format, topic) {
                    self.standard(&under(topic, "image"), time, &image);
                }
            }
            RangeScanHeader::NAME => {
                let Some(header) = header::<RangeScanHeader>(entry) else { return };
                let beams = items::<Beam>(entry);
                if let Some(scan) = ranges::laser_scan(&header, &beams) {
                    self.standard(&under(topic, "scan"), time, &scan);
                }
                self.standard(&under(topic, "scene"), time, &scene::cones(topic, &header, &beams));
            }
            Odometry::NAME => self.odometry(entry),
            Pose::NAME => {
                let Some(pose) = header::<Pose>(entry) else { return };
                let at = Pose2::new(pose.x, pose.y, pose.theta);
                self.frame_tree.localized(&at);
                self.pose(topic, time, pose.stamp_ns, MAP, &at);
            }
            Truth::NAME => {
                let Some(truth) = header::<Truth>(entry) else { return };
                let at = Pose2::new(truth.x, truth.y, truth.theta);
                self.frame_tree.truth(&at);
                self.pose(topic, time, truth.stamp_ns, MAP, &at);
                if let Some(scene) = scene::truth(topic, &truth, self.radius_m) {
                    self.standard(&under(topic, "scene"), time, &scene);
                }
            }
            OverlayHeader::NAME => {
                let Some(header) = header::<OverlayHeader>(entry) else { return };
                let marks = items::<OverlayMark>(entry);
                if let Some(annotations) = overlays::annotations(&header, &marks) {
                    self.standard(&under(topic, "annotations"), time, &annotations);
                }
                if let Some(scene) = overlays::scene(topic, &header, &marks) {
                    self.standard(&under(topic, "scene"), time, &scene);
                }
            }
            Proposal::NAME => {
                let Some(proposal) = header::<Proposal>(entry) else { return };
                self.standard(&under(topic, "scene"), time, &scene::proposal(topic, &proposal));
                let line = self.change_log.proposal(topic, &proposal);
                self.log(time, line);
            }
            Command::NAME => {
                let Some(command) = header::<Command>(entry) else { return };
                self.standard(&under(topic, "scene"), time, &scene::command(topic, &command));
            }
            DecisionHeader::NAME => {
                let Some(decision) = header::<DecisionHeader>(entry) else { return };
                let verdicts = items::<Verdict>(entry);
                let lines = self.change_log.decision(topic, &decision, &verdicts);
                lines.into_iter().for_each(|line| self.log(time, Some(line)));
            }
            Heartbeat::NAME => {
                let Some(heartbeat) = header::<Heartbeat>(entry) else { return };
                let line = self.change_log.heartbeat(topic, &heartbeat);
                self.log(time, line);
            }
            Control::NAME => {
                let Some(control) = header::<Control>(entry) else { return };
                let line = self.change_log.control(&control);
                self.log(time, Some(line));
            }
            _ => {}
        }
    }

    /// Writes odometry; the first odometry topic also moves the robot's frame.
    fn odometry(&mut self, entry: &Entry) {
        let Some(odometry) = header::<Odometry>(entry) else { return };
        let at = Pose2::new(odometry.x, odometry.y, odometry.theta);
        self.pose(entry.topic, entry.time, odometry.stamp_ns, ODOM, &at);
        if *self.odometry_topic.get_or_insert_with(|| entry.topic.clone()) == *entry.topic {
            for transform in self.frame_tree.odometry(odometry.stamp_ns, at) {
                self.standard(TRANSFORMS, entry.time, &transform);
            }
        }
    }

    fn pose(&mut self, topic: &str, time: Time, stamp_ns: u64, frame_id: &str, at: &Pose2) {
        if let Some(pose) = frames::pose_in_frame(stamp_ns, frame_id, at) {
            self.standard(&under(topic, "pose"), time, &pose);
        }
    }

    fn log(&mut self, time: Time, line: Option<foxglove::messages::Log>) {
        if let Some(line) = line {
            self.standard(LOG, time, &line);
        }
    }

    fn json(&mut self, entry: &Entry) {
        let value = schema::to_json(entry.message, entry.header, entry.items);
        self.buffer.clear();
        if serde_json::to_writer(&mut self.buffer, &value).is_err() {
            self.buffer.clear();
            let _ = self.buffer.write_all(b"null");
        }
        let message = entry.message;
        self.send(entry.topic, entry.time, || json_channel(message));
        match self.counts.get_mut(&**entry.topic) {
            Some(count) => *count += 1,
            None => drop(self.counts.insert(entry.topic.to_string(), 1)),
        }
    }

    fn standard<T: Encode>(&mut self, topic: &str, time: Time, message: &T) {
        self.buffer.clear();
        if message.encode(&mut self.buffer).is_ok() {
            self.send(topic, time, || (T::get_message_encoding(), T::get_schema()));
        }
    }

    fn send(&mut self, topic: &str, time: Time, kind: impl FnOnce() -> (String, Option<Schema>)) {
        if !self.channels.contains_key(topic) {
            let (encoding, schema) = kind();
            let channel = self.context.channel_builder(topic).message_encoding(encoding).schema(schema);
            let Ok(channel) = channel.build_raw() else { return };
            self.channels.insert(topic.to_owned(), channel);
        }
        if let Some(channel) = self.channels.get(topic) {
            channel.log_with_meta(&self.buffer, PartialMetadata::with_log_time(time.0));
        }
    }
}

fn json_channel(message: &MessageType) -> (String, Option<Schema>) {
    let schema = schema::of(message).to_string().into_bytes();
    ("json".to_owned(), Some(Schema::new(message.name, "jsonschema", schema)))
}

/// Channel of a standard form of the messages on `topic`.
pub(super) fn under(topic: &str, form: &str) -> String {
    format!("/{}/{form}", topic.trim_start_matches('/'))
}

/// Time `stamp` of a run on the clock of its recording.
fn after(origin: Time, stamp: Time) -> Time {
    Time(stamp.0.saturating_sub(origin.0))
}

fn entry_stamp(bytes: &[u8]) -> Time {
    Time(bytes.try_into().map_or(0, u64::from_ne_bytes))
}

/// Header of a message, with its stamp on the clock of the recording.
fn header<M: Message>(entry: &Entry) -> Option<M> {
    let mut header: M = bytemuck::try_pod_read_unaligned(entry.header).ok()?;
    if let Layout::Struct(layout) = M::LAYOUT
        && let Some(field) = layout.fields.iter().find(|field| field.name == STAMP)
        && let Some(bytes) = bytemuck::bytes_of_mut(&mut header).get_mut(field.offset..field.offset + 8)
    {
        bytes.copy_from_slice(&after(entry.origin, entry_stamp(bytes)).0.to_ne_bytes());
    }
    Some(header)
}

fn items<T: Pod>(entry: &Entry) -> Vec<T> {
    entry.items.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
}
