//! Sensor that publishes images from files.

use std::path::{Path, PathBuf};
use std::time::Duration;

use yamabico_core::behavior::Outputs;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use crate::config::ImageSequenceConfig;
use crate::file_image::FileImage;
use crate::files::{self, SequenceError};
use crate::stamps;

/// Sensor that publishes one image file per period, or at the times of the files, from the first poll on. A late poll skips images that a newer one has
/// already replaced; their sequence numbers are missing.
pub struct ImageSequence {
    name: String,
    config: ImageSequenceConfig,
    files: Vec<PathBuf>,
    /// Time of each file after the first, ns; none at a constant rate.
    times: Option<Vec<u64>>,
    /// Time of the first poll.
    begin: Option<Time>,
    next: u64,
}

impl ImageSequence {
    /// Finds the files, and checks that each is readable, complete and of the right size. Relative paths start at `folder`.
    ///
    /// # Errors
    /// [`SequenceError`]. Errors inside the image data are reported only when the image is published.
    pub fn open(
        name: &str,
        config: ImageSequenceConfig,
        folder: &Path,
    ) -> Result<ImageSequence, SequenceError> {
        let files = files::find(&config, folder)?;
        let times = stamps::read(&config.stamps, &files, folder)?;
        Ok(ImageSequence { name: name.to_owned(), config, files, times, begin: None, next: 0 })
    }

    /// Returns the files in the order in which they are published.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn file(&self, number: u64) -> Option<&Path> {
        let count = self.files.len() as u64;
        let index = if self.config.repeat { number % count } else { number };
        self.files.get(usize::try_from(index).ok()?).map(PathBuf::as_path)
    }

    fn stamp(&self, begin: Time, number: u64) -> Time {
        let Some(times) = &self.times else {
            return begin + Duration::from_secs_f64(number as f64 / self.config.rate_hz);
        };
        // The end is one nominal period after the last image.
        let period_ns = (1e9 / self.config.rate_hz) as u64;
        let count = times.len() as u64;
        let length_ns = times.last().map_or(0, |last| last + period_ns);
        let time_ns =
            usize::try_from(number % count).ok().and_then(|index| times.get(index)).copied().unwrap_or(0);
        begin + Duration::from_nanos(length_ns.saturating_mul(number / count).saturating_add(time_ns))
    }

    fn arrival(&self, begin: Time, number: u64) -> Time {
        self.stamp(begin, number) + Duration::from_secs_f64(1e-3 * self.config.latency_ms)
    }

    fn publish(&self, number: u64, stamp: Time, outputs: &mut Outputs<'_>) -> Result<(), DeviceError> {
        let Some(file) = self.file(number) else { return Ok(()) };
        let view = self.config.description();
        let failed = |error: SequenceError| DeviceError::failed(&self.name, error);
        let image = FileImage::read(file).map_err(failed)?;
        let [width, height] = view.size();
        files::check_size(file, image.size(), width, height).map_err(failed)?;
        let header = view.header(stamp.0, number);
        outputs.publish_in_place(&self.name, &header, view.bytes(), |out| image.write_luma(out))?;
        Ok(())
    }
}

impl Sensor for ImageSequence {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let begin = *self.begin.get_or_insert(now);
        if self.arrival(begin, self.next) > now {
            return Ok(Due::At(self.arrival(begin, self.next)));
        }
        while self.file(self.next + 1).is_some() && self.arrival(begin, self.next + 1) <= now {
            self.next += 1;
        }
        // The sequence ends one period after the last image.
        if self.file(self.next).is_none() {
            return Ok(Due::Ended);
        }
        self.publish(self.next, self.stamp(begin, self.next), outputs)?;
        self.next += 1;
        Ok(Due::At(self.arrival(begin, self.next)))
    }
}
