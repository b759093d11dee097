//! Pose error from single sets of azimuths of four beacons.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_map_localizer::azimuth::{
    BearingPair, EdgeLandmark, LeverArm, Loss, SeenBearing, SolverRule, most_likely_pose, predict,
};

use super::rows;
use crate::arguments::Data;
use crate::report::{Report, Table, number};
use crate::statistics::{mean, percentile};

/// Standard deviation of an azimuth, rad.
const SIGMA_RAD: f64 = 0.0175;
/// Standard deviation of a beacon's apparent position, m.
const BEACON_SIGMA_M: f64 = 0.1;
/// Heading of the robot at every place, rad.
const HEADING_RAD: f64 = FRAC_PI_2;
/// Start of the search for a pose: the center of the room.
const INITIAL: Pose2 = Pose2 { x: 3.0, y: 3.0, theta: HEADING_RAD };

/// Pose error from single sets of azimuths of four beacons in a room of 6 x 6 m (`roh_bearing/`).
///
/// Each set is solved alone, without odometry and without a previous pose, by three methods: plain least squares; with weights that
/// decrease for near beacons, since an inexact beacon position causes larger errors from near; and the same after subtraction of each
/// beacon's mean azimuth error at the *other* places.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

/// Sets of azimuths recorded at one surveyed place.
struct Place {
    truth: Pose2,
    sets: Vec<Vec<f64>>,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let Some(folder) = self.data.set("roh_bearing") else { return Ok(Report::default()) };
        let beacons: Vec<Point2<f64>> = rows(&folder.join("landmarks.csv"))?
            .iter()
            .map(|row| match row[..] {
                [_, x, y, ..] => Ok(Point2::new(x, y)),
                _ => Err("landmarks.csv: a row needs id, x and y".to_owned()),
            })
            .collect::<Result<_, _>>()?;
        let places = places(&folder, beacons.len())?;
        let sets: usize = places.iter().map(|place| place.sets.len()).sum();
        let mut table = Table::new(
            format!("{sets} sets of {} azimuths at {} places", beacons.len(), places.len()),
            &[
                "method",
                "median, m",
                "mean, m",
                "90 %, m",
                "heading median, deg",
                "no pose",
                "medians by place, m",
            ],
        );
        let no_offsets = vec![0.0; beacons.len()];
        for (name, beacon_sigma_m, is_calibrated) in [
            ("plain least squares", 0.0, false),
            ("near beacons count less", BEACON_SIGMA_M, false),
            ("... and mean errors subtracted", BEACON_SIGMA_M, true),
        ] {
            let (mut errors_m, mut headings_deg, mut unsolved) = (Vec::new(), Vec::new(), 0_usize);
            let mut medians = Vec::new();
            for (index, place) in places.iter().enumerate() {
                let others = places.iter().enumerate().filter(|(other, _)| *other != index);
                let offsets = if is_calibrated {
                    mean_errors(others.map(|(_, place)| place), &beacons)
                } else {
                    no_offsets.clone()
                };
                let first = errors_m.len();
                for azimuths in &place.sets {
                    match locate(azimuths, &offsets, &beacons, beacon_sigma_m) {
                        Some(pose) => {
                            errors_m.push(pose.distance(&place.truth));
                            let error = angle_difference(pose.theta, place.truth.theta);
                            headings_deg.push(error.abs().to_degrees());
                        }
                        None => unsolved += 1,
                    }
                }
                medians.push(format!("{:.3}", percentile(&errors_m[first..], 0.5)));
            }
            table.row([
                name.into(),
                number(percentile(&errors_m, 0.5), 3),
                number(mean(&errors_m), 3),
                number(percentile(&errors_m, 0.9), 3),
                number(percentile(&headings_deg, 0.5), 2),
                unsolved.into(),
                medians.join(", ").into(),
            ]);
        }
        Ok(Report::new([table]))
    }
}

/// Returns the pose that one set of azimuths determines.
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
    most_likely_pose(&pairs, &INITIAL, None, &rule, LeverArm::zeros()).ok().map(|found| found.belief.pose)
}

/// Returns the mean azimuth error of each beacon at these places, less the mean over all beacons of a place, rad; weights grow with the
/// squared distance.
fn mean_errors<'a>(places: impl Iterator<Item = &'a Place>, beacons: &[Point2<f64>]) -> Vec<f64> {
    let (mut sums, mut weights) = (vec![0.0; beacons.len()], vec![0.0; beacons.len()]);
    for place in places {
        let errors: Vec<(f64, f64)> = beacons
            .iter()
            .enumerate()
            .map(|(index, beacon)| {
                let landmark = EdgeLandmark { position: *beacon, sign: None, sigma_m: 0.0 };
                let expected = predict(&landmark, &place.truth, LeverArm::zeros());
                let error = |set: &Vec<f64>| angle_difference(set[index], expected.azimuth_rad);
                let mean = place.sets.iter().map(error).sum::<f64>() / place.sets.len() as f64;
                (mean, expected.distance_m.powi(2))
            })
            .collect();
        let weight: f64 = errors.iter().map(|(_, weight)| weight).sum();
        let common = errors.iter().map(|(error, weight)| error * weight).sum::<f64>() / weight;
        for (index, (error, weight)) in errors.into_iter().enumerate() {
            sums[index] += weight * (error - common);
            weights[index] += weight;
        }
    }
    sums.iter().zip(weights).map(|(sum, weight)| sum / weight).collect()
}

/// Reads the places; their files are named `xX_yY.csv`.
fn places(folder: &Path, beacons: usize) -> Result<Vec<Place>, String> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(|error| format!("{}: {error}", folder.display()))?
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
