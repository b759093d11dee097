//! Sensor that publishes the measurements of one topic of a recording in time.

use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::driver::PartSpec;
use yamabico_core::geometry::Pose2;
use yamabico_core::parameters::read;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use crate::config::{CameraConfig, DeviceConfig, RangeConfig, WheelsConfig};
use crate::publication::{Filter, Publication};
use crate::topic_reader::{Recorded, TopicReader};
use crate::wheels::Wheels;

/// Publishes recorded measurements with the delays that they had, on the clock of the run. All sensors of a device start at
/// the same time of the recording, at their first poll.
pub struct Playback {
    name: String,
    reader: TopicReader,
    from_ns: u64,
    pace: f64,
    publication: Publication,
    /// Time of the first poll.
    begin: Option<Time>,
    next: Option<Recorded>,
    has_ended: bool,
}

impl Playback {
    /// Sensor `name` with the measurements of `reader`.
    ///
    /// # Errors
    /// Parameters that do not fit the kind of sensor.
    pub fn new(
        name: &str,
        reader: TopicReader,
        device: &DeviceConfig,
        part: &PartSpec,
    ) -> Result<Playback, ParameterError> {
        let is_of_joints = reader.message_type() == "sensor_msgs/msg/JointState";
        if is_of_joints != (part.kind == "wheel-joints") {
            let right = if is_of_joints { "wheel-joints" } else { "odometry" };
            let problem =
                format!("does not fit `{}` on this topic: use kind = \"{right}\"", reader.message_type());
            return Err(ParameterError::new("kind", problem));
        }
        let filter = match part.kind.as_str() {
            "camera" => {
                let camera: CameraConfig = read(&part.table)?;
                Filter::Size { width: camera.intrinsics.width, height: camera.intrinsics.height }
            }
            "range" => {
                let RangeConfig { x_m, y_m, yaw_deg, min_m, max_m, .. } = read(&part.table)?;
                Filter::Mount { mount: Pose2::new(x_m, y_m, yaw_deg.to_radians()), min_m, max_m }
            }
            "wheel-joints" => Filter::Wheels(Wheels::new(read::<WheelsConfig>(&part.table)?)),
            _ => Filter::Plain,
        };
        Ok(Playback {
            name: name.to_owned(),
            reader,
            from_ns: (device.from_s * 1e9) as u64,
            pace: device.pace,
            publication: Publication::new(name, filter),
            begin: None,
            next: None,
            has_ended: false,
        })
    }

    /// Time of the run for a time of the recording.
    fn on_run_clock(&self, begin: Time, recorded_ns: u64) -> Time {
        let offset_ns = (recorded_ns as f64 - self.from_ns as f64) / self.pace;
        Time(begin.0.saturating_add_signed(offset_ns as i64))
    }

    /// Next measurement that the start leaves.
    fn peek(&mut self) -> Option<&Recorded> {
        while self.next.as_ref().is_none_or(|next| next.arrived_ns < self.from_ns) {
            self.next = Some(self.reader.next()?);
        }
        self.next.as_ref()
    }

    fn publish(&mut self, begin: Time, outputs: &mut Outputs<'_>) -> Result<(), DeviceError> {
        let Some(Recorded { stamp_ns, measurement, .. }) = self.next.take() else { return Ok(()) };
        let stamp_ns = self.on_run_clock(begin, stamp_ns).0;
        self.publication.publish(measurement, stamp_ns, outputs)
    }

    /// Reports once what was left out.
    fn end(&mut self) {
        if std::mem::replace(&mut self.has_ended, true) {
            return;
        }
        if let (count, Some(first)) = self.reader.left_out() {
            tracing::warn!("`{}`: {count} messages were left out, the first: {first}", self.name);
        }
        if let Some(cause) = self.reader.broken_off() {
            tracing::warn!("`{}`: the recording breaks off: {cause}", self.name);
        }
    }
}

impl Sensor for Playback {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let begin = *self.begin.get_or_insert(now);
        loop {
            let Some(arrived_ns) = self.peek().map(|next| next.arrived_ns) else {
                self.end();
                return Ok(Due::Ended);
            };
            let due = self.on_run_clock(begin, arrived_ns);
            if due > now {
                return Ok(Due::At(due));
            }
            self.publish(begin, outputs)?;
        }
    }
}
