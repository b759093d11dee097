//! The search: configuration, candidates and the choice between them.

use super::interpretation_plane::direction_on_horizon;
use super::lines::{Prefilter, VotingLine};
use super::refine::{RefineRule, Refined, refine};
use super::votes::Votes;
use super::{Prediction, VanishingPoint, VanishingPointError, pixel, ray};
use crate::segments::Segment;
use nalgebra::{Matrix2, Vector2, Vector3};
use yamabico_geometry::camera::Intrinsics;

/// How the corridor's vanishing point is looked for. Pixels are those of an image 640 px wide, and scale with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VanishingPointConfig {
    /// Unit vector of gravity in the camera's optical frame; (0, 1, 0) for a level camera.
    pub down_in_camera: Vector3<f64>,
    /// Standard deviation of how well that is known, rad: the corridor's axis is horizontal.
    pub horizon_sigma_rad: f64,
    /// Segments nearer to the vertical do not vote, rad.
    pub vertical_rad: f64,
    /// Segments nearer to the horizontal do not vote, rad, unless they point at the prediction.
    pub horizontal_rad: f64,
    /// Shorter segments do not vote, px.
    pub min_length_px: f64,
    /// So many of the longest segments vote.
    pub max_voters: usize,
    /// So many peaks of the votes are refined.
    pub candidates: usize,
    /// The refinement.
    pub refine: RefineRule,
    /// Fewest lines without a prediction.
    pub min_inliers: usize,
    /// Smallest angle between two of the lines, rad.
    pub min_spread_rad: f64,
    /// Largest root of the covariance's trace, px.
    pub max_sigma_px: f64,
    /// A second point at least this good, as a share of the best one, makes the choice ambiguous.
    pub ambiguity_ratio: f64,
    /// Largest standard deviation of the heading of a point far outside, rad.
    pub max_far_sigma_rad: f64,
    /// Gate of the interpretation planes for points far outside, rad.
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

/// Finds vanishing points; keeps its buffers from frame to frame.
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
    /// A finder with empty buffers.
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

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &VanishingPointConfig {
        &self.config
    }

    /// The vanishing point of the corridor's axis. `segments` are undistorted pixels, longest first.
    ///
    /// # Errors
    /// [`VanishingPointError`]; nothing seen is [`VanishingPointError::NoVanishingPoint`].
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
            most: self.config.max_voters,
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

    /// Refines one peak and checks it; its inliers are left in `self.inliers`.
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

    /// The direction along the horizon when the lines do not meet in or near the picture.
    fn far_outside(
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

/// Largest angle between two of the lines, rad, at most a quarter turn.
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
