//! The forward camera of the indoor robots: 0.6 m above the floor, tilted down.

use yamabico_core::behavior::Slot;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{FrameHeader, Odometry};
use yamabico_core::time::Time;
use yamabico_sim::{CameraView, Renderer, Scene, World};

/// Height of the camera above the floor, m.
pub const HEIGHT_M: f64 = 0.6;
/// Input slot `camera` of a behavior under test.
pub const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames");
/// Input slot `odometry` of a behavior under test.
pub const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion");

/// Returns the camera with this horizontal field of view and downward tilt, degrees.
#[must_use]
pub fn forward_camera(width: u32, height: u32, fov_deg: f64, tilt_deg: f64) -> (Intrinsics, Mount) {
    let intrinsics = Intrinsics::from_horizontal_fov(width, height, fov_deg.to_radians());
    (intrinsics, Mount::tilted(HEIGHT_M, tilt_deg.to_radians()))
}

/// Returns the header of a gray frame of this camera, captured at `seconds`.
#[must_use]
pub fn frame_header(intrinsics: &Intrinsics, seconds: f64) -> FrameHeader {
    FrameHeader::gray(intrinsics.width, intrinsics.height, Time::from_secs_f64(seconds).0)
}

/// Returns an odometry message stamped `seconds`.
#[must_use]
pub fn odometry(seconds: f64, pose: Pose2, twist: Twist) -> Odometry {
    Odometry::new(Time::from_secs_f64(seconds).0, &pose, &twist)
}

/// Reads the world `configs/worlds/NAME.toml`.
///
/// # Panics
/// If the file is missing or invalid.
#[must_use]
pub fn world(name: &str) -> World {
    let text = yamabico_testkit::config_text(&format!("worlds/{name}.toml"));
    World::from_toml(&text).unwrap_or_else(|error| panic!("worlds/{name}.toml: {error}"))
}

/// Reads the hallway of `configs/worlds/hallway.toml` without its people.
#[must_use]
pub fn empty_hallway() -> World {
    World { people: Vec::new(), ..world("hallway") }
}

/// Renders a gray image of the scene.
///
/// # Panics
/// If the view is invalid.
#[must_use]
pub fn render(renderer: &mut Renderer, scene: &Scene, view: &CameraView) -> Vec<u8> {
    let mut pixels = vec![0; (view.intrinsics.width * view.intrinsics.height) as usize];
    renderer.render(scene, view, &mut pixels).expect("a valid view");
    pixels
}
