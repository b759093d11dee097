//! Robots with a mirror camera in the worlds of the configurations, and what they see there.

use std::path::PathBuf;

use yamabico_core::behavior::Setup;
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{Calibration, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Encoding, FrameHeader, Message, Odometry};
use yamabico_core::sensor::{Robot, SensorInfo, SensorKind};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World, random};

/// A robot of the configurations, in its world.
pub struct MirrorRobot {
    pub setup: Setup,
    pub world: World,
    pub mount: Mount,
    renderer: MirrorRenderer,
    encoding: Encoding,
    size: [u32; 2],
}

impl MirrorRobot {
    /// The robot `robots/sim-NAME.toml` in the world `worlds/NAME.toml`.
    pub fn new(name: &str) -> Self {
        let configs = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs"));
        let read = |file: String| std::fs::read_to_string(configs.join(file)).expect("a configuration");
        let world = World::from_toml(&read(format!("worlds/{name}.toml"))).expect("a world");
        let robot: toml::Table = read(format!("robots/sim-{name}.toml")).parse().expect("a robot");
        let sensor = robot["sensors"]["around"].clone();
        let part = |key: &str| sensor[key].clone();
        let picture = part("picture").try_into().expect("a picture");
        let camera =
            mirror_camera(&picture, &part("mirror").try_into().expect("a mirror")).expect("a camera");
        let mount = Mount::level(sensor["mount"]["z_m"].as_float().expect("a height"));
        let is_color = sensor.get("encoding").and_then(toml::Value::as_str) == Some("rgb8");
        let radius_m = robot["footprint"]["radius_m"].as_float().expect("a radius");
        let size = camera.image().size();
        let info = |name: &str, message: &'static str, period_s, kind| SensorInfo {
            name: name.into(),
            message,
            period_s,
            latency_s: 0.0,
            kind,
        };
        let kind = SensorKind::MirrorCamera {
            camera: Box::new(camera.clone()),
            mount,
            calibrated: Calibration::Measured,
        };
        Self {
            setup: Setup {
                folder: configs,
                robot: Robot { radius_m, ..Robot::default() },
                sensors: vec![
                    (CAMERA.name.into(), info("around", FrameHeader::NAME, 0.1, kind)),
                    (ODOMETRY.name.into(), info("wheels", Odometry::NAME, 0.02, SensorKind::Other)),
                ],
                ..Setup::default()
            },
            world,
            mount,
            renderer: MirrorRenderer::new(camera, Photometry::default(), random::stream(1, "mirror")),
            encoding: if is_color { Encoding::Rgb8 } else { Encoding::Gray8 },
            size,
        }
    }

    /// What the robot sees from here, in the world as the seed makes it.
    pub fn see(&mut self, robot: Pose2, seed: u64) -> Vec<u8> {
        let scene = Scene::new(&self.world, seed).expect("a scene");
        let view = MirrorView { mount: self.mount, robot };
        let pixels = (self.size[0] * self.size[1]) as usize;
        let rendered = if self.encoding == Encoding::Rgb8 {
            let mut data = vec![0; 3 * pixels];
            self.renderer.render_rgb(&scene, &view, &mut data).map(|()| data)
        } else {
            let mut data = vec![0; pixels];
            self.renderer.render(&scene, &view, &mut data).map(|()| data)
        };
        rendered.expect("a picture")
    }

    /// Shows a picture to the behavior, `seconds` after the start, of a robot that has not moved.
    pub fn show(&self, bench: &mut Bench<MapLocalizer>, seconds: f64, pixels: &[u8]) {
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let [width, height] = self.size;
        let stride = if self.encoding == Encoding::Rgb8 { 3 * width } else { width };
        let encoding = self.encoding.code();
        let header = FrameHeader { stamp_ns, width, height, stride, encoding, ..FrameHeader::default() };
        let odometry = Odometry { stamp_ns, ..Odometry::default() };
        bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, pixels);
    }
}

/// The keys of the behavior with a mirror camera, believed at this pose to 5 cm and 3 degrees.
pub fn keys(name: &str, believed: &Pose2) -> String {
    let method = match name {
        "field" => {
            "method = \"floor-outline\"\nfloor_plan = \"maps/field-plan.toml\"\n\
             floor_colors = \"maps/field-floor.toml\"\n"
        }
        _ => "method = \"azimuth\"\nedge_map = \"maps/room.toml\"\nmap_sigma_m = 0.003\n",
    };
    let Pose2 { x, y, theta } = believed;
    let degrees = theta.to_degrees();
    format!(
        "{method}start = {{ x_m = {x:?}, y_m = {y:?}, heading_deg = {degrees:?}, sigma_m = 0.05, sigma_deg = 3 }}"
    )
}
