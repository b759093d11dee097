//! Sensor that publishes the messages of a topic.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use yamabico_core::behavior::Outputs;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Beam;
use yamabico_core::sensor::{DeviceError, Due, Sensor, check_real_time};
use yamabico_core::time::Time;
use yamabico_recording::ros2::transforms::Frames;
use yamabico_recording::{Measurement, Publication, mount_beams, ros2};

use crate::ros_clock::{RosClock, StampSource, calendar_now_ns};

/// Time between two looks for new measurements.
const POLL_PERIOD: Duration = Duration::from_millis(2);
/// Maximum number of lines on the log about the stamps of a topic.
const MAX_STAMP_LINES: u32 = 4;

/// Measurements that wait to be published. While the sensor is not polled, the oldest are dropped.
pub(crate) struct Inbox {
    waiting: VecDeque<(Time, Measurement)>,
    capacity: usize,
}

impl Inbox {
    pub fn new(capacity: usize) -> Arc<Mutex<Inbox>> {
        Arc::new(Mutex::new(Inbox { waiting: VecDeque::with_capacity(capacity), capacity }))
    }

    fn push(&mut self, captured: Time, measurement: Measurement) {
        if self.waiting.len() >= self.capacity {
            self.waiting.pop_front();
        }
        self.waiting.push_back((captured, measurement));
    }
}

/// The sensor.
pub(crate) struct TopicSensor {
    pub name: String,
    pub inbox: Arc<Mutex<Inbox>>,
    pub publication: Publication,
}

impl Sensor for TopicSensor {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        check_real_time(&self.name, now)?;
        loop {
            let next = locked(&self.inbox).waiting.pop_front();
            let Some((captured, measurement)) = next else { break };
            self.publication.publish(measurement, captured.0, outputs)?;
        }
        Ok(Due::At(now + POLL_PERIOD))
    }
}

/// Origin of a scanner's pose on the robot.
#[derive(Clone)]
pub(crate) enum ScannerMount {
    /// The message is not of a scanner, or its pose is in the robot file.
    Known,
    /// Frames of the robot, from `/tf_static`.
    Frames(Arc<Mutex<Frames>>),
}

/// Converts the messages of a topic for a sensor, on the thread that receives them.
pub(crate) struct Converter {
    pub name: String,
    pub topic: String,
    pub inbox: Arc<Mutex<Inbox>>,
    pub clock: Arc<Mutex<RosClock>>,
    pub mount: ScannerMount,
    /// Lines that were logged about this topic.
    pub logged: Logged,
}

/// Texts that a converter has put on the log.
#[derive(Default)]
pub(crate) struct Logged {
    refusal: bool,
    /// Origin of the stamps in the last line about them: a simulated time may be heard only after the first measurements.
    stamp: Option<std::mem::Discriminant<StampSource>>,
    stamp_lines: u32,
    frame: bool,
}

impl Converter {
    pub fn take(&mut self, message_type: &str, data: &[u8], arrival: Time) {
        let mut measurement = match ros2::measurement(message_type, data) {
            Ok(measurement) => measurement,
            Err(refusal) => {
                if !std::mem::replace(&mut self.logged.refusal, true) {
                    tracing::warn!("`{}`: a message on `{}` is left out: {refusal}", self.name, self.topic);
                }
                return;
            }
        };
        if let (Measurement::Scan(_, beams), ScannerMount::Frames(frames)) = (&mut measurement, &self.mount) {
            let frame = ros2::frame_id(data).unwrap_or_default();
            let Some(pose) = scanner_pose(&locked(frames), &frame, beams) else {
                if !std::mem::replace(&mut self.logged.frame, true) {
                    tracing::warn!(
                        "`{}`: the pose of the frame `{frame}` on the robot is not on /tf_static, or it is not level: \
                         give x_m, y_m and yaw_deg in the robot file",
                        self.name
                    );
                }
                return;
            };
            mount_beams(beams, &pose);
        }
        let stamp_ns = measurement.stamp_ns();
        let (captured, source) = locked(&self.clock).capture(stamp_ns, calendar_now_ns(), arrival);
        self.tell_stamp(source);
        locked(&self.inbox).push(captured, measurement);
    }

    fn tell_stamp(&mut self, source: StampSource) {
        let topic = &self.topic;
        let text = match source {
            StampSource::Calendar | StampSource::Unstamped => return,
            StampSource::Simulated => format!("the stamps on `{topic}` are of the simulated time on /clock"),
            StampSource::Ahead(ns) => format!(
                "the stamps on `{topic}` are {} ms in the future: synchronize the clocks of both machines (chrony); until \
                 then, the arrival counts",
                ns / 1_000_000
            ),
            StampSource::Unknown => {
                format!("the stamps on `{topic}` are of an unknown clock: the arrival counts")
            }
        };
        let kind = Some(std::mem::discriminant(&source));
        if self.logged.stamp != kind && self.logged.stamp_lines < MAX_STAMP_LINES {
            (self.logged.stamp, self.logged.stamp_lines) = (kind, self.logged.stamp_lines + 1);
            tracing::warn!("{text}");
        }
    }
}

/// Returns the pose on the robot of the scanner with the frame `frame`, and turns the beams of one that hangs upside down;
/// `None` if the frame is unknown or not level.
fn scanner_pose(frames: &Frames, frame: &str, beams: &mut [Beam]) -> Option<Pose2> {
    let body_from_scanner = frames.body_from(frame)?;
    let axis =
        |column: usize| body_from_scanner.rotation.to_rotation_matrix().matrix().column(column).into_owned();
    let (ahead, up) = (axis(0), axis(2));
    if up[2].abs() < 0.9 {
        return None;
    }
    if up[2] < 0.0 {
        beams.iter_mut().for_each(|beam| beam.azimuth_rad = -beam.azimuth_rad);
    }
    let at = body_from_scanner.translation;
    Some(Pose2::new(at.x, at.y, ahead[1].atan2(ahead[0])))
}

pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
