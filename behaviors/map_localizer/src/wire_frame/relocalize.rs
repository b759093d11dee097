//! Relocalization after the pose was lost: the heading from the vanishing point, the position across the corridor from
//! horizontal edges, the position along it from vertical edges.

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::Mount;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::corridor::heading::RobotHeading;
use yamabico_vision::map::{EdgeKind, WireFrame};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

use super::fixer::Fixer;
use super::matching::LineNoise;
use crate::belief::Belief;

/// Spacing of the hypotheses, m.
const STEP_M: f64 = 0.15;
/// Lower and upper bound of the search range to each side of the prior, m.
const REACH_M: [f64; 2] = [2.0, 10.0];
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
#[derive(Clone, Debug)]
pub struct Relocalizer {
    finder: VanishingPointFinder,
    axis_rad: f64,
    /// Offset (m) and score of each hypothesis of the last search.
    hypotheses: Vec<(f64, f64)>,
}

impl Relocalizer {
    /// Creates a search for this map and camera mount.
    #[must_use]
    pub fn new(map: &WireFrame, mount: &Mount) -> Self {
        let down = mount.rotation_body_from_camera().transpose() * Vector3::new(0.0, 0.0, -1.0);
        let config = VanishingPointConfig { down_in_camera: down, ..VanishingPointConfig::default() };
        Self {
            finder: VanishingPointFinder::new(config),
            axis_rad: main_direction(map),
            hypotheses: Vec::new(),
        }
    }

    /// Searches for the robot around the prior with the last image of `fixer`; `None` if there is no solution or more
    /// than one.
    pub fn find(&mut self, fixer: &mut Fixer, prior: &Belief, noise: &LineNoise) -> Option<Belief> {
        let heading = self.heading(fixer, prior)?;
        let along = Vector2::new(self.axis_rad.cos(), self.axis_rad.sin());
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

    /// Returns the robot's heading in the map frame from the vanishing point, the closer to the prior of the two
    /// possible ones.
    fn heading(&mut self, fixer: &Fixer, prior: &Belief) -> Option<f64> {
        let found = self.finder.find(fixer.segments(), fixer.pinhole().intrinsics(), None).ok()?;
        let from_axis = RobotHeading::from_axis(found.direction, fixer.mount()).heading;
        let heading = self.axis_rad + from_axis;
        let error = angle_difference(heading, prior.pose.theta);
        let turned = if error.abs() > std::f64::consts::FRAC_PI_2 { std::f64::consts::PI } else { 0.0 };
        let mut belief = *prior;
        belief.update_heading(heading + turned, HEADING_SIGMA_RAD, f64::INFINITY);
        Some(belief.pose.theta)
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

/// Returns the most frequent direction of the horizontal edges weighted by length, rad, in (-pi/2, pi/2]: the mean
/// direction within the strongest bin of 1 degree.
fn main_direction(map: &WireFrame) -> f64 {
    let mut lengths = [0.0; 180];
    let horizontal = || map.edges().iter().filter(|edge| edge.kind == EdgeKind::Horizontal);
    let degree =
        |run: Vector2<f64>| (run.y.atan2(run.x).to_degrees().round() as i32).rem_euclid(180) as usize;
    for edge in horizontal() {
        let run = (edge.to - edge.from).xy();
        lengths[degree(run)] += run.norm();
    }
    let best = (0..180).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(0);
    let mut sum = Vector2::zeros();
    for edge in horizontal() {
        let run = (edge.to - edge.from).xy();
        if degree(run) == best {
            sum += if run.dot(&sum) < 0.0 { -run } else { run };
        }
    }
    let direction = sum.y.atan2(sum.x);
    if direction.abs() > std::f64::consts::FRAC_PI_2 {
        angle_difference(direction, std::f64::consts::PI)
    } else {
        direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use yamabico_vision::map::Edge;

    #[test]
    fn the_longest_edges_determine_the_main_direction() {
        let (sin, cos) = 0.3_f64.sin_cos();
        let along =
            |length: f64| Edge::between(Point3::origin(), Point3::new(length * cos, length * sin, 0.0));
        let back = Edge::between(Point3::new(9.0 * cos, 9.0 * sin, 1.0), Point3::new(0.0, 0.0, 1.0));
        let across = Edge::between(Point3::origin(), Point3::new(-2.0 * sin, 2.0 * cos, 0.0));
        let map = WireFrame::new(vec![across, along(5.0), back], Vec::new());
        assert!((main_direction(&map) - 0.3).abs() < 1e-9);
    }
}
