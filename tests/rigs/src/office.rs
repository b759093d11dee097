//! The office of `configs/office.toml`, and a robot with a camera that looks down at its floor.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::sensor::Robot;
use yamabico_core::testing::camera_setup;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};

/// Radius of the robot, m.
pub const RADIUS_M: f64 = 0.2;

/// Returns the scene of the office.
///
/// # Panics
/// If the world file is missing or invalid.
#[must_use]
pub fn scene() -> Scene {
    Scene::new(&crate::camera::world("office"), 1).expect("a valid world")
}

/// Returns lens and sensor of the robot's camera in the office.
#[must_use]
pub fn photometry() -> Photometry {
    Photometry { exposure: 0.65, ..Photometry::default() }
}

/// Returns the robot's camera for images of this size.
#[must_use]
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    let mount = Mount { x: 0.1, ..Mount::tilted(0.4, 28_f64.to_radians()) };
    (Intrinsics::from_horizontal_fov(width, height, 90_f64.to_radians()), mount)
}

/// Returns a robot with this camera.
#[must_use]
pub fn setup(intrinsics: Intrinsics, mount: Mount) -> Setup {
    let robot = Robot { radius_m: RADIUS_M, ..Robot::default() };
    Setup { robot, ..camera_setup(intrinsics, mount) }
}

/// Renders an image of the scene.
///
/// # Errors
/// If the view is invalid.
pub fn render(
    renderer: &mut Renderer,
    scene: &Scene,
    (intrinsics, mount): (Intrinsics, Mount),
    robot: Pose2,
) -> Result<GrayImage, String> {
    let mut image = GrayImage::new(intrinsics.width as usize, intrinsics.height as usize);
    let view = CameraView { intrinsics, mount, robot };
    renderer.render(scene, &view, image.pixels_mut()).map_err(|error| error.to_string())?;
    Ok(image)
}
