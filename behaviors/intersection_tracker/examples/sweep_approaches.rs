//! How exactly the middle of an intersection is seen on the way to it, and how often it is lost, over rendered approaches.
//!
//! `sweep_approaches [--approaches N] [--first SEED] [--fov DEGREES] [--size WxH] [--out DIR] [--verbose]`
//!
//! From 10 m to 1.5 m before the place where both walls end, or to where an edge comes within 15 px of the picture's border, at
//! 0.4 m/s with a picture every 0.1 s: half of them to a crossing, half to a T, in corridors 1.7 to 2.4 m wide whose colors,
//! lamps, floors, skirtings and doors vary; noise of 8 gray levels; brightness that grows or shrinks by a fifth on the way;
//! start up to 0.3 m beside the middle and up to 5 degrees turned; odometry that errs by 1 % and 0.3 degrees a meter. Lost is
//! an approach in which the behavior says so, that is not tracked from 8 m on, that ends farther than 3 m before it, or in
//! which what is confirmed is off by more than 20 px or 3 m. The error is that of the mean column of both edges, at the
//! camera's height. `--out` writes a picture of each loss.

#![allow(clippy::unwrap_used, reason = "an evaluation may panic")]

#[path = "../tests/rig/mod.rs"]
mod rig;

use rand::RngExt;
use std::path::PathBuf;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Reason;
use yamabico_intersection_tracker::finder::Side;
use yamabico_intersection_tracker::track::Sides;
use yamabico_sim::random::stream;

use rig::{Drive, END_M, Ending, camera, random_world};

/// An approach that ends farther away (m) is lost.
const FARTHEST_END_M: f64 = 3.0;

struct Arguments {
    approaches: u64,
    first: u64,
    fov_deg: f64,
    size: (u32, u32),
    out: Option<PathBuf>,
    verbose: bool,
}

/// The errors of the middle within a range of distances.
struct Bin {
    from_m: f64,
    to_m: f64,
    middle_px: Vec<f64>,
    distance: Vec<f64>,
    /// Errors of the distance over their standard deviation.
    normalized: Vec<f64>,
}

fn main() {
    let arguments = parse();
    let mut bins = [(8.0, 10.1), (6.0, 8.0), (4.0, 6.0), (1.0, 4.0)].map(|(from_m, to_m)| Bin {
        from_m,
        to_m,
        middle_px: Vec::new(),
        distance: Vec::new(),
        normalized: Vec::new(),
    });
    let (mut lost, mut late, mut one_sided, mut ended_m) = (0, 0, 0, Vec::new());
    for seed in arguments.first..arguments.first + arguments.approaches {
        let ran = approach(seed, &arguments, &mut bins);
        lost += u32::from(ran.is_lost);
        late += u32::from(ran.acquired_m < 9.5);
        one_sided += u32::from(ran.one_sided > 0);
        ended_m.push(ran.ended_m);
        if arguments.verbose || ran.is_lost {
            println!(
                "approach {seed}: acquired at {:.1} m, one-sided for {} pictures, ended at {:.2} m{}",
                ran.acquired_m,
                ran.one_sided,
                ran.ended_m,
                if ran.is_lost { ", LOST" } else { "" }
            );
        }
    }
    let (width, height) = arguments.size;
    println!("{} approaches at {width} x {height}, {} degrees", arguments.approaches, arguments.fov_deg);
    println!("lost: {lost}; acquired after 9.5 m: {late}; with one edge only for a while: {one_sided}");
    println!(
        "ended {:.2} m (median) to {:.2} m before it",
        percentile(&ended_m, 0.5),
        percentile(&ended_m, 1.0)
    );
    println!(
        "distance       pictures  middle, px: median   95 %    max   distance, %: median   95 %   rms of error/sigma"
    );
    for bin in &bins {
        let rms = (bin.normalized.iter().map(|x| x * x).sum::<f64>() / bin.normalized.len() as f64).sqrt();
        println!(
            "{:>4} to {:>4} m {:>9} {:>19.2} {:>6.2} {:>6.2} {:>21.1} {:>6.1} {:>20.2}",
            bin.from_m,
            bin.to_m,
            bin.middle_px.len(),
            percentile(&bin.middle_px, 0.5),
            percentile(&bin.middle_px, 0.95),
            percentile(&bin.middle_px, 1.0),
            percentile(&bin.distance, 0.5),
            percentile(&bin.distance, 0.95),
            rms,
        );
    }
}

struct Ran {
    is_lost: bool,
    acquired_m: f64,
    one_sided: u32,
    ended_m: f64,
}

fn approach(seed: u64, arguments: &Arguments, bins: &mut [Bin]) -> Ran {
    let ending = if seed.is_multiple_of(2) { Ending::Crossing } else { Ending::Tee };
    let mut rng = stream(seed, "start");
    let start =
        Pose2::new(END_M - 10.0, rng.random_range(-0.3..0.3), rng.random_range(-5.0_f64..5.0).to_radians());
    let ramp = if rng.random_bool(0.5) { 0.2 } else { -0.2 };
    let camera = camera(arguments.size.0, arguments.size.1, arguments.fov_deg);
    let mut drive = Drive::new(&random_world(seed, ending), start, camera, 8.0, seed);
    let mut ran = Ran { is_lost: false, acquired_m: 0.0, one_sided: 0, ended_m: 0.0 };
    loop {
        let ahead_m = END_M - drive.robot.x;
        ran.ended_m = ahead_m;
        drive.gain = 0.9 + ramp * (10.0 - ahead_m) / 8.5 * 0.9;
        if ramp > 0.0 {
            drive.gain -= 0.1;
        }
        // Whoever drives while the behavior does not keeps the robot straight.
        drive.otherwise.angular = -drive.robot.theta - 0.8 * drive.robot.y;
        let has_picture = drive.step();
        let reason = drive.proposal.reason();
        let handed_over = reason == Some(Reason::Nominal) && drive.proposal.axes.is_empty();
        if ahead_m < 1.5 || handed_over || drive.now_s() > 60.0 {
            ran.is_lost |= ahead_m > FARTHEST_END_M;
            break;
        }
        if !has_picture {
            continue;
        }
        let track = drive.bench.behavior.track();
        let is_tracked = track.landmarks().is_some();
        let is_confirmed = track.confirmations() > 2;
        if arguments.verbose && ((drive.now_s() / 0.1).round() as u32).is_multiple_of(20) {
            keep(&drive, arguments, &format!("frame_{seed:03}_{:.0}cm", 100.0 * ahead_m));
        }
        if is_tracked && ran.acquired_m == 0.0 {
            ran.acquired_m = ahead_m;
        }
        if reason == Some(Reason::IntersectionLost) || (ahead_m < 8.0 && !is_tracked) {
            if !ran.is_lost {
                keep(&drive, arguments, &format!("lost_{seed:03}_{ahead_m:.1}m"));
            }
            ran.is_lost = true;
        }
        ran.one_sided += u32::from((track.sides() == Sides::One) && is_confirmed);
        if arguments.verbose {
            let ahead = drive.bench.behavior.ahead(&drive.wheels);
            let at = |side| track.seen_at(side).map_or(f64::NAN, |at| at.x);
            println!(
                "{ahead_m:.2} {:?} {:?} L {:.1} ({:.1}) {:?} R {:.1} ({:.1}) {:?}",
                ahead.map(|a| (a.distance_m, a.sigma_m)),
                reason,
                at(Side::Left),
                drive.true_column(Side::Left).unwrap(),
                track.trouble(Side::Left),
                at(Side::Right),
                drive.true_column(Side::Right).unwrap(),
                track.trouble(Side::Right)
            );
        }
        if track.sides() != Sides::Both || !is_confirmed {
            continue;
        }
        let error = |side| Some(track.seen_at(side)?.x - drive.true_column(side)?);
        let Some((left, right)) = error(Side::Left).zip(error(Side::Right)) else { continue };
        let Some(ahead) = drive.bench.behavior.ahead(&drive.wheels) else { continue };
        let middle_px = 0.5 * (left + right).abs();
        let truth_m = drive.robot.inverse().transform_point([END_M, 0.0].into()).x;
        let is_elsewhere = left.abs().max(right.abs()) > 20.0 || (ahead.distance_m - truth_m).abs() > 3.0;
        if is_elsewhere && is_confirmed {
            if !ran.is_lost {
                keep(&drive, arguments, &format!("elsewhere_{seed:03}_{ahead_m:.1}m"));
            }
            ran.is_lost = true;
        }
        if middle_px > 4.0 {
            keep(&drive, arguments, &format!("off_{seed:03}_{ahead_m:.1}m_{middle_px:.1}px"));
        }
        if let Some(bin) = bins.iter_mut().find(|bin| ahead_m >= bin.from_m && ahead_m < bin.to_m) {
            bin.middle_px.push(middle_px);
            bin.distance.push(100.0 * (ahead.distance_m / truth_m - 1.0).abs());
            bin.normalized.push((ahead.distance_m - truth_m) / ahead.sigma_m);
        }
    }
    ran
}

fn keep(drive: &Drive, arguments: &Arguments, name: &str) {
    let (Some(folder), Some(pixels)) = (&arguments.out, &drive.picture) else { return };
    let (width, height) = arguments.size;
    let path = folder.join(name).with_extension("png");
    image::save_buffer(path, pixels, width, height, image::ExtendedColorType::L8).unwrap();
}

fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(index.max(1) - 1).copied().unwrap_or(f64::NAN)
}

fn parse() -> Arguments {
    let mut arguments =
        Arguments { approaches: 100, first: 0, fov_deg: 60.0, size: (640, 480), out: None, verbose: false };
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        let mut value = || rest.next().expect("a value");
        match argument.as_str() {
            "--approaches" => arguments.approaches = value().parse().unwrap(),
            "--first" => arguments.first = value().parse().unwrap(),
            "--fov" => arguments.fov_deg = value().parse().unwrap(),
            "--size" => {
                let size = value();
                let (w, h) = size.split_once('x').unwrap();
                arguments.size = (w.parse().unwrap(), h.parse().unwrap());
            }
            "--out" => {
                let folder = PathBuf::from(value());
                std::fs::create_dir_all(&folder).unwrap();
                arguments.out = Some(folder);
            }
            "--verbose" => arguments.verbose = true,
            _ => panic!("unknown argument {argument}"),
        }
    }
    arguments
}
