//! How exactly two cameras side by side tell the height of floor lines, on rendered pictures.
//!
//! `stereo_heights [--pairs N] [--first SEED]`
//!
//! Two cameras of 640 x 480, 0.12 m apart and 0.6 m above the floor, in corridors 2 m wide, a new one every pair: colors,
//! lamps, floors, skirtings and doors vary; heading -5 to 5 degrees, offset up to 0.3 m, noise of 2 gray levels. Each floor
//! line is found in the left picture and matched in the right one; what the two disagree about in heading and tilt is shared,
//! since they are mounted together; where they take different lines for a wall's, the inner one counts. A height off by more
//! than 0.08 m is no floor line's, and counts as not found. The height of a floor line below the cameras is 0.6 m (Kweon et
//! al. 1991, section 3.4).

use nalgebra::Vector2;
use rand::RngExt;
use std::ops::Range;
use std::process::ExitCode;
use yamabico_core::camera::{Calibration, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::corridor::floor_lines::{ExpectedWall, FloorLineRule};
use yamabico_vision::corridor::heading::CameraAttitude;
use yamabico_vision::corridor::sight::{CorridorCamera, Sight, Sighting};
use yamabico_vision::corridor::wall_distance::CorridorView;
use yamabico_wall_follower::stereo::{is_floor_line, lateral_baseline, stereo_wall};
use yamabico_wall_follower::stereo_match::{StereoPicture, matching_cotangent};

const BASELINE_M: f64 = 0.12;
const HEIGHT_M: f64 = 0.6;
/// How far ahead of the cameras the lines are compared, meters.
const AHEAD_M: f64 = 2.5;
/// Heights that are looked for, meters.
const HEIGHTS_M: [f64; 2] = [0.4, 0.9];
/// A height farther from the cameras' is no floor line's, meters.
const TOLERANCE_M: f64 = 0.08;

/// What one camera saw.
struct Eye {
    sighting: Sighting,
    view: CorridorView,
    mount: Mount,
    pixels: Vec<u8>,
}

fn main() -> ExitCode {
    let number = |name: &str, default: u64| {
        let value = std::env::args().skip_while(|argument| argument != name).nth(1);
        value.map_or(Ok(default), |value| value.parse()).map_err(|e| format!("{name}: {e}"))
    };
    let seeds = number("--first", 0).and_then(|first| Ok(first..first + number("--pairs", 100)?));
    match seeds.and_then(sweep) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn sweep(seeds: Range<u64>) -> Result<(), String> {
    let pairs = seeds.end - seeds.start;
    let mut errors_mm = Vec::new();
    let mut refused = 0;
    for seed in seeds {
        let mut rng = stream(seed, "stereo");
        let mut world = World::random_corridor(seed, 2.0);
        world.boxes.clear();
        let scene = Scene::new(&world, 0).map_err(|e| e.to_string())?;
        let robot = Pose2::new(
            rng.random_range(0.0..4.0),
            rng.random_range(-0.3..0.3),
            rng.random_range(-5.0_f64..5.0).to_radians(),
        );
        let tilt = rng.random_range(3.0_f64..7.0).to_radians();
        let look = |y: f64, name: &str| {
            look(&scene, robot, Mount { y, ..Mount::tilted(HEIGHT_M, tilt) }, seed, name)
        };
        let (Some(left), Some(right)) = (look(0.5 * BASELINE_M, "left")?, look(-0.5 * BASELINE_M, "right")?)
        else {
            refused += 2;
            continue;
        };
        for wall in [|sighting: &Sighting| sighting.left, |sighting: &Sighting| sighting.right] {
            match height_m(&left, &right, wall) {
                Some(height_m) => errors_mm.push(1e3 * (height_m - HEIGHT_M).abs()),
                None => refused += 1,
            }
        }
    }
    errors_mm.sort_by(f64::total_cmp);
    let share = |share: f64| errors_mm.get((share * (errors_mm.len() - 1) as f64).round() as usize);
    println!(
        "{pairs} pairs, baseline {BASELINE_M} m: {} heights of floor lines, {refused} not found",
        errors_mm.len()
    );
    println!("error, mm: median {:.1?}, 95 % {:.1?}, largest {:.1?}", share(0.5), share(0.95), share(1.0));
    Ok(())
}

/// What a camera of the robot sees; `None` without a heading.
fn look(scene: &Scene, robot: Pose2, mount: Mount, seed: u64, name: &str) -> Result<Option<Eye>, String> {
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 60_f64.to_radians());
    let mut pixels = vec![0; 640 * 480];
    Renderer::new(Photometry::default(), stream(seed, name))
        .render(scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
        .map_err(|e| e.to_string())?;
    let image = ImageView::new(&pixels, 640, 480, 640).map_err(|e| e.to_string())?;
    let camera = CorridorCamera {
        pinhole: Pinhole::ideal(intrinsics),
        mount,
        calibration: Calibration::Measured,
        horizon_sigma_rad: 0.1_f64.to_radians(),
    };
    let mut sight = Sight::new(camera, FloorLineRule::default());
    let Some(sighting) = sight.look(image, None).ok() else { return Ok(None) };
    Ok(sight.view().map(|&view| Eye { sighting, view, mount, pixels }))
}

/// The height (m) of the cameras above a wall's floor line; `None` where a camera does not see it or the two do not fit.
fn height_m(left: &Eye, right: &Eye, wall: fn(&Sighting) -> Option<ExpectedWall>) -> Option<f64> {
    let shared = CameraAttitude {
        heading: 0.5 * (left.sighting.heading + right.sighting.heading),
        tilt: 0.5 * (left.sighting.tilt + right.sighting.tilt),
    };
    let view = CorridorView::new(shared, 0.0, HEIGHT_M, left.view.intrinsics);
    let pixel = on_floor_line(left, inner(wall(&left.sighting)?, wall(&right.sighting)?))?;
    let cotangent = view.tied_distance(pixel)? / HEIGHT_M;
    let baseline_m = lateral_baseline(BASELINE_M, shared);
    let [lowest_m, highest_m] = HEIGHTS_M;
    let matching = matching_cotangent(
        &left.picture(&view)?,
        &right.picture(&view)?,
        cotangent,
        baseline_m / highest_m..=baseline_m / lowest_m,
    )?;
    let wall = stereo_wall(cotangent, matching, baseline_m).ok()?;
    is_floor_line(&wall, HEIGHT_M, TOLERANCE_M).then_some(wall.height_m)
}

impl Eye {
    fn picture<'a>(&'a self, view: &'a CorridorView) -> Option<StereoPicture<'a>> {
        Some(StereoPicture { image: ImageView::new(&self.pixels, 640, 480, 640).ok()?, view })
    }
}

/// The wall as the left camera found it, but where the right one found another line: the floor line is the inner one of the two,
/// the outer one the upper edge of a skirting.
fn inner(left: ExpectedWall, right: ExpectedWall) -> ExpectedWall {
    let sigma_m = left.sigma_m.hypot(right.sigma_m);
    let is_same = (left.distance_m - right.distance_m).abs() < 3.0 * sigma_m;
    if is_same || left.distance_m.abs() < right.distance_m.abs() { left } else { right }
}

/// A pixel of the floor line that a camera found.
fn on_floor_line(eye: &Eye, wall: ExpectedWall) -> Option<Vector2<f64>> {
    let (sin, cos) = eye.sighting.heading.sin_cos();
    let distance_m = wall.distance_m - eye.mount.x * sin - eye.mount.y * cos;
    let point = nalgebra::Vector3::new(AHEAD_M, distance_m, -eye.view.height_m);
    let in_camera = eye.view.corridor_from_camera.transpose() * point;
    (in_camera.z > 0.1).then(|| eye.view.intrinsics.pixel_from_normalized(in_camera.xy() / in_camera.z))
}
