//! Mount of a camera, from pictures or a recording of a drive along a corridor.

use std::path::{Path, PathBuf};

use nalgebra::Vector2;
use serde::Serialize;
use yamabico_core::camera::{Calibration, Distortion, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::{Hypotenuse, Pose2};
use yamabico_vision::calibration::corridor_height::{HEIGHTS_M, WIDTHS_M};
use yamabico_vision::calibration::corridor_sight::CorridorSight;
use yamabico_vision::calibration::horizon_fit::{HorizonFit, PrincipalRow, fit_horizon};
use yamabico_vision::corridor::evidence::EvidenceObserver;
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObserver};
use yamabico_vision::segments::SegmentConfig;

use super::overlay::{self, GroundOverlay};
use super::pictures::Picture;
use super::recorded_drive::thinned_frames;
use super::robot_camera::{Findings, RobotCamera};
use super::{Measured, camera_height};
use crate::LearningError;

/// Probability of a corridor from which on a picture counts.
const CORRIDOR: f64 = 0.5;
/// Number of times that pictures are straightened again about an estimated principal point.
const CENTERINGS: usize = 3;
/// Difference of two heights from which on they contradict each other, standard deviations.
const CONTRADICTION: f64 = 4.0;
/// Standard deviation of a height that was measured by hand, m.
const BY_HAND_SIGMA_M: f64 = 0.01;

/// Settings of the calibration.
#[derive(Clone, Debug)]
pub struct Options {
    /// Width of the corridor at the floor, m, if known: gives the height.
    pub corridor_width_m: Option<f64>,
    /// Height of the camera, m, if it was measured by hand.
    pub height_m: Option<f64>,
    /// Treatment of the principal point's row.
    pub principal_row: PrincipalRow,
    /// Overlay to write, a PNG.
    pub overlay: PathBuf,
}

/// Mount of the camera.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// Downward tilt, degrees.
    pub tilt_deg: Measured,
    /// Roll, degrees, positive if the right side is lower.
    pub roll_deg: Measured,
    /// Height, m, by the width of the corridor.
    pub height_by_width_m: Option<Measured>,
    /// Height, m, by the motion of the floor.
    pub height_by_motion_m: Option<Measured>,
    /// Pan, degrees, by the motion of the floor.
    pub pan_deg: Option<Measured>,
    /// Row of the horizon at the principal column, px.
    pub horizon_row: Measured,
    /// Row of the principal point in the robot file, px.
    pub given_row: f64,
    /// Row of the principal point by horizon and plumb lines, px.
    pub estimated_row: Measured,
    /// True if the given row is wrong, as in a cropped picture, so that the estimated one replaces it.
    pub is_cropped: bool,
    /// Tilt by plumb lines alone, degrees.
    pub plumb_tilt_deg: Measured,
    /// Root mean square of the distances of the vanishing points from the horizon, px.
    pub residual_px: f64,
    /// Number of pictures, of those that show a corridor, and of those that agree with the horizon.
    pub pictures: [usize; 3],
    /// Number of plumb lines that agree.
    pub plumb_lines: usize,
    /// Correlation of the floor between frames.
    pub floor_correlation: Option<f64>,
    /// Overlay that was written.
    pub overlay: PathBuf,
    /// Quantities that could not be measured and why, and parts of a recording that were not used, for people.
    pub notes: Vec<String>,
    /// Values for the robot file.
    #[serde(skip)]
    pub findings: Findings,
}

/// Measures the mount of `camera` from pictures.
///
/// # Errors
/// [`LearningError`]: too few pictures show a corridor, or an argument is out of range.
pub fn from_pictures(
    pictures: &[Picture],
    camera: &RobotCamera,
    options: &Options,
) -> Result<Learned, LearningError> {
    for picture in pictures {
        camera.check_size(&picture.name, picture.size())?;
    }
    learn(pictures, None, camera, options)
}

/// Measures the mount of `camera` from pictures of a drive with the pose of the robot at each, odometry frame, where it is known.
///
/// # Errors
/// [`LearningError`]: likewise.
pub fn from_drive(
    pictures: &[Picture],
    poses: &[Option<Pose2>],
    camera: &RobotCamera,
    options: &Options,
) -> Result<Learned, LearningError> {
    for picture in pictures {
        camera.check_size(&picture.name, picture.size())?;
    }
    learn(pictures, Some(poses), camera, options)
}

/// Measures the mount of `camera` from a recording.
///
/// # Errors
/// [`LearningError`]: likewise, or the recording has no frames of the camera.
pub fn from_recording(
    recording: &Path,
    camera: &RobotCamera,
    options: &Options,
) -> Result<Learned, LearningError> {
    let (frames, drive) = thinned_frames(recording, camera)?;
    let poses: Vec<Option<Pose2>> = frames.iter().map(|frame| drive.pose_at(frame.seconds)).collect();
    let pictures: Vec<Picture> = frames.into_iter().map(|frame| frame.picture).collect();
    let mut learned = learn(&pictures, Some(&poses), camera, options)?;
    if drive.odometry.is_empty() {
        learned.notes.insert(
            0,
            "the recording has no odometry: height and pan by the motion of the floor are not known"
                .to_owned(),
        );
    }
    learned.notes.extend(drive.warnings);
    Ok(learned)
}

fn learn(
    pictures: &[Picture],
    poses: Option<&[Option<Pose2>]>,
    camera: &RobotCamera,
    options: &Options,
) -> Result<Learned, LearningError> {
    check(options).map_err(LearningError::Unsuitable)?;
    let given = camera.intrinsics.pinhole();
    let look = |pinhole: &Pinhole| -> Vec<CorridorSight> {
        pictures.iter().map(|picture| sight(picture, pinhole)).collect()
    };
    let fit_to = |sights: &[CorridorSight], row: PrincipalRow| {
        let fit = fit_horizon(sights, given.intrinsics(), camera.calibration, row);
        fit.map_err(|error| LearningError::Unsuitable(error.to_string()))
    };
    let mut sights = look(&given);
    let mut fit = fit_to(&sights, options.principal_row)?;
    if fit.is_cropped && *given.distortion() != Distortion::NONE {
        // The lens bends lines about the principal point, so that they must be straightened about the right one.
        for _ in 0..CENTERINGS {
            let centered = Intrinsics { cy: fit.principal_row, ..*given.intrinsics() };
            sights = look(&Pinhole::new(centered, *given.distortion()));
            fit = fit_to(&sights, PrincipalRow::Estimated)?;
        }
    }
    let intrinsics = Intrinsics { cy: fit.principal_row, ..*given.intrinsics() };
    let pinhole = Pinhole::new(intrinsics, *given.distortion());
    let mount = fit.mount(&camera.mount.into());
    let mut notes = Vec::new();

    let by_width = options.corridor_width_m.and_then(|width_m| {
        let found = camera_height::by_width(pictures, &sights, &pinhole, &mount, width_m);
        if found.is_none() {
            notes.push(
                "too few pictures show the foot of both walls: the width of the corridor gives no height"
                    .to_owned(),
            );
        }
        found
    });
    let by_motion = poses.filter(|poses| poses.iter().flatten().count() > 1).and_then(|poses| {
        camera_height::by_floor_motion(pictures, poses, &pinhole, &mount)
            .map_err(|problem| notes.push(problem))
            .ok()
    });
    let motion_m = by_motion.map(|motion| Measured::new(motion.height_m, motion.height_sigma_m));
    if let (Some(a), Some(b)) = (by_width, motion_m) {
        let sigma = a.sigma.unwrap_or(0.0).hypotenuse(b.sigma.unwrap_or(0.0)).max(0.01);
        if (a.value - b.value).abs() > CONTRADICTION * sigma {
            notes.push(format!(
                "the heights by width ({:.3} m) and by motion ({:.3} m) contradict each other: check the width, and the scale of the odometry; \
                 that with the smaller standard deviation is taken",
                a.value, b.value
            ));
        }
    }
    if let Some(given_m) = options.height_m {
        notes
            .extend(by_width.and_then(|height| contradiction(given_m, &height, "the width of the corridor")));
        notes.extend(motion_m.and_then(|height| contradiction(given_m, &height, "the motion of the floor")));
    }
    let sigma_of = |height: &Measured| height.sigma.unwrap_or(f64::INFINITY);
    let best = [by_width, motion_m].into_iter().flatten().min_by(|a, b| sigma_of(a).total_cmp(&sigma_of(b)));
    let height_m = options.height_m.or(best.map(|height| height.value));
    if height_m.is_none() {
        notes.push("the height is not known: state the width of the corridor (--corridor-width-m), record with odometry, or measure it (--height-m)".to_owned());
    }
    draw(pictures, &sights, &fit, &pinhole, &mount, height_m, &options.overlay)?;
    let pan_deg = by_motion.map(|motion| Measured::degrees(motion.pan, motion.pan_sigma));
    let findings = Findings {
        principal_row: fit.is_cropped.then_some(fit.principal_row),
        height_m,
        tilt_deg: Some(fit.tilt.to_degrees()),
        roll_deg: Some(fit.roll.to_degrees()),
        pan_deg: pan_deg.map(|pan| pan.value),
        is_complete: height_m.is_some()
            && (camera.intrinsics.fx.is_some() || camera.calibration == Calibration::Measured),
        ..Findings::default()
    };
    Ok(Learned {
        tilt_deg: Measured::degrees(fit.tilt, fit.tilt_sigma),
        roll_deg: Measured::degrees(fit.roll, fit.roll_sigma),
        height_by_width_m: by_width,
        height_by_motion_m: motion_m,
        pan_deg,
        horizon_row: Measured::new(fit.horizon_row[0], fit.horizon_row[1]),
        given_row: given.intrinsics().cy,
        estimated_row: Measured::new(fit.estimated_row[0], fit.estimated_row[1]),
        is_cropped: fit.is_cropped,
        plumb_tilt_deg: Measured::degrees(fit.plumb_tilt[0], fit.plumb_tilt[1]),
        residual_px: fit.point_rms_px,
        pictures: [pictures.len(), fit.points[0], fit.points[1]],
        plumb_lines: fit.plumb_lines[1],
        floor_correlation: by_motion.map(|motion| motion.correlation),
        overlay: options.overlay.clone(),
        notes,
        findings,
    })
}

/// Note for people if a height measured by hand, m, is not the measured one.
fn contradiction(given_m: f64, measured: &Measured, from: &str) -> Option<String> {
    let sigma_m = measured.sigma.unwrap_or(0.0).max(BY_HAND_SIGMA_M);
    ((given_m - measured.value).abs() > CONTRADICTION * sigma_m).then(|| {
        format!(
            "--height-m {given_m:.3} contradicts {:.3} m by {from}: check it, and what {from} relies on",
            measured.value
        )
    })
}

fn check(options: &Options) -> Result<(), String> {
    let widths = options.corridor_width_m.filter(|width| !WIDTHS_M.contains(width));
    if let Some(width_m) = widths {
        return Err(format!(
            "a corridor is {} to {} m wide, not {width_m} m",
            WIDTHS_M.start(),
            WIDTHS_M.end()
        ));
    }
    match options.height_m.filter(|height| !HEIGHTS_M.contains(height)) {
        Some(height_m) => {
            Err(format!("a camera is {} to {} m high, not {height_m} m", HEIGHTS_M.start(), HEIGHTS_M.end()))
        }
        None => Ok(()),
    }
}

/// Lines of a picture, with the corridor's vanishing point if one is believed; the horizon is not presumed.
fn sight(picture: &Picture, pinhole: &Pinhole) -> CorridorSight {
    let camera = CorridorCamera {
        pinhole: *pinhole,
        mount: Mount::level(1.0),
        calibration: Calibration::Guessed,
        horizon_sigma_rad: 1.0,
    };
    let observer =
        CorridorObserver::with_segments(camera, FloorLineRule::default(), SegmentConfig::for_evidence());
    let mut observer = EvidenceObserver::new(observer, None);
    let Ok(view) = picture.gray.view() else { return CorridorSight::default() };
    let seen = observer.observe(view, None);
    let point = seen.observation.ok().filter(|_| seen.probability >= CORRIDOR && !seen.is_far);
    let width = f64::from(pinhole.intrinsics().width);
    CorridorSight::new(point.map(|point| point.vanishing_point), observer.observer().segments(), width)
}

/// Draws into the picture whose vanishing point is nearest to the horizon and the middle.
fn draw(
    pictures: &[Picture],
    sights: &[CorridorSight],
    fit: &HorizonFit,
    pinhole: &Pinhole,
    mount: &Mount,
    height_m: Option<f64>,
    file: &Path,
) -> Result<(), LearningError> {
    let intrinsics = pinhole.intrinsics();
    let slope = -fit.roll.tan();
    let off = |point: &Vector2<f64>| (point.y - fit.horizon_row[0] - slope * (point.x - intrinsics.cx)).abs();
    let from_middle = |point: &Vector2<f64>| off(point) + 0.1 * (point.x - intrinsics.cx).abs();
    let seen = || sights.iter().enumerate().filter_map(|(index, sight)| Some((index, sight.point?)));
    let Some((best, _)) = seen().min_by(|a, b| from_middle(&a.1).total_cmp(&from_middle(&b.1))) else {
        return Ok(());
    };
    let gate = 3.0 * fit.point_rms_px.max(1.0);
    let points = seen().filter_map(|(_, point)| Some((pinhole.distort_pixel(point)?, off(&point) <= gate)));
    let drawing = GroundOverlay { pinhole: *pinhole, mount: *mount, height_m, points: points.collect() };
    overlay::ground(file, &pictures[best], &drawing, None)
}
