//! Calibration of a lens from pictures of a board.
//!
//! Zhang (2000): a start in closed form, then the adjustment of lens and poses to all corners. Pictures that do not fit are left out,
//! and views that do not determine the lens are refused.

use nalgebra::{Matrix3, Vector2};
use thiserror::Error;
use yamabico_geometry::camera::Pinhole;

use super::board::Board;
use super::checkerboard::FoundBoard;
use super::closed_form::{intrinsics_of, pose_of};
use super::homography::homography;
use super::lens_adjustment::{AdjustedLens, BoardView, FreeLens, adjust};
use super::view_variety::{Advice, ViewVariety};

/// Minimum number of different views.
pub const MIN_VIEWS: usize = 5;
/// Standard deviation of a focal length above which the views do not determine it, as a share of it.
const MAX_FOCAL_SIGMA: f64 = 0.005;
/// Standard deviation of the principal point above which the views do not determine it, as a share of the image's width.
const MAX_CENTER_SIGMA: f64 = 0.005;
/// Residual of a view that does not fit: multiple of the median of all views, and its lower bound, px.
const OUTLIER_RATIO: f64 = 3.0;
const OUTLIER_PX: f64 = 0.3;
/// Root mean square residual above which no lens of this model fits the pictures, as a share of the image's width.
const MAX_RMS_SHARE: f64 = 0.004;
/// Decrease of the cost from which on k3 counts, in variances of a corner.
const K3_GAIN: f64 = 16.0;

/// Calibrated lens.
#[derive(Clone, Debug, PartialEq)]
pub struct LensCalibration {
    /// Camera, standard deviations, and residuals and poses of the views in `used`.
    pub lens: AdjustedLens,
    /// Indices of the views that the lens was adjusted to.
    pub used: Vec<usize>,
    /// Indices of views that do not fit, with their residuals when they were left out, px.
    pub outliers: Vec<(usize, f64)>,
    /// Differences between the views in `used`.
    pub variety: ViewVariety,
    /// Root mean square of the distances between corners and their projections, px.
    pub rms_px: f64,
}

/// Reason why views give no lens.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LensError {
    /// Too few views.
    #[error(
        "different views of the board: {distinct}, in pictures: {found}. {MIN_VIEWS} are needed, 15 are good: hold it near and far, \
         in the middle and at the edges, and turn it"
    )]
    TooFew {
        /// Number of pictures with the board.
        found: usize,
        /// Number of different views.
        distinct: usize,
    },
    /// The views do not determine the lens.
    #[error("the views of the board are too similar to determine the lens ({cause}): add {}", joined(advice))]
    TooSimilar {
        /// Undetermined quantity.
        cause: String,
        /// Pictures to add.
        advice: Vec<Advice>,
    },
    /// No lens fits.
    #[error(
        "no lens of this model fits: the corners are {rms_px:.1} px off. Is the board flat, the focus fixed, and are all pictures of \
         one camera with one zoom? A fisheye lens needs another model"
    )]
    NoFit {
        /// Root mean square residual, px.
        rms_px: f64,
    },
}

fn joined(advice: &[Advice]) -> String {
    advice.iter().map(Advice::to_string).collect::<Vec<_>>().join("; ")
}

/// Calibrates the lens of a camera with images of `size` (width, height) from the boards found in its pictures.
///
/// # Errors
/// [`LensError`], with the pictures to add.
pub fn calibrate_lens(
    board: &Board,
    found: &[FoundBoard],
    size: [u32; 2],
) -> Result<LensCalibration, LensError> {
    let corners: Vec<&[Vector2<f64>]> = found.iter().map(|found| found.corners.as_slice()).collect();
    let flat = ViewVariety::of(&corners, &[], size);
    if flat.distinct < MIN_VIEWS {
        return Err(LensError::TooFew { found: found.len(), distinct: flat.distinct });
    }
    let undetermined = |cause: &str, variety: &ViewVariety| {
        let advice = variety.advice();
        let advice = if advice.is_empty() { vec![Advice::Other] } else { advice };
        LensError::TooSimilar { cause: cause.to_owned(), advice }
    };
    let on_board = board.corners();
    let homographies: Vec<Matrix3<f64>> =
        found.iter().filter_map(|found| homography(&on_board, &found.corners)).collect();
    let start = Some(&homographies).filter(|all| all.len() == found.len());
    let start = start.and_then(|all| intrinsics_of(all, size));
    let start = start.ok_or_else(|| undetermined("the focal length", &flat))?;
    let views: Option<Vec<BoardView>> = found
        .iter()
        .zip(&homographies)
        .map(|(found, homography)| {
            let pose = pose_of(homography, &start)?;
            Some(BoardView { on_board: on_board.clone(), in_picture: found.corners.clone(), pose })
        })
        .collect();
    let views = views.ok_or_else(|| undetermined("the focal length", &flat))?;

    let mut used: Vec<usize> = (0..views.len()).collect();
    let mut outliers = Vec::new();
    let of = |used: &[usize]| used.iter().map(|&index| views[index].clone()).collect::<Vec<_>>();
    let mut lens = adjust(&Pinhole::ideal(start), &of(&used), FreeLens::WithoutK3)
        .ok_or_else(|| undetermined("the focal length", &flat))?;
    while let Some((at, rms_px)) = worst(&lens.rms_px) {
        if used.len() <= MIN_VIEWS {
            break;
        }
        outliers.push((used.remove(at), rms_px));
        let next = adjust(&lens.pinhole, &of(&used), FreeLens::WithoutK3);
        lens = next.ok_or_else(|| undetermined("the focal length", &flat))?;
    }
    let freedom = |lens: &AdjustedLens| (2 * board.count() * lens.poses.len() - 6 * lens.poses.len()) as f64;
    if let Some(with_k3) = adjust(&lens.pinhole, &of(&used), FreeLens::WithK3)
        && lens.cost - with_k3.cost > K3_GAIN * with_k3.cost / freedom(&with_k3)
    {
        lens = with_k3;
    }
    outliers.sort_by_key(|(index, _)| *index);
    let in_use: Vec<&[Vector2<f64>]> = used.iter().map(|&index| corners[index]).collect();
    let variety = ViewVariety::of(&in_use, &lens.poses, size);
    let rms_px = (lens.cost / (board.count() * used.len()) as f64).sqrt();
    if rms_px > MAX_RMS_SHARE * f64::from(size[0]) {
        return Err(LensError::NoFit { rms_px });
    }
    let intrinsics = lens.pinhole.intrinsics();
    let focal_share = (lens.sigmas[0] / intrinsics.fx).max(lens.sigmas[1] / intrinsics.fy);
    let center_share = lens.sigmas[2].max(lens.sigmas[3]) / f64::from(size[0]);
    if focal_share > MAX_FOCAL_SIGMA {
        let cause = format!("standard deviation of the focal length: {:.1} %", 100.0 * focal_share);
        return Err(undetermined(&cause, &variety));
    }
    if center_share > MAX_CENTER_SIGMA {
        let cause = format!(
            "standard deviation of the principal point: {:.1} px",
            lens.sigmas[2].max(lens.sigmas[3])
        );
        return Err(undetermined(&cause, &variety));
    }
    Ok(LensCalibration { lens, used, outliers, variety, rms_px })
}

/// Returns the view with the largest residual, if it does not fit, and the residual.
fn worst(rms_px: &[f64]) -> Option<(usize, f64)> {
    let mut sorted = rms_px.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    let (at, most) = rms_px.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (most > (OUTLIER_RATIO * median).max(OUTLIER_PX)).then_some((at, most))
}
