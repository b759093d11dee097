//! How exact heading, vanishing point and wall distances are on rendered pictures of a corridor, over many poses.
//!
//! `sweep_rendered [--json] [--poses N] [--size WxH] [--out DIR]`
//!
//! Every picture stands alone: no prediction, no memory. Heading -15 to 15 degrees, tilt -2 to 8 degrees (the behavior is told
//! the tilt with an error of up to 0.87, half a degree rms, as a mount has it), offset up to 0.4 m from the middle of a
//! corridor 2 m wide, a new one every ten poses: closed and open doors, boxes along the walls, skirtings, floors and lamps
//! vary; noise of 4 gray levels. A wall's distance is that of the line where its skirting meets the floor. Then the same at
//! 0.56 m from the left wall (Kweon et al. 1991, section 5), heading by heading, where a bias shows. `--out` writes the
//! pictures with what was found: green the walls found, blue the true ones.

#[allow(dead_code, reason = "the other evaluations use the rest")]
mod evaluation;

use evaluation::{exit_code, percentile};
use nalgebra::{Vector2, Vector3};
use rand::RngExt;
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use yamabico_core::camera::{Calibration, Intrinsics, Mount, Pinhole, clip_to_near_plane};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_drawing::Canvas;
use yamabico_sim::random::{Stream, stream};
use yamabico_sim::world::Corridor;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::heading::vanishing_point_homogeneous;
use yamabico_vision::corridor::sight::{CorridorCamera, Sight, Sighting};

const WIDTH_M: f64 = 2.0;
const HEIGHT_M: f64 = 0.6;
const POSES_PER_WORLD: usize = 10;
/// Distance from the left wall in the sweep over headings, meters.
const NEAR_WALL_M: f64 = 0.56;
/// Its headings (degrees), and how many poses at each.
const HEADINGS_DEG: [i32; 7] = [-15, -10, -5, 0, 5, 10, 15];
const POSES_PER_HEADING: usize = 40;

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

/// Renders poses in corridors, a new one every few poses, and looks at them.
struct Course {
    intrinsics: Intrinsics,
    renderer: Renderer,
    rng: Stream,
    scene: Scene,
    worlds: u64,
    poses_left: usize,
    pixels: Vec<u8>,
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
    let mut course = Course::new(arguments.size)?;
    let mut errors = Errors::default();
    for pose in 0..arguments.poses {
        let (offset_m, heading_deg) =
            (course.rng.random_range(-0.4..0.4), course.rng.random_range(-15.0_f64..15.0));
        let (truth, seen) = course.look(offset_m, heading_deg)?;
        let worst_mm = errors.add(&truth, seen.as_ref());
        course.keep(arguments, &format!("{pose:03}_{worst_mm:04.0}mm"), &truth, seen.as_ref())?;
    }
    let mut headings = Vec::new();
    for heading_deg in HEADINGS_DEG {
        let mut errors_mm = Vec::new();
        for pose in 0..POSES_PER_HEADING {
            let offset_m = 0.5 * WIDTH_M - skirting_m() - NEAR_WALL_M;
            let (truth, seen) = course.look(offset_m, f64::from(heading_deg))?;
            let wall = seen.and_then(|seen| seen.left);
            let error_mm = wall.map(|wall| 1e3 * (wall.distance_m - left_m(&truth)));
            errors_mm.extend(error_mm);
            let name = format!("near_{heading_deg:+03}_{pose:02}_{:+04.0}mm", error_mm.unwrap_or(f64::NAN));
            course.keep(arguments, &name, &truth, seen.as_ref())?;
        }
        headings.push((heading_deg, errors_mm));
    }
    print(&errors, &headings, arguments);
    Ok(())
}

impl Course {
    fn new((width, height): (u32, u32)) -> Result<Self, String> {
        let photometry = Photometry { noise_sigma: 4.0, ..Photometry::default() };
        Ok(Self {
            intrinsics: Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()),
            renderer: Renderer::new(photometry, stream(1, "noise")),
            rng: stream(1, "sweep"),
            scene: corridor(0)?,
            worlds: 1,
            poses_left: POSES_PER_WORLD,
            pixels: vec![0; (width * height) as usize],
        })
    }

    /// The picture at this offset (m, to the left) and heading: what was true and what was seen.
    fn look(&mut self, offset_m: f64, heading_deg: f64) -> Result<(CameraView, Option<Sighting>), String> {
        if self.poses_left == 0 {
            self.scene = corridor(self.worlds)?;
            (self.worlds, self.poses_left) = (self.worlds + 1, POSES_PER_WORLD);
        }
        self.poses_left -= 1;
        let truth = CameraView {
            intrinsics: self.intrinsics,
            mount: Mount::tilted(HEIGHT_M, self.rng.random_range(-2.0_f64..8.0).to_radians()),
            robot: Pose2::new(self.rng.random_range(0.0..4.0), offset_m, heading_deg.to_radians()),
        };
        self.renderer.render(&self.scene, &truth, &mut self.pixels).map_err(|e| e.to_string())?;
        let told_tilt = truth.mount.tilt + self.rng.random_range(-0.87_f64..0.87).to_radians();
        let camera = CorridorCamera {
            pinhole: Pinhole::ideal(self.intrinsics),
            mount: Mount { tilt: told_tilt, ..truth.mount },
            calibration: Calibration::Measured,
            horizon_sigma_rad: 1_f64.to_radians(),
        };
        Ok((truth, Sight::new(camera, FloorLineRule::default()).look(self.image()?, None).ok()))
    }

    /// Writes the last picture with what was seen, where pictures are wanted.
    fn keep(
        &self,
        arguments: &Arguments,
        name: &str,
        truth: &CameraView,
        seen: Option<&Sighting>,
    ) -> Result<(), String> {
        let Some(folder) = &arguments.out else { return Ok(()) };
        draw(self.image()?, truth, seen, &folder.join(name).with_extension("png"))
    }

    fn image(&self) -> Result<ImageView<'_>, String> {
        let (width, height) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        ImageView::new(&self.pixels, width, height, width).map_err(|e| e.to_string())
    }
}

fn corridor(number: u64) -> Result<Scene, String> {
    Scene::new(&World::random_corridor(number, WIDTH_M), 0).map_err(|e| e.to_string())
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
}

/// Prints both sweeps: median, 95 % and largest error; and, by heading, mean and standard deviation at the near wall.
fn print(errors: &Errors, headings: &[(i32, Vec<f64>)], arguments: &Arguments) {
    let figures = |values: &[f64]| [0.5, 0.95, 1.0].map(|share| percentile(values, share));
    let rows = [
        ("heading, degrees", "heading_deg", figures(&errors.heading_deg)),
        ("vanishing point, px", "vanishing_point_px", figures(&errors.vanishing_point_px)),
        ("wall distance, mm", "wall_mm", figures(&errors.wall_mm)),
    ];
    let (width, height) = arguments.size;
    if arguments.json {
        let mut table = json!({"size": [width, height], "poses": errors.poses, "walls": errors.walls,
            "headings_found": errors.heading_deg.len(), "walls_found": errors.wall_mm.len()});
        for (_, key, [median, p95, max]) in rows {
            table[key] = json!({"median": median, "p95": p95, "max": max});
        }
        let row = |(heading_deg, errors_mm): &(i32, Vec<f64>)| {
            let (mean_mm, sd_mm) = mean_and_deviation(errors_mm);
            json!({"heading_deg": heading_deg, "found": errors_mm.len(), "mean_mm": mean_mm, "sd_mm": sd_mm})
        };
        table["near_wall"] = headings.iter().map(row).collect();
        println!("{table}");
        return;
    }
    println!(
        "{} poses at {width} x {height}: {} headings, {} of {} walls found",
        errors.poses,
        errors.heading_deg.len(),
        errors.wall_mm.len(),
        errors.walls
    );
    println!("error                    median     95 %      max");
    for (name, _, [median, p95, max]) in rows {
        println!("{name:<22} {median:>8.3} {p95:>8.3} {max:>8.3}");
    }
    println!("\nleft wall at {NEAR_WALL_M} m, {POSES_PER_HEADING} poses at each heading");
    println!("heading, degrees        found  mean, mm    sd, mm");
    for (heading_deg, errors_mm) in headings {
        let (mean_mm, sd_mm) = mean_and_deviation(errors_mm);
        println!("{heading_deg:>+4} {:>24} {mean_mm:>+9.1} {sd_mm:>9.1}", errors_mm.len());
    }
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, variance.sqrt())
}

/// How far the skirting stands out of the wall, meters.
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
    canvas.copy_gray(image);
    let mut wall = |heading: f64, tilt: f64, distance_m: f64, color: [u8; 3]| {
        let body_from_camera = Mount { pan: heading, tilt, ..truth.mount }.rotation_body_from_camera();
        let point = |x: f64| (body_from_camera.transpose() * Vector3::new(x, distance_m, -HEIGHT_M)).into();
        if let Some((near, far)) = clip_to_near_plane(point(0.0), point(12.0)) {
            let pixel = |p: nalgebra::Point3<f64>| -> Vector2<f64> {
                truth.intrinsics.pixel_from_normalized(p.coords.xy() / p.z)
            };
            canvas.line(pixel(near), pixel(far), color);
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
