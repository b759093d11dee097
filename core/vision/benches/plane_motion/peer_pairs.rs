//! Pairs of pictures with known motion, written for the peer of `tests/peers` with our answers and times.

use std::path::Path;

use nalgebra::{Cholesky, SVector};
use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};
use yamabico_geometry::Pose2;
use yamabico_geometry::image::ImageView;
use yamabico_vision::plane_motion::PlaneMotion;
use yamabico_vision::plane_motion::direct_alignment::{AlignmentPrior, DirectAligner};
use yamabico_vision::plane_motion::floor_view::FloorView;
use yamabico_vision::plane_motion::look_history::{Look, LookHistory};
use yamabico_vision::plane_motion::motion_prior::{CommonCovariance, motion_prior};
use yamabico_vision::plane_motion::picture_judge::BASELINES_M;
use yamabico_vision::plane_motion::wheel_lag::WheelLag;

use super::rendered_floor::camera;
use super::{Drive, STEP_S, there_and_back, thread_ns};

/// Single runs of each measured step.
const RUNS: usize = 40;

/// Writes the pictures of the drives, and `plane_motion_WIDTHxHEIGHT.json` with the camera, the pairs and our results.
/// All drives must have pictures of the same size.
///
/// # Errors
/// A file cannot be written.
pub fn write(folder: &Path, drives: &[Drive]) -> std::io::Result<()> {
    let Some(&Drive { width, height, .. }) = drives.first() else { return Ok(()) };
    std::fs::create_dir_all(folder)?;
    let (intrinsics, mount) = camera(width, height);
    let view = FloorView::new(intrinsics, mount);
    let (mut looks, mut judged_ms) = (Vec::new(), Vec::new());
    for drive in drives {
        for (i, (_, data)) in drive.pictures.iter().enumerate() {
            let path = folder.join(picture_name(drive, i));
            image::save_buffer(path, data, width, height, image::ColorType::L8)
                .map_err(std::io::Error::other)?;
        }
        looks.extend(drive_looks(drive));
        judged_ms.extend(judged_times_ms(drive));
    }
    let rotation: Vec<f64> = view.robot_from_camera().transpose().iter().copied().collect();
    let problem = json!({
        "focal_px": [intrinsics.fx, intrinsics.fy],
        "center_px": [intrinsics.cx, intrinsics.cy],
        "robot_from_camera_rows": rotation,
        "camera_in_robot_m": view.position().as_slice(),
        "top_row": DirectAligner::top_row(&view),
        "judged_ms": judged_ms,
        "looks": looks,
    });
    std::fs::write(folder.join(format!("plane_motion_{width}x{height}.json")), problem.to_string())
}

fn picture_name(drive: &Drive, number: usize) -> String {
    format!("plane_motion_{}x{}_{}_{number:02}.png", drive.width, drive.height, drive.name)
}

/// Pictures of the drive that have older ones at all baselines, with the judged pixels and these pairs. A motion is the
/// pose of the current robot in the frame of the older one (m, m, rad); a warp takes current to older pixels.
fn drive_looks(drive: &Drive) -> Vec<Value> {
    let (width, height) = (drive.width as usize, drive.height as usize);
    let (intrinsics, mount) = camera(drive.width, drive.height);
    let view = FloorView::new(intrinsics, mount);
    let mut history = LookHistory::new(width, height, DirectAligner::top_row(&view) / 2);
    let (mut aligner, mut motion) = (DirectAligner::new(view), PlaneMotion::new(intrinsics, mount));
    let mut random = rand_pcg::Pcg64::seed_from_u64(7);
    let mut looks = Vec::new();
    for (i, (robot, data)) in drive.pictures.iter().enumerate() {
        let Ok(image) = ImageView::new(data, width, height, width) else { continue };
        let at_s = STEP_S * i as f64;
        // Both band-passed images and the copy of the gray levels.
        let begin = thread_ns();
        history.push(image, *robot, at_s, &WheelLag::default());
        let prepared_ms = 1e-6 * (thread_ns() - begin) as f64;
        let points = motion.look(image, *robot, at_s).unwrap_or_default();
        let pixels: Vec<[f64; 2]> =
            points.iter().map(|point| [point.pixel.x.into(), point.pixel.y.into()]).collect();
        let numbers: Vec<usize> =
            BASELINES_M.iter().filter_map(|&way_m| history.at_baseline(way_m)).collect();
        let (Some(newest), true) = (history.newest(), numbers.len() == BASELINES_M.len()) else { continue };
        let pairs = numbers.iter().map(|&number| {
            let previous = history.look(number);
            let name = picture_name(drive, (previous.at_s / STEP_S).round() as usize);
            aligned_pair(&mut aligner, &view, (&name, previous), newest, &mut random)
        });
        looks.push(json!({
            "scene": drive.name,
            "current": picture_name(drive, i),
            "prepared_ms": prepared_ms,
            "judged_pixels": pixels,
            "pairs": pairs.collect::<Vec<_>>(),
        }));
    }
    looks
}

/// True motion, a prior off it, and our alignment from that prior with its time.
fn aligned_pair(
    aligner: &mut DirectAligner,
    view: &FloorView,
    (name, previous): (&str, &Look),
    newest: &Look,
    random: &mut rand_pcg::Pcg64,
) -> Value {
    let truth = previous.odometry.relative(&newest.odometry);
    let covariance = motion_prior(truth.x, truth.theta, 1.0);
    let motion = drawn(&truth, &covariance, random);
    let prior = AlignmentPrior { motion, covariance, tilt: 0.0, roll: 0.0 };
    let mut aligned = aligner.align(&newest.bands, &previous.bands, &prior);
    let mut times_ms: Vec<f64> = (0..RUNS)
        .map(|_| {
            let begin = thread_ns();
            aligned = aligner.align(&newest.bands, &previous.bands, &prior);
            1e-6 * (thread_ns() - begin) as f64
        })
        .collect();
    times_ms.sort_unstable_by(f64::total_cmp);
    let warp = view.turned(aligned.tilt, aligned.roll).homography(&aligned.motion, 0.0);
    json!({
        "previous": name,
        "true_motion": as_row(&truth),
        "prior_motion": as_row(&prior.motion),
        "our_motion": as_row(&aligned.motion),
        "our_warp_rows": warp.transpose().as_slice(),
        "our_pixels": aligned.pixels,
        "our_ms": times_ms[RUNS / 2],
    })
}

/// A motion off `truth` by a draw from the prior's distribution.
fn drawn(truth: &Pose2, covariance: &CommonCovariance, random: &mut rand_pcg::Pcg64) -> Pose2 {
    let covariance = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let mut unit = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
    let unit = SVector::<f64, 3>::from_fn(|_, _| unit());
    let off = Cholesky::new(covariance).map_or(unit * 0.0, |root| root.l() * unit);
    Pose2::new(truth.x + off[0], truth.y + off[1], truth.theta + off[2])
}

/// Times of the judgements of single pictures, with evidence and obstacles, ms.
fn judged_times_ms(drive: &Drive) -> Vec<f64> {
    let (width, height) = (drive.width as usize, drive.height as usize);
    let (intrinsics, mount) = camera(drive.width, drive.height);
    let mut motion = PlaneMotion::new(intrinsics, mount);
    let mut times_ms = Vec::new();
    for (turn, number) in there_and_back(drive.pictures.len()).cycle().take(4 * RUNS).enumerate() {
        let Some((robot, data)) = drive.pictures.get(number) else { continue };
        let Ok(image) = ImageView::new(data, width, height, width) else { continue };
        let begin = thread_ns();
        let is_judged = motion.look(image, *robot, STEP_S * turn as f64).is_ok();
        motion.obstacles(robot, |_| true);
        let took_ms = 1e-6 * (thread_ns() - begin) as f64;
        if is_judged && motion.judge().shows_things() {
            times_ms.push(took_ms);
        }
    }
    times_ms
}

fn as_row(motion: &Pose2) -> [f64; 3] {
    [motion.x, motion.y, motion.theta]
}
