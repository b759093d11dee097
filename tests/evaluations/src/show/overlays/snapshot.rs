//! The moment of a run at which the picture is taken.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};

use yamabico_core::geometry::{Hypotenuse, Pose2};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{
    FrameHeader, Message, MessageType, Obstacle, ObstaclesHeader, OverlayHeader, OverlayMark, Proposal,
    RawMessage, Truth, View,
};
use yamabico_core::time::Time;
use yamabico_runtime::record::Tap;
use yamabico_sim::building::Building;

/// Behavior whose proposal the text shows.
const AVOIDER: &str = "stationary-obstacle-avoider";
/// Number of frames that are kept until their overlays arrive.
const KEPT: usize = 8;
/// Time from the moment to the picture, by which the overlays of its frame have arrived, s.
const WAIT_S: f64 = 0.4;

/// Moment of a run.
#[derive(Clone, Copy, Debug)]
pub enum Moment {
    /// The robot has driven this far, m.
    Driven(f64),
    /// The robot's center is this far before the middle of the first box, m.
    BeforeBox(f64),
    /// A person is this far from the robot's rim, m.
    BeforePerson(f64),
}

/// A frame with the overlays over it.
pub struct Snapshot {
    /// Time since the start, s.
    pub time_s: f64,
    /// False if the run ended before the moment had come; this is its last frame then.
    pub is_in_time: bool,
    /// Pose of the robot at the frame, world frame.
    pub robot: Pose2,
    /// The frame.
    pub frame: GrayImage,
    /// Marks by behavior.
    pub overlays: BTreeMap<String, Vec<OverlayMark>>,
    /// Obstacles that the avoider published for the frame, robot frame.
    pub obstacles: Vec<Obstacle>,
    /// Kind, reason and note of the avoider's proposal.
    pub note: String,
}

impl Snapshot {
    /// Returns the places of the obstacles from near to far, as text.
    pub fn occupied(&self) -> String {
        let mut places: Vec<[f64; 2]> = self.obstacles.iter().map(|o| [o.x, o.y]).collect();
        places.sort_by(|a, b| a[0].hypotenuse(a[1]).total_cmp(&b[0].hypotenuse(b[1])));
        let texts: Vec<String> = places.iter().take(6).map(|[x, y]| format!("({x:.1}, {y:.1})")).collect();
        match (places.len(), texts.join(" ")) {
            (0, _) => "nothing".to_owned(),
            (count, texts) if count > 6 => format!("{texts} and {} more", count - 6),
            (_, texts) => texts,
        }
    }
}

/// Keeps the newest frames and overlays of a run, until the moment has come.
pub struct SnapshotTap<'a> {
    moment: Moment,
    first_box_m: f64,
    done: &'a AtomicBool,
    start_ns: Option<u64>,
    /// Time at which the moment came.
    came: Option<Time>,
    /// Stamp, image, and pose of the robot.
    frames: VecDeque<(u64, GrayImage, Pose2)>,
    overlays: VecDeque<(u64, String, Vec<OverlayMark>)>,
    obstacles: VecDeque<(u64, Vec<Obstacle>)>,
    note: String,
    robot: VecDeque<(u64, Pose2)>,
    snapshot: Option<Snapshot>,
}

impl<'a> SnapshotTap<'a> {
    /// Returns a tap that sets `done` once it has the picture.
    pub fn new(building: &Building, moment: Moment, done: &'a AtomicBool) -> Self {
        let boxes = building.world.boxes.iter().map(|item| item.at_m[0]);
        Self {
            moment,
            first_box_m: boxes.fold(f64::INFINITY, f64::min),
            done,
            start_ns: None,
            came: None,
            frames: VecDeque::new(),
            overlays: VecDeque::new(),
            obstacles: VecDeque::new(),
            note: String::new(),
            robot: VecDeque::new(),
            snapshot: None,
        }
    }

    /// Returns the picture of the moment, or of the end of the run if that came first; `None` if no frame was drawn over.
    pub fn into_snapshot(mut self) -> Option<Snapshot> {
        self.snapshot.take().or_else(|| self.take(self.start_ns?))
    }

    fn truth(&mut self, truth: &Truth) {
        let start_ns = *self.start_ns.get_or_insert(truth.stamp_ns);
        push(&mut self.robot, (truth.stamp_ns, Pose2::new(truth.x, truth.y, truth.theta)), 64);
        let has_come = match self.moment {
            Moment::Driven(way_m) => truth.distance_m >= way_m,
            Moment::BeforeBox(ahead_m) => truth.x >= self.first_box_m - ahead_m,
            Moment::BeforePerson(range_m) => truth.person_m <= range_m,
        };
        let now = Time(truth.stamp_ns);
        if has_come && self.came.is_none() {
            self.came = Some(now);
        }
        if let Some(came) = self.came
            && self.snapshot.is_none()
            && now.seconds_after(came) >= WAIT_S
        {
            self.snapshot = self.take(start_ns);
            self.done.store(self.snapshot.is_some(), Ordering::Relaxed);
        }
    }

    /// Returns the newest frame that the avoider drew over.
    fn take(&self, start_ns: u64) -> Option<Snapshot> {
        let drawn = |stamp_ns: u64| {
            self.overlays.iter().any(|(stamp, behavior, _)| *stamp == stamp_ns && behavior == AVOIDER)
        };
        let (stamp_ns, frame, robot) = self.frames.iter().rev().find(|(stamp_ns, ..)| drawn(*stamp_ns))?;
        let overlays = self.overlays.iter().filter(|(stamp, ..)| stamp == stamp_ns);
        Some(Snapshot {
            time_s: (stamp_ns - start_ns) as f64 * 1e-9,
            is_in_time: self.came.is_some(),
            robot: *robot,
            frame: frame.clone(),
            overlays: overlays.map(|(_, behavior, marks)| (behavior.clone(), marks.clone())).collect(),
            obstacles: self
                .obstacles
                .iter()
                .min_by_key(|(stamp, _)| stamp.abs_diff(*stamp_ns))
                .map_or_else(Vec::new, |(_, obstacles)| obstacles.clone()),
            note: self.note.clone(),
        })
    }

    /// Pose of the robot at a time.
    fn pose_at(&self, stamp_ns: u64) -> Pose2 {
        let nearest = self.robot.iter().min_by_key(|(stamp, _)| stamp.abs_diff(stamp_ns));
        nearest.map_or_else(Pose2::default, |(_, pose)| *pose)
    }
}

impl Tap for SnapshotTap<'_> {
    fn message(&mut self, topic: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        match message.name {
            Truth::NAME => {
                if let Some(truth) = View::<Truth>::of(raw) {
                    self.truth(truth.header);
                }
            }
            FrameHeader::NAME => {
                let Some(frame) = View::<FrameHeader>::of(raw) else { return };
                let mut buffer = GrayImage::default();
                let Some(view) = frame.gray([frame.header.width, frame.header.height], &mut buffer) else {
                    return;
                };
                let mut gray = GrayImage::new(view.width(), view.height());
                for (v, row) in gray.pixels_mut().chunks_exact_mut(view.width()).enumerate() {
                    row.copy_from_slice(view.row(v));
                }
                let stamp_ns = frame.header.stamp_ns;
                let entry = (stamp_ns, gray, self.pose_at(stamp_ns));
                push(&mut self.frames, entry, KEPT);
            }
            OverlayHeader::NAME => {
                let Some(overlay) = View::<OverlayHeader>::of(raw) else { return };
                let behavior = topic.strip_prefix("behaviors/").unwrap_or(topic);
                let behavior = behavior.strip_suffix("/overlay").unwrap_or(behavior);
                let entry = (overlay.header.stamp_ns, behavior.to_owned(), overlay.items.to_vec());
                push(&mut self.overlays, entry, 8 * KEPT);
            }
            ObstaclesHeader::NAME => {
                let Some(obstacles) = View::<ObstaclesHeader>::of(raw) else { return };
                push(&mut self.obstacles, (obstacles.header.evidence_ns, obstacles.items.to_vec()), KEPT);
            }
            Proposal::NAME => {
                let Some(proposal) = View::<Proposal>::of(raw) else { return };
                if proposal.header.behavior.as_str() == AVOIDER {
                    let kind = proposal.header.kind().map_or("?", |kind| kind.as_str());
                    let reason = proposal.header.reason().map_or("", |reason| reason.as_str());
                    let parts = [kind, reason, proposal.header.note.as_str()];
                    let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
                    self.note = parts.join(", ");
                }
            }
            _ => {}
        }
    }
}

fn push<T>(list: &mut VecDeque<T>, item: T, limit: usize) {
    if list.len() == limit {
        list.pop_front();
    }
    list.push_back(item);
}
