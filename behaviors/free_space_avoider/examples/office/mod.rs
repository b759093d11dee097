//! The office robot, and pictures of the simulator.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::sensor::Robot;
use yamabico_core::testing::camera_setup;
use yamabico_sim::{CameraView, Renderer, Scene};

/// Radius of the robot, meters.
pub const RADIUS_M: f64 = 0.2;

/// Its camera, for a picture of another width and height.
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    let mount = Mount { x: 0.1, ..Mount::tilted(0.4, 28_f64.to_radians()) };
    (Intrinsics::from_horizontal_fov(width, height, 90_f64.to_radians()), mount)
}

/// A robot with this camera.
pub fn setup(intrinsics: Intrinsics, mount: Mount) -> Setup {
    let robot = Robot { radius_m: RADIUS_M, ..Robot::default() };
    Setup { robot, ..camera_setup(intrinsics, mount) }
}

/// A picture of the scene.
pub fn render(
    renderer: &mut Renderer,
    scene: &Scene,
    (intrinsics, mount): (Intrinsics, Mount),
    robot: Pose2,
) -> Result<GrayImage, String> {
    let mut image = GrayImage::new(intrinsics.width as usize, intrinsics.height as usize);
    renderer
        .render(scene, &CameraView { intrinsics, mount, robot }, image.pixels_mut())
        .map_err(|e| e.to_string())?;
    Ok(image)
}
