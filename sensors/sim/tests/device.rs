//! Simulator as a device: opened, polled and driven.

use std::path::Path;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{Device, DeviceSpec, PartSpec};
use yamabico_core::message::{Command, FrameHeader, Message, Odometry, RangeScanHeader, Truth, Twist};
use yamabico_core::sensor::{Due, MotionLimits, Robot, SensorKind};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;
use yamabico_sim::driver;

const TICK_S: f64 = 0.02;

fn headers<M: Message>(published: &Published, name: &str) -> Vec<M> {
    published.of::<M>(name).into_iter().map(|(header, _)| header).collect()
}

fn open(world: &str, seed: u64) -> Device {
    open_with(world, seed, "differential", 50)
}

fn open_with(world: &str, seed: u64, drive: &str, latency_ms: u32) -> Device {
    open_spec(spec(world, seed, drive, latency_ms))
}

fn spec(world: &str, seed: u64, drive: &str, latency_ms: u32) -> DeviceSpec {
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
    let camera = "intrinsics = { width = 64, height = 48 }\nmount = { z_m = 0.6 }";
    DeviceSpec {
        name: "world".into(),
        table: "world = \"world.toml\"\nstart = { jitter_m = 0.1 }".parse().unwrap(),
        sensors: vec![
            part("eye", "camera", &format!("{camera}\nlatency_ms = {latency_ms}")),
            part("ears", "sonar", "x_m = 0.25\ndropout = 0.0"),
            part("wheels", "encoders", ""),
        ],
        drive: Some(part("drive", drive, "")),
        folder,
        seed,
        robot: Robot {
            limits: MotionLimits { speed: [0.6, 0.6, 1.2], ..Default::default() },
            ..Default::default()
        },
    }
}

fn open_spec(spec: DeviceSpec) -> Device {
    let folder = spec.folder.clone();
    let device = driver().open(spec).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    device
}

/// Drives at `speed` (m/s) for `seconds`, then sends no commands for `silent` seconds.
fn run(device: &mut Device, speed: f64, seconds: f64, silent: f64) -> Published {
    let ahead = |now: f64| (now < seconds).then(|| Twist { linear: speed, ..Twist::default() });
    run_by(device, ahead, seconds + silent)
}

/// Drives with the command that `command_at` returns for every time (s).
fn run_by(device: &mut Device, command_at: impl Fn(f64) -> Option<Twist>, seconds: f64) -> Published {
    let mut tape = Published::default();
    let ticks = (seconds / TICK_S).round() as u64;
    for tick in 0..=ticks {
        let now = Time::from_secs_f64(tick as f64 * TICK_S);
        let ground_truth = device.ground_truth.as_mut().unwrap();
        for sensor in device.sensors.iter_mut().map(|s| &mut s.1).chain([ground_truth]) {
            let due = sensor.poll(now, &mut Outputs::new(&mut tape)).unwrap();
            assert!(matches!(due, Due::At(at) if at > now));
        }
        let command =
            command_at(now.as_secs_f64()).map(|twist| Command { twist, ..bytemuck::Zeroable::zeroed() });
        device.drive.as_mut().unwrap().apply(command.as_ref(), now).unwrap();
    }
    tape
}

const EMPTY: &str = "[corridor]\nlength_m = 12";

#[test]
fn one_seed_gives_one_run_to_the_byte() {
    let bytes = |seed| {
        let tape = run(&mut open(EMPTY, seed), 0.3, 1.0, 0.0);
        let bytes =
            tape.iter().map(|(name, _, raw)| (name.to_owned(), raw.header.to_vec(), raw.items.to_vec()));
        bytes.collect::<Vec<_>>()
    };
    assert!(bytes(7) == bytes(7));
    assert!(bytes(7) != bytes(8));
}

#[test]
fn frames_show_the_time_of_exposure_and_arrive_after_the_latency() {
    let tape = run(&mut open(EMPTY, 1), 0.3, 1.0, 0.0);
    let frames = headers::<FrameHeader>(&tape, "eye");
    assert_eq!(frames.len(), 10, "every 100 ms from 0 on, none within the latency of the end");
    assert_eq!(frames[3].stamp_ns, 300_000_000);
    assert_eq!(frames[3].sequence, 3);
    assert!(tape.of::<FrameHeader>("eye").iter().all(|(_, pixels)| pixels.len() == 64 * 48));
}

#[test]
fn frames_show_the_pose_at_exposure_not_at_delivery() {
    let pixels = |latency_ms| {
        let mut device = open_with(EMPTY, 1, "differential", latency_ms);
        run(&mut device, 0.5, 2.0, 0.0).of::<FrameHeader>("eye")
    };
    let (at_once, late) = (pixels(0), pixels(400));
    assert_eq!((at_once.len(), late.len()), (21, 17));
    for ((soon, seen), (header, seen_late)) in at_once.iter().zip(&late) {
        assert_eq!(soon.stamp_ns, header.stamp_ns);
        assert!(seen == seen_late, "the image of {} ns differs", header.stamp_ns);
    }
    assert!(at_once[10].1 != at_once[14].1, "0.2 m farther on it looks otherwise");
}

#[test]
fn a_mirror_camera_publishes_its_model_and_its_frames() {
    let table = "picture = { width = 64, height = 60, blind_radius_px = 3, rim_radius_px = 30 }\n\
        mirror = { kind = 'hyperboloidal', focal_px = 65, eccentricity = 1.45, foci_m = 0.08 }\n\
        mount = { z_m = 0.5 }\nencoding = 'rgb8'\nphotometry = { noise_sigma = 0.0 }";
    let table: toml::Table = table.parse().unwrap();
    let describe = |table: &toml::Table| {
        let part = PartSpec { name: "ring".into(), kind: "mirror-camera".into(), table: table.clone() };
        driver().describe_sensor(&part, Path::new(""))
    };
    let described = describe(&table).unwrap();
    let SensorKind::MirrorCamera { camera, mount, .. } = described.info.kind else { panic!("another kind") };
    assert_eq!((camera.image().width, camera.image().rim_radius_px(), mount.z), (64, 30.0, 0.5));
    assert_eq!(described.max_item_bytes, 64 * 60 * 3);

    let mut spec = spec(EMPTY, 1, "differential", 50);
    let part = PartSpec { name: "ring".into(), kind: "mirror-camera".into(), table: table.clone() };
    spec.sensors.push(part);
    let frames = run(&mut open_spec(spec), 0.3, 1.0, 0.0).of::<FrameHeader>("ring");
    assert_eq!((frames.len(), frames[3].0.stamp_ns), (10, 300_000_000));
    let gray_at = |(header, pixels): &(FrameHeader, Vec<u8>), [x, y]: [usize; 2]| {
        assert_eq!((header.width, header.stride, pixels.len()), (64, 192, 64 * 60 * 3));
        pixels[y * 192 + 3 * x + 1]
    };
    for frame in &frames {
        assert_eq!((gray_at(frame, [0, 0]), gray_at(frame, [31, 29])), (0, 0), "beside the ring is nothing");
        assert!(gray_at(frame, [31, 20]) > 60, "the floor before it");
    }

    let mut narrow = table;
    narrow["picture"].as_table_mut().unwrap().insert("blind_radius_px".into(), toml::Value::Float(40.0));
    let refused = describe(&narrow).unwrap_err();
    assert_eq!(refused.key, "picture");
    assert!(refused.problem.contains("40 to 30 px"), "{}", refused.problem);
}

#[test]
fn it_follows_commands_and_stops_without_them() {
    let tape = run(&mut open(EMPTY, 1), 0.3, 4.0, 1.0);
    let truth = headers::<Truth>(&tape, "truth");
    let end = truth.last().unwrap();
    assert_eq!(end.vx, 0.0);
    assert!((end.distance_m - 1.2).abs() < 0.1, "4 s at 0.3 m/s: {}", end.distance_m);
    assert!(end.clearance_m > 0.4 && end.contacts == 0 && end.person_m.is_infinite());
    let odometry = headers::<Odometry>(&tape, "wheels");
    let at_end = odometry.last().unwrap();
    assert!((at_end.x - end.distance_m).abs() < 0.05, "{} {}", at_end.x, end.distance_m);
    assert!(at_end.covariance[0] > 0.0);
}

#[test]
fn a_box_returns_echoes_and_is_one_contact() {
    let world = format!("{EMPTY}\n[[box]]\nat_m = [1.5, 0]\nsize_m = [0.3, 0.8, 0.5]");
    let tape = run(&mut open(&world, 1), 0.3, 5.0, 0.0);
    let (_, beams) = &tape.of::<RangeScanHeader>("ears")[0];
    assert_eq!(beams.len(), 3);
    let heard = beams[1].echo_m();
    assert!((heard.unwrap() - 1.1).abs() < 0.03, "face at 1.35 m, sonar at 0.25 m: {heard:?}");
    let end = *headers::<Truth>(&tape, "truth").last().unwrap();
    assert_eq!(end.contacts, 1);
    assert!((end.x - 1.1).abs() < 0.01, "radius 0.25 m before 1.35 m: {}", end.x);
    assert!(end.clearance_m.abs() < 0.01);
}

#[test]
fn without_clutter_the_building_is_empty() {
    let world = "[corridor]\n[[box]]\nat_m = [1.0, 0.0]\n[[person]]\npath_m = [[0.5, 0.0]]";
    let mut empty = spec(world, 1, "differential", 50);
    empty.table.insert("clutter".into(), "none".into());
    let tape = run(&mut open_spec(empty), 0.4, 4.0, 1.0);
    let last = *headers::<Truth>(&tape, "truth").last().unwrap();
    assert!(last.x > 1.3 && last.contacts == 0 && last.person_m.is_infinite(), "{last:?}");
}

#[test]
fn a_person_who_walks_into_the_standing_robot_is_counted_separately() {
    let world = format!("{EMPTY}\n[[person]]\npath_m = [[3, 0], [-1, 0]]\nspeed_mps = 1");
    let standing = *headers::<Truth>(&run(&mut open(&world, 1), 0.0, 4.0, 0.0), "truth").last().unwrap();
    assert_eq!((standing.contacts, standing.struck), (0, 1));
    let driving = *headers::<Truth>(&run(&mut open(&world, 1), 0.3, 4.0, 0.0), "truth").last().unwrap();
    assert_eq!((driving.contacts, driving.struck), (1, 0));
}

#[test]
fn driving_into_a_person_who_struck_the_robot_is_a_contact() {
    let world = format!("{EMPTY}\n[[person]]\npath_m = [[3, 0], [0.3, 0]]\nspeed_mps = 1");
    let waits = |now: f64| Some(Twist { linear: if now < 4.0 { 0.0 } else { 0.3 }, ..Twist::default() });
    let tape = run_by(&mut open(&world, 1), waits, 6.0);
    let truth = headers::<Truth>(&tape, "truth");
    let waited = truth.iter().rfind(|truth| truth.stamp_ns < 4_000_000_000).unwrap();
    assert_eq!((waited.contacts, waited.struck), (0, 1));
    let end = truth.last().unwrap();
    assert_eq!((end.contacts, end.struck), (1, 1));
}

#[test]
fn a_holonomic_drive_moves_sideways_and_its_odometry_agrees() {
    let sideways = |_: f64| Some(Twist { lateral: 0.2, ..Twist::default() });
    let tape = run_by(&mut open_with(EMPTY, 1, "holonomic", 50), sideways, 2.0);
    let truth = headers::<Truth>(&tape, "truth");
    let (begin, end) = (truth.first().unwrap(), truth.last().unwrap());
    assert!((0.3..0.45).contains(&(end.y - begin.y)), "{} to {}", begin.y, end.y);
    let at_end = *headers::<Odometry>(&tape, "wheels").last().unwrap();
    assert!((at_end.y - (end.y - begin.y)).abs() < 0.03, "{} {}", at_end.y, end.y - begin.y);
    let tape = run_by(&mut open(EMPTY, 1), sideways, 1.0);
    assert_eq!(headers::<Truth>(&tape, "truth").last().unwrap().distance_m, 0.0, "two wheels do not");
}

#[test]
fn lost_frames_leave_gaps_and_do_not_change_the_others() {
    let frames = |dropout: f64| {
        let mut spec = spec(EMPTY, 3, "differential", 50);
        let config = "intrinsics = { width = 64, height = 48 }\nmount = { z_m = 0.6 }\nphotometry = { noise_sigma = 0 }";
        spec.sensors[0].table = format!("{config}\nperiod_ms = 20\ndropout = {dropout:?}").parse().unwrap();
        run(&mut open_spec(spec), 0.3, 8.0, 0.0).of::<FrameHeader>("eye")
    };
    let (all, some) = (frames(0.0), frames(0.25));
    let lost = 1.0 - some.len() as f64 / all.len() as f64;
    assert!((0.18..0.32).contains(&lost), "{lost}");
    for (header, pixels) in some.iter().take(20) {
        let same = all.iter().find(|(other, _)| other.sequence == header.sequence).unwrap();
        assert!(same.0.stamp_ns == header.stamp_ns && same.1 == *pixels);
    }
    assert!(frames(1.0).is_empty());
}
