//! Error of the tracked center of an intersection on rendered approaches.

use clap::Args;
use nalgebra::Point2;
use rand::RngExt;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Reason;
use yamabico_intersection_tracker::IntersectionTracker;
use yamabico_intersection_tracker::finder::Side;
use yamabico_intersection_tracker::track::Sides;
use yamabico_rigs::approach::{END_M, Ending, approach, edge_column, random_world, wall_ends};
use yamabico_rigs::camera::forward_camera;
use yamabico_rigs::camera_drive::CameraDrive;
use yamabico_sim::random::stream;

use crate::arguments::{Seeds, Size};
use crate::images::Output;
use crate::report::{Cell, Report, Table, number};
use crate::statistics::{nearest_rank, rms};

/// Distance before the intersection above which the end of tracking counts as a loss, m.
const MAX_END_M: f64 = 3.0;
/// Column error above which a confirmed track counts as lost, px.
const MAX_ERROR_PX: f64 = 20.0;
/// Distance error above which a confirmed track counts as lost, m.
const MAX_ERROR_M: f64 = 3.0;

/// Error of the tracked center of an intersection, and losses, on rendered approaches, one per seed.
///
/// From 10 m to 1.5 m before the end of both walls, or until an edge is within 15 px of the image border, at 0.4 m/s with a frame every
/// 0.1 s: even seeds lead to a crossing, odd ones to a T-junction, in corridors 1.7 to 2.4 m wide whose colors, lamps, floors,
/// baseboards and doors vary; noise of 8 gray levels; brightness that changes by a fifth on the way; start up to 0.3 m off the center
/// line and 5 degrees turned; odometry with errors of 1 % and 0.3 degrees per meter. An approach is lost if the behavior reports
/// so, if it does not track from 8 m on, if it ends more than 3 m early, or if a confirmed track is off by more than 20 px or 3 m.
/// The error is that of the mean column of both edges at the height of the camera. Images: each loss and each error above 4 px.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    seeds: Seeds,
    #[command(flatten)]
    size: Size,
    /// Horizontal field of view, degrees.
    #[arg(long, default_value_t = 60.0)]
    fov_deg: f64,
    /// List every frame and every approach.
    #[arg(long)]
    verbose: bool,
}

/// Errors within a range of distances.
struct Bin {
    from_m: f64,
    to_m: f64,
    center_px: Vec<f64>,
    distance_percent: Vec<f64>,
    /// Distance errors divided by their standard deviation.
    normalized: Vec<f64>,
}

/// Result of one approach.
#[derive(Default)]
struct Outcome {
    is_lost: bool,
    acquired_m: f64,
    one_sided: u32,
    ended_m: f64,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let mut bins = [(8.0, 10.1), (6.0, 8.0), (4.0, 6.0), (1.0, 4.0)].map(|(from_m, to_m)| Bin {
            from_m,
            to_m,
            center_px: Vec::new(),
            distance_percent: Vec::new(),
            normalized: Vec::new(),
        });
        let seeds = self.seeds.or(0..100);
        let (mut lost, mut late, mut one_sided, mut ended_m) = (0_u32, 0_u32, 0_u32, Vec::new());
        let progress = indicatif::ProgressBar::new(seeds.end - seeds.start);
        for seed in seeds.clone() {
            let outcome = self.approach(seed, &mut bins, out)?;
            lost += u32::from(outcome.is_lost);
            late += u32::from(outcome.acquired_m < 9.5);
            one_sided += u32::from(outcome.one_sided > 0);
            ended_m.push(outcome.ended_m);
            if self.verbose || outcome.is_lost {
                eprintln!(
                    "seed {seed}: acquired at {:.1} m, one-sided for {} frames, ended at {:.2} m{}",
                    outcome.acquired_m,
                    outcome.one_sided,
                    outcome.ended_m,
                    if outcome.is_lost { ", lost" } else { "" }
                );
            }
            progress.inc(1);
        }
        progress.finish_and_clear();
        let (width, height) = self.size.or((640, 480));
        let mut losses = Table::new(
            format!("Approaches at {width} x {height}, {} degrees", self.fov_deg),
            &[
                "approaches",
                "lost",
                "acquired after 9.5 m",
                "one-sided at times",
                "ended, median, m",
                "max, m",
            ],
        );
        losses.row([
            ended_m.len().into(),
            lost.into(),
            late.into(),
            one_sided.into(),
            number(nearest_rank(&ended_m, 0.5), 2),
            number(nearest_rank(&ended_m, 1.0), 2),
        ]);
        let mut errors = Table::new(
            "Errors by distance",
            &[
                "from, m",
                "to, m",
                "frames",
                "center median, px",
                "95 %, px",
                "max, px",
                "distance median, %",
                "95 %, %",
                "rms error / sigma",
            ],
        );
        for bin in &bins {
            errors.row(bin.row());
        }
        Ok(Report::new([losses, errors]))
    }

    fn approach(&self, seed: u64, bins: &mut [Bin], out: &Output) -> Result<Outcome, String> {
        let (width, height) = self.size.or((640, 480));
        let ending = if seed.is_multiple_of(2) { Ending::Crossing } else { Ending::Tee };
        let mut rng = stream(seed, "start");
        let start = Pose2::new(
            END_M - 10.0,
            rng.random_range(-0.3..0.3),
            rng.random_range(-5.0_f64..5.0).to_radians(),
        );
        let ramp = if rng.random_bool(0.5) { 0.2 } else { -0.2 };
        let camera = forward_camera(width, height, self.fov_deg, 6.0);
        let world = random_world(seed, ending);
        let ends = wall_ends(&world);
        let mut drive: CameraDrive<IntersectionTracker> = approach(&world, start, camera, 8.0, seed);
        let mut outcome = Outcome::default();
        let keep = |drive: &CameraDrive<IntersectionTracker>, name: &str| match &drive.image {
            Some(pixels) => out.gray(name, pixels, width, height),
            None => Ok(()),
        };
        loop {
            let ahead_m = END_M - drive.robot.x;
            outcome.ended_m = ahead_m;
            drive.gain = 0.9 + ramp * (10.0 - ahead_m) / 8.5 * 0.9;
            if ramp > 0.0 {
                drive.gain -= 0.1;
            }
            // Keeps the robot straight while the behavior does not drive.
            drive.fallback.angular = -drive.robot.theta - 0.8 * drive.robot.y;
            let has_frame = drive.step();
            let reason = drive.proposal.reason();
            let handed_over = reason == Some(Reason::Nominal) && drive.proposal.axes.is_empty();
            if ahead_m < 1.5 || handed_over || drive.now_s() > 60.0 {
                outcome.is_lost |= ahead_m > MAX_END_M;
                return Ok(outcome);
            }
            if !has_frame {
                continue;
            }
            let track = drive.bench.behavior.track();
            let is_tracked = track.landmarks().is_some();
            let is_confirmed = track.confirmations() > 2;
            if self.verbose && ((drive.now_s() / 0.1).round() as u32).is_multiple_of(20) {
                keep(&drive, &format!("frame_{seed:03}_{:.0}cm", 100.0 * ahead_m))?;
            }
            if is_tracked && outcome.acquired_m == 0.0 {
                outcome.acquired_m = ahead_m;
            }
            if reason == Some(Reason::IntersectionLost) || (ahead_m < 8.0 && !is_tracked) {
                if !outcome.is_lost {
                    keep(&drive, &format!("lost_{seed:03}_{ahead_m:.1}m"))?;
                }
                outcome.is_lost = true;
            }
            outcome.one_sided += u32::from((track.sides() == Sides::One) && is_confirmed);
            if self.verbose {
                print_frame(&drive, ahead_m, ends);
            }
            if track.sides() != Sides::Both || !is_confirmed {
                continue;
            }
            let Some([left, right]) = column_errors(&drive, ends) else { continue };
            let Some(ahead) = drive.bench.behavior.ahead(&drive.wheels) else { continue };
            let center_px = 0.5 * (left + right).abs();
            let truth_m = drive.robot.inverse().transform_point([END_M, 0.0].into()).x;
            let is_elsewhere = left.abs().max(right.abs()) > MAX_ERROR_PX
                || (ahead.distance_m - truth_m).abs() > MAX_ERROR_M;
            if is_elsewhere {
                if !outcome.is_lost {
                    keep(&drive, &format!("elsewhere_{seed:03}_{ahead_m:.1}m"))?;
                }
                outcome.is_lost = true;
            }
            if center_px > 4.0 {
                keep(&drive, &format!("off_{seed:03}_{ahead_m:.1}m_{center_px:.1}px"))?;
            }
            if let Some(bin) = bins.iter_mut().find(|bin| ahead_m >= bin.from_m && ahead_m < bin.to_m) {
                bin.center_px.push(center_px);
                bin.distance_percent.push(100.0 * (ahead.distance_m / truth_m - 1.0).abs());
                bin.normalized.push((ahead.distance_m - truth_m) / ahead.sigma_m);
            }
        }
    }
}

/// Returns the column errors of the left and the right edge, px.
fn column_errors(drive: &CameraDrive<IntersectionTracker>, ends: [Point2<f64>; 2]) -> Option<[f64; 2]> {
    let track = drive.bench.behavior.track();
    let error = |side, end| Some(track.observed_at(side)?.x - edge_column(&drive.view, end)?);
    Some([error(Side::Left, ends[0])?, error(Side::Right, ends[1])?])
}

fn print_frame(drive: &CameraDrive<IntersectionTracker>, ahead_m: f64, ends: [Point2<f64>; 2]) {
    let track = drive.bench.behavior.track();
    let ahead = drive.bench.behavior.ahead(&drive.wheels);
    let edge = |side, end| {
        let column = track.observed_at(side).map_or(f64::NAN, |at| at.x);
        let truth = edge_column(&drive.view, end).unwrap_or(f64::NAN);
        format!("{side:?} {column:.1} ({truth:.1}) {:?}", track.failure(side))
    };
    eprintln!(
        "{ahead_m:.2} m: {:?} {:?} {} {}",
        ahead.map(|ahead| (ahead.distance_m, ahead.sigma_m)),
        drive.proposal.reason(),
        edge(Side::Left, ends[0]),
        edge(Side::Right, ends[1]),
    );
}

impl Bin {
    fn row(&self) -> [Cell; 9] {
        [
            number(self.from_m, 1),
            number(self.to_m, 1),
            self.center_px.len().into(),
            number(nearest_rank(&self.center_px, 0.5), 2),
            number(nearest_rank(&self.center_px, 0.95), 2),
            number(nearest_rank(&self.center_px, 1.0), 2),
            number(nearest_rank(&self.distance_percent, 0.5), 1),
            number(nearest_rank(&self.distance_percent, 0.95), 1),
            number(rms(&self.normalized), 2),
        ]
    }
}
