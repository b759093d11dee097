//! Thread that reads images from a source, and opens it again after it failed.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use yamabico_core::time::Time;

use crate::pixels::Pixels;

/// Shortest and longest time between two attempts to open a source.
const RETRY: [Duration; 2] = [Duration::from_millis(200), Duration::from_secs(2)];

/// Source of images.
pub(crate) trait Source: Send + 'static {
    /// Name for reports, such as an address.
    fn name(&self) -> String;

    /// Opens the source, for the first time or again.
    ///
    /// # Errors
    /// The source is not there, or does not offer what is asked for.
    fn open(&mut self) -> io::Result<Box<dyn Stream>>;
}

/// Open source.
pub(crate) trait Stream {
    /// Waits for the next image.
    ///
    /// # Errors
    /// The source has ended, failed, or is silent for too long.
    fn next(&mut self) -> io::Result<Image>;
}

/// An image as a camera gave it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Image {
    /// Time at which it was captured or, if the source does not know, at which it arrived.
    pub stamp: Time,
    /// Number of the image; missing ones were lost.
    pub number: u64,
    /// Arrangement of its bytes.
    pub pixels: Pixels,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// Grabber of images. Dropping it closes the source.
pub(crate) struct Grabber {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    newest: Mutex<Option<Image>>,
    is_over: AtomicBool,
}

impl Grabber {
    /// Starts to read `source`, which belongs to the sensor `sensor`.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn start(sensor: &str, source: impl Source) -> io::Result<Grabber> {
        let shared = Arc::new(Shared::default());
        let (of_thread, sensor) = (Arc::clone(&shared), sensor.to_owned());
        let thread = std::thread::Builder::new().name(format!("grab {sensor}"));
        let thread = thread.spawn(move || of_thread.run(&sensor, source))?;
        Ok(Grabber { shared, thread: Some(thread) })
    }

    /// Returns true if the thread has ended although the source is wanted: it panicked.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_some_and(JoinHandle::is_finished)
    }

    /// Returns the newest image, once.
    pub fn newest(&self) -> Option<Image> {
        self.shared.newest.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Drop for Grabber {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        // A source ends at its next image or timeout.
        drop(self.thread.take());
    }
}

impl Shared {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    fn run(&self, sensor: &str, mut source: impl Source) {
        let (mut count, mut pause, mut reported) = (0, RETRY[0], String::new());
        while !self.is_over() {
            let before = count;
            let opened = source.open();
            let ended =
                opened.map_or_else(|error| error, |mut stream| self.read(stream.as_mut(), &mut count));
            if self.is_over() {
                return;
            }
            let text = format!("sensor `{sensor}`: {}: {ended}; trying again", source.name());
            if text != reported || count > before {
                tracing::warn!("{text}");
                reported = text;
            }
            pause = if count > before { RETRY[0] } else { (2 * pause).min(RETRY[1]) };
            sleep(pause);
        }
    }

    /// Reads images until the stream ends. Returns the reason. The numbers go on from stream to stream.
    fn read(&self, stream: &mut dyn Stream, count: &mut u64) -> io::Error {
        let begin = *count;
        while !self.is_over() {
            match stream.next() {
                Ok(mut image) => {
                    *count = begin + 1 + image.number;
                    image.number = *count;
                    *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(image);
                }
                Err(error) => return error,
            }
        }
        io::Error::from(io::ErrorKind::Interrupted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Source whose stream panics when it is closed, as a library may that meets an unexpected error.
    struct Fragile;
    struct FragileStream;

    impl Source for Fragile {
        fn name(&self) -> String {
            "fragile".to_owned()
        }

        fn open(&mut self) -> io::Result<Box<dyn Stream>> {
            Ok(Box::new(FragileStream))
        }
    }

    impl Stream for FragileStream {
        fn next(&mut self) -> io::Result<Image> {
            Err(io::Error::from(io::ErrorKind::NotConnected))
        }
    }

    impl Drop for FragileStream {
        fn drop(&mut self) {
            panic!("on purpose");
        }
    }

    #[test]
    fn a_panic_of_a_source_is_a_failure_and_no_silence() {
        let grabber = Grabber::start("front", Fragile).unwrap();
        let begun = std::time::Instant::now();
        while !grabber.has_failed() {
            assert!(begun.elapsed() < Duration::from_secs(30), "it goes on");
            sleep(Duration::from_millis(5));
        }
        assert_eq!(grabber.newest(), None);
    }
}
