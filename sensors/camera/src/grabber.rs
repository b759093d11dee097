//! Thread that reads images from a source, and opens it again after it failed.

use std::io::{self, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use yamabico_core::time::Time;

use crate::jpeg_cutter::{Cut, JpegCutter};

/// Number of bytes read at once.
const READ_SIZE: usize = 64 * 1024;
/// Maximum size of an image, bytes.
const MAX_IMAGE: usize = 8 << 20;
/// Shortest and longest time between two attempts to open a source.
const RETRY: [Duration; 2] = [Duration::from_millis(200), Duration::from_secs(2)];

/// Source of a stream of JPEG images.
pub(crate) trait Source: Send + 'static {
    /// Name for reports, such as an address.
    fn name(&self) -> String;

    /// Opens the source, for the first time or again.
    ///
    /// # Errors
    /// The source is not there.
    fn open(&mut self) -> io::Result<Box<dyn Read>>;
}

/// An image as it was captured.
#[derive(Clone, Debug, Default)]
pub(crate) struct Captured {
    /// Arrival of its first byte.
    pub arrival: Time,
    /// Number of the image; missing numbers are images that a newer one replaced.
    pub sequence: u64,
    /// The image.
    pub jpeg: Vec<u8>,
}

/// Grabber of images. Dropping it closes the source.
pub(crate) struct Grabber {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    newest: Mutex<Option<Captured>>,
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

    /// Exchanges `captured` with the newest image. Returns false if there is none since the last call.
    pub fn newest(&self, captured: &mut Captured) -> bool {
        match self.shared.newest.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(newest) => {
                *captured = newest;
                true
            }
            None => false,
        }
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
        let (mut sequence, mut pause, mut told) = (0, RETRY[0], String::new());
        while !self.is_over() {
            let before = sequence;
            let ended =
                source.open().map_or_else(|error| error, |mut stream| self.read(&mut *stream, &mut sequence));
            if self.is_over() {
                return;
            }
            let text = format!("sensor `{sensor}`: {}: {ended}; trying again", source.name());
            if text != told || sequence > before {
                tracing::warn!("{text}");
                told = text;
            }
            pause = if sequence > before { RETRY[0] } else { (2 * pause).min(RETRY[1]) };
            sleep(pause);
        }
    }

    /// Reads images until the stream ends. Returns the reason.
    fn read(&self, stream: &mut dyn Read, sequence: &mut u64) -> io::Error {
        let mut bytes = vec![0; READ_SIZE];
        let mut cutter = JpegCutter::new(MAX_IMAGE);
        let mut arrival = Time::ZERO;
        while !self.is_over() {
            let count = match stream.read(&mut bytes) {
                Ok(0) => return io::Error::new(io::ErrorKind::UnexpectedEof, "the stream has ended"),
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    return io::Error::new(io::ErrorKind::TimedOut, "no image in time");
                }
                Err(error) => return error,
            };
            let now = Time::monotonic_now();
            cutter.push(&bytes[..count], |cut| match cut {
                Cut::Begin => arrival = now,
                Cut::Image(jpeg) => {
                    *sequence += 1;
                    self.put(Captured { arrival, sequence: *sequence, jpeg: jpeg.to_vec() });
                }
            });
        }
        io::Error::from(io::ErrorKind::Interrupted)
    }

    fn put(&self, captured: Captured) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(captured);
    }
}
