//! The simulator through its seams: opened like any device, polled and driven.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use yamabico_core::behavior::{OutputSink, Outputs, PublishError};
use yamabico_core::message::{Beam, Command, FrameHeader, MessageType, NO_ECHO, Odometry, Truth, Twist};
use yamabico_core::sensor::{Device, DeviceSpec, Due, MotionLimits, PartSpec, Robot};
use yamabico_core::time::Time;
use yamabico_sim::PLUGIN;

const TICK_S: f64 = 0.02;

#[derive(Default)]
struct Tape {
    messages: Vec<(String, Vec<u8>, Vec<u8>)>,
}

impl OutputSink for Tape {
    fn publish(
        &mut self,
        name: &str,
        _: &MessageType,
        header: &[u8],
        items: &[u8],
    ) -> Result<(), PublishError> {
        self.messages.push((name.into(), header.into(), items.into()));
        Ok(())
    }

    fn publish_in_place(
        &mut self,
        name: &str,
        _: &MessageType,
        header: &[u8],
        len: usize,
        fill: &mut dyn FnMut(&mut [u8]),
    ) -> Result<(), PublishError> {
        let mut items = vec![0; len];
        fill(&mut items);
        self.messages.push((name.into(), header.into(), items));
        Ok(())
    }
}

impl Tape {
    fn headers<M: bytemuck::AnyBitPattern>(&self, name: &str) -> Vec<M> {
        let of_name = self.messages.iter().filter(|m| m.0 == name);
        of_name.map(|m| bytemuck::pod_read_unaligned(&m.1)).collect()
    }
}

fn open(world: &str, seed: u64) -> Device {
    open_with(world, seed, "differential")
}

fn open_with(world: &str, seed: u64, drive: &str) -> Device {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let folder =
        PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("world-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("world.toml"), world).unwrap();
    let part = |name: &str, kind: &str, table: &str| PartSpec {
        name: name.into(),
        kind: kind.into(),
        table: table.parse().unwrap(),
    };
    let camera = "intrinsics = { width = 64, height = 48 }\nmount = { z_m = 0.6 }\nlatency_ms = 50";
    let spec = DeviceSpec {
        name: "world".into(),
        table: "world = \"world.toml\"\nstart = { jitter_m = 0.1 }".parse().unwrap(),
        sensors: vec![
            part("eye", "camera", camera),
            part("ears", "sonar", "x_m = 0.25\ndropout = 0.0"),
            part("wheels", "encoders", ""),
        ],
        drive: Some(part("drive", drive, "")),
        folder: folder.clone(),
        seed,
        robot: Robot {
            limits: MotionLimits { speed: [0.6, 0.6, 1.2], ..Default::default() },
            ..Default::default()
        },
    };
    let device = (PLUGIN.open)(spec).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    device
}

/// Drives at `speed` m/s for `seconds`, then keeps silent for as long as `silent`.
fn run(device: &mut Device, speed: f64, seconds: f64, silent: f64) -> Tape {
    let ahead = |now: f64| (now < seconds).then(|| Twist { linear: speed, ..Twist::default() });
    run_by(device, ahead, seconds + silent)
}

/// Drives as `told` says of every instant.
fn run_by(device: &mut Device, told: impl Fn(f64) -> Option<Twist>, seconds: f64) -> Tape {
    let mut tape = Tape::default();
    let ticks = (seconds / TICK_S).round() as u64;
    for tick in 0..=ticks {
        let now = Time::from_secs_f64(tick as f64 * TICK_S);
        let judge = device.judge.as_mut().unwrap();
        for sensor in device.sensors.iter_mut().map(|s| &mut s.1).chain([judge]) {
            let due = sensor.poll(now, &mut Outputs::new(&mut tape)).unwrap();
            assert!(matches!(due, Due::At(at) if at > now));
        }
        let command = told(now.as_secs_f64()).map(|twist| Command { twist, ..bytemuck::Zeroable::zeroed() });
        device.drive.as_mut().unwrap().apply(command.as_ref(), now).unwrap();
    }
    tape
}

const EMPTY: &str = "[corridor]\nlength_m = 12";

#[test]
fn one_seed_gives_one_run_to_the_byte() {
    let tape = |seed| run(&mut open(EMPTY, seed), 0.3, 1.0, 0.0).messages;
    assert!(tape(7) == tape(7));
    assert!(tape(7) != tape(8));
}

#[test]
fn pictures_show_the_exposure_and_arrive_after_the_latency() {
    let tape = run(&mut open(EMPTY, 1), 0.3, 1.0, 0.0);
    let frames = tape.headers::<FrameHeader>("eye");
    assert_eq!(frames.len(), 10, "every 100 ms from 0 on, none within the latency of the end");
    assert_eq!(frames[3].stamp_ns, 300_000_000);
    assert_eq!(frames[3].sequence, 3);
    assert!(tape.messages.iter().filter(|m| m.0 == "eye").all(|m| m.2.len() == 64 * 48));
}

#[test]
fn it_drives_as_told_and_stops_when_commands_stop() {
    let tape = run(&mut open(EMPTY, 1), 0.3, 4.0, 1.0);
    let truth = tape.headers::<Truth>("truth");
    let end = truth.last().unwrap();
    assert_eq!(end.vx, 0.0);
    assert!((end.distance_m - 1.2).abs() < 0.1, "4 s at 0.3 m/s: {}", end.distance_m);
    assert!(end.clearance_m > 0.4 && end.contacts == 0 && end.person_m.is_infinite());
    let odometry = tape.headers::<Odometry>("wheels");
    let at_end = odometry.last().unwrap();
    assert!((at_end.x - end.distance_m).abs() < 0.05, "{} {}", at_end.x, end.distance_m);
    assert!(at_end.covariance[0] > 0.0);
}

#[test]
fn a_box_is_heard_then_run_into_once() {
    let world = format!("{EMPTY}\n[[box]]\nat_m = [1.5, 0]\nsize_m = [0.3, 0.8, 0.5]");
    let tape = run(&mut open(&world, 1), 0.3, 5.0, 0.0);
    let heard = |m: &(String, Vec<u8>, Vec<u8>)| {
        let beams: Vec<Beam> =
            m.2.chunks_exact(size_of::<Beam>()).map(bytemuck::pod_read_unaligned).collect();
        assert_eq!(beams.len(), 3);
        (beams[1].flags & NO_ECHO == 0).then_some(beams[1].range_m)
    };
    let first = tape.messages.iter().find(|m| m.0 == "ears").unwrap();
    assert!(
        (heard(first).unwrap() - 1.1).abs() < 0.03,
        "face at 1.35 m, sonar at 0.25 m: {:?}",
        heard(first)
    );
    let end = *tape.headers::<Truth>("truth").last().unwrap();
    assert_eq!(end.contacts, 1);
    assert!((end.x - 1.1).abs() < 0.01, "radius 0.25 m before 1.35 m: {}", end.x);
    assert!(end.clearance_m.abs() < 0.01);
}

#[test]
fn a_person_who_walks_into_the_standing_robot_is_counted_apart() {
    let world = format!("{EMPTY}\n[[person]]\npath_m = [[3, 0], [-1, 0]]\nspeed_mps = 1");
    let standing = *run(&mut open(&world, 1), 0.0, 4.0, 0.0).headers::<Truth>("truth").last().unwrap();
    assert_eq!((standing.contacts, standing.struck), (0, 1));
    let driving = *run(&mut open(&world, 1), 0.3, 4.0, 0.0).headers::<Truth>("truth").last().unwrap();
    assert_eq!((driving.contacts, driving.struck), (1, 0));
}

#[test]
fn driving_on_into_somebody_who_struck_the_robot_is_a_contact() {
    let world = format!("{EMPTY}\n[[person]]\npath_m = [[3, 0], [0.3, 0]]\nspeed_mps = 1");
    let waits = |now: f64| Some(Twist { linear: if now < 4.0 { 0.0 } else { 0.3 }, ..Twist::default() });
    let tape = run_by(&mut open(&world, 1), waits, 6.0);
    let truth = tape.headers::<Truth>("truth");
    let waited = truth.iter().rfind(|truth| truth.stamp_ns < 4_000_000_000).unwrap();
    assert_eq!((waited.contacts, waited.struck), (0, 1));
    let end = truth.last().unwrap();
    assert_eq!((end.contacts, end.struck), (1, 1));
}

#[test]
fn a_holonomic_drive_moves_sideways_and_its_wheels_tell() {
    let sideways = |_: f64| Some(Twist { lateral: 0.2, ..Twist::default() });
    let tape = run_by(&mut open_with(EMPTY, 1, "holonomic"), sideways, 2.0);
    let truth = tape.headers::<Truth>("truth");
    let (begin, end) = (truth.first().unwrap(), truth.last().unwrap());
    assert!((0.3..0.45).contains(&(end.y - begin.y)), "{} to {}", begin.y, end.y);
    let at_end = *tape.headers::<Odometry>("wheels").last().unwrap();
    assert!((at_end.y - (end.y - begin.y)).abs() < 0.03, "{} {}", at_end.y, end.y - begin.y);
    let tape = run_by(&mut open(EMPTY, 1), sideways, 1.0);
    assert_eq!(tape.headers::<Truth>("truth").last().unwrap().distance_m, 0.0, "two wheels do not");
}
