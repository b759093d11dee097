//! Pose error after one image of the rendered hallway.

use clap::Args;
use rand::{RngExt, SeedableRng};
use yamabico_core::camera::Pinhole;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_map_localizer::belief::{Belief, difference};
use yamabico_map_localizer::wire_frame::fixer::Fixer;
use yamabico_map_localizer::wire_frame::matching::LineNoise;
use yamabico_rigs::camera::{empty_hallway, forward_camera};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, random};
use yamabico_vision::map::WireFrame;

use crate::arguments::Size;
use crate::report::{Report, Table, number};

/// Standard deviations of the priors, m and rad.
const PRIOR: [f64; 2] = [0.03, 0.01];
/// Number of priors at each place.
const PRIORS: usize = 20;
const PLACES: i32 = 30;

/// Pose error after one image, along the rendered hallway.
///
/// At each of 30 places 20 priors are drawn from their covariance. Shown are mean error and spread of the pose after the fix, NEES
/// (normalized estimation error squared in three degrees of freedom, 3 if the covariance is right) and NIS per line
/// (normalized innovation squared over its degrees of freedom, 1 if the covariance is right).
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    size: Size,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let (width, height) = self.size.or((256, 240));
        let map =
            WireFrame::read(&yamabico_testkit::config("maps/hallway.toml")).map_err(|e| e.to_string())?;
        let scene = Scene::new(&empty_hallway(), 1).map_err(|error| error.to_string())?;
        let (intrinsics, mount) = forward_camera(width, height, 60.0, 6.0);
        let mut renderer = Renderer::new(Photometry::default(), random::stream(1, "sweep"));
        let mut fixer = Fixer::new(map, Pinhole::ideal(intrinsics), mount);
        let noise = LineNoise { sigma_px: 0.7, map_sigma_m: 0.01, scale: 1.0, correlation: 1.0 };
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        let mut image = GrayImage::new(width as usize, height as usize);
        let mut table = Table::new(
            format!("Pose after one image of {width} x {height} ({PRIORS} priors at each place)"),
            &[
                "x, m",
                "y, m",
                "deg",
                "expected",
                "lines",
                "uprights",
                "along, m",
                "across, m",
                "heading, deg",
                "along sd, m",
                "across sd, m",
                "heading sd, deg",
                "NEES",
                "NIS per line",
                "verdict",
            ],
        );
        for step in 0..PLACES {
            let mut within = |limit: f64| random.random_range(-limit..limit);
            let truth = Pose2::new(f64::from(step) * 0.45, within(0.2), within(0.1));
            renderer
                .render(&scene, &CameraView { intrinsics, mount, robot: truth }, image.pixels_mut())
                .map_err(|error| error.to_string())?;
            let (mut sum, mut squares, mut nees, mut lines, mut nis) = ([0.0; 3], [0.0; 3], 0.0, 0, 0.0);
            let mut last = None;
            for _ in 0..PRIORS {
                let mut normal =
                    |sigma: f64| sigma * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
                let prior = Pose2::new(
                    truth.x + normal(PRIOR[0]),
                    truth.y + normal(PRIOR[0]),
                    truth.theta + normal(PRIOR[1]),
                );
                let view = image.view().map_err(|error| error.to_string())?;
                fixer.observe(view).map_err(|reason| format!("{reason:?}"))?;
                let fix = fixer.fix(&Belief::new(prior, PRIOR[0], PRIOR[1]), &noise);
                let error = difference(&fix.posterior.pose, &truth);
                for k in 0..3 {
                    sum[k] += error[k] / PRIORS as f64;
                    squares[k] += error[k] * error[k] / PRIORS as f64;
                }
                nees += fix.posterior.distance_squared(&truth) / PRIORS as f64;
                lines += fix.lines;
                nis += fix.nis;
                last = Some(fix);
            }
            let Some(fix) = last else { continue };
            table.row([
                number(truth.x, 2),
                number(truth.y, 2),
                number(truth.theta.to_degrees(), 1),
                fix.expected.into(),
                number(lines as f64 / PRIORS as f64, 1),
                format!("{} of {}", fix.uprights[1], fix.uprights[0]).into(),
                number(sum[0], 3),
                number(sum[1], 3),
                number(sum[2].to_degrees(), 2),
                number(squares[0].sqrt(), 3),
                number(squares[1].sqrt(), 3),
                number(squares[2].sqrt().to_degrees(), 2),
                number(nees, 1),
                number(nis / lines as f64, 2),
                format!("{:?}", fix.verdict).into(),
            ]);
        }
        Ok(Report::new([table]))
    }
}
