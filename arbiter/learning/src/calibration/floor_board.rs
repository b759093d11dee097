//! Mount of a camera from pictures of a board that lies on the floor.

use std::path::{Path, PathBuf};

use serde::Serialize;
use yamabico_core::camera::{Calibration, Mount};
use yamabico_vision::calibration::board_mount::{BoardMountError, board_mount};
use yamabico_vision::calibration::{Board, FoundBoard, NotFound, find_board};

use super::Measured;
use super::lens::PictureReport;
use super::overlay::{self, GroundOverlay};
use super::pictures::Picture;
use super::refusal::refusal;
use super::robot_camera::{Findings, RobotCamera};
use crate::LearningError;

/// Alignment of the board on the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// A side of the board is parallel to the robot's forward axis: the pan follows.
    Square,
    /// It lies anyhow.
    Any,
}

/// Mount of the camera.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// Height, m.
    pub height_m: Measured,
    /// Downward tilt, degrees.
    pub tilt_deg: Measured,
    /// Roll, degrees, positive if the right side is lower.
    pub roll_deg: Measured,
    /// Pan, degrees, if the board lies square.
    pub pan_deg: Option<Measured>,
    /// Pictures, in their order.
    pub pictures: Vec<PictureReport>,
    /// Overlay that was written.
    pub overlay: PathBuf,
    /// Values for the robot file.
    #[serde(skip)]
    pub findings: Findings,
}

/// Measures the mount of `camera` and draws horizon and ground into a picture.
///
/// # Errors
/// [`LearningError`]: no picture shows the board, or it does not lie on the floor.
pub fn learn(
    pictures: &[Picture],
    camera: &RobotCamera,
    board: &Board,
    alignment: Alignment,
    overlay: &Path,
) -> Result<Learned, LearningError> {
    let pinhole = camera.intrinsics.pinhole();
    let (mut found, mut shown): (Vec<FoundBoard>, Vec<usize>) = Default::default();
    let (mut reports, mut missing): (Vec<PictureReport>, Vec<NotFound>) = Default::default();
    for (index, picture) in pictures.iter().enumerate() {
        camera.check_size(&picture.name, picture.size())?;
        let corners =
            picture.gray.view().map_err(|_| NotFound::NoBoard).and_then(|view| find_board(view, board));
        let refused = corners.as_ref().err().map(ToString::to_string);
        missing.extend(corners.as_ref().err());
        reports.push(PictureReport { name: picture.name.clone(), rms_px: None, refused });
        if let Ok(corners) = corners {
            found.push(corners);
            shown.push(index);
        }
    }
    let Some(&first) = shown.first() else {
        return Err(LearningError::Unsuitable(refusal("", board, &reports, &missing)));
    };
    let mount = board_mount(&pinhole, board, &found).map_err(|error| {
        LearningError::Unsuitable(match error {
            BoardMountError::NotOnFloor { picture, .. } => {
                format!("{}: {error}; lay it down, or remove the picture", pictures[shown[picture]].name)
            }
            BoardMountError::NoFit => error.to_string(),
        })
    })?;
    for (index, rms_px) in shown.iter().zip(&mount.rms_px) {
        reports[*index].rms_px = *rms_px;
        if rms_px.is_none() {
            reports[*index].refused = Some("its corners fit no plane".to_owned());
        }
    }
    let sigma = |axis: usize| mount.sigmas.map_or(f64::NAN, |sigmas| sigmas[axis]);
    let pan_deg = match alignment {
        Alignment::Square => Some(Measured::degrees(-mount.board_direction, sigma(3))),
        Alignment::Any => None,
    };
    let pose = Mount { z: mount.height_m, tilt: mount.tilt, roll: mount.roll, ..Mount::default() };
    let drawing = GroundOverlay { pinhole, mount: pose, height_m: Some(mount.height_m), points: Vec::new() };
    overlay::ground(overlay, &pictures[first], &drawing, Some(&found[0].corners))?;
    let findings = Findings {
        height_m: Some(mount.height_m),
        tilt_deg: Some(mount.tilt.to_degrees()),
        roll_deg: Some(mount.roll.to_degrees()),
        pan_deg: pan_deg.map(|pan| pan.value),
        is_complete: camera.intrinsics.fx.is_some() || camera.calibration == Calibration::Measured,
        ..Findings::default()
    };
    Ok(Learned {
        height_m: Measured::new(mount.height_m, sigma(0)),
        tilt_deg: Measured::degrees(mount.tilt, sigma(1)),
        roll_deg: Measured::degrees(mount.roll, sigma(2)),
        pan_deg,
        pictures: reports,
        overlay: overlay.to_owned(),
        findings,
    })
}
