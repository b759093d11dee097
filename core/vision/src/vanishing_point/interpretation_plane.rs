//! Vanishing points far outside the image, as directions.

use super::lines::{VotingLine, image_of_down};
use crate::segments::Segment;
use nalgebra::{Matrix3, Vector3};
use yamabico_geometry::camera::Intrinsics;

/// Number of histogram bins over half a turn of heading.
const BINS: usize = 180;

/// Direction that lies in many interpretation planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaneDirection {
    /// Unit direction in the optical frame; the sign is arbitrary.
    pub direction: Vector3<f64>,
    /// Variances of the angle along the horizon and perpendicular to it, rad^2.
    pub variance: [f64; 2],
    /// Total length of the inliers, px.
    pub score: f64,
    /// Maximum angle between two of the planes, rad.
    pub spread_rad: f64,
}

/// Finds the horizontal direction that most segment length supports. `planes` is scratch memory, `inliers` receives the
/// indices of the segments. `None` if fewer than two segments agree.
///
/// Each line spans an interpretation plane with the optical center, which contains the line's direction. Votes go to
/// the intersections of the planes with the horizontal plane through the camera. The eigenvector of the smallest
/// eigenvalue of the weighted scatter matrix of the normals within `gate_rad` is the refined direction.
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

/// Unit normal of the interpretation plane of the segment.
fn plane_normal(segment: &Segment, camera: &Intrinsics) -> Vector3<f64> {
    Vector3::new(
        camera.fx * segment.normal.x,
        camera.fy * segment.normal.y,
        segment.normal.x * camera.cx + segment.normal.y * camera.cy - segment.rho,
    )
    .normalize()
}

/// Orthogonal axes of the horizontal plane: closest to forward, and to the right of it.
fn horizontal_axes(down: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let forward = (Vector3::z() - down * down.z).try_normalize(1e-6).unwrap_or_else(Vector3::x);
    (forward, down.cross(&forward))
}

/// Horizontal direction contained in the interpretation planes with the largest total segment length.
fn heading_peak(planes: &[(VotingLine, Vector3<f64>)], down: Vector3<f64>) -> Option<Vector3<f64>> {
    let (forward, right) = horizontal_axes(down);
    let mut bins = [0.0_f64; BINS];
    for (line, normal) in planes {
        let meet = normal.cross(&down);
        // Weight by the sine: a nearly horizontal plane has no well-defined intersection.
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
        // Noise of half a pixel at both endpoints, as an angle.
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
