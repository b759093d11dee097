//! A robot with a camera in the rendered hallway, localized and driven by the map-localizer alone.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::FrameHeader;
use yamabico_core::sensor::Robot;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_map_localizer::MapLocalizer;
use yamabico_rigs::camera::{empty_hallway, forward_camera};
use yamabico_rigs::camera_drive::{CameraDrive, Sensors, TICK_S};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};

/// The robot of these tests.
pub type Drive = CameraDrive<MapLocalizer>;

/// Returns the camera of the tests: 60 degrees wide, 6 degrees down.
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    forward_camera(width, height, 60.0, 6.0)
}

/// Returns a robot of 0.2 m radius with that camera.
pub fn setup(width: u32, height: u32) -> Setup {
    let (intrinsics, mount) = camera(width, height);
    Setup {
        folder: yamabico_testkit::configs(),
        robot: Robot { radius_m: 0.2, ..Robot::default() },
        ..camera_setup(intrinsics, mount)
    }
}

/// Returns parameters with the hallway's map, and more keys.
pub fn toml(more: &str) -> String {
    format!("map = \"maps/hallway.toml\"\n{more}")
}

/// Returns the header of a gray frame of this size, captured at `seconds`.
pub fn frame_header(width: u32, height: u32, seconds: f64) -> FrameHeader {
    FrameHeader::gray(width, height, Time::from_secs_f64(seconds).0)
}

/// Places a robot into the empty hallway.
pub fn drive(robot: Pose2, more: &str) -> Drive {
    let (intrinsics, mount) = camera(256, 240);
    CameraDrive::new(
        Bench::new(&toml(more), setup(256, 240)).expect("valid parameters"),
        CameraView { intrinsics, mount, robot },
        Scene::new(&empty_hallway(), 0).expect("a valid world"),
        Renderer::new(Photometry::default(), stream(7, "drive")),
        Sensors { latency_ticks: 2, drift_rad_per_m: 0.5_f64.to_radians() },
    )
}

/// Returns position and heading error of the published pose, m and rad.
pub fn pose_error(drive: &Drive) -> (f64, f64) {
    let pose = drive.pose.expect("a pose");
    let pose = Pose2::new(pose.x, pose.y, pose.theta);
    // The pose was published before the robot moved.
    let truth = drive.robot.integrate(&drive.twist(), -TICK_S);
    (pose.distance(&truth), angle_difference(pose.theta, truth.theta).abs())
}
