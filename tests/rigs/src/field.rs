//! A small soccer field with four cubes, and a robot with a mirror camera on it.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{
    Calibration, FloorFormula, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, Mount,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Encoding, FrameHeader, Message, Odometry};
use yamabico_core::sensor::{MotionLimits, Robot, SensorInfo, SensorKind};
use yamabico_core::time::Time;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World};

/// World file of the field: four walls and four cubes; the seed of the scene moves the cubes.
pub const FIELD: &str = include_str!("field.toml");
/// Height of the lens above the floor, m.
pub const LENS_M: f64 = 0.165;
/// Radius of the robot, m.
pub const RADIUS_M: f64 = 0.08;
/// Width and height of the images, px.
pub const SIZE: [u32; 2] = [256, 220];
/// Parameters of the free-space avoider for this robot.
pub const CONFIG: &str = "method = 'polar-cells'\nspeed_mps = 0.4\nmargin_m = 0.03\nturn_radps = 2.0\n";

/// Returns the scene of the field with seed 1.
///
/// # Panics
/// Never: the world is valid.
#[must_use]
pub fn scene() -> Scene {
    Scene::new(&World::from_toml(FIELD).expect("a valid world"), 1).expect("a valid world")
}

/// Returns the mirror camera of Sekimori et al., 256 x 220 pixels.
///
/// # Panics
/// Never: the camera is valid.
#[must_use]
pub fn camera() -> MirrorCamera {
    let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
    let mirror = HyperboloidalMirror::from_floor_formula(formula, LENS_M).expect("a hyperboloid");
    let image = MirrorImage::centered(SIZE[0], SIZE[1]).with_ring(22.0, 112.0).expect("a ring");
    MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).expect("a camera")
}

/// Returns a renderer of this camera with sensor noise.
#[must_use]
pub fn renderer(camera: MirrorCamera) -> MirrorRenderer {
    MirrorRenderer::new(camera, Photometry::default(), yamabico_sim::random::stream(1, "noise"))
}

/// Renders a color image of the scene.
///
/// # Panics
/// If the renderer has another image size.
#[must_use]
pub fn render(renderer: &mut MirrorRenderer, scene: &Scene, robot: Pose2) -> Vec<u8> {
    let mut pixels = vec![0; (3 * SIZE[0] * SIZE[1]) as usize];
    let view = MirrorView { mount: Mount::level(LENS_M), robot };
    renderer.render_rgb(scene, &view, &mut pixels).expect("an image of the right size");
    pixels
}

/// Returns a robot with this camera whose drive has these axes.
#[must_use]
pub fn setup(camera: MirrorCamera, axes: Axes) -> Setup {
    let sensor = |name: &str, message, period_s, latency_s, kind| SensorInfo {
        name: name.into(),
        message,
        period_s,
        latency_s,
        kind,
    };
    let (mount, calibrated) = (Mount::level(LENS_M), Calibration::Measured);
    let kind = SensorKind::MirrorCamera { camera: Box::new(camera), mount, calibrated };
    let limits = MotionLimits {
        speed: [0.6, 0.6, 3.0],
        acceleration: [0.3, 0.3, 8.0],
        deceleration: [0.3, 0.3, 8.0],
        jerk: [20.0, 20.0, 200.0],
        ..MotionLimits::default()
    };
    Setup {
        robot: Robot { radius_m: RADIUS_M, axes, limits, ..Robot::default() },
        sensors: vec![
            ("camera".into(), sensor("around", FrameHeader::NAME, 0.04, 0.02, kind)),
            ("odometry".into(), sensor("wheels", Odometry::NAME, 0.02, 0.0, SensorKind::Other)),
        ],
        ..Setup::default()
    }
}

/// Returns the header of a color frame captured at `seconds`.
#[must_use]
pub fn frame_header(seconds: f64) -> FrameHeader {
    FrameHeader {
        stamp_ns: Time::from_secs_f64(seconds).0,
        width: SIZE[0],
        height: SIZE[1],
        stride: 3 * SIZE[0],
        encoding: Encoding::Rgb8.code(),
        ..FrameHeader::default()
    }
}
