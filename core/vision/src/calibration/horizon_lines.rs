//! Horizon by vanishing points, and direction of gravity by plumb lines.

use nalgebra::{Matrix2, Vector2};
use yamabico_geometry::camera::Intrinsics;

use super::corridor_sight::{CorridorSight, PlumbLine};
use super::spread::{median, robust_sigma};

/// Scales of the robust weights of plumb lines in turn, rad.
const KERNELS_RAD: [f64; 4] = [0.15, 0.08, 0.04, 0.025];
/// Rounds with each scale.
const ROUNDS: usize = 6;
/// Length at which a plumb line has its full weight, as a share of the picture's width.
const FULL_LENGTH_SHARE: f64 = 0.3;
/// Standard deviations of tilt and roll before any plumb line is seen, rad.
const PRIOR_RAD: f64 = 0.4;
/// Standard deviation of a plumb line, rad.
const LINE_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Standard deviation of the horizon's slope by plumb lines when vanishing points refine it, rad.
const SLOPE_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Direction of gravity over its downward component: (a, 1, b); and the row of the horizon at the principal column.
pub struct HorizonLines {
    /// Rightward part of gravity.
    pub a: f64,
    /// Forward part of gravity.
    pub b: f64,
    /// Row of the horizon, px.
    pub row: f64,
    /// Root mean square of the distances of the vanishing points that agree, px.
    pub point_rms_px: f64,
    /// Number of these.
    pub points: usize,
    /// Number of plumb lines that agree.
    pub plumb_lines: usize,
}

impl HorizonLines {
    /// Fits them to pictures; `None` with fewer than two vanishing points, or without plumb lines.
    pub fn fit(sights: &[CorridorSight], intrinsics: &Intrinsics) -> Option<Self> {
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
        Some(Self {
            a: -slope,
            b: gravity.y,
            row,
            point_rms_px: rms,
            points: near.len(),
            plumb_lines: agreeing,
        })
    }
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
