//! A robot with a camera in a rendered corridor, driven by the wall follower alone.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Calibration, Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::sensor::SensorKind;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_rigs::camera::forward_camera;
use yamabico_rigs::camera_drive::{CameraDrive, Sensors};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_wall_follower::WallFollower;

/// Returns the camera of the tests: 60 degrees wide, 5 degrees down.
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    forward_camera(width, height, 60.0, 5.0)
}

/// Returns a robot with that camera in the behavior's slot.
pub fn setup(intrinsics: Intrinsics, mount: Mount, calibration: Calibration) -> Setup {
    let mut setup = camera_setup(intrinsics, mount);
    if let SensorKind::Camera { calibrated, .. } = &mut setup.sensors[0].1.kind {
        *calibrated = calibration;
    }
    setup
}

/// Renders an image of a corridor 2 m wide from a pose.
pub fn render(intrinsics: Intrinsics, mount: Mount, robot: Pose2) -> Vec<u8> {
    let scene = Scene::new(&World::random_corridor(3, 2.0), 0).expect("a valid world");
    let mut renderer = Renderer::new(Photometry::default(), stream(3, "picture"));
    yamabico_rigs::camera::render(&mut renderer, &scene, &CameraView { intrinsics, mount, robot })
}

/// Places a robot into the world; its camera has images of this size.
pub fn drive(world: &World, robot: Pose2, size: (u32, u32), toml: &str) -> CameraDrive<WallFollower> {
    let (intrinsics, mount) = camera(size.0, size.1);
    CameraDrive::new(
        Bench::new(toml, setup(intrinsics, mount, Calibration::Measured)).expect("valid parameters"),
        CameraView { intrinsics, mount, robot },
        Scene::new(world, 0).expect("a valid world"),
        Renderer::new(Photometry::default(), stream(7, "drive")),
        Sensors { latency_ticks: 3, drift_rad_per_m: 0.3_f64.to_radians() },
    )
}
