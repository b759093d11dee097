//! The last minute of a running robot, ready to be saved as a recording.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use yamabico_core::message::MessageType;
use yamabico_core::sensor::Robot;
use yamabico_core::time::Time;
use yamabico_runtime::execution::RobotManifest;
use yamabico_runtime::record::{ImageFormat, McapRecorder, Pace, Recording, Tap, is_lasting, utc};

use crate::model::map_files;

/// Time that is kept.
pub const KEPT: Duration = Duration::from_secs(60);
/// Maximum size of the messages, bytes; beyond it the oldest are dropped earlier.
const MAX_BYTES: usize = 64 << 20;
/// Memory of a message besides its bytes.
const OVERHEAD: usize = 128;

/// Messages of the last minute, and older ones that still hold, such as the goal; images are compressed.
#[derive(Clone, Default)]
pub struct Recent {
    robot: RobotManifest,
    entries: VecDeque<Entry>,
    lasting: BTreeMap<Arc<str>, Entry>,
    topics: BTreeMap<String, Arc<str>>,
    bytes: usize,
}

#[derive(Clone)]
struct Entry {
    topic: Arc<str>,
    message: MessageType,
    time: Time,
    header: Arc<[u8]>,
    items: Arc<[u8]>,
}

impl Entry {
    fn size(&self) -> usize {
        self.header.len() + self.items.len() + OVERHEAD
    }
}

impl Recent {
    /// Buffer for the messages of this robot.
    pub fn new(robot: &RobotManifest) -> Recent {
        Recent { robot: robot.clone(), ..Recent::default() }
    }

    /// Takes in a message; the items of a frame are its compressed picture.
    pub fn add(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: Arc<[u8]>) {
        let topic = match self.topics.get(topic) {
            Some(known) => Arc::clone(known),
            None => Arc::clone(self.topics.entry(topic.to_owned()).or_insert(topic.into())),
        };
        let entry = Entry { topic, message: *message, time, header: header.into(), items };
        self.bytes += entry.size();
        self.entries.push_back(entry);
        while let Some(oldest) = self.entries.front()
            && (self.bytes > MAX_BYTES || time.since(oldest.time) > KEPT)
        {
            self.bytes -= oldest.size();
            if let Some(oldest) = self.entries.pop_front()
                && is_lasting(&oldest.message)
            {
                self.lasting.insert(Arc::clone(&oldest.topic), oldest);
            }
        }
    }

    /// Number of messages.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns true if there is none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Writes the messages to a new recording; returns its size, bytes.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<u64, String> {
        let recording = Recording {
            images: ImageFormat::IsJpeg,
            robot: Robot {
                name: self.robot.robot.clone(),
                radius_m: self.robot.radius_m,
                ..Robot::default()
            },
            sensors: self.robot.sensors.clone(),
            files: map_files(&self.robot),
            facts: BTreeMap::from([("robot_name".to_owned(), self.robot.robot.clone())]),
            ..Recording::new(path, Pace::Lockstep)
        };
        let mut recorder = McapRecorder::create(recording).map_err(|error| error.to_string())?;
        let begin = self.entries.front().map_or(Time::ZERO, |first| first.time);
        for Entry { topic, message, time, header, items } in self.lasting.values().chain(&self.entries) {
            recorder.message(topic, message, begin.max(*time), header, items);
        }
        let result = recorder.finish(BTreeMap::new());
        result.error.map_or(Ok(result.bytes), |error| Err(error.to_string()))
    }
}

/// File name for a recording of `robot` that is saved at `now`, such as `kame-2026-11-23T18-04-05Z.mcap`.
pub fn file_name(robot: &str, now: SystemTime) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let robot: String = robot.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    let time = utc(now).replace(':', "-");
    format!("{robot}-{}Z.mcap", time.get(..19).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Player, Recording};
    use std::time::UNIX_EPOCH;
    use yamabico_core::message::{FrameHeader, Goal, Odometry};
    use yamabico_runtime::record::{ImageFormat, compress};

    #[test]
    fn a_file_is_named_after_the_robot_and_the_time() {
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        assert_eq!(file_name("kame", at(951_782_400)), "kame-2000-02-29T00-00-00Z.mcap");
        assert_eq!(file_name("../a b", at(1_795_457_045)), "___a_b-2026-11-23T18-04-05Z.mcap");
    }

    #[test]
    fn the_last_minute_is_kept_in_bounded_memory() {
        let mut recent = Recent::default();
        let message = MessageType::of::<Odometry>();
        for second in 0..200 {
            recent.add("wheels", &message, Time(second * 1_000_000_000), &[0; 8], vec![].into());
        }
        assert_eq!(recent.len(), 61);
        for _ in 0..100 {
            recent.add("front", &message, Time(200_000_000_000), &[], vec![0; 1 << 20].into());
        }
        assert!(recent.bytes <= MAX_BYTES && recent.len() == 63, "{}", recent.len());
    }
    #[test]
    fn what_still_holds_is_saved_with_the_last_minute() {
        let mut recent = Recent::default();
        let (goal, odometry) = (MessageType::of::<Goal>(), MessageType::of::<Odometry>());
        let at = |second: u64| Time(second * 1_000_000_000);
        let far = Goal { x: 7.0, ..Goal::default() };
        recent.add("goal", &goal, at(1), bytemuck::bytes_of(&far), vec![].into());
        let picture = FrameHeader::gray(16, 12, at(250).0);
        let jpeg = compress(&picture, &[90; 16 * 12], ImageFormat::Jpeg(85)).unwrap();
        for second in 200..=300 {
            let header = Odometry { stamp_ns: at(second).0, sequence: second, ..Odometry::default() };
            recent.add("wheels", &odometry, at(second), bytemuck::bytes_of(&header), vec![].into());
            if second == 250 {
                let message = MessageType::of::<FrameHeader>();
                recent.add("front", &message, at(second), bytemuck::bytes_of(&picture), jpeg.clone().into());
            }
        }
        let path = std::env::temp_dir().join(format!("yamabico-recent-{}.mcap", std::process::id()));
        assert!(recent.save(&path).unwrap() > 0);
        let saved = Recording::open(&path).unwrap();
        let _ = std::fs::remove_file(&path);
        assert!((saved.duration_s() - 60.0).abs() < 1e-6 && saved.left_out() == 0);
        let mut player = Player::new(saved).unwrap();
        player.seek(10.5).unwrap();
        let model = player.model();
        assert_eq!(model.snapshot().scene.goal.map(|goal| goal[0]), Some(7.0));
        let shown = model.pictures().get("front", Some(picture.stamp_ns)).unwrap();
        assert_eq!(shown.header.stamp_ns, picture.stamp_ns, "stamps are on the clock of the run");
        assert_eq!(&*shown.data, &*jpeg, "the picture is not compressed again");
        assert!(recent.save(&path.join("missing")).is_err());
    }
}
