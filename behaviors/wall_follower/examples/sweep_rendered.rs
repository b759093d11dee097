//! How exact heading, vanishing point and wall distances are on rendered pictures of a corridor, over many poses.
//!
//! `sweep_rendered [--json] [--poses N] [--size WxH] [--out DIR]`
//!
//! Every picture stands alone: no prediction, no memory. Heading -15 to 15 degrees, tilt -2 to 8 degrees (the behaviour is told
//! the tilt with an error of up to 0.87, half a degree rms, as a mount has it), offset up to 0.4 m from the middle of a
//! corridor 2 m wide, a new one every ten poses: closed and open doors, boxes along the walls, skirtings, floors and lamps
//! vary; noise of 4 grey levels. A wall's distance is that of the line where its skirting meets the floor. `--out` writes the
//! pictures with what was found: green the walls found, blue the true ones.

#[allow(dead_code, reason = "the other evaluations use the rest")]
mod evaluation;

use evaluation::{exit_code, percentile};
use nalgebra::{Vector2, Vector3};
use rand::RngExt;
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use yamabico_core::camera::{Intrinsics, Mount, Pinhole, clip_to_near_plane};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::sensor::Calibration;
use yamabico_core::vision::overlay::Canvas;
use yamabico_sim::random::stream;
use yamabico_sim::world::Corridor;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_wall_follower::floor_lines::FloorLineRule;
use yamabico_wall_follower::heading::vanishing_point_homogeneous;
use yamabico_wall_follower::sight::{CorridorCamera, Sight, Sighting};

const WIDTH_M: f64 = 2.0;
const HEIGHT_M: f64 = 0.6;
const POSES_PER_WORLD: usize = 10;

struct Arguments {
    json: bool,
    poses: usize,
    size: (u32, u32),
    out: Option<PathBuf>,
}

impl Arguments {
    fn parse() -> Result<Self, String> {
        let mut arguments = Self { json: false, poses: 500, size: (640, 480), out: None };
        let mut rest = std::env::args().skip(1);
        while let Some(argument) = rest.next() {
            let mut value = || rest.next().ok_or(format!("{argument} needs a value"));
            match argument.as_str() {
                "--json" => arguments.json = true,
                "--poses" => arguments.poses = value()?.parse().map_err(|e| format!("--poses: {e}"))?,
                "--size" => {
                    let size = value()?;
                    let (w, h) = size.split_once('x').ok_or("--size: WxH, such as 640x480")?;
                    let number = |text: &str| text.parse().map_err(|e| format!("--size: {e}"));
                    arguments.size = (number(w)?, number(h)?);
                }
                "--out" => {
                    let folder = PathBuf::from(value()?);
                    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
                    arguments.out = Some(folder);
                }
                _ => return Err(format!("unknown argument {argument}")),
            }
        }
        Ok(arguments)
    }
}

/// Absolute errors over all poses.
#[derive(Default)]
struct Errors {
    heading_deg: Vec<f64>,
    vanishing_point_px: Vec<f64>,
    wall_mm: Vec<f64>,
    poses: usize,
    walls: usize,
}

fn main() -> ExitCode {
    exit_code(Arguments::parse().and_then(|arguments| sweep(&arguments)))
}

fn sweep(arguments: &Arguments) -> Result<(), String> {
    let (width, height) = arguments.size;
    let intrinsics = Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians());
    let photometry = Photometry { noise_sigma: 4.0, ..Photometry::default() };
    let mut renderer = Renderer::new(photometry, stream(1, "noise"));
    let mut rng = stream(1, "sweep");
    let mut pixels = vec![0; (width * height) as usize];
    let mut errors = Errors::default();
    let mut scene = None;
    for pose in 0..arguments.poses {
        if pose % POSES_PER_WORLD == 0 {
            scene = Some(
                Scene::new(&World::random_corridor(pose as u64, WIDTH_M), 0).map_err(|e| e.to_string())?,
            );
        }
        let Some(scene) = &scene else { continue };
        let truth = CameraView {
            intrinsics,
            mount: Mount::tilted(HEIGHT_M, rng.random_range(-2.0_f64..8.0).to_radians()),
            robot: Pose2::new(
                rng.random_range(0.0..4.0),
                rng.random_range(-0.4..0.4),
                rng.random_range(-15.0_f64..15.0).to_radians(),
            ),
        };
        renderer.render(scene, &truth, &mut pixels).map_err(|e| e.to_string())?;
        let image = ImageView::new(&pixels, width as usize, height as usize, width as usize)
            .map_err(|e| e.to_string())?;
        let told_tilt = truth.mount.tilt + rng.random_range(-0.87_f64..0.87).to_radians();
        let camera = CorridorCamera {
            pinhole: Pinhole::ideal(intrinsics),
            mount: Mount { tilt: told_tilt, ..truth.mount },
            calibration: Calibration::Measured,
            horizon_sigma_rad: 1_f64.to_radians(),
        };
        let seen = Sight::new(camera, FloorLineRule::default()).look(image, None);
        let worst_mm = errors.add(&truth, seen.as_ref().ok());
        if let Some(folder) = &arguments.out {
            let path = folder.join(format!("{pose:03}_{worst_mm:04.0}mm.png"));
            draw(image, &truth, seen.as_ref().ok(), &path)?;
        }
    }
    errors.print(arguments);
    Ok(())
}

impl Errors {
    /// Takes one picture's result; gives the larger of its wall errors, mm.
    fn add(&mut self, truth: &CameraView, seen: Option<&Sighting>) -> f64 {
        self.poses += 1;
        self.walls += 2;
        let Some(seen) = seen else { return 9999.0 };
        let vp = vanishing_point_homogeneous(truth.robot.theta, &truth.mount, &truth.intrinsics);
        self.vanishing_point_px.push((seen.vanishing_point - vp.xy() / vp.z).norm());
        self.heading_deg.push((seen.heading - truth.robot.theta).to_degrees().abs());
        let mut worst = 0.0_f64;
        for (wall, distance_m) in [(seen.left, left_m(truth)), (seen.right, right_m(truth))] {
            if let Some(wall) = wall {
                let error_mm = 1e3 * (wall.distance_m - distance_m).abs();
                self.wall_mm.push(error_mm);
                worst = worst.max(error_mm);
            }
        }
        worst
    }

    fn print(&self, arguments: &Arguments) {
        let figures = |values: &[f64]| [0.5, 0.95, 1.0].map(|share| percentile(values, share));
        let (heading, vp, wall) =
            (figures(&self.heading_deg), figures(&self.vanishing_point_px), figures(&self.wall_mm));
        let (width, height) = arguments.size;
        if arguments.json {
            let row = |[median, p95, max]: [f64; 3]| json!({"median": median, "p95": p95, "max": max});
            println!(
                "{}",
                json!({"size": [width, height], "poses": self.poses, "headings_found": self.heading_deg.len(),
                       "walls": self.walls, "walls_found": self.wall_mm.len(), "heading_deg": row(heading),
                       "vanishing_point_px": row(vp), "wall_mm": row(wall)})
            );
            return;
        }
        println!(
            "{} poses at {width} x {height}: {} headings, {} of {} walls found",
            self.poses,
            self.heading_deg.len(),
            self.wall_mm.len(),
            self.walls
        );
        println!("error                    median     95 %      max");
        let row = |name: &str, [a, b, c]: [f64; 3]| println!("{name:<22} {a:>8.3} {b:>8.3} {c:>8.3}");
        row("heading, degrees", heading);
        row("vanishing point, px", vp);
        row("wall distance, mm", wall);
    }
}

/// How far the skirting stands out of the wall, metres.
fn skirting_m() -> f64 {
    Corridor::default().baseboard.map_or(0.0, |baseboard| baseboard.depth_m)
}

fn left_m(truth: &CameraView) -> f64 {
    0.5 * WIDTH_M - skirting_m() - truth.robot.y
}

fn right_m(truth: &CameraView) -> f64 {
    -0.5 * WIDTH_M + skirting_m() - truth.robot.y
}

fn draw(
    image: ImageView<'_>,
    truth: &CameraView,
    seen: Option<&Sighting>,
    path: &std::path::Path,
) -> Result<(), String> {
    let (width, height) = (image.width(), image.height());
    let mut data = vec![0; 3 * width * height];
    let mut canvas = Canvas::new(&mut data, width, height).ok_or("a canvas of the wrong size")?;
    canvas.copy_grey(image);
    let mut wall = |heading: f64, tilt: f64, distance_m: f64, colour: [u8; 3]| {
        let body_from_camera = Mount { pan: heading, tilt, ..truth.mount }.rotation_body_from_camera();
        let point = |x: f64| (body_from_camera.transpose() * Vector3::new(x, distance_m, -HEIGHT_M)).into();
        if let Some((near, far)) = clip_to_near_plane(point(0.0), point(12.0)) {
            let pixel = |p: nalgebra::Point3<f64>| -> Vector2<f64> {
                truth.intrinsics.pixel_from_normalised(p.coords.xy() / p.z)
            };
            canvas.line(pixel(near), pixel(far), colour);
        }
    };
    for distance_m in [left_m(truth), right_m(truth)] {
        wall(truth.robot.theta, truth.mount.tilt, distance_m, [60, 120, 255]);
    }
    if let Some(seen) = seen {
        for found in [seen.left, seen.right].into_iter().flatten() {
            wall(seen.heading, seen.tilt, found.distance_m, [0, 255, 60]);
        }
        canvas.cross(seen.vanishing_point, 12.0, [255, 0, 0]);
    }
    image::save_buffer(path, &data, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| format!("{}: {e}", path.display()))
}
