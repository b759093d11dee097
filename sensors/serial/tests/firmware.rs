//! The reference firmware, compiled by gcc, behind a line that can be pulled.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex, OnceLock};

use yamabico_core::geometry::Twist;
use yamabico_core::message::{Odometry, RangeScanHeader};
use yamabico_played_devices::plug::{Device, Plug};
use yamabico_serial::microcontroller::driver;

use crate::bench::{Bench, MAX_STOP_S};

const KEYS: &str = "counts_per_m = 5000.0\ntrack_m = 0.2";
const SENSORS: [(&str, &str); 3] = [("encoders", ""), ("bumpers", ""), ("sonars", "azimuths_deg = [0.0]")];

/// Compiles the firmware once.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware");
        let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("firmware-{}", std::process::id()));
        let mut gcc = Command::new("gcc");
        gcc.args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Wconversion",
            "-Wno-sign-conversion",
            "-Werror",
            "-O1",
            "-o",
        ]);
        let built = gcc.arg(&program).args([folder.join("robot.c"), folder.join("host.c")]).output().unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        program
    })
}

/// A running firmware.
struct Firmware {
    child: Child,
    input: ChildStdin,
    sent: Arc<Mutex<Vec<u8>>>,
    /// Speeds of the wheels that it holds, counts per second.
    speeds: Arc<Mutex<[i64; 2]>>,
}

impl Firmware {
    fn start() -> Firmware {
        let mut command = Command::new(program());
        let pipes = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = pipes.spawn().unwrap();
        let (mut output, log) = (child.stdout.take().unwrap(), BufReader::new(child.stderr.take().unwrap()));
        let (sent, speeds) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new([0; 2])));
        let (of_output, of_log) = (Arc::clone(&sent), Arc::clone(&speeds));
        std::thread::spawn(move || {
            let mut bytes = [0; 512];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                of_output.lock().unwrap().extend(&bytes[..count]);
            }
        });
        std::thread::spawn(move || {
            for line in log.lines().map_while(Result::ok) {
                let mut numbers = line.split(' ').map(|number| number.parse().unwrap());
                *of_log.lock().unwrap() = [numbers.next().unwrap(), numbers.next().unwrap()];
            }
        });
        Firmware { input: child.stdin.take().unwrap(), child, sent, speeds }
    }

    fn speeds(&self) -> [i64; 2] {
        *self.speeds.lock().unwrap()
    }
}

impl Device for Firmware {
    fn receive(&mut self, bytes: &[u8]) {
        self.input.write_all(bytes).unwrap();
        self.input.flush().unwrap();
    }

    fn turn(&mut self, out: &mut Vec<u8>) {
        out.append(&mut self.sent.lock().unwrap());
    }
}

impl Drop for Firmware {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn open(plug: &Plug<Firmware>) -> Bench {
    let mut bench = Bench::open(&driver(), &plug.port(), KEYS, &SENSORS, Some("watchdog_ms = 150"));
    bench.run_until(2.0, "no odometry", |bench| !bench.messages::<Odometry>("encoders").is_empty());
    bench
}

#[test]
fn it_drives_through_noise() {
    let plug = Plug::new(Firmware::start());
    let mut bench = open(&plug);
    plug.set(|manners| manners.damage = 0.002);
    bench.twist = Some(Twist::planar(0.2, 0.5));
    bench.run(1.5);
    assert_eq!(plug.device().speeds(), [750, 1250]);
    let sonars = bench.messages::<RangeScanHeader>("sonars");
    assert!(sonars.len() > 8, "{} scans", sonars.len());
    assert!(sonars.windows(2).all(|pair| pair[1].sequence == pair[0].sequence + 1), "a gap counts as a loss");
    plug.set(|manners| manners.damage = 0.0);
    bench.run(0.3);
    let odometry = bench.messages::<Odometry>("encoders");
    let last = odometry.last().unwrap();
    // The firmware counts what it commands.
    assert!((last.vx - 0.2).abs() < 0.02 && (last.omega - 0.5).abs() < 0.1, "{last:?}");
    let stamps_increase = odometry.windows(2).all(|pair| pair[1].stamp_ns > pair[0].stamp_ns);
    assert!(stamps_increase && odometry.len() > 50, "{}", odometry.len());
    bench.twist = Some(Twist::planar(0.0, 0.0));
    bench.run_until(1.0, "drives on", |_| plug.device().speeds() == [0, 0]);
}

#[test]
fn commands_that_stop_stop_it_twice_over() {
    let plug = Plug::new(Firmware::start());
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run_until(1.0, "does not drive", |_| plug.device().speeds() == [1000, 1000]);
    bench.twist = None;
    let took_s = bench.run_until(1.0, "drives on", |_| plug.device().speeds() == [0, 0]);
    assert!((0.1..MAX_STOP_S).contains(&took_s), "{took_s}");

    // A driver that hangs: the firmware's own watchdog.
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run_until(1.0, "does not drive", |_| plug.device().speeds() == [1000, 1000]);
    plug.set(|manners| manners.is_silent = true);
    let took_s = bench.run_until(1.0, "drives on", |_| plug.device().speeds() == [0, 0]);
    assert!((0.1..MAX_STOP_S).contains(&took_s), "{took_s}");
    plug.set(|manners| manners.is_silent = false);
    bench.run_until(2.0, "does not drive again", |_| plug.device().speeds() == [1000, 1000]);
}

#[test]
fn a_pulled_cable_and_a_reset_stop_it_and_it_comes_back() {
    let plug = Plug::new(Firmware::start());
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run_until(1.0, "does not drive", |_| plug.device().speeds() == [1000, 1000]);
    plug.set(|manners| manners.is_pulled = true);
    let stopped_s = bench.run_until(1.0, "drives on", |_| plug.device().speeds() == [0, 0]);
    assert!(stopped_s < MAX_STOP_S, "{stopped_s}");
    plug.set(|manners| manners.is_pulled = false);
    let back_s = bench.run_until(2.0, "not back", |_| plug.device().speeds() == [1000, 1000]);
    println!(
        "microcontroller: stopped {stopped_s:.2} s after the cable was pulled, drives {back_s:.2} s after it is back"
    );

    let before = *bench.messages::<Odometry>("encoders").last().unwrap();
    *plug.device() = Firmware::start();
    bench.run_until(2.0, "not back", |_| plug.device().speeds() == [1000, 1000]);
    bench.run(0.2);
    let after = *bench.messages::<Odometry>("encoders").last().unwrap();
    assert!((after.x - before.x).abs() < 0.3 && after.x > before.x, "{} {}", before.x, after.x);
}

#[test]
fn a_firmware_of_another_version_is_not_driven() {
    /// Answers every line with an identity of version 9.
    struct Stranger(Vec<u8>, Vec<u8>);
    impl Device for Stranger {
        fn receive(&mut self, bytes: &[u8]) {
            self.0.extend(bytes);
            if !bytes.is_empty() {
                let identity = yamabico_serial::microcontroller::ProtocolLine::Identity {
                    version: 9,
                    name: "stranger".into(),
                    watchdog_ms: 200,
                };
                identity.encode(&mut self.1);
            }
        }
        fn turn(&mut self, out: &mut Vec<u8>) {
            out.append(&mut self.1);
        }
    }
    let plug = Plug::new(Stranger(Vec::new(), Vec::new()));
    let mut bench = Bench::open(&driver(), &plug.port(), KEYS, &SENSORS, Some(""));
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(1.0);
    let received = plug.device().0.clone();
    assert!(received.starts_with(b"$H*") && !received.windows(3).any(|bytes| bytes == b"$D,"));
}
