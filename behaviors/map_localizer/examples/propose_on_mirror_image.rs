//! Finds the robot in one picture of a mirror camera: `propose_on_mirror_image room|field [--at X,Y,HEADING_DEG] [--out FILE.png]`.
//!
//! The picture is rendered in the room or on the field of the configurations; the robot believes itself 4 cm and 2 degrees aside.
//! Prints what was found. In the overlay of the room: edges that are the map's (green) and that are not (orange). In that of the
//! field: the border of the floor that is seen (yellow) and the plan from the pose that was found (magenta).

#[path = "../tests/rig/mirror.rs"]
mod mirror;

use std::error::Error;

use image::RgbImage;
use mirror::{MirrorRobot, keys};
use nalgebra::{Point3, Vector2};
use yamabico_core::camera::MirrorCamera;
use yamabico_core::geometry::Pose2;
use yamabico_core::testing::Bench;
use yamabico_drawing::Canvas;
use yamabico_map_localizer::azimuth::AzimuthFinder;
use yamabico_map_localizer::finder::Finder;
use yamabico_map_localizer::floor_outline::{FloorFinder, FloorPlanFile};
use yamabico_map_localizer::{CAMERA, MapLocalizer};
use yamabico_vision::polygon::sides;

const GREEN: [u8; 3] = [0, 230, 60];
const ORANGE: [u8; 3] = [255, 130, 0];
const YELLOW: [u8; 3] = [255, 220, 0];
const MAGENTA: [u8; 3] = [255, 0, 200];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().filter(|name| name == "room" || name == "field").ok_or("room or field")?;
    let mut at = if name == "room" { [-0.9, -0.7, 40.0] } else { [-0.4, 0.05, 20.0] };
    let mut out = None;
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or("a value is missing")?;
        match argument.as_str() {
            "--at" => {
                let numbers: Result<Vec<f64>, _> = value.split(',').map(str::parse).collect();
                at = numbers?.try_into().map_err(|_| "--at X,Y,HEADING_DEG")?;
            }
            "--out" => out = Some(value),
            other => return Err(format!("unknown argument {other}").into()),
        }
    }
    let truth = Pose2::new(at[0], at[1], at[2].to_radians());
    let believed = Pose2::new(truth.x + 0.03, truth.y - 0.03, truth.theta + 0.035);
    let mut robot = MirrorRobot::new(&name);
    let pixels = robot.see(truth, 1);
    let mut bench = Bench::<MapLocalizer>::new(&keys(&name, &believed), robot.setup.clone())?;
    robot.show(&mut bench, 0.0, &pixels);
    bench.propose();
    let localizer = &bench.behavior;
    let (status, reason) = localizer.status();
    let pose = localizer.belief().ok_or("no pose")?.pose;
    println!(
        "{status:?}, {reason:?}: {:.1} mm off, {:.1} mm before",
        1e3 * pose.distance(&truth),
        1e3 * believed.distance(&truth)
    );
    let Some(out) = out else { return Ok(()) };
    let camera = robot.setup.mirror_camera(&CAMERA)?.camera;
    let [width, height] = camera.image().size();
    let scale = if name == "field" { 2 } else { 1 };
    let mut overlay = RgbImage::from_fn(scale * width, scale * height, |u, v| {
        let at = (v / scale * width + u / scale) as usize;
        let channel = |c: usize| if name == "field" { pixels[3 * at + c] } else { pixels[at] };
        // Few levels are enough to look at, and make small files.
        image::Rgb([0, 1, 2].map(|c| channel(c) / 28 * 28))
    });
    let mut canvas = Canvas::new(&mut overlay, (scale * width) as usize, (scale * height) as usize)
        .ok_or("an image of no size")?;
    match localizer.finder() {
        Finder::Azimuth(finder) => draw_edges(&mut canvas, &camera, finder),
        Finder::FloorOutline(finder) => {
            let file = robot.setup.folder.join("maps/field-plan.toml");
            draw_floor(&mut canvas, &camera, finder, &FloorPlanFile::read(&file)?, &pose, robot.mount.z);
        }
        _ => return Err("another method".into()),
    }
    Ok(overlay.save(out)?)
}

fn draw_edges(canvas: &mut Canvas, camera: &MirrorCamera, finder: &AzimuthFinder) {
    let image = camera.image();
    for (edge, of_map) in finder.seen().iter().zip(finder.localizer().edge_of_seen()) {
        let color = if of_map.is_some() { GREEN } else { ORANGE };
        let outer = image.rim_radius_px() - 2.0;
        let inner = edge.inner_radius_px().unwrap_or(outer - edge.length_px);
        let at = |radius| image.pixel_from_polar(radius, edge.azimuth_rad);
        for aside in [-1.0, 0.0, 1.0] {
            let shift = Vector2::new(aside, aside);
            canvas.line(at(inner) + shift, at(outer) + shift, color);
        }
    }
}

fn draw_floor(
    canvas: &mut Canvas,
    camera: &MirrorCamera,
    finder: &FloorFinder,
    file: &FloorPlanFile,
    pose: &Pose2,
    height_m: f64,
) {
    let twice = |pixel: Vector2<f64>| pixel * 2.0 + Vector2::repeat(0.5);
    let hull = finder.localizer().outline().hull();
    for [a, b] in sides(hull) {
        canvas.line(
            twice(camera.image().pixel_from_mirror(a.coords)),
            twice(camera.image().pixel_from_mirror(b.coords)),
            YELLOW,
        );
    }
    let robot_from_map = pose.inverse();
    for [a, b] in sides(&file.corners()) {
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
