//! Laser scanner and bumpers of the simulator.

use std::path::PathBuf;

use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{Device, DeviceSpec, PartSpec};
use yamabico_core::message::{Beam, Bumper, Command, RangeScanHeader, Truth, Twist};
use yamabico_core::sensor::{Robot, SensorKind};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;
use yamabico_sim::driver;

fn part(name: &str, kind: &str, table: &str) -> PartSpec {
    PartSpec { name: name.into(), kind: kind.into(), table: table.parse().unwrap() }
}

/// A corridor 2 m wide with its end 3 m ahead.
fn open(lidar: &str) -> Device {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("lidar-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("world.toml"), "[corridor]\nstart_x_m = 0\nlength_m = 8\nwidth_m = 2")
        .unwrap();
    let spec = DeviceSpec {
        name: "world".into(),
        table: "world = \"world.toml\"\nstart = { x_m = 5.0 }".parse().unwrap(),
        sensors: vec![part("laser", "lidar", lidar), part("bumper", "bumper", "")],
        drive: Some(part("drive", "differential", "")),
        folder,
        seed: 1,
        robot: Robot::default(),
    };
    driver().open(spec).unwrap()
}

fn run(device: &mut Device, twist: Twist, seconds: f64) -> Published {
    let mut tape = Published::default();
    for tick in 0..(seconds / 0.02) as u64 {
        let now = Time::from_secs_f64(0.02 * tick as f64);
        let truth = device.ground_truth.as_mut().unwrap();
        for sensor in device.sensors.iter_mut().map(|sensor| &mut sensor.1).chain([truth]) {
            sensor.poll(now, &mut Outputs::new(&mut tape)).unwrap();
        }
        let command = Command { twist, ..bytemuck::Zeroable::zeroed() };
        device.drive.as_mut().unwrap().apply(Some(&command), now).unwrap();
    }
    tape
}

#[test]
fn a_scan_shows_the_corridor_around_the_robot() {
    let tape = run(&mut open("noise_m = 0.0\ndropout = 0.0\nx_m = 0.1"), Twist::ZERO, 0.5);
    let scans = tape.of::<RangeScanHeader>("laser");
    assert_eq!(scans.len(), 5);
    let (header, beams) = &scans[4];
    assert_eq!((header.stamp_ns, header.max_m, beams.len()), (400_000_000, 8.0, 360));
    let towards = |degrees: f64| {
        let off = |beam: &&Beam| (beam.azimuth_rad - degrees.to_radians()).abs();
        beams.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap().echo_m().unwrap()
    };
    for (degrees, expected_m) in [(0.0, 2.9), (90.0, 1.0), (-90.0, 1.0), (30.0, 2.0), (-150.0, 2.0)] {
        let range_m = towards(degrees);
        assert!((range_m - expected_m).abs() < 0.05, "{degrees} degrees: {range_m} m");
    }
}

#[test]
fn the_bumpers_are_pressed_at_a_wall_ahead_and_released_on_the_way_back() {
    let mut device = open("");
    let tape = run(&mut device, Twist::planar(0.6, 0.0), 7.0);
    let pressed: Vec<u64> = tape.of::<Bumper>("bumper").iter().map(|(bumper, _)| bumper.pressed).collect();
    let truth = tape.of::<Truth>("truth");
    assert_eq!((pressed[0], pressed.last()), (0, Some(&3)), "both at a wall straight ahead");
    assert!(truth.last().unwrap().0.clearance_m < 0.02);
}

#[test]
fn a_lidar_is_described_by_its_limits_and_refused_without_room_between_them() {
    let describe = |table| driver().describe_sensor(&part("laser", "lidar", table), std::path::Path::new(""));
    let described = describe("beams = 2048").unwrap();
    assert_eq!(described.max_item_bytes, 2048 * size_of::<Beam>());
    assert_eq!(described.info.kind, SensorKind::Range { min_m: 0.1, max_m: 8.0 });
    assert_eq!(describe("min_m = 0.5\nmax_m = 0.4").unwrap_err().key, "max_m");
}
