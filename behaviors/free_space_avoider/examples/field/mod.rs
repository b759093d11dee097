//! A small field, a mirror camera and its pictures of the simulator.

use yamabico_core::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene};

/// Four walls and four cubes; the seed moves the cubes.
pub const FIELD: &str = include_str!("field.toml");
/// Height of the lens above the floor, meters.
pub const LENS_M: f64 = 0.165;
/// Radius of the robot, meters.
pub const RADIUS_M: f64 = 0.08;
/// The mirror of Sekimori et al., seen in 256 x 220 pixels.
pub fn camera() -> MirrorCamera {
    let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
    let mirror = HyperboloidalMirror::from_floor_formula(formula, LENS_M).expect("a hyperboloid");
    let image = MirrorImage::centered(256, 220).with_ring(22.0, 112.0).expect("a ring");
    MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).expect("a camera")
}

/// A color picture of the scene.
pub fn render(renderer: &mut MirrorRenderer, scene: &Scene, robot: Pose2) -> Vec<u8> {
    let mut pixels = vec![0; 3 * 256 * 220];
    let view = MirrorView { mount: Mount::level(LENS_M), robot };
    renderer.render_rgb(scene, &view, &mut pixels).expect("a picture");
    pixels
}

/// A camera with its noise.
pub fn renderer(camera: MirrorCamera) -> MirrorRenderer {
    MirrorRenderer::new(camera, Photometry::default(), yamabico_sim::random::stream(1, "noise"))
}
