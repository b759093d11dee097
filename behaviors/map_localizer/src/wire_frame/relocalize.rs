//! Finding a robot again whose pose is not known within a door or two: the heading from the vanishing point, the place across
//! from long level lines, the place along from upright edges.

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::Mount;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::corridor::heading::RobotHeading;
use yamabico_vision::map::{EdgeKind, WireFrame};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

use super::fixer::Fixer;
use super::matching::LineNoise;
use crate::belief::Belief;

/// Distance of the places that are tried, meters.
const STEP_M: f64 = 0.15;
/// Farthest places to either side of the prior that are tried, meters: at least, at most.
const REACH_M: [f64; 2] = [2.0, 10.0];
/// Standard deviation of a place that is tried, meters.
const TRIED_SIGMA_M: f64 = 0.1;
/// Least share of the upright edges' length in view that must be seen.
const MIN_SHARE: f64 = 0.5;
/// Least number of upright edges that must be seen.
const MIN_UPRIGHTS: usize = 3;
/// Another place, farther away than this (m), must not be nearly as good ...
const RIVAL_M: f64 = 0.6;
/// ... by this share.
const RIVAL_SHARE: f64 = 0.8;
/// Least standard deviations of a robot that was found again: meters, radians.
const FOUND_SIGMA: [f64; 2] = [0.05, 0.01];
/// No heading is trusted better than this, rad.
const HEADING_SIGMA_RAD: f64 = 0.01;

/// Looks for the robot along the map's main direction; keeps its buffers.
#[derive(Clone, Debug)]
pub struct Relocalizer {
    finder: VanishingPointFinder,
    axis_rad: f64,
    tried: Vec<(f64, f64)>,
}

impl Relocalizer {
    /// One for this map and mount.
    #[must_use]
    pub fn new(map: &WireFrame, mount: &Mount) -> Self {
        let down = mount.rotation_body_from_camera().transpose() * Vector3::new(0.0, 0.0, -1.0);
        let config = VanishingPointConfig { down_in_camera: down, ..VanishingPointConfig::default() };
        Self { finder: VanishingPointFinder::new(config), axis_rad: main_direction(map), tried: Vec::new() }
    }

    /// The robot in the picture that `fixer` took last, within the reach of the prior; `None` where it is found nowhere, or in
    /// two places.
    pub fn find(&mut self, fixer: &mut Fixer, prior: &Belief, noise: &LineNoise) -> Option<Belief> {
        let heading = self.heading(fixer, prior)?;
        let along = Vector2::new(self.axis_rad.cos(), self.axis_rad.sin());
        let across = Vector2::new(-along.y, along.x);
        let place = |along_m: f64, across_m: f64| {
            let shift = along * along_m + across * across_m;
            Pose2::new(prior.pose.x + shift.x, prior.pose.y + shift.y, heading)
        };
        let reach = (3.0 * prior.sigma_xy_m()).clamp(REACH_M[0], REACH_M[1]);
        let across_m = self.best(reach.min(REACH_M[0]), |aside| {
            let belief = tried(place(0.0, aside));
            fixer.fix(&belief, noise);
            seen_px(fixer, EdgeKind::Horizontal).0
        })?;
        let score_along = |fixer: &mut Fixer, ahead: f64| {
            let fix = fixer.fix(&tried(place(ahead, across_m)), noise);
            let (seen, expected) = seen_px(fixer, EdgeKind::Vertical);
            // A place where little could be seen is no better for having seen all of it.
            let share = seen / expected.max(1.0);
            if fix.uprights[1] >= MIN_UPRIGHTS { share * seen.sqrt() } else { 0.0 }
        };
        let along_m = self.best(reach, |ahead| score_along(fixer, ahead))?;
        let best = score_along(fixer, along_m);
        let is_rivalled = self
            .tried
            .iter()
            .any(|&(other_m, score)| (other_m - along_m).abs() > RIVAL_M && score > RIVAL_SHARE * best);
        let fix = fixer.fix(&tried(place(along_m, across_m)), noise);
        let (seen, expected) = seen_px(fixer, EdgeKind::Vertical);
        let is_found = best > 0.0 && !is_rivalled && seen >= MIN_SHARE * expected && fix.verdict.is_ok();
        is_found.then(|| {
            let mut found = fix.posterior;
            let [place, heading] = FOUND_SIGMA;
            found.floor([place * place, place * place, heading * heading]);
            found
        })
    }

    /// The robot's heading on the map by the vanishing point, of the two that it allows the one nearer to the prior.
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

    /// The place within +-`reach` (m) that scores best, above zero; all that were tried are kept.
    fn best(&mut self, reach: f64, mut score: impl FnMut(f64) -> f64) -> Option<f64> {
        let steps = (reach / STEP_M).ceil() as i32;
        self.tried.clear();
        for step in -steps..=steps {
            let place = f64::from(step) * STEP_M;
            self.tried.push((place, score(place)));
        }
        let best = self.tried.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 > 0.0).then_some(best.0)
    }
}

/// A place to try: near enough for the gates, wide enough to reach the next one.
fn tried(pose: Pose2) -> Belief {
    Belief::new(pose, TRIED_SIGMA_M, 2.0 * HEADING_SIGMA_RAD)
}

/// Length (pixels) of the edges of a kind that were matched, and of those that should have been in view.
fn seen_px(fixer: &Fixer, kind: EdgeKind) -> (f64, f64) {
    let expected = fixer.expected();
    let of_kind = |number: usize| {
        let edge = &expected[number];
        if edge.kind == kind { edge.length_px() } else { 0.0 }
    };
    let seen = fixer.used().iter().map(|pair| of_kind(pair.expected)).sum();
    (seen, (0..expected.len()).map(of_kind).sum())
}

/// The direction (rad, in (-pi/2, pi/2]) that most of the map's level edges run in, by length, to a degree; their mean within it.
fn main_direction(map: &WireFrame) -> f64 {
    let mut lengths = [0.0; 180];
    let level = || map.edges().iter().filter(|edge| edge.kind == EdgeKind::Horizontal);
    let degree =
        |run: Vector2<f64>| (run.y.atan2(run.x).to_degrees().round() as i32).rem_euclid(180) as usize;
    for edge in level() {
        let run = (edge.to - edge.from).xy();
        lengths[degree(run)] += run.norm();
    }
    let best = (0..180).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(0);
    let mut sum = Vector2::zeros();
    for edge in level() {
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
    fn the_main_direction_is_that_of_the_longest_edges() {
        let (sin, cos) = 0.3_f64.sin_cos();
        let along =
            |length: f64| Edge::between(Point3::origin(), Point3::new(length * cos, length * sin, 0.0));
        let back = Edge::between(Point3::new(9.0 * cos, 9.0 * sin, 1.0), Point3::new(0.0, 0.0, 1.0));
        let across = Edge::between(Point3::origin(), Point3::new(-2.0 * sin, 2.0 * cos, 0.0));
        let map = WireFrame::new(vec![across, along(5.0), back], Vec::new());
        assert!((main_direction(&map) - 0.3).abs() < 1e-9);
    }
}
