//! Vanishing point search: configuration, candidates and selection.

use super::interpretation_plane::direction_on_horizon;
use super::lines::{Prefilter, VotingLine};
use super::refine::{RefineRule, Refined, refine};
use super::votes::Votes;
use super::{Prediction, VanishingPoint, VanishingPointError, pixel, ray};
use crate::segments::Segment;
use nalgebra::{Matrix2, Vector2, Vector3};
use yamabico_geometry::camera::Intrinsics;

/// Parameters of the vanishing point search. Lengths in pixels are for an image 640 px wide and scale with the width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VanishingPointConfig {
    /// Unit vector of gravity in the optical frame; (0, 1, 0) for a level camera.
    pub down_in_camera: Vector3<f64>,
    /// Standard deviation of the direction of gravity, rad. The corridor axis is horizontal, so its vanishing point
    /// lies on the horizon.
    pub horizon_sigma_rad: f64,
    /// Minimum angle of a voting segment from the vertical, rad.
    pub vertical_rad: f64,
    /// Minimum angle of a voting segment from the horizontal, rad. Segments that point at the prediction vote
    /// regardless.
    pub horizontal_rad: f64,
    /// Minimum length of a voting segment, px.
    pub min_length_px: f64,
    /// Maximum number of voting segments; the longest vote.
    pub max_voters: usize,
    /// Number of vote peaks that are refined.
    pub candidates: usize,
    /// Parameters of the least squares refinement.
    pub refine: RefineRule,
    /// Minimum number of inliers without a prediction.
    pub min_inliers: usize,
    /// Minimum angle between the two most divergent inliers, rad.
    pub min_spread_rad: f64,
    /// Maximum root of the covariance's trace, px.
    pub max_sigma_px: f64,
    /// Score ratio of the second best to the best point above which the result is ambiguous.
    pub ambiguity_ratio: f64,
    /// Maximum standard deviation of the heading of a point far outside the image, rad.
    pub max_far_sigma_rad: f64,
    /// Inlier gate of the interpretation planes for points far outside the image, rad.
    pub plane_gate_rad: f64,
}

impl Default for VanishingPointConfig {
    fn default() -> Self {
        Self {
            down_in_camera: Vector3::y(),
            horizon_sigma_rad: 8_f64.to_radians(),
            vertical_rad: 10_f64.to_radians(),
            horizontal_rad: 5_f64.to_radians(),
            min_length_px: 20.0,
            max_voters: 150,
            candidates: 5,
            refine: RefineRule { first_gate_px: 8.0, sigma_floor_px: 2.0, ..RefineRule::default() },
            min_inliers: 3,
            min_spread_rad: 10_f64.to_radians(),
            max_sigma_px: 10.0,
            ambiguity_ratio: 0.97,
            max_far_sigma_rad: 5_f64.to_radians(),
            plane_gate_rad: 1_f64.to_radians(),
        }
    }
}

/// Finds vanishing points. Reuses its buffers between frames.
#[derive(Clone, Debug)]
pub struct VanishingPointFinder {
    config: VanishingPointConfig,
    lines: Vec<VotingLine>,
    near: Vec<VotingLine>,
    votes: Votes,
    peaks: Vec<Vector2<f64>>,
    inliers: Vec<usize>,
    best_inliers: Vec<usize>,
    planes: Vec<(VotingLine, Vector3<f64>)>,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    refined: Refined,
    score: f64,
    spread_rad: f64,
}

impl VanishingPointFinder {
    /// Creates a finder with empty buffers.
    #[must_use]
    pub fn new(config: VanishingPointConfig) -> Self {
        Self {
            config,
            lines: Vec::new(),
            near: Vec::new(),
            votes: Votes::default(),
            peaks: Vec::new(),
            inliers: Vec::new(),
            best_inliers: Vec::new(),
            planes: Vec::new(),
        }
    }

    /// Configuration of the finder.
    #[must_use]
    pub fn config(&self) -> &VanishingPointConfig {
        &self.config
    }

    /// Finds the vanishing point of the corridor axis. `segments` are in undistorted pixels, longest first.
    ///
    /// # Errors
    /// [`VanishingPointError`], with [`VanishingPointError::NoVanishingPoint`] if the lines do not meet.
    pub fn find(
        &mut self,
        segments: &[Segment],
        camera: &Intrinsics,
        prediction: Option<Prediction>,
    ) -> Result<VanishingPoint<'_>, VanishingPointError> {
        let scale = f64::from(camera.width) / 640.0;
        let ahead = prediction.filter(|p| p.direction.z > 0.1);
        let prefilter = Prefilter {
            down: self.config.down_in_camera,
            vertical_rad: self.config.vertical_rad,
            horizontal_rad: self.config.horizontal_rad,
            predicted: ahead.map(|p| pixel(p.direction, camera)),
            keep_px: 10.0 * scale,
            min_length_px: self.config.min_length_px * scale,
            max_lines: self.config.max_voters,
        };
        prefilter.select(segments, camera, &mut self.lines);
        match self.best_candidate(camera, prediction, scale) {
            Ok(candidate) => Ok(self.in_view(candidate, camera)),
            Err(failure) => self.far_outside(segments, camera, prediction).ok_or(failure),
        }
    }

    fn best_candidate(
        &mut self,
        camera: &Intrinsics,
        prediction: Option<Prediction>,
        scale: f64,
    ) -> Result<Candidate, VanishingPointError> {
        if self.lines.len() < 2 {
            return Err(VanishingPointError::TooFewSegments { found: self.lines.len() });
        }
        self.votes.cast(&self.lines, camera);
        self.votes.peaks(camera, self.config.candidates, 3, &mut self.peaks);
        let mut best: Option<Candidate> = None;
        let mut second = 0.0;
        let mut failure = VanishingPointError::NoVanishingPoint;
        for index in 0..self.peaks.len() {
            let candidate = match self.candidate(self.peaks[index], camera, prediction, scale) {
                Ok(candidate) => candidate,
                Err(VanishingPointError::Degenerate) => {
                    failure = VanishingPointError::Degenerate;
                    continue;
                }
                Err(_) => continue,
            };
            let Some(so_far) = best else {
                best = Some(candidate);
                std::mem::swap(&mut self.inliers, &mut self.best_inliers);
                continue;
            };
            let apart = (candidate.refined.pixel - so_far.refined.pixel).norm() > 25.0 * scale;
            let lesser = candidate.score.min(so_far.score);
            if candidate.score > so_far.score {
                best = Some(candidate);
                std::mem::swap(&mut self.inliers, &mut self.best_inliers);
            }
            if apart {
                second = lesser.max(second);
            }
        }
        let best = best.ok_or(failure)?;
        if prediction.is_none() && second > self.config.ambiguity_ratio * best.score {
            return Err(VanishingPointError::Ambiguous);
        }
        Ok(best)
    }

    /// Refines and validates one peak. Leaves the segment indices of its inliers in `self.inliers`.
    fn candidate(
        &mut self,
        peak: Vector2<f64>,
        camera: &Intrinsics,
        prediction: Option<Prediction>,
        scale: f64,
    ) -> Result<Candidate, VanishingPointError> {
        self.near.clear();
        self.near.extend(self.lines.iter().filter(|line| !line.straddles(peak)));
        let refined = refine(&self.near, peak, &self.config.refine.scaled(scale), &mut self.inliers)?;
        let spread_rad = spread(&self.near, &self.inliers);
        let direction = ray(refined.pixel, camera);
        let deviation = prediction.map(|p| angle_between(direction, p.direction) / p.sigma_rad);
        let enough = self.inliers.len() >= self.config.min_inliers
            || (self.inliers.len() == 2 && deviation.is_some_and(|d| d <= 3.0));
        let sigma = refined.covariance.trace().sqrt();
        if !enough
            || spread_rad < self.config.min_spread_rad
            || sigma.is_nan()
            || sigma > self.config.max_sigma_px * scale
        {
            return Err(VanishingPointError::NoVanishingPoint);
        }
        let length: f64 = self.inliers.iter().map(|&i| self.near[i].length).sum();
        let above_horizon = direction.dot(&self.config.down_in_camera).asin() / self.config.horizon_sigma_rad;
        let prior = deviation.map_or(1.0, |d| (-0.5 * d * d).exp().max(0.05))
            * (-0.5 * above_horizon * above_horizon).exp();
        let score = length * (spread_rad / 20_f64.to_radians()).min(1.0) * prior;
        for i in &mut self.inliers {
            *i = self.near[*i].segment;
        }
        Ok(Candidate { refined, score, spread_rad })
    }

    fn in_view(&self, candidate: Candidate, camera: &Intrinsics) -> VanishingPoint<'_> {
        VanishingPoint {
            pixel: candidate.refined.pixel,
            direction: ray(candidate.refined.pixel, camera),
            covariance: candidate.refined.covariance,
            inliers: &self.best_inliers,
            score: candidate.score,
            spread_rad: candidate.spread_rad,
            at_infinity: false,
        }
    }

    /// Finds the direction along the horizon if the lines do not meet in or near the image.
    pub(crate) fn far_outside(
        &mut self,
        segments: &[Segment],
        camera: &Intrinsics,
        prediction: Option<Prediction>,
    ) -> Option<VanishingPoint<'_>> {
        let found = direction_on_horizon(
            segments,
            camera,
            self.config.down_in_camera,
            self.config.plane_gate_rad,
            &mut self.planes,
            &mut self.best_inliers,
        )?;
        let towards = prediction.map_or_else(Vector3::z, |p| p.direction);
        let direction = if found.direction.dot(&towards) < 0.0 { -found.direction } else { found.direction };
        let is_outside = direction.z < (0.5 * camera.horizontal_fov()).cos();
        let is_expected =
            prediction.is_none_or(|p| angle_between(direction, p.direction) <= 3.0 * p.sigma_rad);
        let is_enough = self.best_inliers.len() >= self.config.min_inliers
            && found.spread_rad >= self.config.min_spread_rad
            && found.variance[0].sqrt() <= self.config.max_far_sigma_rad;
        (is_outside && is_expected && is_enough).then(|| VanishingPoint {
            pixel: pixel(direction, camera),
            direction,
            covariance: Matrix2::from_diagonal(&Vector2::from(found.variance)) * camera.fx.powi(2),
            inliers: &self.best_inliers,
            score: found.score,
            spread_rad: found.spread_rad,
            at_infinity: true,
        })
    }
}

fn angle_between(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    a.cross(&b).norm().atan2(a.dot(&b))
}

/// Maximum angle between two of the lines, rad, at most pi/2.
fn spread(lines: &[VotingLine], members: &[usize]) -> f64 {
    let mut sine = 0.0_f64;
    for (n, &i) in members.iter().enumerate() {
        for &j in &members[..n] {
            let (a, b) = (lines[i].normal, lines[j].normal);
            sine = sine.max((a.x * b.y - a.y * b.x).abs());
        }
    }
    sine.min(1.0).asin()
}
