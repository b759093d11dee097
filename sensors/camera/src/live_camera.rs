//! Sensor that publishes the newest image of a stream.

use std::time::Duration;

use yamabico_core::behavior::Outputs;
use yamabico_core::sensor::{DeviceError, Due, Sensor, check_real_time};
use yamabico_core::time::Time;

use crate::description::CameraDescription;
use crate::grabber::{Grabber, Image};
use crate::jpeg::JpegError;

/// Time between two looks for a new image.
const POLL_PERIOD: Duration = Duration::from_millis(3);

/// Camera that sends by itself. Damaged ones are dropped; their numbers are missing.
pub(crate) struct LiveCamera {
    name: String,
    view: CameraDescription,
    grabber: Grabber,
    damaged: u64,
}

impl LiveCamera {
    /// Returns the sensor `name`.
    pub fn new(name: &str, view: CameraDescription, grabber: Grabber) -> LiveCamera {
        LiveCamera { name: name.to_owned(), view, grabber, damaged: 0 }
    }
}

impl Sensor for LiveCamera {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        check_real_time(&self.name, now)?;
        if self.grabber.has_failed() {
            return Err(DeviceError::failed(
                &self.name,
                "reading the camera failed by a bug; the log has its panic",
            ));
        }
        if let Some(Image { stamp, number, pixels, data }) = self.grabber.newest() {
            let stamp = stamp - Duration::from_secs_f64(1e-3 * self.view.latency_ms);
            let (header, bytes) = (self.view.header(stamp.0, number), self.view.bytes());
            let (size, encoding) = (self.view.size(), self.view.encoding);
            let decoded = outputs.try_publish_in_place(&self.name, &header, bytes, |out: &mut [u8]| {
                pixels.convert(&data, size, encoding, out)
            })?;
            match decoded {
                Ok(()) => {}
                Err(wrong @ JpegError::WrongSize { .. }) => {
                    return Err(DeviceError::failed(&self.name, wrong));
                }
                Err(damaged) => {
                    self.damaged += 1;
                    if self.damaged.is_power_of_two() {
                        tracing::warn!(
                            "sensor `{}`: {damaged}; {} images dropped so far",
                            self.name,
                            self.damaged
                        );
                    }
                }
            }
        }
        Ok(Due::At(now + POLL_PERIOD))
    }
}
