//! What the behavior proposes on one picture, and what it sees in it.
//!
//! `propose_on_image [PICTURE] [--fov DEGREES] [--height M] [--tilt DEGREES] [--distance M] [--out FILE]`
//!
//! Without a picture it renders one of the simulator, `--distance` meters before a crossing. The camera looks along the
//! corridor; the robot is taken to stand. `--out` writes the picture with the corridor's edges (blue), the ends of walls
//! (yellow), the floor lines of both walls (green) and the tracked edges with the middle between them (red).

use nalgebra::{Vector2, Vector3};
use std::path::PathBuf;
use std::process::ExitCode;
use yamabico_core::camera::{Calibration, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::{FrameHeader, Odometry, Proposal};
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_drawing::Canvas;
use yamabico_intersection_tracker::finder::{EndFinder, FinderRule, Side, floor_line};
use yamabico_intersection_tracker::{CAMERA, IntersectionTracker, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::world::{Branch, Side as WallSide};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::sight::{CorridorCamera, Sight};

struct Arguments {
    picture: Option<PathBuf>,
    fov_deg: f64,
    height_m: f64,
    tilt_deg: f64,
    distance_m: f64,
    out: Option<PathBuf>,
}

/// A gray picture and its camera.
struct Picture {
    pixels: Vec<u8>,
    intrinsics: Intrinsics,
    mount: Mount,
}

fn main() -> ExitCode {
    match Arguments::parse().and_then(|arguments| run(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let picture = match &arguments.picture {
        Some(path) => load(path, arguments)?,
        None => rendered(arguments)?,
    };
    let (bench, proposal) = propose(&picture)?;
    println!(
        "{} on {}, {:.2} m/s {:+.2} rad/s: {} ({})",
        proposal.kind().map_or("?", |kind| kind.as_str()),
        proposal.axes,
        proposal.twist.linear,
        proposal.twist.angular,
        proposal.reason().map_or("?", |reason| reason.as_str()),
        proposal.note.as_str(),
    );
    if let Some(path) = &arguments.out {
        draw(&picture, &bench)?.save(path).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

/// The same picture some times, from a robot that stands.
fn propose(picture: &Picture) -> Result<(Bench<IntersectionTracker>, Proposal), String> {
    let (intrinsics, mount) = (picture.intrinsics, picture.mount);
    let setup = camera_setup(intrinsics, mount);
    let mut bench = Bench::<IntersectionTracker>::new("", setup).map_err(|error| error.to_string())?;
    let mut proposal = Proposal::default();
    for call in 1..=4 {
        let seconds = 0.1 * f64::from(call);
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let header = FrameHeader::gray(intrinsics.width, intrinsics.height, stamp_ns);
        bench.at(seconds).feed(&ODOMETRY, &Odometry { stamp_ns, ..Odometry::default() }, &[]);
        proposal = bench.feed(&CAMERA, &header, &picture.pixels).propose();
    }
    Ok((bench, proposal))
}

fn draw(picture: &Picture, bench: &Bench<IntersectionTracker>) -> Result<image::RgbImage, String> {
    let Intrinsics { width, height, .. } = picture.intrinsics;
    let image = ImageView::new(&picture.pixels, width as usize, height as usize, width as usize)
        .map_err(|error| error.to_string())?;
    let mut data = vec![0; 3 * picture.pixels.len()];
    let mut canvas =
        Canvas::new(&mut data, width as usize, height as usize).ok_or("a canvas of the wrong size")?;
    canvas.copy_gray(image);
    let mut sight = Sight::new(
        CorridorCamera {
            pinhole: Pinhole::ideal(picture.intrinsics),
            mount: picture.mount,
            calibration: Calibration::Measured,
            horizon_sigma_rad: 1_f64.to_radians(),
        },
        FloorLineRule::default(),
    );
    match sight.look(image, None) {
        Ok(sighting) => {
            for line in sight.along_corridor() {
                canvas.line(line.p0, line.p1, [60, 120, 255]);
            }
            if let Some(view) = sight.view() {
                for wall in [sighting.left, sighting.right].into_iter().flatten() {
                    let line: Vector3<f64> = floor_line(view, wall.distance_m);
                    let at = |v: f64| Vector2::new(-(line.y * v + line.z) / line.x, v);
                    canvas.line(at(sighting.vanishing_point.y), at(f64::from(height)), [0, 255, 60]);
                }
            }
            let rule = FinderRule { range_m: [1.5, 12.0], border_px: 25.0, pair_m: 0.3 };
            for end in EndFinder::default().find(image, &sight, &sighting, &rule) {
                println!(
                    "{:?} wall ends {:.2} m ahead, {:.2} m aside",
                    end.side, end.ahead_m, end.point_in_robot.y
                );
                canvas.line(end.base, end.base - Vector2::new(0.0, end.length_px), [255, 220, 0]);
            }
            canvas.cross(sighting.vanishing_point, 8.0, [255, 0, 255]);
        }
        Err(reason) => println!("{reason}"),
    }
    let track = bench.behavior.track();
    if let (Some(left), Some(right)) = (track.seen_at(Side::Left), track.seen_at(Side::Right)) {
        for at in [left, right] {
            canvas.outline(at - Vector2::new(10.0, 20.0), at + Vector2::new(10.0, 20.0), [255, 0, 0]);
        }
        canvas.cross(0.5 * (left + right), 12.0, [255, 0, 0]);
    }
    image::RgbImage::from_raw(width, height, data).ok_or_else(|| "a picture of the wrong size".into())
}

fn rendered(arguments: &Arguments) -> Result<Picture, String> {
    let mut world = World::corridor(23.0, 2.0);
    if let Some(corridor) = &mut world.corridor {
        let branch = |side| Branch { side, at_m: 13.2, width_m: 2.4, depth_m: 5.0 };
        corridor.branches = vec![branch(WallSide::Left), branch(WallSide::Right)];
    }
    let scene = Scene::new(&world, 0).map_err(|error| error.to_string())?;
    let (intrinsics, mount) = arguments.camera(640, 480);
    let robot = Pose2::new(12.0 - arguments.distance_m, 0.1, 0.03);
    let mut pixels = vec![0; 640 * 480];
    Renderer::new(Photometry::default(), stream(1, "propose_on_image"))
        .render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
        .map_err(|error| error.to_string())?;
    Ok(Picture { pixels, intrinsics, mount })
}

fn load(path: &std::path::Path, arguments: &Arguments) -> Result<Picture, String> {
    let gray = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?.to_luma8();
    let (intrinsics, mount) = arguments.camera(gray.width(), gray.height());
    Ok(Picture { pixels: gray.into_raw(), intrinsics, mount })
}

impl Arguments {
    fn camera(&self, width: u32, height: u32) -> (Intrinsics, Mount) {
        (
            Intrinsics::from_horizontal_fov(width, height, self.fov_deg.to_radians()),
            Mount::tilted(self.height_m, self.tilt_deg.to_radians()),
        )
    }

    fn parse() -> Result<Self, String> {
        let mut arguments =
            Self { picture: None, fov_deg: 60.0, height_m: 0.6, tilt_deg: 6.0, distance_m: 6.0, out: None };
        let mut rest = std::env::args().skip(1);
        while let Some(argument) = rest.next() {
            let mut value = || rest.next().ok_or(format!("{argument} needs a value"));
            let number = |text: String| text.parse::<f64>().map_err(|error| format!("{text}: {error}"));
            match argument.as_str() {
                "--fov" => arguments.fov_deg = number(value()?)?,
                "--height" => arguments.height_m = number(value()?)?,
                "--tilt" => arguments.tilt_deg = number(value()?)?,
                "--distance" => arguments.distance_m = number(value()?)?,
                "--out" => arguments.out = Some(value()?.into()),
                _ if argument.starts_with('-') => return Err(format!("unknown argument {argument}")),
                _ => arguments.picture = Some(argument.into()),
            }
        }
        Ok(arguments)
    }
}
