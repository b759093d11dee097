//! A serial line that a thread of its own reads, and opens again after it was lost.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use serial2::SerialPort;
use yamabico_core::time::Time;

use crate::port::{self, PortError};

/// Time between two attempts to open a lost port.
const REOPEN_PERIOD: Duration = Duration::from_millis(200);
/// Length of the pulse on the control lines that wakes a device.
const WAKE_PULSE: Duration = Duration::from_millis(300);
/// Time without a valid frame after which the line is reported.
const SILENCE: Duration = Duration::from_secs(3);
/// Number of bytes read at once.
const READ_SIZE: usize = 4096;

/// Talk with one device: takes in its bytes, and says what to send. It knows nothing of ports, so that a test can hold it.
pub trait Conversation: Send + 'static {
    /// Begins the talk on a line that was opened, for the first time or again. The device may have been reset meanwhile.
    fn begin(&mut self, now: Time);

    /// Takes in bytes that arrived at `arrival`: any bytes, cut anywhere.
    fn receive(&mut self, bytes: &[u8], arrival: Time);

    /// Appends the bytes to send at `now` to `out`. Called after bytes arrived and after a new command, and at least every 10 ms:
    /// this is where a watchdog stops the robot.
    fn turn(&mut self, now: Time, out: &mut Vec<u8>);

    /// Returns the number of valid frames so far, and of the bytes that were part of none.
    fn frames(&self) -> (u64, u64);

    /// Appends the bytes that stop the robot for good.
    fn end(&mut self, _out: &mut Vec<u8>) {}

    /// Returns true, once per attempt, if the device seems to sleep and a pulse on the lines DTR and RTS may wake it.
    fn wants_waking(&mut self, _now: Time) -> bool {
        false
    }
}

/// Name, path and speed of a line.
#[derive(Clone, Debug)]
pub struct LineConfig {
    /// Name of the device in the robot file, for reports.
    pub device: String,
    /// Device file, such as `/dev/serial/by-id/...`.
    pub port: PathBuf,
    /// Bits per second.
    pub baud: u32,
}

/// A line with its conversation. Dropping it stops the robot and closes the port.
pub struct Line<C: Conversation> {
    shared: Arc<Shared<C>>,
    reader: Option<JoinHandle<()>>,
}

struct Shared<C> {
    config: LineConfig,
    end: Mutex<LineEnd<C>>,
    is_over: AtomicBool,
}

/// This end of a line: a conversation, and the port while it is open.
struct LineEnd<C> {
    conversation: C,
    port: Option<Arc<SerialPort>>,
    out: Vec<u8>,
}

impl<C: Conversation> Line<C> {
    /// Opens the port and begins the conversation on a thread of its own.
    ///
    /// # Errors
    /// [`PortError`]. A port that is lost later is opened again.
    pub fn open(config: LineConfig, conversation: C) -> Result<Line<C>, PortError> {
        let port = Arc::new(port::open(&config.port, config.baud)?);
        let (path, name) = (config.port.clone(), format!("line {}", config.device));
        let end = LineEnd { conversation, port: None, out: Vec::new() };
        let shared = Arc::new(Shared { config, end: Mutex::new(end), is_over: AtomicBool::new(false) });
        let of_thread = Arc::clone(&shared);
        let run = move || of_thread.run(port);
        let reader = std::thread::Builder::new().name(name).spawn(run);
        let reader = reader.map_err(|source| PortError { path, source })?;
        Ok(Line { shared, reader: Some(reader) })
    }

    /// Calls `access` with the conversation.
    pub fn with<R>(&self, access: impl FnOnce(&mut C) -> R) -> R {
        access(&mut self.shared.lock().conversation)
    }

    /// Calls `access` with the conversation, and then sends without delay.
    pub fn command(&self, access: impl FnOnce(&mut C)) {
        let mut end = self.shared.lock();
        access(&mut end.conversation);
        // The reader notices a lost port.
        let _ = end.send(Time::monotonic_now());
    }
}

impl<C: Conversation> Drop for Line<C> {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        let end = &mut *self.shared.lock();
        end.conversation.end(&mut end.out);
        let _ = end.write();
    }
}

impl<C: Conversation> Shared<C> {
    fn lock(&self) -> MutexGuard<'_, LineEnd<C>> {
        self.end.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// Reads `port`, and after its loss the port that takes its place, until the line is dropped.
    fn run(&self, mut port: Arc<SerialPort>) {
        let device = &self.config.device;
        loop {
            self.begin(&port);
            let lost = self.read(&port);
            if self.is_over() {
                return;
            }
            self.lock().port = None;
            drop(port);
            tracing::warn!(
                "device `{device}`: {} was lost: {lost}; waiting for it",
                self.config.port.display()
            );
            port = loop {
                sleep(REOPEN_PERIOD);
                if self.is_over() {
                    return;
                }
                if let Ok(port) = port::open(&self.config.port, self.config.baud) {
                    break Arc::new(port);
                }
            };
            tracing::warn!("device `{device}`: {} is back", self.config.port.display());
        }
    }

    fn begin(&self, port: &Arc<SerialPort>) {
        let mut end = self.lock();
        end.conversation.begin(Time::monotonic_now());
        end.port = Some(Arc::clone(port));
    }

    /// Reads and answers until the line is dropped. Returns the error that ended it.
    fn read(&self, port: &SerialPort) -> io::Error {
        let mut bytes = [0; READ_SIZE];
        let mut silence = Silence { frames: 0, since: Time::monotonic_now(), is_told: false };
        while !self.is_over() {
            let count = match port.read(&mut bytes) {
                // A terminal without its other side ends.
                Ok(0) => return io::Error::from(io::ErrorKind::UnexpectedEof),
                Ok(count) => count,
                Err(error) if is_pause(&error) => 0,
                Err(error) => return error,
            };
            let now = Time::monotonic_now();
            let mut end = self.lock();
            if count > 0 {
                end.conversation.receive(&bytes[..count], now);
            }
            match end.send(now) {
                Err(error) if !is_pause(&error) => return error,
                _ => {}
            }
            if let Some(skipped) = silence.watch(end.conversation.frames(), now) {
                let (device, port, baud) =
                    (&self.config.device, self.config.port.display(), self.config.baud);
                tracing::warn!(
                    "device `{device}`: nothing valid arrives on {port} at {baud} baud ({skipped} other bytes so far): is it \
                     switched on, and are port and baud rate right?"
                );
            }
            if end.conversation.wants_waking(now) {
                drop(end);
                wake(port);
            }
        }
        io::Error::from(io::ErrorKind::Interrupted)
    }
}

/// Watch for a device that is connected but says nothing.
struct Silence {
    frames: u64,
    since: Time,
    is_told: bool,
}

impl Silence {
    /// Returns the number of invalid bytes, once, when no valid frame has arrived for too long.
    fn watch(&mut self, (frames, skipped): (u64, u64), now: Time) -> Option<u64> {
        if frames != self.frames {
            *self = Silence { frames, since: now, is_told: false };
        }
        let is_silent = now.since(self.since) > SILENCE && !self.is_told;
        self.is_told |= is_silent;
        is_silent.then_some(skipped)
    }
}

impl<C: Conversation> LineEnd<C> {
    fn send(&mut self, now: Time) -> io::Result<()> {
        self.conversation.turn(now, &mut self.out);
        self.write()
    }

    /// Writes the waiting bytes. Those that the device does not take in time are dropped: they would be old.
    fn write(&mut self) -> io::Result<()> {
        let written = match &self.port {
            Some(port) if !self.out.is_empty() => port.write_all(&self.out),
            _ => Ok(()),
        };
        self.out.clear();
        written
    }
}

/// Returns true for an error after which the port still works.
fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Pulls DTR and RTS low for a moment. A port without these lines ignores it.
fn wake(port: &SerialPort) {
    for is_low in [false, true, false] {
        let _ = (port.set_dtr(is_low), port.set_rts(is_low));
        sleep(WAKE_PULSE);
    }
}
