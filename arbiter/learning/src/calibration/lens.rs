//! Lens of a camera, from pictures of a printed checkerboard.

use std::path::{Path, PathBuf};

use serde::Serialize;
use yamabico_core::camera::Pinhole;
use yamabico_vision::calibration::{Board, FoundBoard, NotFound, calibrate_lens, find_board};

use super::pictures::Picture;
use super::refusal::refusal;
use super::{Measured, overlay};
use crate::LearningError;

/// Calibrated lens.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// Camera.
    #[serde(skip)]
    pub pinhole: Option<Pinhole>,
    /// Image width and height, px.
    pub size: [u32; 2],
    /// Parameters by name: focal lengths and principal point, px; distortion.
    pub parameters: Vec<(&'static str, Measured)>,
    /// Horizontal field of view, degrees.
    pub fov_deg: f64,
    /// Root mean square of the distances between corners and their projections, px.
    pub rms_px: f64,
    /// Pictures, in their order.
    pub pictures: Vec<PictureReport>,
    /// Pictures that would make the result more accurate, for people.
    pub advice: Vec<String>,
    /// Overlays that were written.
    pub overlays: Option<PathBuf>,
}

/// Use of one picture.
#[derive(Clone, Debug, Serialize)]
pub struct PictureReport {
    /// File.
    pub name: String,
    /// Root mean square residual, px; `None` without board.
    pub rms_px: Option<f64>,
    /// Cause why it was not used, for people; `None` if it was.
    pub refused: Option<String>,
}

/// Calibrates the lens. With `overlays`, a folder, draws the corners into a copy of each picture.
///
/// # Errors
/// [`LearningError`]: no board in any picture, too few or too similar views, with what to add.
pub fn learn(pictures: &[Picture], board: &Board, overlays: Option<&Path>) -> Result<Learned, LearningError> {
    let size = pictures.first().map(Picture::size).unwrap_or_default();
    let mut found: Vec<(usize, FoundBoard)> = Vec::new();
    let mut reports = Vec::new();
    let mut missing: Vec<NotFound> = Vec::new();
    for (index, picture) in pictures.iter().enumerate() {
        let mut report = PictureReport { name: picture.name.clone(), rms_px: None, refused: None };
        match picture.gray.view().map_err(|_| NotFound::NoBoard).and_then(|view| find_board(view, board)) {
            Ok(corners) => found.push((index, corners)),
            Err(reason) => {
                report.refused = Some(reason.to_string());
                missing.push(reason);
            }
        }
        reports.push(report);
    }
    let boards: Vec<FoundBoard> = found.iter().map(|(_, board)| board.clone()).collect();
    let calibrated = calibrate_lens(board, &boards, size);
    let refused = |cause: &str| LearningError::Unsuitable(refusal(cause, board, &reports, &missing));
    let calibrated = calibrated.map_err(|error| refused(&error.to_string()))?;
    for (at, rms_px) in calibrated.used.iter().zip(&calibrated.lens.rms_px) {
        reports[found[*at].0].rms_px = Some(*rms_px);
    }
    for (at, rms_px) in &calibrated.outliers {
        let report = &mut reports[found[*at].0];
        report.rms_px = Some(*rms_px);
        report.refused = Some(
            "its corners do not fit those of the other pictures: blurred by motion, or the board was bent"
                .to_owned(),
        );
    }
    if let Some(folder) = overlays {
        std::fs::create_dir_all(folder).map_err(|error| LearningError::write(folder, error))?;
        for (index, corners) in &found {
            overlay::corners(folder, &pictures[*index], board, &corners.corners)?;
        }
    }
    let (pinhole, sigmas) = (calibrated.lens.pinhole, calibrated.lens.sigmas);
    let (at, lens) = (pinhole.intrinsics(), pinhole.distortion());
    let values = [
        ("fx", at.fx),
        ("fy", at.fy),
        ("cx", at.cx),
        ("cy", at.cy),
        ("k1", lens.k1),
        ("k2", lens.k2),
        ("p1", lens.p1),
        ("p2", lens.p2),
        ("k3", lens.k3),
    ];
    let parameters =
        values.iter().zip(sigmas).map(|((name, value), sigma)| (*name, Measured::new(*value, sigma)));
    Ok(Learned {
        pinhole: Some(pinhole),
        size,
        parameters: parameters.filter(|(_, number)| number.value != 0.0).collect(),
        fov_deg: at.horizontal_fov().to_degrees(),
        rms_px: calibrated.rms_px,
        pictures: reports,
        advice: calibrated.variety.advice().iter().map(|advice| format!("add {advice}")).collect(),
        overlays: overlays.map(Path::to_owned),
    })
}
