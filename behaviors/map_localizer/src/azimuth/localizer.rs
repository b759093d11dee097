use nalgebra::{Point2, Vector3};
use thiserror::Error;
use yamabico_core::geometry::{Hypotenuse, Pose2, wrap_angle};
use yamabico_vision::polygon::segments_cross;

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing};
use super::chi_square::quantile;
use super::joint_compatibility::{JointCompatibility, JointRule};
use super::solver::{BearingPair, SolverRule, most_likely_pose};
use crate::belief::Belief;

/// Ends of a wall that occludes edges, map frame, m.
pub type Obstruction = [Point2<f64>; 2];

/// Limits of the localization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AzimuthRule {
    /// Limits of the pairing.
    pub joint: JointRule,
    /// Limits of the optimization.
    pub solver: SolverRule,
    /// Probability that the chi-squared test accepts a correct pose, 0 to 1.
    pub probability: f64,
    /// Maximum correction of the position, m.
    pub max_correction_m: f64,
    /// Maximum distance of a map edge that is expected in view, m.
    pub max_range_m: f64,
    /// Distance from an edge below which a wall does not occlude it, m.
    pub occlusion_margin_m: f64,
    /// Maximum number of edges of an image.
    pub max_seen: u32,
}

impl Default for AzimuthRule {
    fn default() -> Self {
        Self {
            joint: JointRule::default(),
            solver: SolverRule::default(),
            probability: 0.999,
            max_correction_m: 0.5,
            max_range_m: 15.0,
            occlusion_margin_m: 0.05,
            max_seen: 128,
        }
    }
}

/// Pose found from azimuths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AzimuthFix {
    /// Pose and its covariance.
    pub belief: Belief,
    /// Number of paired edges. With fewer than three the prediction determines the rest.
    pub pairs: usize,
    /// Sum of the squared normalized residuals including the prediction's; one degree of freedom per pair.
    pub chi_squared: f64,
    /// Ratio of the eigenvalues of the position's covariance; 100 or more if the edges determine one direction only.
    pub condition: f64,
}

/// Reason why there is no pose.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum AzimuthProblem {
    /// The image contains no edges.
    #[error("the image contains no edges")]
    NoEdges,
    /// The prediction is not finite or has a negative variance.
    #[error("the predicted pose is invalid")]
    BadPrediction,
    /// The map has no edge in view of the predicted pose.
    #[error("the map has no edge in view of the predicted pose")]
    NoneInView,
    /// No observed edge matches the map.
    #[error("none of {seen} observed edges matches the map")]
    AllUnknown {
        /// Number of observed edges.
        seen: usize,
    },
    /// The edges do not determine the pose.
    #[error("the edges do not determine the pose")]
    Singular,
    /// The residuals fail the chi-squared test.
    #[error("the residuals are too large: chi-squared {chi_squared:.1} with {pairs} edges")]
    Inconsistent {
        /// Sum of the squared normalized residuals.
        chi_squared: f64,
        /// Number of paired edges.
        pairs: usize,
    },
    /// The correction of the position is too large.
    #[error("the pose is {distance_m:.2} m away from the prediction")]
    Jump {
        /// Distance from the prediction, m.
        distance_m: f64,
    },
}

/// Localizer by the azimuths of map edges. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct AzimuthLocalizer {
    rule: AzimuthRule,
    map: Vec<EdgeLandmark>,
    walls: Vec<Obstruction>,
    lever: LeverArm,
    joint: JointCompatibility,
    gates: Vec<f64>,
    visible: Vec<EdgeLandmark>,
    /// Index in the map of each visible edge.
    indices: Vec<usize>,
    pairs: Vec<BearingPair>,
    edge_of_seen: Vec<Option<usize>>,
}

/// Number of hypotheses around the prediction in a search.
const SAMPLES: u32 = 200;

impl AzimuthLocalizer {
    /// Creates a localizer for a map, the walls that occlude parts of it, and the position of the sensor's axis on the
    /// robot.
    #[must_use]
    pub fn new(map: Vec<EdgeLandmark>, walls: Vec<Obstruction>, lever: LeverArm, rule: AzimuthRule) -> Self {
        Self {
            joint: JointCompatibility::new(rule.joint, rule.max_seen),
            gates: (0..=rule.max_seen).map(|n| quantile(rule.probability, n)).collect(),
            visible: Vec::with_capacity(map.len()),
            indices: Vec::with_capacity(map.len()),
            pairs: Vec::with_capacity(rule.max_seen as usize),
            edge_of_seen: Vec::with_capacity(rule.max_seen as usize),
            rule,
            map,
            walls,
            lever,
        }
    }

    /// Returns the number of map edges expected in view by the last call of [`AzimuthLocalizer::locate`].
    #[must_use]
    pub fn visible(&self) -> usize {
        self.visible.len()
    }

    /// Returns the map edges expected in view by the last call of [`AzimuthLocalizer::locate`].
    #[must_use]
    pub fn expected(&self) -> &[EdgeLandmark] {
        &self.visible
    }

    /// Returns the map edge of each observed edge, or `None`, from the last call of [`AzimuthLocalizer::locate`].
    #[must_use]
    pub fn edge_of_seen(&self) -> &[Option<usize>] {
        &self.edge_of_seen
    }

    /// Returns the pairs of the last call of [`AzimuthLocalizer::locate`].
    #[must_use]
    pub fn pairs(&self) -> &[BearingPair] {
        &self.pairs
    }

    /// Finds the pose from the pose predicted by odometry and the edges observed in an image.
    ///
    /// # Errors
    /// The edges do not determine the pose, or contradict the map or the prediction.
    pub fn locate(&mut self, predicted: &Belief, seen: &[SeenBearing]) -> Result<AzimuthFix, AzimuthProblem> {
        self.pairs.clear();
        self.edge_of_seen.clear();
        self.edge_of_seen.resize(seen.len(), None);
        if seen.is_empty() {
            return Err(AzimuthProblem::NoEdges);
        }
        if !predicted.is_valid() {
            return Err(AzimuthProblem::BadPrediction);
        }
        self.find_visible(&predicted.pose);
        if self.visible.is_empty() {
            return Err(AzimuthProblem::NoneInView);
        }
        self.joint.pair(predicted, self.lever, &self.visible, seen);
        for (i, (landmark, seen)) in self.joint.landmark_of_seen().iter().zip(seen).enumerate() {
            if let Some(landmark) = *landmark {
                self.edge_of_seen[i] = Some(self.indices[landmark]);
                self.pairs.push(BearingPair { landmark: self.visible[landmark], seen: *seen });
            }
        }
        if self.pairs.is_empty() {
            return Err(AzimuthProblem::AllUnknown { seen: seen.len() });
        }
        let guess = self.joint.corrected(&predicted.pose);
        let found = most_likely_pose(&self.pairs, &guess, Some(predicted), &self.rule.solver, self.lever)
            .map_err(|_| AzimuthProblem::Singular)?;
        let (pairs, chi_squared) = (self.pairs.len(), found.chi_squared + found.prior_distance_squared);
        let is_consistent = chi_squared <= self.gates[pairs.min(self.gates.len() - 1)];
        if !is_consistent {
            return Err(AzimuthProblem::Inconsistent { chi_squared, pairs });
        }
        let distance_m = found.belief.pose.distance(&predicted.pose);
        let is_near = distance_m <= self.rule.max_correction_m;
        if !is_near {
            return Err(AzimuthProblem::Jump { distance_m });
        }
        Ok(AzimuthFix { belief: found.belief, pairs, chi_squared, condition: condition(&found.belief) })
    }

    /// Searches for the pose if the prediction is unreliable: evaluates hypotheses within three standard deviations of
    /// it and selects the one with the most pairs, then the smallest residuals. Takes as long as 200 calls of
    /// [`AzimuthLocalizer::locate`].
    ///
    /// # Errors
    /// No hypothesis has three pairs; the error is that of the prediction itself.
    pub fn search(&mut self, wide: &Belief, seen: &[SeenBearing]) -> Result<AzimuthFix, AzimuthProblem> {
        let mut best = self.locate(wide, seen);
        let deviations = Vector3::from_fn(|i, _| wide.covariance[(i, i)].max(0.0).sqrt());
        // Adjacent hypotheses overlap.
        let factor = 3.0 / f64::from(SAMPLES).cbrt();
        let narrow = wide.covariance * (factor * factor);
        for sample in 1..=SAMPLES {
            let at = [2, 3, 5].map(|base| 6.0 * halton(sample, base) - 3.0);
            let pose = Pose2 {
                x: wide.pose.x + at[0] * deviations.x,
                y: wide.pose.y + at[1] * deviations.y,
                theta: wrap_angle(wide.pose.theta + at[2] * deviations.z),
            };
            let found = self.locate(&Belief { pose, covariance: narrow }, seen);
            if is_better(&found, &best) {
                best = found;
            }
        }
        // Repeated so that the buffers contain the best one.
        match best {
            Ok(fix) if fix.pairs >= 3 => self.locate(&Belief { covariance: narrow, ..fix.belief }, seen),
            _ => self.locate(wide, seen),
        }
    }

    /// Collects the map edges in range that no wall occludes.
    fn find_visible(&mut self, pose: &Pose2) {
        self.visible.clear();
        self.indices.clear();
        let sensor = pose.transform_point(Point2::from(self.lever));
        for (index, edge) in self.map.iter().enumerate() {
            let away = edge.position - sensor;
            let distance = away.norm();
            if !(distance > 0.0 && distance <= self.rule.max_range_m) {
                continue;
            }
            let short = (1.0 - self.rule.occlusion_margin_m / distance).max(0.0);
            let ray = [sensor, sensor + away * short];
            if !self.walls.iter().any(|wall| segments_cross(ray, *wall)) {
                self.visible.push(*edge);
                self.indices.push(index);
            }
        }
    }
}

fn is_better(a: &Result<AzimuthFix, AzimuthProblem>, b: &Result<AzimuthFix, AzimuthProblem>) -> bool {
    match (a, b) {
        (Ok(a), Ok(b)) => a.pairs > b.pairs || a.pairs == b.pairs && a.chi_squared < b.chi_squared,
        (Ok(_), Err(_)) => true,
        (Err(_), _) => false,
    }
}

fn condition(belief: &Belief) -> f64 {
    let [a, b, c] = [belief.covariance[(0, 0)], belief.covariance[(0, 1)], belief.covariance[(1, 1)]];
    let (middle, half) = (0.5 * (a + c), (0.5 * (a - c)).hypotenuse(b));
    (middle + half) / (middle - half).max(f64::MIN_POSITIVE)
}

/// Returns element `index` of the van der Corput sequence in this base, in (0, 1).
fn halton(mut index: u32, base: u32) -> f64 {
    let (mut digit_value, mut value) = (1.0, 0.0);
    while index > 0 {
        digit_value /= f64::from(base);
        value += digit_value * f64::from(index % base);
        index /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::azimuth::predict;
    use yamabico_vision::azimuth_profile::EdgeSign;

    fn map() -> Vec<EdgeLandmark> {
        [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (0.0, 4.0),
            (1.2, 0.0),
            (2.0, 0.0),
            (4.0, 1.5),
            (0.5, 3.2),
            (3.0, 3.0),
        ]
        .iter()
        .enumerate()
        .map(|(i, &(x, y))| EdgeLandmark {
            position: Point2::new(x, y),
            sign: Some(EdgeSign::ALL[i % 2]),
            sigma_m: 0.005,
        })
        .collect()
    }

    fn observe(edges: &[EdgeLandmark], pose: &Pose2) -> Vec<SeenBearing> {
        let bearing = |edge: &EdgeLandmark| SeenBearing {
            azimuth_rad: predict(edge, pose, LeverArm::zeros()).azimuth_rad,
            sign: edge.sign,
            sigma_rad: 0.005,
        };
        edges.iter().map(bearing).collect()
    }

    fn localizer(walls: Vec<Obstruction>) -> AzimuthLocalizer {
        AzimuthLocalizer::new(map(), walls, LeverArm::zeros(), AzimuthRule::default())
    }

    #[test]
    fn the_pose_is_found_among_unknown_edges() {
        let truth = Pose2::new(1.6, 2.2, 0.4);
        let mut seen = observe(&map(), &truth);
        let unknown = [0.3, -0.9, 2.9].map(|azimuth_rad| SeenBearing { azimuth_rad, ..seen[0] });
        seen.extend(unknown);
        let predicted = Belief::new(Pose2::new(1.63, 2.17, 0.42), 0.05, 0.03);
        let mut localizer = localizer(Vec::new());
        let fix = localizer.locate(&predicted, &seen).unwrap();
        assert!(fix.belief.pose.distance(&truth) < 0.005);
        assert!(fix.pairs >= 9 && fix.condition < 10.0);
        assert!((0..9).all(|i| localizer.edge_of_seen()[i] == Some(i)));
    }

    #[test]
    fn a_wall_occludes_the_edges_behind_it() {
        let truth = Pose2::new(1.6, 2.2, 0.4);
        // The corner at (4, 4) is behind the wall, the one at (3, 3) is its end.
        let wall = [Point2::new(3.0, 3.0), Point2::new(2.8, 3.6)];
        let mut localizer = localizer(vec![wall]);
        localizer.find_visible(&truth);
        assert!(!localizer.indices.contains(&2) && localizer.indices.contains(&8));
    }

    #[test]
    fn each_problem_is_reported() {
        let truth = Pose2::new(1.6, 2.2, 0.4);
        let predicted = Belief::new(truth, 0.05, 0.03);
        let mut localizer = localizer(Vec::new());
        assert_eq!(localizer.locate(&predicted, &[]), Err(AzimuthProblem::NoEdges));
        let broken = Belief::new(Pose2 { x: f64::NAN, ..truth }, 0.05, 0.03);
        let seen = observe(&map(), &truth);
        assert_eq!(localizer.locate(&broken, &seen), Err(AzimuthProblem::BadPrediction));
        let unknown = SeenBearing { azimuth_rad: 0.2, ..seen[0] };
        let tight = Belief::new(truth, 0.01, 0.005);
        assert_eq!(localizer.locate(&tight, &[unknown]), Err(AzimuthProblem::AllUnknown { seen: 1 }));
        let no_number = SeenBearing { azimuth_rad: f64::NAN, ..seen[0] };
        assert_eq!(localizer.locate(&tight, &[no_number]), Err(AzimuthProblem::AllUnknown { seen: 1 }));
        let far = Belief::new(Pose2::new(100.0, 0.0, 0.0), 0.05, 0.03);
        assert_eq!(localizer.locate(&far, &seen), Err(AzimuthProblem::NoneInView));
        // Two edges do not determine a pose, but correct it.
        let fix = localizer.locate(&predicted, &seen[..2]).unwrap();
        assert!(fix.pairs == 2 && fix.belief.sigma_xy_m() > 0.02);
    }

    #[test]
    fn a_lost_robot_is_found_again() {
        let truth = Pose2::new(2.4, 1.1, -0.8);
        let seen = observe(&map(), &truth);
        let lost = Belief::new(Pose2::new(1.9, 1.6, -0.4), 0.35, 0.3);
        let mut localizer = localizer(Vec::new());
        let fix = localizer.search(&lost, &seen).unwrap();
        assert!(fix.belief.pose.distance(&truth) < 0.02, "{:?}", fix.belief.pose);
        assert_eq!(fix.pairs, 9);
    }
}
