//! Sensor that publishes images from files.

use std::path::{Path, PathBuf};
use std::time::Duration;

use yamabico_core::behavior::Outputs;
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use crate::config::ImageSequenceConfig;
use crate::file_image::FileImage;
use crate::files::{self, SequenceError};

/// Sensor that publishes one image file per period, from the first poll on. A late poll skips images that a newer one has
/// already replaced; their sequence numbers are missing.
pub struct ImageSequence {
    name: String,
    config: ImageSequenceConfig,
    files: Vec<PathBuf>,
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
        Ok(ImageSequence { name: name.to_owned(), config, files, begin: None, next: 0 })
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
        begin + Duration::from_secs_f64(number as f64 / self.config.rate_hz)
    }

    fn arrival(&self, begin: Time, number: u64) -> Time {
        self.stamp(begin, number) + Duration::from_secs_f64(1e-3 * self.config.latency_ms)
    }

    fn publish(&self, number: u64, stamp: Time, outputs: &mut Outputs<'_>) -> Result<(), DeviceError> {
        let Some(file) = self.file(number) else { return Ok(()) };
        let (width, height) = (self.config.intrinsics.width, self.config.intrinsics.height);
        let failed = |error: SequenceError| DeviceError::failed(&self.name, error);
        let image = FileImage::read(file).map_err(failed)?;
        files::check_size(file, image.size(), width, height).map_err(failed)?;
        let header = FrameHeader {
            stamp_ns: stamp.0,
            sequence: number,
            width,
            height,
            stride: width,
            encoding: Encoding::Gray8.code(),
            exposure: 1.0,
        };
        let pixels = self.config.bytes();
        outputs.publish_in_place(&self.name, &header, pixels, |out| image.write_luma(out))?;
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
