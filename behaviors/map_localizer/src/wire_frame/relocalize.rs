//! Relocalization after the pose was lost: the heading from the vanishing point, the position across the corridor from
//! horizontal edges, the position along it from vertical edges.

use nalgebra::Vector2;
use yamabico_core::geometry::Pose2;
use yamabico_vision::map::EdgeKind;

use super::axis_heading::AxisHeading;
use super::fixer::Fixer;
use super::matching::LineNoise;
use crate::belief::Belief;

/// Spacing of the hypotheses, m.
const STEP_M: f64 = 0.15;
/// Lower and upper bound of the search range to each side of the prior, m.
const REACH_M: [f64; 2] = [2.0, 10.0];
/// Minimum standard deviation of the prior, m; matches are rated by their distance from it, with the long tails of a robot that
/// was carried.
const MIN_PRIOR_SIGMA_M: f64 = 0.3;
/// Standard deviation of the position of a hypothesis, m.
const HYPOTHESIS_SIGMA_M: f64 = 0.1;
/// Minimum matched fraction of the total length of the vertical edges expected in view.
const MIN_MATCHED_LENGTH: f64 = 0.5;
/// Minimum number of matched vertical edges.
const MIN_MATCHED_UPRIGHTS: usize = 3;
/// Distance from the best hypothesis above which another one is a competitor, m.
const COMPETITOR_M: f64 = 0.6;
/// Fraction of the best score at which a competitor makes the result ambiguous.
const COMPETITOR_SCORE: f64 = 0.8;
/// Minimum standard deviations of position (m) and heading (rad) after a relocalization.
const RELOCALIZED_SIGMA: [f64; 2] = [0.05, 0.01];
/// Standard deviation of the heading from the vanishing point, rad.
const HEADING_SIGMA_RAD: f64 = 0.01;

/// Search for the robot along the main direction of the map. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Relocalizer {
    /// Offset (m) and score of each hypothesis of the last search.
    hypotheses: Vec<(f64, f64)>,
}

impl Relocalizer {
    /// Searches for the robot around the prior with the last image of `fixer`; `None` if there is no solution or more
    /// than one.
    pub fn find(
        &mut self,
        fixer: &mut Fixer,
        axis: &mut AxisHeading,
        prior: &Belief,
        noise: &LineNoise,
    ) -> Option<Belief> {
        let heading = heading(fixer, axis, prior)?;
        let along = Vector2::new(axis.axis_rad().cos(), axis.axis_rad().sin());
        let across = Vector2::new(-along.y, along.x);
        let pose = |along_m: f64, across_m: f64| {
            let shift = along * along_m + across * across_m;
            Pose2::new(prior.pose.x + shift.x, prior.pose.y + shift.y, heading)
        };
        let reach = (3.0 * prior.sigma_xy_m()).clamp(REACH_M[0], REACH_M[1]);
        let across_m = self.best(reach.min(REACH_M[0]), |across| {
            let belief = hypothesis(pose(0.0, across));
            fixer.fix(&belief, noise);
            matched_px(fixer, EdgeKind::Horizontal).0
        })?;
        let score_along = |fixer: &mut Fixer, along: f64| {
            let fix = fixer.fix(&hypothesis(pose(along, across_m)), noise);
            let (matched, expected) = matched_px(fixer, EdgeKind::Vertical);
            // Weighted by the matched length: a full match of a short expected length is weak evidence.
            let fraction = matched / expected.max(1.0);
            if fix.uprights[1] >= MIN_MATCHED_UPRIGHTS { fraction * matched.sqrt() } else { 0.0 }
        };
        // Doors repeat along a corridor: of equal matches the one near the prior counts.
        let sigma_m = MIN_PRIOR_SIGMA_M.max(prior.sigma_xy_m());
        let score_along = |fixer: &mut Fixer, along: f64| {
            score_along(fixer, along) / (1.0 + (0.5 * along / sigma_m).powi(2))
        };
        let along_m = self.best(reach, |along| score_along(fixer, along))?;
        let best = score_along(fixer, along_m);
        let is_ambiguous = self.hypotheses.iter().any(|&(other_m, score)| {
            (other_m - along_m).abs() > COMPETITOR_M && score > COMPETITOR_SCORE * best
        });
        let fix = fixer.fix(&hypothesis(pose(along_m, across_m)), noise);
        let (matched, expected) = matched_px(fixer, EdgeKind::Vertical);
        let is_found =
            best > 0.0 && !is_ambiguous && matched >= MIN_MATCHED_LENGTH * expected && fix.verdict.is_ok();
        is_found.then(|| {
            let mut found = fix.posterior;
            let [position, heading] = RELOCALIZED_SIGMA;
            found.raise_variances([position * position, position * position, heading * heading]);
            found
        })
    }

    /// Returns the offset within ±`reach` (m) with the highest positive score, and stores all hypotheses.
    fn best(&mut self, reach: f64, mut score: impl FnMut(f64) -> f64) -> Option<f64> {
        let steps = (reach / STEP_M).ceil() as i32;
        self.hypotheses.clear();
        for step in -steps..=steps {
            let offset = f64::from(step) * STEP_M;
            self.hypotheses.push((offset, score(offset)));
        }
        let best = self.hypotheses.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 > 0.0).then_some(best.0)
    }
}

/// Returns the robot's heading in the map frame from the vanishing point, of the possible ones the nearest to the prior.
fn heading(fixer: &Fixer, axis: &mut AxisHeading, prior: &Belief) -> Option<f64> {
    let seen = axis.observe(fixer.segments(), fixer.pinhole(), fixer.mount(), prior.pose.theta)?;
    let mut belief = *prior;
    belief.update_heading(seen.heading.rad, HEADING_SIGMA_RAD, f64::INFINITY);
    Some(belief.pose.theta)
}

/// Returns a hypothesis: narrow enough for the gates, wide enough to reach the next one.
fn hypothesis(pose: Pose2) -> Belief {
    Belief::new(pose, HYPOTHESIS_SIGMA_M, 2.0 * HEADING_SIGMA_RAD)
}

/// Returns the total length of the matched edges of a kind and of the expected ones, px.
fn matched_px(fixer: &Fixer, kind: EdgeKind) -> (f64, f64) {
    let expected = fixer.expected();
    let length_px = |index: usize| {
        let edge = &expected[index];
        if edge.kind == kind { edge.length_px() } else { 0.0 }
    };
    let matched = fixer.used().iter().map(|pair| length_px(pair.expected)).sum();
    (matched, (0..expected.len()).map(length_px).sum())
}
