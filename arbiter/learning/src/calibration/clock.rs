//! Offset of a camera's clock from that of odometry, from a recording of turns.

use std::path::Path;

use serde::Serialize;
use yamabico_core::camera::Mount;
use yamabico_vision::calibration::clock_offset::fit_clock_offset;
use yamabico_vision::calibration::float_image::FloatImage;
use yamabico_vision::calibration::heading_track::{HeadingTrack, TimedTurn};
use yamabico_vision::calibration::turn_rate::HorizonBand;

use super::Measured;
use super::recorded_drive::RecordedDrive;
use super::robot_camera::{Findings, RobotCamera};
use crate::LearningError;

/// Smoothing of frames, px.
const SMOOTHING_PX: f64 = 1.0;
/// Longest time between two frames that are compared, s.
const MAX_GAP_S: f64 = 0.5;

/// Offset of the camera's clock.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// Time by which stamps of frames are late relative to those of odometry, ms.
    pub offset_ms: Measured,
    /// Correlation of the turn rates by frames and by odometry.
    pub correlation: f64,
    /// Turns by frames over turns by odometry.
    pub scale: f64,
    /// Standard deviation of the turn rate, degrees/s.
    pub rate_degps: f64,
    /// Number of frames, and of turns between frames that were compared.
    pub frames: [usize; 2],
    /// Latency that the robot file states, ms.
    pub latency_before_ms: Option<f64>,
    /// Latency that the camera has, ms; `None` if the file states none, or if it would be negative.
    pub latency_ms: Option<f64>,
    /// Parts of the recording that were not used, for people.
    pub warnings: Vec<String>,
    /// Values for the robot file.
    #[serde(skip)]
    pub findings: Findings,
}

/// Estimates the offset of `camera` in a recording.
///
/// # Errors
/// [`LearningError`]: the recording has no frames or no odometry, or its turns do not determine the offset.
pub fn learn(recording: &Path, camera: &RobotCamera) -> Result<Learned, LearningError> {
    let unsuitable =
        |problem: String| LearningError::Unsuitable(format!("{}: {problem}", recording.display()));
    let (pinhole, mount) = (camera.intrinsics.pinhole(), Mount::from(camera.mount));
    let (mut turns, mut last): (Vec<TimedTurn>, Option<(f64, HorizonBand)>) = (Vec::new(), None);
    let size = pinhole.intrinsics().size();
    let drive = RecordedDrive::read(recording, &camera.sensor, size, &mut |seconds, image| {
        let band = HorizonBand::of(&FloatImage::of(image).smoothed(SMOOTHING_PX), &pinhole, &mount);
        if let Some((from_s, earlier)) = &last
            && (f64::EPSILON..MAX_GAP_S).contains(&(seconds - from_s))
            && let Some(seen) = earlier.turn_to(&band)
        {
            turns.push(TimedTurn { from_s: *from_s, to_s: seconds, turn: seen.turn });
        }
        last = Some((seconds, band));
    })?;
    if drive.odometry.len() < 2 {
        return Err(unsuitable(
            "has no odometry: the offset is that between camera and odometry, so record a robot with a sensor for it".to_owned(),
        ));
    }
    let mut headings = HeadingTrack::default();
    drive.odometry.iter().for_each(|(seconds, pose)| headings.push(*seconds, pose.theta));
    let found = fit_clock_offset(&turns, &headings).map_err(|error| unsuitable(error.to_string()))?;
    let offset_ms = Measured::new(1e3 * found.offset_s, 1e3 * found.sigma_s);
    let latency_ms =
        camera.latency_ms.map(|before| before + offset_ms.value).filter(|latency| *latency >= 0.0);
    Ok(Learned {
        offset_ms,
        correlation: found.correlation,
        scale: found.scale,
        rate_degps: found.rate_sigma.to_degrees(),
        frames: [drive.frames, found.turns],
        latency_before_ms: camera.latency_ms,
        latency_ms,
        warnings: drive.warnings,
        findings: Findings { latency_ms, ..Findings::default() },
    })
}
