//! The robots with a mirror camera of `configs/robots`, in their worlds.

use yamabico_core::behavior::{Plugin, Setup};
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{Calibration, MirrorCamera, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Encoding, FrameHeader, Message, Odometry};
use yamabico_core::sensor::{Robot, SensorInfo, SensorKind};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World, random};

use crate::camera::{CAMERA, ODOMETRY};

/// A robot in its world.
pub struct MirrorRobot {
    /// Sensors and dimensions, for the slots `camera` and `odometry` of a behavior.
    pub setup: Setup,
    /// World of the robot.
    pub world: World,
    /// Mount of the mirror camera.
    pub mount: Mount,
    /// The mirror camera.
    pub camera: MirrorCamera,
    renderer: MirrorRenderer,
    encoding: Encoding,
    size: [u32; 2],
}

impl MirrorRobot {
    /// Reads the robot `robots/sim-NAME.toml` and the world `worlds/NAME.toml`.
    ///
    /// # Panics
    /// If a file is missing or invalid.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let robot = robot_file(&format!("sim-{name}.toml"));
        let sensor = robot["sensors"]["around"].clone();
        let part = |key: &str| sensor[key].clone();
        let image = part("picture").try_into().expect("the image");
        let camera = mirror_camera(&image, &part("mirror").try_into().expect("a mirror")).expect("a camera");
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
                folder: yamabico_testkit::configs(),
                robot: Robot { radius_m, ..Robot::default() },
                sensors: vec![
                    (CAMERA.name.into(), info("around", FrameHeader::NAME, 0.1, kind)),
                    (ODOMETRY.name.into(), info("wheels", Odometry::NAME, 0.02, SensorKind::Other)),
                ],
                ..Setup::default()
            },
            world: crate::camera::world(name),
            mount,
            camera: camera.clone(),
            renderer: MirrorRenderer::new(camera, Photometry::default(), random::stream(1, "mirror")),
            encoding: if is_color { Encoding::Rgb8 } else { Encoding::Gray8 },
            size,
        }
    }

    /// Renders an image from a pose in the world that the seed produces.
    ///
    /// # Panics
    /// If the world is invalid.
    pub fn render(&mut self, robot: Pose2, seed: u64) -> Vec<u8> {
        let scene = Scene::new(&self.world, seed).expect("a valid world");
        let view = MirrorView { mount: self.mount, robot };
        let pixels = (self.size[0] * self.size[1]) as usize;
        let rendered = if self.encoding == Encoding::Rgb8 {
            let mut data = vec![0; 3 * pixels];
            self.renderer.render_rgb(&scene, &view, &mut data).map(|()| data)
        } else {
            let mut data = vec![0; pixels];
            self.renderer.render(&scene, &view, &mut data).map(|()| data)
        };
        rendered.expect("an image of the right size")
    }

    /// Feeds a frame and odometry at rest to the behavior at `seconds`.
    pub fn feed<B: Plugin>(&self, bench: &mut Bench<B>, seconds: f64, pixels: &[u8]) {
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let [width, height] = self.size;
        let stride = if self.encoding == Encoding::Rgb8 { 3 * width } else { width };
        let encoding = self.encoding.code();
        let header = FrameHeader { stamp_ns, width, height, stride, encoding, ..FrameHeader::default() };
        let odometry = Odometry { stamp_ns, ..Odometry::default() };
        bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, pixels);
    }
}

/// Returns parameters of the map-localizer for robot `name` with a pose estimate within 5 cm and 3 degrees of `start`.
#[must_use]
pub fn localizer_parameters(name: &str, start: &Pose2) -> String {
    let method = match name {
        "field" => {
            "method = \"floor-outline\"\nfloor_plan = \"maps/field-plan.toml\"\n\
             floor_colors = \"maps/field-floor.toml\"\n"
        }
        _ => "method = \"azimuth\"\nedge_map = \"maps/room.toml\"\nmap_sigma_m = 0.003\n",
    };
    let Pose2 { x, y, theta } = start;
    let degrees = theta.to_degrees();
    format!(
        "{method}start = {{ x_m = {x:?}, y_m = {y:?}, heading_deg = {degrees:?}, sigma_m = 0.05, sigma_deg = 3 }}"
    )
}

/// Reads `configs/robots/FILE` with its included parts.
fn robot_file(file: &str) -> toml::Table {
    let text = yamabico_testkit::config_text(&format!("robots/{file}"));
    let mut table: toml::Table = text.parse().expect("a robot file");
    if let Some(toml::Value::Array(parts)) = table.remove("include") {
        for part in parts {
            merge(&mut table, robot_file(part.as_str().expect("the path of a part")));
        }
    }
    table
}

/// Adds the keys of `part` to `table`, in subtables too.
fn merge(table: &mut toml::Table, part: toml::Table) {
    for (key, value) in part {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(table)), toml::Value::Table(part)) => merge(table, part),
            (Some(_), _) => {}
            (None, value) => {
                table.insert(key, value);
            }
        }
    }
}
