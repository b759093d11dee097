//! Vanishing points far outside the picture, as directions.

use super::lines::{VotingLine, image_of_down};
use crate::segments::Segment;
use nalgebra::{Matrix3, Vector3};
use yamabico_geometry::camera::Intrinsics;

/// Histogram bins over half a turn of heading.
const BINS: usize = 180;

/// A direction that many interpretation planes hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaneDirection {
    /// Unit direction in the optical frame; its sign is arbitrary.
    pub direction: Vector3<f64>,
    /// Variance of its angle along the horizon and up from it, rad^2.
    pub variance: [f64; 2],
    /// Summed length of the inliers, px.
    pub score: f64,
    /// Largest angle between two of the planes, rad.
    pub spread_rad: f64,
}

/// The direction along the horizon that the longest lines agree on; `planes` is scratch, `inliers` takes the indices of the
/// segments. `None` when fewer than two agree.
///
/// Each line spans a plane with the camera; a direction along the line lies in it. Votes go to where the planes meet
/// the horizontal plane through the camera; then the smallest eigenvector of the weighted sum of N N^T, over the planes
/// within `gate_rad`, is the direction that lies best in all.
pub(super) fn direction_on_horizon(
    segments: &[Segment],
    camera: &Intrinsics,
    down: Vector3<f64>,
    gate_rad: f64,
    planes: &mut Vec<(VotingLine, Vector3<f64>)>,
    inliers: &mut Vec<usize>,
) -> Option<PlaneDirection> {
    planes.clear();
    for (index, segment) in segments.iter().enumerate() {
        let vertical = image_of_down(down, segment.midpoint(), camera);
        if segment.direction().dot(&vertical).abs() < 0.7 {
            planes.push((VotingLine::new(index, segment), plane_normal(segment, camera)));
        }
    }
    let mut direction = heading_peak(planes, down)?;
    for _ in 0..5 {
        inliers.clear();
        let mut scatter = Matrix3::zeros();
        for (line, normal) in
            planes.iter().filter(|(_, normal)| normal.dot(&direction).abs() <= gate_rad.sin())
        {
            scatter += normal * normal.transpose() * line.length.powi(2);
            inliers.push(line.segment);
        }
        let eigen = scatter.symmetric_eigen();
        let smallest = eigen.eigenvalues.imin();
        direction = eigen.eigenvectors.column(smallest).into_owned();
    }
    measure(planes, direction, down, gate_rad).filter(|_| inliers.len() >= 2)
}

/// Unit normal of the plane through the camera and the segment.
fn plane_normal(segment: &Segment, camera: &Intrinsics) -> Vector3<f64> {
    Vector3::new(
        camera.fx * segment.normal.x,
        camera.fy * segment.normal.y,
        segment.normal.x * camera.cx + segment.normal.y * camera.cy - segment.rho,
    )
    .normalize()
}

/// Two axes of the horizontal plane: forwards-most and to the right of it.
fn horizontal_axes(down: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let forward = (Vector3::z() - down * down.z).try_normalize(1e-6).unwrap_or_else(Vector3::x);
    (forward, down.cross(&forward))
}

/// The horizontal direction with the most length of lines whose planes hold it.
fn heading_peak(planes: &[(VotingLine, Vector3<f64>)], down: Vector3<f64>) -> Option<Vector3<f64>> {
    let (forward, right) = horizontal_axes(down);
    let mut bins = [0.0_f64; BINS];
    for (line, normal) in planes {
        let meet = normal.cross(&down);
        // A plane close to horizontal meets it anywhere.
        let sine = meet.norm();
        let heading = meet.dot(&right).atan2(meet.dot(&forward)).rem_euclid(std::f64::consts::PI);
        let bin = (heading / std::f64::consts::PI * BINS as f64) as usize % BINS;
        bins[bin] += line.length * sine;
    }
    let around = |bin: usize| -> f64 {
        (0..5).map(|step| bins[(bin + BINS + step - 2) % BINS] * [1.0, 2.0, 3.0, 2.0, 1.0][step]).sum()
    };
    let best = (0..BINS).max_by(|&a, &b| around(a).total_cmp(&around(b)))?;
    if around(best) <= 0.0 {
        return None;
    }
    let heading = (best as f64 + 0.5) / BINS as f64 * std::f64::consts::PI;
    Some(forward * heading.cos() + right * heading.sin())
}

fn measure(
    planes: &[(VotingLine, Vector3<f64>)],
    direction: Vector3<f64>,
    down: Vector3<f64>,
    gate_rad: f64,
) -> Option<PlaneDirection> {
    let inliers = || planes.iter().filter(|(_, normal)| normal.dot(&direction).abs() <= gate_rad.sin());
    let sideways = down.cross(&direction).try_normalize(1e-6)?;
    let upwards = direction.cross(&sideways);
    let (mut information, mut chi2, mut score, mut count) = ([0.0; 2], 0.0, 0.0, 0.0);
    let mut spread = 0.0_f64;
    for (line, normal) in inliers() {
        // Noise of half a pixel at both ends, as an angle at one radian from the segment.
        let sigma = 0.7 / line.length;
        for (information, axis) in information.iter_mut().zip([sideways, upwards]) {
            *information += (normal.dot(&axis) / sigma).powi(2);
        }
        chi2 += (normal.dot(&direction) / sigma).powi(2);
        score += line.length;
        count += 1.0;
        spread = inliers().map(|(_, other)| normal.cross(other).norm()).fold(spread, f64::max);
    }
    let inflation = if count > 2.0 { (chi2 / (count - 2.0)).max(1.0) } else { 1.0 };
    let variance = information.map(|information| inflation / information.max(1e-12));
    Some(PlaneDirection { direction, variance, score, spread_rad: spread.min(1.0).asin() })
}
