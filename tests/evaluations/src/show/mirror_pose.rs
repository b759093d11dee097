//! The map-localizer on one image of a mirror camera.

use clap::{Args, ValueEnum};
use nalgebra::{Point3, Vector2};
use yamabico_core::camera::MirrorCamera;
use yamabico_core::geometry::Pose2;
use yamabico_core::testing::Bench;
use yamabico_drawing::Canvas;
use yamabico_map_localizer::MapLocalizer;
use yamabico_map_localizer::azimuth::AzimuthFinder;
use yamabico_map_localizer::finder::Finder;
use yamabico_map_localizer::floor_outline::{FloorFinder, FloorPlanFile};
use yamabico_rigs::mirror_robot::{MirrorRobot, localizer_parameters};
use yamabico_vision::polygon::sides;

use crate::arguments::At;
use crate::images::{Output, posterize};
use crate::report::{Report, Table, number};

const GREEN: [u8; 3] = [0, 230, 60];
const ORANGE: [u8; 3] = [255, 130, 0];
const YELLOW: [u8; 3] = [255, 220, 0];
const MAGENTA: [u8; 3] = [255, 0, 200];

/// Robot and world of the configurations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum World {
    /// A room with a conic mirror: azimuths of vertical edges.
    Room,
    /// A soccer field with a hyperboloidal mirror: outline of the floor.
    Field,
}

/// Pose that the map-localizer finds in one rendered image of a mirror camera, from an estimate 4 cm and 2 degrees off.
///
/// Image of the room: edges of the map green, other edges orange. Image of the field: detected outline of the floor yellow, plan from the
/// pose that was found magenta.
#[derive(Args)]
pub struct Arguments {
    /// Robot and world.
    world: World,
    #[command(flatten)]
    at: At,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let (name, default) = match self.world {
            World::Room => ("room", [-0.9, -0.7, 40.0]),
            World::Field => ("field", [-0.4, 0.05, 20.0]),
        };
        let truth = self.at.or(default);
        let estimate = Pose2::new(truth.x + 0.03, truth.y - 0.03, truth.theta + 0.035);
        let mut robot = MirrorRobot::new(name);
        let pixels = robot.render(truth, 1);
        let mut bench =
            Bench::<MapLocalizer>::new(&localizer_parameters(name, &estimate), robot.setup.clone())
                .map_err(|error| error.to_string())?;
        robot.feed(&mut bench, 0.0, &pixels);
        bench.propose();
        let localizer = &bench.behavior;
        let (status, reason) = localizer.status();
        let pose = localizer.belief().ok_or("the localizer has no pose")?.pose;
        let mut table = Table::new("Pose error", &["status", "reason", "before, mm", "after, mm"]);
        table.row([
            status.as_str().into(),
            reason.as_str().into(),
            number(1e3 * estimate.distance(&truth), 1),
            number(1e3 * pose.distance(&truth), 1),
        ]);
        if out.is_on() {
            self.draw(out, name, &robot, &pixels, localizer, &pose)?;
        }
        Ok(Report::new([table]))
    }

    fn draw(
        &self,
        out: &Output,
        name: &str,
        robot: &MirrorRobot,
        pixels: &[u8],
        localizer: &MapLocalizer,
        pose: &Pose2,
    ) -> Result<(), String> {
        let [width, height] = robot.camera.image().size().map(|size| size as usize);
        let (scale, channels) = if self.world == World::Field { (2, 3) } else { (1, 1) };
        let mut data = Vec::with_capacity(3 * scale * width * scale * height);
        for v in 0..scale * height {
            for u in 0..scale * width {
                let first = channels * (v / scale * width + u / scale);
                data.extend([0, 1, 2].map(|c: usize| pixels[first + c.min(channels - 1)]));
            }
        }
        posterize(&mut data, 28);
        let mut canvas =
            Canvas::new(&mut data, scale * width, scale * height).ok_or("an image without pixels")?;
        match localizer.finder() {
            Finder::Azimuth(finder) => draw_edges(&mut canvas, &robot.camera, finder),
            Finder::FloorOutline(finder) => {
                let file = yamabico_testkit::config("maps/field-plan.toml");
                let plan = FloorPlanFile::read(&file).map_err(|error| error.to_string())?;
                draw_floor(&mut canvas, &robot.camera, finder, &plan, pose, robot.mount.z);
            }
            _ => return Err("the localizer has another method".to_owned()),
        }
        out.rgb(&format!("mirror_pose_{name}"), &data, (scale * width) as u32, (scale * height) as u32)
    }
}

fn draw_edges(canvas: &mut Canvas, camera: &MirrorCamera, finder: &AzimuthFinder) {
    let image = camera.image();
    for (edge, edge_of_map) in finder.seen().iter().zip(finder.localizer().edge_of_seen()) {
        let color = if edge_of_map.is_some() { GREEN } else { ORANGE };
        let outer = image.rim_radius_px() - 2.0;
        let inner = edge.inner_radius_px().unwrap_or(outer - edge.length_px);
        let at = |radius| image.pixel_from_polar(radius, edge.azimuth_rad);
        for shift in [-1.0, 0.0, 1.0].map(Vector2::repeat) {
            canvas.line(at(inner) + shift, at(outer) + shift, color);
        }
    }
}

fn draw_floor(
    canvas: &mut Canvas,
    camera: &MirrorCamera,
    finder: &FloorFinder,
    plan: &FloorPlanFile,
    pose: &Pose2,
    height_m: f64,
) {
    let twice = |pixel: Vector2<f64>| pixel * 2.0 + Vector2::repeat(0.5);
    let corner = |point: &nalgebra::Point2<f64>| twice(camera.image().pixel_from_mirror(point.coords));
    for [a, b] in sides(finder.localizer().outline().hull()) {
        canvas.line(corner(&a), corner(&b), YELLOW);
    }
    let robot_from_map = pose.inverse();
    for [a, b] in sides(&plan.corners()) {
        let at = |share: f64| {
            let point = robot_from_map.transform_point(a + (b - a) * share);
            camera.pixel_from_point(&Point3::new(point.x, point.y, -height_m)).ok()
        };
        for step in 0..20 {
            let (from, to) = (at(f64::from(step) / 20.0), at(f64::from(step + 1) / 20.0));
            if let (Some(from), Some(to)) = (from, to) {
                canvas.line(twice(from), twice(to), MAGENTA);
            }
        }
    }
}
