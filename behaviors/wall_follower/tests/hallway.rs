//! Drives through rendered corridors.

use crate::rig::{drive, setup};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Kind, Reason};
use yamabico_core::testing::Bench;
use yamabico_rigs::camera_drive::{CameraDrive, Light, Sensors, TICK_S};
use yamabico_sim::building::Building;
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Renderer, Scene, World};
use yamabico_wall_follower::WallFollower;

/// Drives 12.5 m and returns the RMS offset from the center line and the largest one, m.
fn offsets_m(world: &World, start: Pose2, size: (u32, u32)) -> (f64, f64) {
    let mut drive = drive(world, start, size, "speed_mps = 0.4");
    let (mut sum, mut count, mut largest) = (0.0, 0.0, 0.0_f64);
    while drive.robot.x < start.x + 12.5 {
        drive.step();
        assert!(drive.now_s() < 60.0, "stands at {:?} with {:?}", drive.robot, drive.proposal.reason());
        sum += drive.robot.y.powi(2);
        count += 1.0;
        largest = largest.max(drive.robot.y.abs());
    }
    ((sum / count).sqrt(), largest)
}

#[test]
fn keeps_to_the_middle_at_forty_centimeters_a_second() {
    for (seed, size) in [(0, (640, 480)), (1, (256, 240)), (2, (256, 240))] {
        let world = World::random_corridor(seed, 2.0);
        let (rms_m, largest_m) = offsets_m(&world, Pose2::new(-0.5, 0.0, 0.0), size);
        println!("world {seed}: RMS {rms_m:.4} m, largest {largest_m:.4} m");
        assert!(rms_m <= 0.05, "world {seed}: RMS offset {rms_m} m");
        assert!(largest_m < 0.5, "world {seed}: {largest_m} m off");
    }
}

#[test]
fn comes_to_the_middle_from_the_side() {
    for (y, degrees) in [(0.4, 15.0_f64), (-0.4, -10.0)] {
        let world = World::random_corridor(11, 2.0);
        let mut drive =
            drive(&world, Pose2::new(-0.5, y, degrees.to_radians()), (256, 240), "speed_mps = 0.4");
        while drive.robot.x < 6.0 {
            drive.step();
            assert!(drive.robot.y.abs() < 0.7, "almost touches a wall at {:?}", drive.robot);
            assert!(drive.now_s() < 60.0);
        }
        assert!(drive.robot.y.abs() < 0.08, "from {y}: {} m off after 6.5 m", drive.robot.y);
    }
}

#[test]
fn a_joint_of_the_floor_is_no_wall_where_floor_goes_on() {
    // Planks whose joints are longer and of more contrast than the feet of the walls.
    let overrides = ["boxes = 0", "person = \"none\""].map(str::to_owned);
    let building = Building::new(2142, &overrides).expect("a building");
    let false_walls = |keys: &str| {
        let (intrinsics, mount) = building.camera();
        let mut drive = CameraDrive::new(
            Bench::<WallFollower>::new(keys, setup(intrinsics, mount, Calibration::Measured)).expect("valid"),
            CameraView { intrinsics, mount, robot: Pose2::IDENTITY },
            Scene::new(&building.world, 0).expect("a valid world"),
            Renderer::new(building.photometry(), stream(7, "drive")),
            Sensors { latency_ticks: 3, drift_rad_per_m: 0.0 },
        );
        // Along the middle in any case: what the wall-follower sees depends on where it drives.
        drive.led = Some(Twist::planar(0.3, 0.0));
        let half_m = 0.5 * building.properties.width_m;
        let (mut seen, mut inside) = (0, 0);
        while drive.robot.x < 4.0 && drive.now_s() < 40.0 {
            drive.step();
            let Some(estimate) = drive.bench.behavior.estimate().filter(|_| drive.robot.x > 1.5) else {
                continue;
            };
            let walls = [estimate.walls.left_m, estimate.walls.right_m.map(|right_m| -right_m)];
            for (wall_m, true_m) in walls.into_iter().zip([half_m - drive.robot.y, half_m + drive.robot.y]) {
                seen += i32::from(wall_m.is_some());
                inside += i32::from(wall_m.is_some_and(|wall_m| wall_m < true_m - 0.15));
            }
        }
        println!("{keys}: {inside} of {seen} walls are joints");
        assert!(seen > 100, "{seen}");
        f64::from(inside) / f64::from(seen)
    };
    let [with, without] = ["uses_motion = true", "uses_motion = false"].map(false_walls);
    assert!(without > 0.1, "the test needs joints that pass for walls: {without}");
    assert!(with < 0.1 * without, "{with} instead of {without}");
}

#[test]
fn coasts_in_the_dark_then_searches_then_reports() {
    let world = World::random_corridor(5, 2.0);
    let mut drive = drive(&world, Pose2::new(0.0, 0.0, 0.0), (256, 240), "speed_mps = 0.4");
    let mut cruising = 0.0_f64;
    for i in 0..250 {
        drive.step();
        if i >= 200 {
            cruising = cruising.max(drive.proposal.twist.linear);
        }
    }
    assert!(cruising > 0.3, "{cruising} m/s, {:?}", drive.proposal.reason());
    drive.light = Light::Uniform(0);
    let (dark_from_s, mut reasons) = (drive.now_s(), Vec::new());
    while drive.now_s() < dark_from_s + 60.0 {
        drive.step();
        let reason = drive.proposal.reason();
        if drive.now_s() - dark_from_s > 0.5 && reasons.last() != Some(&reason) {
            reasons.push(reason);
        }
        let dark_s = drive.now_s() - dark_from_s;
        let speed =
            if drive.proposal.kind() == Some(Kind::Drive) { drive.proposal.twist.linear } else { 0.0 };
        assert!(speed <= cruising + 1e-9, "a failure raised the speed to {speed}");
        if dark_s > 0.3 {
            assert!(speed <= 0.2 + 1e-9, "{speed} m/s after {dark_s} s in the dark");
        }
        if dark_s > 1.3 + TICK_S {
            assert!(speed == 0.0, "still drives after {dark_s} s in the dark");
        }
    }
    assert_eq!(reasons, [Some(Reason::Coasting), Some(Reason::Searching), Some(Reason::TooFewSegments)]);
    drive.light = Light::Normal;
    for _ in 0..100 {
        drive.step();
    }
    assert!(drive.proposal.twist.linear > 0.2, "light again: {:?}", drive.proposal.reason());
}

#[test]
fn creeps_on_in_the_dark_for_two_meters_where_others_see_the_way() {
    let world = World::random_corridor(5, 2.0);
    let mut drive = drive(&world, Pose2::IDENTITY, (256, 240), "speed_mps = 0.4\nlost = { creep_m = 2.0 }");
    for _ in 0..250 {
        drive.step();
    }
    drive.light = Light::Uniform(0);
    let (dark_from_s, mut creeping_s) = (drive.now_s(), 0.0);
    while drive.now_s() < dark_from_s + 40.0 {
        drive.step();
        let is_driving = drive.proposal.kind() == Some(Kind::Drive) && drive.proposal.twist.linear > 0.0;
        if is_driving && drive.now_s() - dark_from_s > 1.3 + TICK_S {
            assert_eq!(
                (drive.proposal.twist.linear, drive.proposal.reason()),
                (0.1, Some(Reason::Searching))
            );
            creeping_s += TICK_S;
        }
    }
    // Two meters less what it coasted.
    assert!((15.0..20.0).contains(&creeping_s), "crept for {creeping_s} s");
    assert_eq!(drive.proposal.reason(), Some(Reason::TooFewSegments), "then searched in vain");
}
