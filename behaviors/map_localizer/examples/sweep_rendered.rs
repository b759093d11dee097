//! How far one picture brings the pose, along the rendered hallway: `sweep_rendered [WIDTH HEIGHT]`. At each place some priors
//! are drawn from their covariance; the errors after the fix are told, and how they compare with its covariance.

use std::error::Error;
use std::path::PathBuf;

use rand::{RngExt, SeedableRng};
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_map_localizer::belief::{Belief, difference};
use yamabico_map_localizer::wire_frame::fixer::Fixer;
use yamabico_map_localizer::wire_frame::matching::LineNoise;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
use yamabico_vision::map::WireFrame;

/// Standard deviations of the priors, meters and radians.
const PRIOR: [f64; 2] = [0.03, 0.01];
const DRAWS: usize = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let sizes: Vec<u32> = std::env::args().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    let (width, height) = match sizes[..] {
        [width, height] => (width, height),
        _ => (256, 240),
    };
    let configs = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs"));
    let world = World::from_toml(&std::fs::read_to_string(configs.join("worlds/hallway.toml"))?)?;
    let map = WireFrame::read(&configs.join("maps/hallway.toml"))?;
    let scene = Scene::new(&World { people: Vec::new(), ..world }, 1)?;
    let intrinsics = Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians());
    let mount = Mount::tilted(0.6, 6_f64.to_radians());
    let mut renderer = Renderer::new(Photometry::default(), random::stream(1, "sweep"));
    let mut fixer = Fixer::new(map, Pinhole::ideal(intrinsics), mount);
    let noise = LineNoise { sigma_px: 0.7, map_sigma_m: 0.01, scale: 1.0, repetition: 1.0 };
    let mut random = rand_pcg::Pcg64::seed_from_u64(1);
    let mut image = GrayImage::new(width as usize, height as usize);
    println!(
        "  x m |  y m | deg  | expected lines uprights | along across heading, mean | spread | NEES | surprise"
    );
    for step in 0..30 {
        let mut of = |most: f64| random.random_range(-most..most);
        let truth = Pose2::new(f64::from(step) * 0.45, of(0.2), of(0.1));
        renderer.render(&scene, &CameraView { intrinsics, mount, robot: truth }, image.pixels_mut())?;
        let (mut sum, mut squares, mut nees, mut lines, mut surprise) = ([0.0; 3], [0.0; 3], 0.0, 0, 0.0);
        let mut last = None;
        for _ in 0..DRAWS {
            let mut normal =
                |sigma: f64| sigma * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            let prior = Pose2::new(
                truth.x + normal(PRIOR[0]),
                truth.y + normal(PRIOR[0]),
                truth.theta + normal(PRIOR[1]),
            );
            fixer.take(image.view()?).map_err(|reason| format!("{reason:?}"))?;
            let fix = fixer.fix(&Belief::new(prior, PRIOR[0], PRIOR[1]), &noise);
            let error = difference(&fix.posterior.pose, &truth);
            for k in 0..3 {
                sum[k] += error[k] / DRAWS as f64;
                squares[k] += error[k] * error[k] / DRAWS as f64;
            }
            nees += fix.posterior.distance_squared(&truth) / DRAWS as f64;
            lines += fix.lines;
            surprise += fix.surprise;
            last = Some(fix);
        }
        let Some(fix) = last else { continue };
        println!(
            "{:5.2} | {:+.2} | {:+4.1} | {:3} {:5.1} {:2} of {:2} | {:+.3} {:+.3} {:+.2} | {:.3} {:.3} {:.2} | {:5.1} | {:.2} {:?}",
            truth.x,
            truth.y,
            truth.theta.to_degrees(),
            fix.expected,
            lines as f64 / DRAWS as f64,
            fix.uprights[1],
            fix.uprights[0],
            sum[0],
            sum[1],
            sum[2].to_degrees(),
            squares[0].sqrt(),
            squares[1].sqrt(),
            squares[2].sqrt().to_degrees(),
            nees,
            surprise / lines as f64,
            fix.verdict,
        );
    }
    Ok(())
}
