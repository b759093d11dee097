//! Frames of a camera and odometry from a recording of a drive.

use std::collections::BTreeSet;
use std::path::Path;

use yamabico_core::geometry::Pose2;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::{FrameHeader, Message, MessageType, Odometry, RawMessage, View};
use yamabico_core::time::Time;
use yamabico_runtime::execution::topics;
use yamabico_runtime::record::{Tap, play_topics};

use super::pictures::Picture;
use super::robot_camera::RobotCamera;
use crate::LearningError;

/// Time between the frames of a recording that are used, s; it doubles where a recording has too many.
const FRAME_EVERY_S: f64 = 0.15;
/// Maximum number of frames.
const MAX_FRAMES: usize = 240;

/// Odometry of a drive, and what was wrong with its recording.
#[derive(Debug, Default)]
pub(super) struct RecordedDrive {
    /// Stamps, s from the first measurement, and poses; increasing.
    pub odometry: Vec<(f64, Pose2)>,
    /// Number of frames.
    pub frames: usize,
    /// Parts of the recording that were not used, for people.
    pub warnings: Vec<String>,
}

/// Frame of a recording.
pub(super) struct Frame {
    /// Stamp, s from the first measurement.
    pub seconds: f64,
    /// Picture, named by the recording and its stamp.
    pub picture: Picture,
}

impl RecordedDrive {
    /// Reads a recording, and shows each frame of the camera `sensor` with its stamp, s from the first measurement.
    ///
    /// # Errors
    /// The recording cannot be read, has no frames of this camera, or frames of another size.
    pub fn read(
        recording: &Path,
        sensor: &str,
        size: [u32; 2],
        on_frame: &mut dyn FnMut(f64, ImageView<'_>),
    ) -> Result<Self, LearningError> {
        let camera = topics::sensor(sensor);
        let mut tap = DriveTap {
            camera: camera.clone(),
            size,
            origin_ns: None,
            odometry_topic: None,
            luma: GrayImage::default(),
            seen: BTreeSet::new(),
            other_size: None,
            drive: RecordedDrive::default(),
            on_frame,
        };
        let prefix = topics::sensor("");
        let played = play_topics(recording, &mut tap, &|topic| topic.starts_with(&prefix))?;
        let unsuitable =
            |problem: String| LearningError::Unsuitable(format!("{}: {problem}", recording.display()));
        if let Some([width, height]) = tap.other_size {
            return Err(unsuitable(format!(
                "frames of `{sensor}` have {width} x {height} pixels, but the robot file says {} x {}",
                size[0], size[1]
            )));
        }
        if tap.drive.frames == 0 {
            let seen: Vec<String> = tap.seen.into_iter().collect();
            let seen = if seen.is_empty() { "none".to_owned() } else { seen.join(", ") };
            return Err(unsuitable(format!(
                "no frames of the camera `{sensor}` (topic {camera}); sensors in it: {seen}. A recording of ROS 2 is read through a robot \
                 file with the driver `recording`: run it and record that"
            )));
        }
        let mut drive = tap.drive;
        drive.warnings = played.notes();
        Ok(drive)
    }

    /// Pose at a time, interpolated; `None` outside of the odometry.
    pub fn pose_at(&self, seconds: f64) -> Option<Pose2> {
        let after = self.odometry.partition_point(|(stamp, _)| *stamp < seconds);
        let (later_s, later) = self.odometry.get(after)?;
        if *later_s == seconds {
            return Some(*later);
        }
        let (earlier_s, earlier) = self.odometry.get(after.checked_sub(1)?)?;
        let share = (seconds - earlier_s) / (later_s - earlier_s);
        let motion = earlier.relative(later);
        Some(earlier.compose(&Pose2::new(share * motion.x, share * motion.y, share * motion.theta)))
    }
}

/// Reads a recording with the frames of `camera`, at most [`MAX_FRAMES`] at equal distances in time.
///
/// # Errors
/// As [`RecordedDrive::read`].
pub(super) fn thinned_frames(
    recording: &Path,
    camera: &RobotCamera,
) -> Result<(Vec<Frame>, RecordedDrive), LearningError> {
    let size = camera.intrinsics.intrinsics().size();
    let (mut frames, mut every_s): (Vec<Frame>, f64) = (Vec::new(), FRAME_EVERY_S);
    let drive = RecordedDrive::read(recording, &camera.sensor, size, &mut |seconds, image| {
        if frames.last().is_some_and(|last| seconds - last.seconds < every_s) {
            return;
        }
        let mut gray = GrayImage::default();
        gray.copy_from(image);
        let name = format!("{}, {seconds:.2} s", recording.display());
        frames.push(Frame { seconds, picture: Picture { name, gray } });
        if frames.len() > MAX_FRAMES {
            let mut index = 0;
            frames.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            every_s *= 2.0;
        }
    })?;
    Ok((frames, drive))
}

struct DriveTap<'a> {
    camera: String,
    size: [u32; 2],
    origin_ns: Option<u64>,
    odometry_topic: Option<String>,
    luma: GrayImage,
    seen: BTreeSet<String>,
    other_size: Option<[u32; 2]>,
    drive: RecordedDrive,
    on_frame: &'a mut dyn FnMut(f64, ImageView<'_>),
}

impl DriveTap<'_> {
    /// Time of a stamp, s from the first one.
    fn seconds(&mut self, stamp_ns: u64) -> f64 {
        let origin_ns = *self.origin_ns.get_or_insert(stamp_ns);
        if stamp_ns >= origin_ns {
            (stamp_ns - origin_ns) as f64 * 1e-9
        } else {
            (origin_ns - stamp_ns) as f64 * -1e-9
        }
    }
}

impl Tap for DriveTap<'_> {
    fn message(&mut self, topic: &str, kind: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if !self.seen.contains(topic) {
            self.seen.insert(topic.to_owned());
        }
        if topic == self.camera
            && let Some(frame) = View::<FrameHeader>::of(raw)
        {
            let seconds = self.seconds(frame.header.stamp_ns);
            if [frame.header.width, frame.header.height] != self.size {
                self.other_size = Some([frame.header.width, frame.header.height]);
            } else if let Some(image) = frame.gray(self.size, &mut self.luma) {
                self.drive.frames += 1;
                (self.on_frame)(seconds, image);
            }
        }
        if kind.name == Odometry::NAME
            && self.odometry_topic.get_or_insert_with(|| topic.to_owned()) == topic
            && let Some(odometry) = View::<Odometry>::of(raw)
        {
            let Odometry { x, y, theta, stamp_ns, .. } = *odometry.header;
            let (seconds, pose) = (self.seconds(stamp_ns), Pose2::new(x, y, theta));
            let is_newer = self.drive.odometry.last().is_none_or(|(last, _)| seconds > *last);
            if is_newer && pose.is_finite() {
                self.drive.odometry.push((seconds, pose));
            }
        }
    }
}
