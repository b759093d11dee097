//! A serial port that can be pulled out and plugged in again, with a device behind it.

use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// A device as a test plays it.
pub trait Device: Send + 'static {
    /// Takes in what the driver sent.
    fn receive(&mut self, bytes: &[u8]);
    /// Appends what the device sends; called every millisecond.
    fn turn(&mut self, out: &mut Vec<u8>);
}

/// Bad manners of the line from the device to the driver.
#[derive(Clone, Copy, Debug)]
pub struct Manners {
    /// Time for which an adapter holds bytes back.
    pub batch: Duration,
    /// Share of the bytes that are replaced, dropped or doubled.
    pub damage: f64,
    /// True if nothing passes.
    pub is_silent: bool,
    /// True if the device's line is unplugged.
    pub is_pulled: bool,
}

impl Default for Manners {
    fn default() -> Self {
        Manners { batch: Duration::from_millis(16), damage: 0.0, is_silent: false, is_pulled: false }
    }
}

/// A device behind a port.
pub struct Plug<D: Device> {
    folder: PathBuf,
    device: Arc<Mutex<D>>,
    manners: Arc<Mutex<Manners>>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

static COUNT: AtomicU64 = AtomicU64::new(0);

impl<D: Device> Plug<D> {
    /// Plugs a device into a port of its own.
    pub fn new(device: D) -> Plug<D> {
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("yamabico-plug-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let device = Arc::new(Mutex::new(device));
        let manners = Arc::new(Mutex::new(Manners::default()));
        let is_over = Arc::new(AtomicBool::new(false));
        let mut line = DeviceLine::new(folder.join("port"));
        line.plug_in();
        let (of_device, of_manners, over) = (Arc::clone(&device), Arc::clone(&manners), Arc::clone(&is_over));
        let run = move || {
            while !over.load(Ordering::Relaxed) {
                line.step(&mut *of_device.lock().unwrap(), *of_manners.lock().unwrap());
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        Plug { folder, device, manners, is_over, thread: Some(std::thread::spawn(run)) }
    }

    /// Path of the port, which stays the same.
    pub fn port(&self) -> PathBuf {
        self.folder.join("port")
    }

    /// The device, while its thread waits.
    pub fn device(&self) -> MutexGuard<'_, D> {
        self.device.lock().unwrap()
    }

    /// Changes the manners of the line.
    pub fn set(&self, change: impl FnOnce(&mut Manners)) {
        change(&mut self.manners.lock().unwrap());
    }
}

impl<D: Device> Drop for Plug<D> {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// The device's end of the line.
struct DeviceLine {
    path: PathBuf,
    master: Option<File>,
    held: Vec<u8>,
    flushed: Instant,
    random: Random,
}

impl DeviceLine {
    fn new(path: PathBuf) -> DeviceLine {
        DeviceLine { path, master: None, held: Vec::new(), flushed: Instant::now(), random: Random(7) }
    }

    fn plug_in(&mut self) {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        rustix::io::ioctl_fionbio(&master, true).unwrap();
        // A port that is not open echoes nothing.
        let mut settings = tcgetattr(&master).unwrap();
        settings.make_raw();
        tcsetattr(&master, OptionalActions::Now, &settings).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        symlink(Path::new(&name), &self.path).unwrap();
        self.master = Some(File::from(master));
    }

    fn step(&mut self, device: &mut impl Device, manners: Manners) {
        match (manners.is_pulled, self.master.is_some()) {
            (true, true) => {
                std::fs::remove_file(&self.path).unwrap();
                self.master = None;
            }
            (false, false) => self.plug_in(),
            _ => {}
        }
        let mut bytes = [0; 4096];
        if let Some(master) = &mut self.master {
            // An error: the driver has not opened it.
            if let Ok(count) = master.read(&mut bytes)
                && !manners.is_silent
            {
                device.receive(&bytes[..count]);
            }
        }
        let mut sent = Vec::new();
        device.turn(&mut sent);
        for byte in sent {
            self.damaged(byte, manners.damage);
        }
        if self.flushed.elapsed() >= manners.batch {
            self.flushed = Instant::now();
            if let Some(master) = self.master.as_mut().filter(|_| !manners.is_silent) {
                let _ = master.write(&self.held);
            }
            self.held.clear();
        }
    }

    fn damaged(&mut self, byte: u8, damage: f64) {
        if self.random.share() >= damage {
            self.held.push(byte);
            return;
        }
        match self.random.draw() % 4 {
            0 => {}
            1 => self.held.extend([byte, byte]),
            2 => self.held.push(self.random.draw() as u8),
            _ => (0..self.random.draw() % 40).for_each(|_| self.held.push(self.random.draw() as u8)),
        }
    }
}

/// Reproducible random numbers (xorshift64*, Vigna 2016).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// Draws an integer.
    pub fn draw(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 8
    }

    /// Draws a number in [0, 1).
    pub fn share(&mut self) -> f64 {
        (self.draw() & 0xf_ffff) as f64 / f64::from(0x10_0000)
    }
}
