//! How near the pose from one set of azimuths comes to the truth, on recorded azimuths of four beacons in a room of 6 x 6 m.
//!
//! `evaluate_beacons [DIR]`
//!
//! DIR holds `roh_bearing/` (places of the beacons, and for each of several surveyed poses some hundred sets of azimuths); without
//! it `YAMABICO_DATA`, else `../shared/data` beside the workspace. Every set stands alone: no odometry, no pose before.
//!
//! Three ways: plain least squares; with beacons that count less the nearer they are, as a beacon whose place is not exact errs
//! more from near; and the same after the mean error of each beacon's azimuth at the *other* places has been taken off, so that
//! no pose is judged by what it taught.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_map_localizer::azimuth::{
    BearingPair, EdgeLandmark, LeverArm, Loss, SeenBearing, SolverRule, most_likely_pose, predict,
};

/// Standard deviation of an azimuth, rad.
const SIGMA_RAD: f64 = 0.0175;
/// Standard deviation of the place that a beacon seems to stand at, m.
const BEACON_SIGMA_M: f64 = 0.1;
/// The heading of the robot at every place, rad.
const HEADING_RAD: f64 = FRAC_PI_2;
/// Where the search for a pose begins: the middle of the room.
const GUESS: Pose2 = Pose2 { x: 3.0, y: 3.0, theta: HEADING_RAD };

fn main() -> ExitCode {
    match evaluate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

/// Sets of azimuths from one place.
struct Place {
    truth: Pose2,
    sets: Vec<Vec<f64>>,
}

fn evaluate() -> Result<(), String> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let given = std::env::args_os().nth(1).or_else(|| std::env::var_os("YAMABICO_DATA"));
    let folder = given.map_or(beside, PathBuf::from).join("roh_bearing");
    if !folder.is_dir() {
        println!("no {}: skipped", folder.display());
        return Ok(());
    }
    let beacons: Vec<Point2<f64>> = rows(&folder.join("landmarks.csv"))?
        .iter()
        .map(|row| match row[..] {
            [_, x, y, ..] => Ok(Point2::new(x, y)),
            _ => Err("landmarks.csv: a row needs id, x and y".to_owned()),
        })
        .collect::<Result<_, _>>()?;
    let places = places(&folder, beacons.len())?;
    let sets: usize = places.iter().map(|place| place.sets.len()).sum();
    println!("{sets} sets of {} azimuths at {} places", beacons.len(), places.len());
    let none = vec![0.0; beacons.len()];
    for (name, beacon_sigma_m, is_calibrated) in [
        ("plain least squares", 0.0, false),
        ("near beacons count less", BEACON_SIGMA_M, false),
        ("... and their mean errors elsewhere taken off", BEACON_SIGMA_M, true),
    ] {
        let (mut errors_m, mut turns, mut unsolved) = (Vec::new(), Vec::new(), 0);
        let mut medians = Vec::new();
        for (number, place) in places.iter().enumerate() {
            let others = places.iter().enumerate().filter(|(other, _)| *other != number);
            let offsets = if is_calibrated {
                mean_errors(others.map(|(_, place)| place), &beacons)
            } else {
                none.clone()
            };
            let begin = errors_m.len();
            for azimuths in &place.sets {
                match locate(azimuths, &offsets, &beacons, beacon_sigma_m) {
                    Some(pose) => {
                        errors_m.push(pose.distance(&place.truth));
                        turns.push(angle_difference(pose.theta, place.truth.theta).abs());
                    }
                    None => unsolved += 1,
                }
            }
            medians.push(format!("{:.3}", quantile(&mut errors_m[begin..].to_vec(), 0.5)));
        }
        let mean_m = errors_m.iter().sum::<f64>() / errors_m.len() as f64;
        println!(
            "{name}: position median {:.3} m, mean {mean_m:.3} m, 90 % within {:.3} m; heading median {:.2} deg; \
             {unsolved} without a pose; medians of the places {} m",
            quantile(&mut errors_m, 0.5),
            quantile(&mut errors_m, 0.9),
            quantile(&mut turns, 0.5).to_degrees(),
            medians.join(", "),
        );
    }
    Ok(())
}

/// The pose that one set tells.
fn locate(azimuths: &[f64], offsets: &[f64], beacons: &[Point2<f64>], beacon_sigma_m: f64) -> Option<Pose2> {
    let pairs: Vec<BearingPair> = azimuths
        .iter()
        .zip(offsets)
        .zip(beacons)
        .map(|((azimuth, offset), beacon)| BearingPair {
            landmark: EdgeLandmark { position: *beacon, sign: None, sigma_m: beacon_sigma_m },
            seen: SeenBearing { azimuth_rad: azimuth - offset, sign: None, sigma_rad: SIGMA_RAD },
        })
        .collect();
    let rule = SolverRule::exact(Loss::Squares);
    most_likely_pose(&pairs, &GUESS, None, &rule, LeverArm::zeros()).ok().map(|found| found.belief.pose)
}

/// How much each beacon's azimuth errs at these places beyond what all of one place err together, rad; the farther a beacon, the
/// more it counts.
fn mean_errors<'a>(places: impl Iterator<Item = &'a Place>, beacons: &[Point2<f64>]) -> Vec<f64> {
    let (mut sums, mut weights) = (vec![0.0; beacons.len()], vec![0.0; beacons.len()]);
    for place in places {
        let errors: Vec<(f64, f64)> = beacons
            .iter()
            .enumerate()
            .map(|(number, beacon)| {
                let landmark = EdgeLandmark { position: *beacon, sign: None, sigma_m: 0.0 };
                let expected = predict(&landmark, &place.truth, LeverArm::zeros());
                let off = |set: &Vec<f64>| angle_difference(set[number], expected.azimuth_rad);
                let mean = place.sets.iter().map(off).sum::<f64>() / place.sets.len() as f64;
                (mean, expected.distance_m.powi(2))
            })
            .collect();
        let weight: f64 = errors.iter().map(|(_, weight)| weight).sum();
        let common = errors.iter().map(|(error, weight)| error * weight).sum::<f64>() / weight;
        for (number, (error, weight)) in errors.into_iter().enumerate() {
            sums[number] += weight * (error - common);
            weights[number] += weight;
        }
    }
    sums.iter().zip(weights).map(|(sum, weight)| sum / weight).collect()
}

/// Files are named after the place: `xX_yY.csv`.
fn places(folder: &Path, beacons: usize) -> Result<Vec<Place>, String> {
    let cannot = |error: std::io::Error| format!("{}: {error}", folder.display());
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(cannot)?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "csv"))
        .collect();
    files.sort();
    let mut places = Vec::new();
    for path in files {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let Some((x, y)) = name.strip_prefix('x').and_then(|rest| rest.split_once("_y")) else { continue };
        let (Ok(x), Ok(y)) = (x.parse(), y.parse()) else { continue };
        let sets: Vec<Vec<f64>> = rows(&path)?
            .into_iter()
            .filter(|row| row.len() == beacons)
            .map(|row| row.into_iter().map(|degrees| degrees.to_radians() % TAU).collect())
            .collect();
        if !sets.is_empty() {
            places.push(Place { truth: Pose2::new(x, y, HEADING_RAD), sets });
        }
    }
    if places.len() < 2 {
        return Err(format!("{}: needs at least two files xX_yY.csv", folder.display()));
    }
    Ok(places)
}

/// The numbers of a table with one row of names.
fn rows(path: &Path) -> Result<Vec<Vec<f64>>, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let parse = |line: &str| line.split(',').map(|value| value.trim().parse()).collect::<Result<_, _>>();
    let lines = text.lines().skip(1).filter(|line| !line.trim().is_empty());
    lines.map(parse).collect::<Result<_, _>>().map_err(|error| format!("{}: {error}", path.display()))
}

/// The value that this share of them does not exceed.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}
