//! Sensor that publishes the measurements of one topic of a recording in time.

use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::driver::PartSpec;
use yamabico_core::message::{Beam, NO_ECHO};
use yamabico_core::parameters::read;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use crate::config::{CameraConfig, DeviceConfig, RangeConfig, WheelsConfig};
use crate::measurement::Measurement;
use crate::topic_reader::{Recorded, TopicReader};
use crate::wheels::Wheels;

/// Publishes recorded measurements with the delays that they had, on the clock of the run. All sensors of a device start at
/// the same time of the recording, at their first poll.
pub struct Playback {
    name: String,
    reader: TopicReader,
    from_ns: u64,
    pace: f64,
    filter: Filter,
    /// Time of the first poll.
    begin: Option<Time>,
    next: Option<Recorded>,
    sequence: u64,
    has_ended: bool,
}

/// Adaption of measurements to the sensor of the robot file.
enum Filter {
    /// As they are.
    Plain,
    /// Images of this size only.
    Size(u32, u32),
    /// Beams from this position and direction, in m and rad, with echoes between these ranges, m.
    Mount { x_m: f64, y_m: f64, yaw_rad: f64, min_m: f64, max_m: f64 },
    /// Joints of the wheels.
    Wheels(Wheels),
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
                Filter::Size(camera.intrinsics.width, camera.intrinsics.height)
            }
            "range" => {
                let RangeConfig { x_m, y_m, yaw_deg, min_m, max_m, .. } = read(&part.table)?;
                Filter::Mount { x_m, y_m, yaw_rad: yaw_deg.to_radians(), min_m, max_m }
            }
            "wheel-joints" => Filter::Wheels(Wheels::new(read::<WheelsConfig>(&part.table)?)),
            _ => Filter::Plain,
        };
        Ok(Playback {
            name: name.to_owned(),
            reader,
            from_ns: (device.from_s * 1e9) as u64,
            pace: device.pace,
            filter,
            begin: None,
            next: None,
            sequence: 0,
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
        let name = &self.name;
        match measurement {
            Measurement::Frame(mut header, pixels) => {
                if matches!(self.filter, Filter::Size(width, height) if (width, height) != (header.width, header.height))
                {
                    tracing::warn!(
                        "`{name}`: an image of {}x{} pixels is left out",
                        header.width,
                        header.height
                    );
                    return Ok(());
                }
                self.sequence += 1;
                (header.stamp_ns, header.sequence) = (stamp_ns, self.sequence);
                outputs.publish(name, &header, &pixels)?;
            }
            Measurement::Scan(mut header, mut beams) => {
                if let Filter::Mount { x_m, y_m, yaw_rad, min_m, max_m } = self.filter {
                    for beam in &mut beams {
                        mount(beam, x_m, y_m, yaw_rad);
                        if beam.echo_m().is_some_and(|range_m| range_m < min_m || range_m > max_m) {
                            (beam.range_m, beam.flags) = (max_m, NO_ECHO);
                        }
                    }
                    (header.min_m, header.max_m) = (min_m, max_m);
                }
                self.sequence += 1;
                (header.stamp_ns, header.sequence) = (stamp_ns, self.sequence);
                outputs.publish(name, &header, &beams)?;
            }
            Measurement::Odometry(mut header) => {
                self.sequence += 1;
                (header.stamp_ns, header.sequence) = (stamp_ns, self.sequence);
                outputs.publish(name, &header, &[])?;
            }
            Measurement::Imu(mut header) => {
                self.sequence += 1;
                (header.stamp_ns, header.sequence) = (stamp_ns, self.sequence);
                outputs.publish(name, &header, &[])?;
            }
            Measurement::Bumper(mut header) => {
                self.sequence += 1;
                (header.stamp_ns, header.sequence) = (stamp_ns, self.sequence);
                outputs.publish(name, &header, &[])?;
            }
            Measurement::Joints { angles, .. } => {
                let Filter::Wheels(wheels) = &mut self.filter else { return Ok(()) };
                if let Some(mut odometry) = wheels.odometry(stamp_ns, &angles) {
                    self.sequence += 1;
                    odometry.sequence = self.sequence;
                    outputs.publish(name, &odometry, &[])?;
                }
            }
        }
        Ok(())
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

/// Moves a beam from the frame of its sensor to that of the robot.
fn mount(beam: &mut Beam, x_m: f64, y_m: f64, yaw_rad: f64) {
    let (sin, cos) = yaw_rad.sin_cos();
    let (x, y) = (beam.x_m, beam.y_m);
    (beam.x_m, beam.y_m) = (x_m + cos * x - sin * y, y_m + sin * x + cos * y);
    let azimuth_rad = beam.azimuth_rad + yaw_rad;
    beam.azimuth_rad = azimuth_rad.sin().atan2(azimuth_rad.cos());
}
