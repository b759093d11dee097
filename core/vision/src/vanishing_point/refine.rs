//! Sub-pixel place of a vanishing point: weighted least squares over the lines that meet there.

use super::VanishingPointError;
use super::lines::VotingLine;
use nalgebra::{Matrix2, Vector2};

/// Who takes part, and when it is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineRule {
    /// Standard deviation of a segment's end across it, px.
    pub sigma_end_px: f64,
    /// Standard deviation that no length removes, px: bent edges and what is left of the lens's distortion.
    pub sigma_floor_px: f64,
    /// A line takes part when it passes within three standard deviations, but at least this far, px.
    pub gate_min_px: f64,
    /// The same in the first round, when the start is coarse, px.
    pub first_gate_px: f64,
    /// Lines are too parallel when the eigenvalues of the normal matrix have a smaller ratio.
    pub min_eigen_ratio: f64,
    /// Done when a step is shorter, px, and the same lines take part.
    pub step_px: f64,
    /// Most rounds.
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
    /// The rule for an image `scale` times as wide; the noise of a segment's ends is a matter of pixels and stays.
    #[must_use]
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            sigma_floor_px: self.sigma_floor_px * scale,
            first_gate_px: self.first_gate_px * scale,
            ..*self
        }
    }
}

/// A refined vanishing point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Place, px.
    pub pixel: Vector2<f64>,
    /// Covariance, px^2; inflated when the lines disagree more than their noise explains.
    pub covariance: Matrix2<f64>,
    /// Weighted sum of squared distances.
    pub chi2: f64,
    /// Smaller over larger eigenvalue of the normal matrix: 1 for lines from all sides, 0 for parallel ones.
    pub eigen_ratio: f64,
}

/// Weighted sums of the normal equations.
#[derive(Clone, Copy, Default)]
struct Sums {
    a: Matrix2<f64>,
    g: Vector2<f64>,
    count: usize,
}

/// Moves `start` to where the lines near it meet, and leaves the indices (into `lines`) of those that took part in
/// `inliers`.
///
/// A line whose segment of length L ends a distance D away counts with the variance sigma^2 (1/2 + 2 D^2/L^2) that
/// independent noise of its ends gives. Differs from Kweon et al. (1991): their standard deviation c/L is the limit for
/// far points with D frozen.
///
/// # Errors
/// [`VanishingPointError::TooFewSegments`] below two lines, [`VanishingPointError::Degenerate`] when they are parallel.
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
    // The set goes back and forth: the larger one holds.
    finish(lines, largest.1, rule, inliers)
}

fn variance(line: &VotingLine, pixel: Vector2<f64>, rule: &RefineRule) -> f64 {
    let ratio = (pixel - line.midpoint).norm_squared() / (line.length * line.length);
    rule.sigma_end_px * rule.sigma_end_px * (0.5 + 2.0 * ratio) + rule.sigma_floor_px * rule.sigma_floor_px
}

fn takes_part(distance: f64, variance: f64, gate: f64) -> bool {
    distance.abs() <= gate || distance * distance <= 9.0 * variance
}

/// The sums, and a fingerprint of the set of lines in them.
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

/// The point of least squares and the ratio of the eigenvalues.
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
