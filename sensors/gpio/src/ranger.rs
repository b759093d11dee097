//! Thread that lets a ring of sonars measure, and opens its lines again after they were lost.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use yamabico_core::behavior::Outputs;
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor, check_real_time};
use yamabico_core::time::Time;

use crate::ring::{Lines, Ring, Turn};

/// Time between two attempts to open lost lines.
const REOPEN_PERIOD: Duration = Duration::from_millis(500);
/// Time between two looks for a new scan.
const POLL_PERIOD: Duration = Duration::from_millis(5);
/// Number of scans that wait for a look; without one, the oldest are dropped.
const MAX_WAITING: usize = 8;

/// Scans that wait to be published.
type Scans = Mutex<VecDeque<(RangeScanHeader, Vec<Beam>)>>;

/// Sonars that measure on a thread of their own. Dropping it ends the thread and releases the lines.
pub struct Ranger {
    name: String,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    has_begun: bool,
}

#[derive(Default)]
struct Shared {
    scans: Scans,
    is_over: AtomicBool,
}

impl Ranger {
    /// Starts the sonars of the sensor `name`. `open` opens their lines, now and after their loss.
    ///
    /// # Errors
    /// The lines do not open, or no thread starts.
    pub fn start<L: Lines + Send + 'static>(
        name: &str,
        ring: Ring,
        open: impl Fn() -> Result<L, String> + Send + 'static,
    ) -> Result<Ranger, String> {
        let lines = open()?;
        let shared = Arc::new(Shared::default());
        let (of_thread, sensor) = (Arc::clone(&shared), name.to_owned());
        let thread = std::thread::Builder::new().name(format!("sonars {name}"));
        let thread = thread.spawn(move || of_thread.run(&sensor, ring, lines, &open));
        let thread = thread.map_err(|error| format!("no thread starts: {error}"))?;
        Ok(Ranger { name: name.to_owned(), shared, thread: Some(thread), has_begun: false })
    }
}

impl Drop for Ranger {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Sensor for Ranger {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        check_real_time(&self.name, now)?;
        // Measurements from before the run are old.
        let is_begin = !std::mem::replace(&mut self.has_begun, true);
        while let Some((header, beams)) = self.shared.pop() {
            if !is_begin {
                outputs.publish(&self.name, &header, &beams)?;
            }
        }
        Ok(Due::At(now + POLL_PERIOD))
    }
}

impl Shared {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    fn pop(&self) -> Option<(RangeScanHeader, Vec<Beam>)> {
        self.scans.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    fn push(&self, scan: (RangeScanHeader, Vec<Beam>)) {
        let mut scans = self.scans.lock().unwrap_or_else(PoisonError::into_inner);
        if scans.len() >= MAX_WAITING {
            scans.pop_front();
        }
        scans.push_back(scan);
    }

    fn run<L: Lines>(
        &self,
        sensor: &str,
        mut ring: Ring,
        mut lines: L,
        open: &dyn Fn() -> Result<L, String>,
    ) {
        loop {
            ring.begin();
            let lost = self.range(sensor, &mut ring, &mut lines);
            drop(lines);
            if self.is_over() {
                return;
            }
            tracing::warn!("sensor `{sensor}`: its lines were lost: {lost}; trying again");
            lines = loop {
                sleep(REOPEN_PERIOD);
                if self.is_over() {
                    return;
                }
                if let Ok(lines) = open() {
                    break lines;
                }
            };
            tracing::warn!("sensor `{sensor}`: its lines are back");
        }
    }

    /// Measures until the lines are lost or the ranger is dropped. Returns the error.
    fn range(&self, sensor: &str, ring: &mut Ring, lines: &mut impl Lines) -> io::Error {
        while !self.is_over() {
            match ring.turn(lines) {
                Ok(Turn { scan, fault, recovered }) => {
                    if let Some((sonar, fault, count)) = fault {
                        tracing::warn!(
                            "sensor `{sensor}`: sonar {sonar} did not measure, {count} x in a row: {fault}"
                        );
                    }
                    if let Some((sonar, count)) = recovered {
                        tracing::info!(
                            "sensor `{sensor}`: sonar {sonar} measures again, after {count} faults"
                        );
                    }
                    scan.into_iter().for_each(|scan| self.push(scan));
                }
                Err(error) => return error,
            }
        }
        io::Error::from(io::ErrorKind::Interrupted)
    }
}
