//! Tilt and roll of a camera that looks along corridors, and the row of its principal point.
//!
//! Vanishing points of corridors lie on the horizon, and plumb lines meet at the vanishing point of the vertical. The first say where
//! the horizon is in the picture; the second by how much the camera is tilted. Where the two contradict the principal point, the
//! picture was cropped.

use nalgebra::Vector3;
use thiserror::Error;
use yamabico_geometry::Hypotenuse;
use yamabico_geometry::camera::{Calibration, Intrinsics, Mount};

use super::corridor_sight::CorridorSight;
use super::horizon_lines::HorizonLines;
use super::spread::block_jackknife;

/// Minimum number of plumb lines, and of vanishing points.
pub const MIN_PLUMB_LINES: usize = 12;
/// Minimum number of vanishing points.
pub const MIN_POINTS: usize = 3;
/// Errors that all pictures of a building share: of the tilt and the roll by plumb lines, rad, and of the horizon's row, px.
const SHARED_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;
const SHARED_PX: f64 = 1.0;
/// Standard deviation of the principal row: measured, px; guessed, as a share of the height.
const MEASURED_ROW_PX: f64 = 3.0;
const GUESSED_ROW_SHARE: f64 = 0.03;
/// Standard deviations by which the principal row must be off before the picture counts as cropped.
const CROPPED_SIGMAS: f64 = 3.0;

/// Treatment of the principal point's row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PrincipalRow {
    /// Estimated where it contradicts the horizon, else as given.
    #[default]
    Judged,
    /// As given.
    Given,
    /// Estimated.
    Estimated,
}

/// Attitude of the camera, and where the horizon lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonFit {
    /// Downward tilt, rad.
    pub tilt: f64,
    /// Standard deviation of the tilt, rad.
    pub tilt_sigma: f64,
    /// Roll, rad, positive if the right side is lower.
    pub roll: f64,
    /// Standard deviation of the roll, rad.
    pub roll_sigma: f64,
    /// Row of the principal point, px: as given, or estimated.
    pub principal_row: f64,
    /// Row of the principal point by horizon and plumb lines, px, and its standard deviation.
    pub estimated_row: [f64; 2],
    /// True if `principal_row` is estimated.
    pub is_cropped: bool,
    /// Row of the horizon at the principal column, px, and its standard deviation.
    pub horizon_row: [f64; 2],
    /// Tilt by plumb lines alone, rad, and its standard deviation.
    pub plumb_tilt: [f64; 2],
    /// Root mean square of the distances of the vanishing points that agree from the horizon, px.
    pub point_rms_px: f64,
    /// Number of vanishing points, and of those that agree.
    pub points: [usize; 2],
    /// Number of candidates for plumb lines, and of those that agree.
    pub plumb_lines: [usize; 2],
}

/// Reason why pictures give no attitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum HorizonError {
    /// Too few pictures show the end of a corridor.
    #[error(
        "only {found} pictures show where a corridor leads: {MIN_POINTS} are needed, 20 are good. Take them in the middle of a straight \
         corridor, looking along it"
    )]
    NoCorridor {
        /// Pictures with a vanishing point.
        found: usize,
    },
    /// Too few vertical edges.
    #[error(
        "only {found} vertical edges are in view: {MIN_PLUMB_LINES} are needed. Take pictures with doors or corners of walls in view"
    )]
    NoPlumbLines {
        /// Vertical edges.
        found: usize,
    },
}

impl HorizonFit {
    /// Mount with this attitude, and everything else of `mount`.
    #[must_use]
    pub fn mount(&self, mount: &Mount) -> Mount {
        Mount { tilt: self.tilt, roll: self.roll, ..*mount }
    }
}

/// Fits tilt, roll and the principal row to pictures of corridors. Focal length and principal column are those of `intrinsics`;
/// `calibration` says how well its principal row is known.
///
/// # Errors
/// [`HorizonError`].
pub fn fit_horizon(
    sights: &[CorridorSight],
    intrinsics: &Intrinsics,
    calibration: Calibration,
    treatment: PrincipalRow,
) -> Result<HorizonFit, HorizonError> {
    let points = sights.iter().filter(|sight| sight.point.is_some()).count();
    if points < MIN_POINTS {
        return Err(HorizonError::NoCorridor { found: points });
    }
    let candidates: usize = sights.iter().map(|sight| sight.plumb.len()).sum();
    let too_few = HorizonError::NoPlumbLines { found: candidates };
    if candidates < MIN_PLUMB_LINES {
        return Err(too_few);
    }
    let lines = HorizonLines::fit(sights, intrinsics).ok_or(too_few)?;
    let numbers = |sights: &[CorridorSight]| {
        HorizonLines::fit(sights, intrinsics).map(|lines| [lines.a, lines.b, lines.row])
    };
    let [a_sigma, b_sigma, row_sigma] = block_jackknife(sights, numbers).unwrap_or([0.05, 0.05, 20.0]);
    let (a_sigma, b_sigma) = (a_sigma.hypotenuse(SHARED_RAD), b_sigma.hypotenuse(SHARED_RAD));
    let row_sigma = row_sigma.hypotenuse(SHARED_PX);

    let estimated = lines.row + intrinsics.fy * lines.b;
    let estimated_sigma = row_sigma.hypotenuse(intrinsics.fy * b_sigma);
    let given_sigma = match calibration {
        Calibration::Measured => MEASURED_ROW_PX,
        Calibration::Guessed => GUESSED_ROW_SHARE * f64::from(intrinsics.height),
    };
    let is_off = (estimated - intrinsics.cy).abs() > CROPPED_SIGMAS * estimated_sigma.hypotenuse(given_sigma);
    let is_cropped = match treatment {
        PrincipalRow::Judged => is_off,
        PrincipalRow::Given => false,
        PrincipalRow::Estimated => true,
    };
    let (b, b_sigma_used, principal_row) = if is_cropped {
        (lines.b, b_sigma, estimated)
    } else {
        (
            (intrinsics.cy - lines.row) / intrinsics.fy,
            row_sigma.hypotenuse(given_sigma) / intrinsics.fy,
            intrinsics.cy,
        )
    };
    let down = Vector3::new(lines.a, 1.0, b).normalize();
    Ok(HorizonFit {
        tilt: down.z.asin(),
        tilt_sigma: b_sigma_used / (1.0 + b * b),
        roll: lines.a.atan(),
        roll_sigma: a_sigma,
        principal_row,
        estimated_row: [estimated, estimated_sigma],
        is_cropped,
        horizon_row: [lines.row, row_sigma],
        plumb_tilt: [Vector3::new(lines.a, 1.0, lines.b).normalize().z.asin(), b_sigma],
        point_rms_px: lines.point_rms_px,
        points: [points, lines.points],
        plumb_lines: [candidates, lines.plumb_lines],
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::super::corridor_sight::PlumbLine;
    use super::*;

    /// Sights of a camera with this mount and a true principal row of `row`.
    fn sights(mount: &Mount, row: f64) -> Vec<CorridorSight> {
        let camera = Intrinsics { cy: row, ..Intrinsics::from_horizontal_fov(640, 480, 1.05) };
        let picture = |i: i32| {
            let heading = 0.03 * f64::from(i - 5);
            let turned = Mount { pan: heading, ..*mount };
            let camera_from_body = turned.rotation_body_from_camera().transpose();
            let pixel = |direction: Vector3<f64>| {
                let seen = camera_from_body * direction;
                camera.pixel_from_normalized(seen.xy() / seen.z)
            };
            let plumb = (-3..=3).filter(|k| *k != 0).map(|k| {
                let ends = [-0.3, 1.5].map(|z| pixel(Vector3::new(4.0, 0.6 * f64::from(k), z)));
                let along = ends[1] - ends[0];
                PlumbLine {
                    middle: 0.5 * (ends[0] + ends[1]),
                    slope: along.x / along.y,
                    length: along.norm(),
                }
            });
            CorridorSight { point: Some(pixel(Vector3::x())), plumb: plumb.collect() }
        };
        (0..10).map(picture).collect()
    }

    #[test]
    fn tilt_and_cropping_are_told_apart() {
        let given = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        for (tilt, roll, row) in
            [(0.2, 0.05, 239.5), (0.0, 0.0, 380.0), (-0.05, -0.08, 239.5), (0.15, 0.0, 140.0)]
        {
            let mount = Mount { tilt, roll, ..Mount::level(0.5) };
            let fit = fit_horizon(&sights(&mount, row), &given, Calibration::Measured, PrincipalRow::Judged)
                .unwrap();
            assert!((fit.tilt - tilt).abs() < 1e-3 && (fit.roll - roll).abs() < 1e-3, "{fit:?}");
            assert_eq!(fit.is_cropped, row != 239.5, "{fit:?}");
            assert!((fit.principal_row - row).abs() < 1.0, "{fit:?}");
        }
    }

    #[test]
    fn pictures_without_corridor_or_edges_are_refused() {
        let camera = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        let fit = |sights: &[CorridorSight]| {
            fit_horizon(sights, &camera, Calibration::Guessed, PrincipalRow::Judged)
        };
        assert_eq!(fit(&[]), Err(HorizonError::NoCorridor { found: 0 }));
        let bare = CorridorSight { point: Some(Vector2::new(300.0, 200.0)), plumb: Vec::new() };
        assert_eq!(fit(&vec![bare; 5]), Err(HorizonError::NoPlumbLines { found: 0 }));
    }
}
