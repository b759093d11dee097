//! A sensor that shows pictures from files.

use std::path::{Path, PathBuf};
use std::time::Duration;

use yamabico_core::behavior::Outputs;
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use crate::config::ImageSequenceConfig;
use crate::files::{self, SequenceError};
use crate::luma::Picture;

/// Publishes one picture a period, beginning with the first poll. Where a poll comes late, pictures that a newer one has
/// replaced are passed over; their numbers are missing from the sequence.
pub struct ImageSequence {
    name: String,
    config: ImageSequenceConfig,
    files: Vec<PathBuf>,
    begin: Option<Time>,
    next: u64,
}

impl ImageSequence {
    /// Finds the files and looks whether each is there, whole and of the right size; relative paths start at `folder`.
    ///
    /// # Errors
    /// See [`SequenceError`]; what is wrong inside the data of a picture shows when it is its turn.
    pub fn open(
        name: &str,
        config: ImageSequenceConfig,
        folder: &Path,
    ) -> Result<ImageSequence, SequenceError> {
        let files = files::find(&config, folder)?;
        Ok(ImageSequence { name: name.to_owned(), config, files, begin: None, next: 0 })
    }

    /// The files in the order in which they are shown.
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

    fn show(&self, number: u64, stamp: Time, outputs: &mut Outputs<'_>) -> Result<(), DeviceError> {
        let Some(file) = self.file(number) else { return Ok(()) };
        let (width, height) = (self.config.intrinsics.width, self.config.intrinsics.height);
        let failed = |error: SequenceError| DeviceError::failed(&self.name, error);
        let picture = Picture::read(file).map_err(failed)?;
        files::check_size(file, picture.size(), width, height).map_err(failed)?;
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
        outputs.publish_in_place(&self.name, &header, pixels, |out| picture.write_luma(out))?;
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
        // The last picture stays for its whole period before the sequence ends.
        if self.file(self.next).is_none() {
            return Ok(Due::Ended);
        }
        self.show(self.next, self.stamp(begin, self.next), outputs)?;
        self.next += 1;
        Ok(Due::At(self.arrival(begin, self.next)))
    }
}
