//! Recovery of a pose that is somewhat wrong: a search over headings and positions around the prior, with a check
//! against alternatives.

use nalgebra::Vector2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::map::ExpectedEdge;

use super::axis_heading::SeenHeading;
use super::fixer::Fixer;
use super::matching::LineNoise;
use crate::belief::Belief;
use crate::fix::Fix;

/// Maximum heading error, rad: the reach of the search, to each side.
const REACH_RAD: f64 = 0.26;
/// Spacing of the headings without a vanishing point, rad.
const STEP_RAD: f64 = 0.035;
/// Offsets of the hypotheses along and across the prior's heading, m: number of steps to each side, and their length.
const STEPS_ALONG: (i32, f64) = (2, 0.15);
const STEPS_ACROSS: (i32, f64) = (3, 0.13);
/// Standard deviations of the prior of the search, m and rad: the errors that it recovers from are not larger.
const PRIOR_SIGMAS: (f64, f64) = (0.25, 0.15);
/// Standard deviations of each hypothesis, m and rad.
const HYPOTHESIS_SIGMAS: (f64, f64) = (0.1, 0.02);
/// Minimum matched fraction of the total length of the expected edges.
const MIN_MATCHED: f64 = 0.5;
/// Fraction of the best score at which another pose is a competitor, and the distance (m) and angle (rad) from which a
/// pose is another one.
const COMPETITOR_SCORE: f64 = 0.85;
const OTHER_POSE: (f64, f64) = (0.15, 0.035);
/// Minimum standard deviations of position (m) and heading (rad) of a recovered pose.
const MIN_SIGMAS: (f64, f64) = (0.03, 0.009);

/// Search around a prior. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Recovery {
    /// Posterior pose and score of each hypothesis of the last search.
    candidates: Vec<(Pose2, f64)>,
}

impl Recovery {
    /// Searches for the pose around the prior with the last image of `fixer`; `None` if too little is matched or another
    /// pose matches as well. `seen` is the heading by the vanishing point, if there is one.
    pub fn find(
        &mut self,
        fixer: &mut Fixer,
        seen: Option<&SeenHeading>,
        prior: &Belief,
        noise: &LineNoise,
    ) -> Option<Fix> {
        let mut wide = *prior;
        let (sigma_m, sigma_rad) = PRIOR_SIGMAS;
        wide.raise_variances([sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad]);
        let turn_seen = seen
            .filter(|seen| seen.is_supported)
            .map(|seen| angle_difference(seen.heading.rad, prior.pose.theta))
            .filter(|turn| turn.abs() <= REACH_RAD);
        self.candidates.clear();
        let mut best = (0.0, wide);
        let mut consider = |turn: f64, candidates: &mut Vec<(Pose2, f64)>| {
            for about in hypotheses(prior, turn) {
                let fix = fixer.fix_from(&wide, &about, noise);
                let score = if fix.verdict.is_ok() { score(fixer) } else { 0.0 };
                candidates.push((fix.posterior.pose, score));
                if score > best.0 {
                    best = (score, about);
                }
            }
        };
        match turn_seen {
            Some(turn) => consider(turn, &mut self.candidates),
            None => {
                let steps = (REACH_RAD / STEP_RAD) as i32;
                (-steps..=steps).for_each(|step| consider(f64::from(step) * STEP_RAD, &mut self.candidates));
            }
        }
        let (best_score, about) = best;
        let mut fix = fixer.fix_from(&wide, &about, noise);
        let found = fix.posterior.pose;
        let is_ambiguous = self.candidates.iter().any(|(pose, score)| {
            let turn = angle_difference(pose.theta, found.theta).abs();
            *score > COMPETITOR_SCORE * best_score
                && (pose.distance(&found) > OTHER_POSE.0 || turn > OTHER_POSE.1)
        });
        let (matched, expected) = lengths_px(fixer);
        let is_found = fix.verdict.is_ok() && !is_ambiguous && matched >= MIN_MATCHED * expected;
        is_found.then(|| {
            let (sigma_m, sigma_rad) = MIN_SIGMAS;
            fix.posterior.raise_variances([sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad]);
            fix
        })
    }
}

/// Returns the hypotheses around the prior's position at this turn from its heading.
fn hypotheses(prior: &Belief, turn: f64) -> impl Iterator<Item = Belief> {
    let heading = prior.pose.theta + turn;
    let along = Vector2::new(heading.cos(), heading.sin());
    let across = Vector2::new(-along.y, along.x);
    let position = prior.pose.position();
    let ((steps_along, step_along), (steps_across, step_across)) = (STEPS_ALONG, STEPS_ACROSS);
    (-steps_along..=steps_along).flat_map(move |i| {
        (-steps_across..=steps_across).map(move |k| {
            let at = position + along * (f64::from(i) * step_along) + across * (f64::from(k) * step_across);
            Belief::new(Pose2::new(at.x, at.y, heading), HYPOTHESIS_SIGMAS.0, HYPOTHESIS_SIGMAS.1)
        })
    })
}

/// Returns the score of the last match: the matched length, weighted by its share of the expected one.
fn score(fixer: &Fixer) -> f64 {
    let (matched, expected) = lengths_px(fixer);
    matched * matched / expected.max(1.0)
}

/// Returns the total length of the matched edges and of the expected ones, px.
fn lengths_px(fixer: &Fixer) -> (f64, f64) {
    let expected = fixer.expected();
    let matched = fixer.used().iter().map(|pair| expected[pair.expected].length_px()).sum();
    (matched, expected.iter().map(ExpectedEdge::length_px).sum())
}
