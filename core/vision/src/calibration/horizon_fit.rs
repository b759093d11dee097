//! Tilt and roll of a camera that looks along corridors, and the row of its principal point.
//!
//! Vanishing points of corridors lie on the horizon, and plumb lines meet at the vanishing point of the vertical. The first say where
//! the horizon is in the picture; the second by how much the camera is tilted. Where the two contradict the principal point, the
//! picture was cropped.

use nalgebra::{Matrix2, Vector2, Vector3};
use thiserror::Error;
use yamabico_geometry::Hypotenuse;
use yamabico_geometry::camera::{Calibration, Intrinsics, Mount};

use super::spread::{block_jackknife, median, robust_sigma};
use crate::segments::Segment;

/// Maximum angle of a plumb line from the column direction, rad.
const PLUMB_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// Scales of the robust weights of plumb lines in turn, rad.
const KERNELS_RAD: [f64; 4] = [0.15, 0.08, 0.04, 0.025];
/// Rounds with each scale.
const ROUNDS: usize = 6;
/// Length at which a plumb line has its full weight, as a share of the picture's width.
const FULL_LENGTH_SHARE: f64 = 0.3;
/// Minimum length of a plumb line, likewise.
const MIN_LENGTH_SHARE: f64 = 0.04;
/// Distance of a line from the vanishing point below which it may run along the corridor instead, likewise.
const ALONG_SHARE: f64 = 0.012;
/// Standard deviations of tilt and roll before any plumb line is seen, rad.
const PRIOR_RAD: f64 = 0.4;
/// Standard deviation of a plumb line, rad.
const LINE_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Minimum number of plumb lines, and of vanishing points.
pub const MIN_PLUMB_LINES: usize = 12;
/// Minimum number of vanishing points.
pub const MIN_POINTS: usize = 3;
/// Errors that all pictures of a building share: of the tilt and the roll by plumb lines, rad, and of the horizon's row, px.
const SHARED_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;
const SHARED_PX: f64 = 1.0;
/// Standard deviation of the horizon's slope by plumb lines when vanishing points refine it, rad.
const SLOPE_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Standard deviation of the principal row: measured, px; guessed, as a share of the height.
const MEASURED_ROW_PX: f64 = 3.0;
const GUESSED_ROW_SHARE: f64 = 0.03;
/// Standard deviations by which the principal row must be off before the picture counts as cropped.
const CROPPED_SIGMAS: f64 = 3.0;

/// Plumb line in a picture, undistorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlumbLine {
    /// Middle, px.
    pub middle: Vector2<f64>,
    /// Columns per row.
    pub slope: f64,
    /// Length, px.
    pub length: f64,
}

/// Lines of one picture of a corridor, undistorted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CorridorSight {
    /// Vanishing point of the corridor, px.
    pub point: Option<Vector2<f64>>,
    /// Edges that may be vertical.
    pub plumb: Vec<PlumbLine>,
}

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

impl CorridorSight {
    /// Takes from the undistorted segments of a picture, `width` px wide, those that may be plumb lines. Lines towards the corridor's
    /// vanishing point are none, even where they are steep.
    #[must_use]
    pub fn new(point: Option<Vector2<f64>>, segments: &[Segment], width: f64) -> Self {
        let plumb = segments.iter().filter_map(|segment| {
            let direction = segment.direction();
            let slope = direction.x / direction.y;
            let is_steep = slope.is_finite() && slope.atan().abs() < PLUMB_RAD;
            let is_along = point.is_some_and(|point| segment.distance(point).abs() < ALONG_SHARE * width);
            let is_plumb = is_steep && !is_along && segment.length > MIN_LENGTH_SHARE * width;
            is_plumb.then(|| PlumbLine { middle: segment.midpoint(), slope, length: segment.length })
        });
        Self { point, plumb: plumb.collect() }
    }
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
    let lines = fit_lines(sights, intrinsics).ok_or(too_few)?;
    let numbers =
        |sights: &[CorridorSight]| fit_lines(sights, intrinsics).map(|lines| [lines.a, lines.b, lines.row]);
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

/// Direction of gravity over its downward component: (a, 1, b); and the row of the horizon at the principal column.
struct Lines {
    a: f64,
    b: f64,
    row: f64,
    point_rms_px: f64,
    points: usize,
    plumb_lines: usize,
}

fn fit_lines(sights: &[CorridorSight], intrinsics: &Intrinsics) -> Option<Lines> {
    let width = f64::from(intrinsics.width);
    let points: Vec<Vector2<f64>> = sights.iter().filter_map(|sight| sight.point).collect();
    let plumb: Vec<PlumbLine> = sights.iter().flat_map(|sight| sight.plumb.iter().copied()).collect();
    if points.len() < 2 || plumb.is_empty() {
        return None;
    }
    let start_row = median(&points.iter().map(|point| point.y).collect::<Vec<_>>())?;
    let (mut gravity, mut row, mut slope) = (Vector2::zeros(), start_row, 0.0);
    let mut agreeing = 0;
    // The height of a plumb line above the principal point, which depends on the result, matters little.
    for _ in 0..3 {
        let center = Vector2::new(intrinsics.cx, row + intrinsics.fy * gravity.y);
        (gravity, agreeing) = fit_gravity(&plumb, intrinsics, center, width)?;
        (row, slope) = fit_row(&points, intrinsics.cx, -gravity.x)?;
    }
    let off: Vec<f64> =
        points.iter().map(|point| point.y - row - slope * (point.x - intrinsics.cx)).collect();
    let gate = 3.0 * robust_sigma(&off)?.max(0.5);
    let near: Vec<f64> = off.into_iter().filter(|off| off.abs() <= gate).collect();
    let rms = (near.iter().map(|off| off * off).sum::<f64>() / near.len().max(1) as f64).sqrt();
    Some(Lines { a: -slope, b: gravity.y, row, point_rms_px: rms, points: near.len(), plumb_lines: agreeing })
}

/// Fits (a, b) to plumb lines, with weights that fall with the distance; returns also the number of lines that agree.
fn fit_gravity(
    plumb: &[PlumbLine],
    intrinsics: &Intrinsics,
    center: Vector2<f64>,
    width: f64,
) -> Option<(Vector2<f64>, usize)> {
    let focal = Vector2::new(intrinsics.fx, intrinsics.fy);
    let aspect = intrinsics.fy / intrinsics.fx;
    let rows: Vec<(Vector2<f64>, f64, f64)> = plumb
        .iter()
        .map(|line| {
            let at = (line.middle - center).component_div(&focal);
            let slope = line.slope * aspect;
            let weight = (line.length / (FULL_LENGTH_SHARE * width)).min(1.0).powi(2);
            (Vector2::new(1.0, slope * at.y - at.x), slope, weight)
        })
        .collect();
    let mut state =
        Vector2::new(median(&plumb.iter().map(|line| line.slope * aspect).collect::<Vec<_>>())?, 0.0);
    for kernel in KERNELS_RAD {
        for _ in 0..ROUNDS {
            let mut normal = Matrix2::identity() * PRIOR_RAD.powi(-2);
            let mut right = Vector2::zeros();
            for (row, slope, weight) in &rows {
                let off = (slope - row.dot(&state)) / kernel;
                let weight = weight / (1.0 + off * off).powi(2) / (LINE_RAD * LINE_RAD);
                normal += row * row.transpose() * weight;
                right += row * (weight * slope);
            }
            state = normal.try_inverse()? * right;
        }
    }
    let last = KERNELS_RAD[KERNELS_RAD.len() - 1];
    let agreeing = rows.iter().filter(|(row, slope, _)| (slope - row.dot(&state)).abs() <= last).count();
    state.iter().all(|value| value.is_finite()).then_some((state, agreeing))
}

/// Fits a line to the vanishing points, whose slope is that of the plumb lines but for [`SLOPE_RAD`]: row at the column `at`, and slope.
fn fit_row(points: &[Vector2<f64>], at: f64, plumb_slope: f64) -> Option<(f64, f64)> {
    let offs = |row: f64, slope: f64| points.iter().map(move |point| point.y - row - slope * (point.x - at));
    let mut row = median(&offs(0.0, plumb_slope).collect::<Vec<_>>())?;
    let mut slope = plumb_slope;
    for _ in 0..10 {
        let all: Vec<f64> = offs(row, slope).collect();
        let scale = robust_sigma(&all)?.max(0.5);
        let mut normal = Matrix2::new(1e-9, 0.0, 0.0, SLOPE_RAD.powi(-2));
        let mut right = Vector2::new(0.0, SLOPE_RAD.powi(-2) * plumb_slope);
        for (point, off) in points.iter().zip(&all) {
            let off = off / (3.0 * scale);
            let weight = (1.0 + off * off).powi(-2) / (scale * scale);
            let row = Vector2::new(1.0, point.x - at);
            normal += row * row.transpose() * weight;
            right += row * (weight * point.y);
        }
        let state: Vector2<f64> = normal.try_inverse()? * right;
        (row, slope) = (state.x, state.y);
    }
    (row.is_finite() && slope.is_finite()).then_some((row, slope))
}

#[cfg(test)]
mod tests {
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
