//! Sub-pixel refinement of a vanishing point: weighted least squares over the lines that meet there.

use super::VanishingPointError;
use super::lines::VotingLine;
use nalgebra::{Matrix2, Vector2};

/// Noise model, inlier gates and convergence of the refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineRule {
    /// Standard deviation of a segment's endpoint perpendicular to the segment, px.
    pub sigma_end_px: f64,
    /// Noise floor independent of length, px: curved edges and residual lens distortion.
    pub sigma_floor_px: f64,
    /// Minimum inlier gate, px. A line is an inlier within three standard deviations, or within this distance.
    pub gate_min_px: f64,
    /// Minimum inlier gate in the first iteration, when the start is coarse, px.
    pub first_gate_px: f64,
    /// Minimum ratio of the eigenvalues of the normal matrix. Below it, the lines are too parallel.
    pub min_eigen_ratio: f64,
    /// Step length below which the iteration has converged, px, if the inliers no longer change.
    pub step_px: f64,
    /// Maximum number of iterations.
    pub max_rounds: usize,
}

impl Default for RefineRule {
    fn default() -> Self {
        Self {
            sigma_end_px: 0.5,
            sigma_floor_px: 0.0,
            gate_min_px: 2.0,
            first_gate_px: 2.0,
            min_eigen_ratio: 1e-3,
            step_px: 1e-6,
            max_rounds: 20,
        }
    }
}

impl RefineRule {
    /// Scales the rule to an image `scale` times as wide. The noise of endpoints is constant in pixels.
    #[must_use]
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            sigma_floor_px: self.sigma_floor_px * scale,
            first_gate_px: self.first_gate_px * scale,
            ..*self
        }
    }
}

/// Refined vanishing point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Position, px.
    pub pixel: Vector2<f64>,
    /// Covariance, px^2, inflated if the residuals exceed the noise model.
    pub covariance: Matrix2<f64>,
    /// Weighted sum of squared distances.
    pub chi2: f64,
    /// Ratio of the smaller to the larger eigenvalue of the normal matrix: 1 for lines from all directions, 0 for
    /// parallel ones.
    pub eigen_ratio: f64,
}

/// Sums of the weighted normal equations.
#[derive(Clone, Copy, Default)]
struct Sums {
    a: Matrix2<f64>,
    g: Vector2<f64>,
    count: usize,
}

/// Moves `start` to the point where the lines near it meet. Writes the indices (into `lines`) of the inliers to
/// `inliers`.
///
/// A line whose segment of length L has its midpoint at distance D has the variance sigma^2 (1/2 + 2 D^2/L^2), from
/// independent noise of both endpoints. Differs from Kweon et al. (1991): their standard deviation c/L is the limit for
/// distant points with constant D.
///
/// # Errors
/// [`VanishingPointError::TooFewSegments`] for fewer than two lines, [`VanishingPointError::Degenerate`] if they are
/// parallel.
pub fn refine(
    lines: &[VotingLine],
    start: Vector2<f64>,
    rule: &RefineRule,
    inliers: &mut Vec<usize>,
) -> Result<Refined, VanishingPointError> {
    let mut pixel = start;
    let mut set = 0;
    let mut gate = rule.first_gate_px.max(rule.gate_min_px);
    let mut largest = (0, start);
    for round in 0..rule.max_rounds {
        let (sums, members) = normal_equations(lines, pixel, rule, gate);
        let (next, _) = solve(&sums, rule)?;
        let step = (next - pixel).norm();
        let is_stable = members == set && gate == rule.gate_min_px;
        pixel = next;
        set = members;
        gate = rule.gate_min_px;
        if step < rule.step_px && is_stable {
            return finish(lines, pixel, rule, inliers);
        }
        if 2 * round >= rule.max_rounds && sums.count >= largest.0 {
            largest = (sums.count, next);
        }
    }
    // The set of inliers alternates: the larger set is used.
    finish(lines, largest.1, rule, inliers)
}

fn variance(line: &VotingLine, pixel: Vector2<f64>, rule: &RefineRule) -> f64 {
    let ratio = (pixel - line.midpoint).norm_squared() / (line.length * line.length);
    rule.sigma_end_px * rule.sigma_end_px * (0.5 + 2.0 * ratio) + rule.sigma_floor_px * rule.sigma_floor_px
}

fn takes_part(distance: f64, variance: f64, gate: f64) -> bool {
    distance.abs() <= gate || distance * distance <= 9.0 * variance
}

/// Normal equations, and a hash of the set of inliers.
fn normal_equations(lines: &[VotingLine], pixel: Vector2<f64>, rule: &RefineRule, gate: f64) -> (Sums, u64) {
    let mut sums = Sums::default();
    let mut members = 1;
    for (i, line) in lines.iter().enumerate() {
        let variance = variance(line, pixel, rule);
        let distance = line.normal.dot(&pixel) - line.rho;
        if takes_part(distance, variance, gate) {
            let weight = 1.0 / variance;
            sums.a += line.normal * line.normal.transpose() * weight;
            sums.g += line.normal * (weight * line.rho);
            sums.count += 1;
            members = (members ^ i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }
    (sums, members)
}

/// Least squares solution and the eigenvalue ratio of the normal matrix.
fn solve(sums: &Sums, rule: &RefineRule) -> Result<(Vector2<f64>, f64), VanishingPointError> {
    if sums.count < 2 {
        return Err(VanishingPointError::TooFewSegments { found: sums.count });
    }
    let a = &sums.a;
    let half_trace = 0.5 * a.trace();
    let root = (0.25 * (a.m11 - a.m22).powi(2) + a.m12 * a.m12).sqrt();
    let ratio = (half_trace - root) / (half_trace + root);
    let inverse = a.try_inverse().filter(|_| ratio >= rule.min_eigen_ratio);
    inverse.map(|inverse| (inverse * sums.g, ratio)).ok_or(VanishingPointError::Degenerate)
}

fn finish(
    lines: &[VotingLine],
    pixel: Vector2<f64>,
    rule: &RefineRule,
    inliers: &mut Vec<usize>,
) -> Result<Refined, VanishingPointError> {
    inliers.clear();
    let mut chi2 = 0.0;
    for (i, line) in lines.iter().enumerate() {
        let variance = variance(line, pixel, rule);
        let distance = line.normal.dot(&pixel) - line.rho;
        if takes_part(distance, variance, rule.gate_min_px) {
            inliers.push(i);
            chi2 += distance * distance / variance;
        }
    }
    let (sums, _) = normal_equations(lines, pixel, rule, rule.gate_min_px);
    let (_, eigen_ratio) = solve(&sums, rule)?;
    let inverse = sums.a.try_inverse().ok_or(VanishingPointError::Degenerate)?;
    let inflation = if sums.count > 2 { (chi2 / (sums.count - 2) as f64).max(1.0) } else { 1.0 };
    Ok(Refined { pixel, covariance: inverse * inflation, chi2, eigen_ratio })
}
