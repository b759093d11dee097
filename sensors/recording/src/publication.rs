//! Publication of measurements on the output of a sensor.

use yamabico_core::behavior::Outputs;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Beam, NO_ECHO};
use yamabico_core::sensor::DeviceError;

use crate::measurement::Measurement;
use crate::wheels::Wheels;

/// Adaption of measurements to the sensor of the robot file.
pub enum Filter {
    /// As they are.
    Plain,
    /// Images of this size only.
    Size {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// Beams of a scanner, with echoes between these ranges.
    Mount {
        /// Pose of the scanner on the robot.
        mount: Pose2,
        /// Minimum range, m; a shorter one is no echo.
        min_m: f64,
        /// Maximum range, m; a longer one is no echo.
        max_m: f64,
    },
    /// Joints of the wheels.
    Wheels(Wheels),
}

/// Output of one sensor, with its sequence numbers.
pub struct Publication {
    name: String,
    filter: Filter,
    sequence: u64,
    wrong_size: Option<[u32; 2]>,
}

impl Publication {
    /// Returns the output `name`.
    pub fn new(name: &str, filter: Filter) -> Publication {
        Publication { name: name.to_owned(), filter, sequence: 0, wrong_size: None }
    }

    /// Publishes a measurement, stamped with `stamp_ns` on the clock of the run. Images of another size, and joints of a sensor
    /// without wheels, are left out.
    ///
    /// # Errors
    /// The bus failed.
    pub fn publish(
        &mut self,
        measurement: Measurement,
        stamp_ns: u64,
        outputs: &mut Outputs<'_>,
    ) -> Result<(), DeviceError> {
        let name = self.name.as_str();
        match measurement {
            Measurement::Frame(mut header, pixels) => {
                let size = [header.width, header.height];
                if matches!(self.filter, Filter::Size { width, height } if [width, height] != size) {
                    if self.wrong_size.replace(size) != Some(size) {
                        let [width, height] = size;
                        tracing::warn!("`{name}`: images of {width}x{height} pixels are left out");
                    }
                    return Ok(());
                }
                self.sequence += 1;
                (header.stamp_ns, header.sequence) = (stamp_ns, self.sequence);
                outputs.publish(name, &header, &pixels)?;
            }
            Measurement::Scan(mut header, mut beams) => {
                if let Filter::Mount { mount, min_m, max_m } = self.filter {
                    mount_beams(&mut beams, &mount);
                    for beam in &mut beams {
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
}

/// Moves beams from the frame of their scanner to that of the robot, where the scanner has the pose `mount`.
pub fn mount_beams(beams: &mut [Beam], mount: &Pose2) {
    let (sin, cos) = mount.theta.sin_cos();
    for beam in beams {
        let (x, y) = (beam.x_m, beam.y_m);
        (beam.x_m, beam.y_m) = (mount.x + cos * x - sin * y, mount.y + sin * x + cos * y);
        let azimuth_rad = beam.azimuth_rad + mount.theta;
        beam.azimuth_rad = azimuth_rad.sin().atan2(azimuth_rad.cos());
    }
}
