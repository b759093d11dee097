//! Error of heading, vanishing point and wall distances on single rendered images of a corridor.

use clap::Args;
use nalgebra::{Point3, Vector2, Vector3};
use rand::RngExt;
use yamabico_core::camera::{Calibration, Intrinsics, Mount, Pinhole, clip_to_near_plane};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_rigs::camera::HEIGHT_M;
use yamabico_sim::random::{Stream, stream};
use yamabico_sim::world::Corridor;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::heading::vanishing_point_homogeneous;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObservation, CorridorObserver};

use crate::arguments::{Samples, Size};
use crate::images::{Output, view};
use crate::report::{Report, Table, number};
use crate::statistics::{mean, percentile, standard_deviation};

const WIDTH_M: f64 = 2.0;
const POSES_PER_WORLD: usize = 10;
/// Distance from the left wall in the sweep over headings, m (Kweon et al. 1991, section 5).
const NEAR_WALL_M: f64 = 0.56;
/// Headings of that sweep, degrees.
const HEADINGS_DEG: [i32; 7] = [-15, -10, -5, 0, 5, 10, 15];
const POSES_PER_HEADING: usize = 40;

/// Error of heading, vanishing point and wall distances on single rendered images of a corridor.
///
/// Images are independent: no prediction, no memory. Heading -15 to 15 degrees, tilt -2 to 8 degrees (known with an error of up to
/// 0.87, half a degree rms), offset up to 0.4 m from the center line of a corridor 2 m wide, a new one every ten poses: doors, boxes,
/// baseboards, floors and lamps vary; noise of 4 gray levels. The distance of a wall is that of the line between baseboard and floor.
/// Then 40 poses at each of seven headings 0.56 m from the left wall, which reveals a bias. Images: detected walls green, true ones
/// blue.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    samples: Samples,
    #[command(flatten)]
    size: Size,
}

/// Renders poses in corridors, a new corridor every few poses.
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

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let (width, height) = self.size.or((640, 480));
        let mut course = Course::new((width, height), self.samples.seed)?;
        let mut errors = Errors::default();
        for pose in 0..self.samples.count_or(500) {
            let (offset_m, heading_deg) =
                (course.rng.random_range(-0.4..0.4), course.rng.random_range(-15.0_f64..15.0));
            let (truth, observation) = course.sample(offset_m, heading_deg)?;
            let worst_mm = errors.add(&truth, observation.as_ref());
            course.draw(out, &format!("{pose:03}_{worst_mm:04.0}mm"), &truth, observation.as_ref())?;
        }
        let mut near = Table::new(
            format!("Left wall at {NEAR_WALL_M} m, {POSES_PER_HEADING} poses at each heading"),
            &["heading, deg", "detected", "mean error, mm", "sd, mm"],
        );
        for heading_deg in HEADINGS_DEG {
            let mut errors_mm = Vec::new();
            for pose in 0..POSES_PER_HEADING {
                let offset_m = 0.5 * WIDTH_M - baseboard_m() - NEAR_WALL_M;
                let (truth, observation) = course.sample(offset_m, f64::from(heading_deg))?;
                let wall = observation.and_then(|observation| observation.left);
                let error_mm = wall.map(|wall| 1e3 * (wall.distance_m - left_m(&truth)));
                errors_mm.extend(error_mm);
                let error_mm = error_mm.unwrap_or(f64::NAN);
                let name = format!("near_{heading_deg:+03}_{pose:02}_{error_mm:+04.0}mm");
                course.draw(out, &name, &truth, observation.as_ref())?;
            }
            near.row([
                number(f64::from(heading_deg), 0),
                errors_mm.len().into(),
                number(mean(&errors_mm), 1),
                number(standard_deviation(&errors_mm), 1),
            ]);
        }
        Ok(Report::new([errors.table(width, height), near]))
    }
}

impl Course {
    fn new((width, height): (u32, u32), seed: u64) -> Result<Self, String> {
        let photometry = Photometry { noise_sigma: 4.0, ..Photometry::default() };
        Ok(Self {
            intrinsics: Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()),
            renderer: Renderer::new(photometry, stream(seed, "noise")),
            rng: stream(seed, "sweep"),
            scene: corridor(0)?,
            worlds: 1,
            poses_left: POSES_PER_WORLD,
            pixels: vec![0; (width * height) as usize],
        })
    }

    /// Renders and evaluates an image at this offset (m, to the left) and heading.
    fn sample(
        &mut self,
        offset_m: f64,
        heading_deg: f64,
    ) -> Result<(CameraView, Option<CorridorObservation>), String> {
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
        self.renderer.render(&self.scene, &truth, &mut self.pixels).map_err(|error| error.to_string())?;
        let assumed_tilt = truth.mount.tilt + self.rng.random_range(-0.87_f64..0.87).to_radians();
        let camera = CorridorCamera {
            pinhole: Pinhole::ideal(self.intrinsics),
            mount: Mount { tilt: assumed_tilt, ..truth.mount },
            calibration: Calibration::Measured,
            horizon_sigma_rad: 1_f64.to_radians(),
        };
        Ok((truth, CorridorObserver::new(camera, FloorLineRule::default()).observe(self.image()?, None).ok()))
    }

    fn image(&self) -> Result<ImageView<'_>, String> {
        view(&self.pixels, self.intrinsics.width, self.intrinsics.height)
    }

    /// Draws detected and true walls on the latest image.
    fn draw(
        &self,
        out: &Output,
        name: &str,
        truth: &CameraView,
        observation: Option<&CorridorObservation>,
    ) -> Result<(), String> {
        out.overlay(name, self.image()?, |canvas| {
            let mut wall = |heading: f64, tilt: f64, distance_m: f64, color: [u8; 3]| {
                let body_from_camera =
                    Mount { pan: heading, tilt, ..truth.mount }.rotation_body_from_camera();
                let point =
                    |x: f64| (body_from_camera.transpose() * Vector3::new(x, distance_m, -HEIGHT_M)).into();
                if let Some((near, far)) = clip_to_near_plane(point(0.0), point(12.0)) {
                    let pixel = |p: Point3<f64>| -> Vector2<f64> {
                        truth.intrinsics.pixel_from_normalized(p.coords.xy() / p.z)
                    };
                    canvas.line(pixel(near), pixel(far), color);
                }
            };
            for distance_m in [left_m(truth), right_m(truth)] {
                wall(truth.robot.theta, truth.mount.tilt, distance_m, [60, 120, 255]);
            }
            if let Some(observation) = observation {
                for found in [observation.left, observation.right].into_iter().flatten() {
                    wall(observation.heading, observation.tilt, found.distance_m, [0, 255, 60]);
                }
                canvas.cross(observation.vanishing_point, 12.0, [255, 0, 0]);
            }
        })
    }
}

fn corridor(seed: u64) -> Result<Scene, String> {
    Scene::new(&World::random_corridor(seed, WIDTH_M), 0).map_err(|error| error.to_string())
}

impl Errors {
    /// Adds the result of one image; returns the larger of its wall errors, mm.
    fn add(&mut self, truth: &CameraView, observation: Option<&CorridorObservation>) -> f64 {
        self.poses += 1;
        self.walls += 2;
        let Some(observation) = observation else { return 9999.0 };
        let vp = vanishing_point_homogeneous(truth.robot.theta, &truth.mount, &truth.intrinsics);
        self.vanishing_point_px.push((observation.vanishing_point - vp.xy() / vp.z).norm());
        self.heading_deg.push((observation.heading - truth.robot.theta).to_degrees().abs());
        let mut worst = 0.0_f64;
        for (wall, distance_m) in [(observation.left, left_m(truth)), (observation.right, right_m(truth))] {
            if let Some(wall) = wall {
                let error_mm = 1e3 * (wall.distance_m - distance_m).abs();
                self.wall_mm.push(error_mm);
                worst = worst.max(error_mm);
            }
        }
        worst
    }

    fn table(&self, width: u32, height: u32) -> Table {
        let mut table = Table::new(
            format!("{} images of {width} x {height}", self.poses),
            &["error", "detected", "of", "median", "95 %", "max"],
        );
        for (name, errors, of) in [
            ("heading, degrees", &self.heading_deg, self.poses),
            ("vanishing point, px", &self.vanishing_point_px, self.poses),
            ("wall distance, mm", &self.wall_mm, self.walls),
        ] {
            table.row([
                name.into(),
                errors.len().into(),
                of.into(),
                number(percentile(errors, 0.5), 3),
                number(percentile(errors, 0.95), 3),
                number(percentile(errors, 1.0), 3),
            ]);
        }
        table
    }
}

/// Returns the depth of the baseboard in front of the wall, m.
fn baseboard_m() -> f64 {
    Corridor::default().baseboard.map_or(0.0, |baseboard| baseboard.depth_m)
}

fn left_m(truth: &CameraView) -> f64 {
    0.5 * WIDTH_M - baseboard_m() - truth.robot.y
}

fn right_m(truth: &CameraView) -> f64 {
    -0.5 * WIDTH_M + baseboard_m() - truth.robot.y
}
