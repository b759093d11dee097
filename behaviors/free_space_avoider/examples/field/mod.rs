//! What the examples share: a robot with a mirror camera on a small field, pictures of the simulator, and a picture of what the
//! behaviour saw.

use std::path::Path;

use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use nalgebra::Vector2;
use yamabico_core::behavior::Setup;
use yamabico_core::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Encoding, FrameHeader, Message, Odometry, Proposal};
use yamabico_core::sensor::{Calibration, MotionLimits, Robot, SensorInfo, SensorKind};
use yamabico_core::time::Time;
use yamabico_core::vision::overlay::{Canvas, Colour};
use yamabico_free_space_avoider::polar_cells::RingSight;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene};

/// Four walls and four cubes; the seed moves the cubes.
pub const FIELD: &str = include_str!("field.toml");
/// Height of the lens above the floor, metres.
pub const LENS_M: f64 = 0.165;
/// Radius of the robot, metres.
pub const RADIUS_M: f64 = 0.08;
/// What the behaviour is told besides its defaults.
pub const CONFIG: &str = "method = 'polar-cells'\nspeed_mps = 0.4\nmargin_m = 0.03\nturn_rad_s = 2.0\n";

/// The mirror of Sekimori et al., seen in 256 x 220 pixels.
pub fn camera() -> MirrorCamera {
    let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
    let mirror = HyperboloidalMirror::from_floor_formula(formula, LENS_M).expect("a hyperboloid");
    let image = MirrorImage::centred(256, 220).with_ring(22.0, 112.0).expect("a ring");
    MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).expect("a camera")
}

/// A robot with this camera whose drive has these axes.
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

/// The header of a colour picture.
pub fn frame_header(seconds: f64) -> FrameHeader {
    FrameHeader {
        stamp_ns: Time::from_secs_f64(seconds).0,
        width: 256,
        height: 220,
        stride: 3 * 256,
        encoding: Encoding::Rgb8.code(),
        ..FrameHeader::default()
    }
}

/// A colour picture of the scene.
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

/// Writes the picture, twice as large: free cells outlined green, the first blocked cell of each direction red, and a line from
/// the centre, as long as the robot drives in a second, magenta.
pub fn draw(pixels: &[u8], sight: &RingSight, proposal: &Proposal, path: &Path) -> Result<(), String> {
    const SCALE: usize = 2;
    let (columns, rows) = (sight.image().width as usize, sight.image().height as usize);
    let (width, height) = (SCALE * columns, SCALE * rows);
    let mut data = Vec::with_capacity(3 * width * height);
    for v in 0..height {
        for u in 0..width {
            let pixel = &pixels[3 * (v / SCALE * columns + u / SCALE)..][..3];
            // Thirteen levels are enough to look at, and make small files.
            data.extend(pixel.iter().map(|level| level / 20 * 20));
        }
    }
    let mut canvas = Canvas::new(&mut data, width, height).ok_or("a canvas of the wrong size")?;
    let at = |radius_px: f64, azimuth: f64| {
        let half = Vector2::repeat(0.5 * (SCALE as f64 - 1.0));
        sight.image().pixel_from_polar(radius_px, azimuth) * SCALE as f64 + half
    };
    let distances = sight.distances();
    let cell = |canvas: &mut Canvas, ring: usize, sector: usize, colour: Colour| {
        let (right, left) = distances.borders(sector);
        let (right, left) = (right + 0.015, left - 0.015);
        let (inner, outer) = (sight.edges_px()[ring] + 0.7, sight.edges_px()[ring + 1] - 0.7);
        let corners = [(inner, right), (outer, right), (outer, left), (inner, left), (inner, right)];
        for pair in corners.windows(2) {
            canvas.line(at(pair[0].0, pair[0].1), at(pair[1].0, pair[1].1), colour);
        }
    };
    for (sector, &free) in sight.free().rings().iter().enumerate() {
        for ring in 0..free {
            cell(&mut canvas, ring, sector, [70, 230, 90]);
        }
        if free + 1 < sight.edges_px().len() {
            cell(&mut canvas, free, sector, [255, 50, 30]);
        }
    }
    let velocity = Vector2::new(proposal.twist.linear, proposal.twist.lateral);
    if velocity.norm() > 0.0 {
        let azimuth = velocity.y.atan2(velocity.x);
        let reach = sight.edges_m().iter().filter(|&&edge| edge <= velocity.norm()).count();
        let radius_px = sight.edges_px()[reach.clamp(1, sight.edges_px().len() - 1)];
        let aside = Vector2::new(-azimuth.sin(), azimuth.cos());
        for side in -4..=4 {
            let shift =
                sight.image().pixel_from_mirror(aside * (0.3 * f64::from(side))) - sight.image().centre();
            canvas.line(at(4.0, azimuth) + shift * 3.0, at(radius_px, azimuth) + shift * 3.0, [255, 0, 255]);
        }
    }
    let cannot = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let file = std::fs::File::create(path).map_err(|e| cannot(&e))?;
    PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::NoFilter)
        .write_image(&data, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| cannot(&e))
}
