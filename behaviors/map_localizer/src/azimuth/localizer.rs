use nalgebra::{Point2, Vector3};
use thiserror::Error;
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_vision::polygon::segments_cross;

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing};
use super::chi_square::quantile;
use super::joint_compatibility::{JointCompatibility, JointRule};
use super::solver::{BearingPair, SolverRule, most_likely_pose};
use crate::belief::Belief;

/// A wall that hides what is behind it: its two ends on the map, meters.
pub type Obstruction = [Point2<f64>; 2];

/// How the pose is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AzimuthRule {
    /// How edges are paired.
    pub joint: JointRule,
    /// How the most likely pose is sought.
    pub solver: SolverRule,
    /// Share of right poses that the test of the residuals lets pass, 0 to 1.
    pub probability: f64,
    /// Largest correction of the position, meters.
    pub max_correction_m: f64,
    /// Farthest edges of the map that are looked for, meters.
    pub farthest_m: f64,
    /// An edge is not hidden by what ends this near to it, meters.
    pub hiding_margin_m: f64,
    /// Most edges of a picture.
    pub max_seen: u32,
}

impl Default for AzimuthRule {
    fn default() -> Self {
        Self {
            joint: JointRule::default(),
            solver: SolverRule::default(),
            probability: 0.999,
            max_correction_m: 0.5,
            farthest_m: 15.0,
            hiding_margin_m: 0.05,
            max_seen: 128,
        }
    }
}

/// A pose found from azimuths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AzimuthFix {
    /// The pose and its covariance.
    pub belief: Belief,
    /// How many edges were paired. Below three the prediction does the rest.
    pub pairs: usize,
    /// Sum of the squared residuals over their variances, that of the prediction among them; one degree of freedom a pair.
    pub chi_squared: f64,
    /// Longest over shortest axis of the position's covariance, squared; 100 and more where the edges fix one direction only.
    pub condition: f64,
}

/// Why there is no pose. The prediction stays what it was.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum AzimuthProblem {
    /// The picture shows no edges.
    #[error("no edges are seen")]
    NoEdges,
    /// The prediction is no number.
    #[error("the prediction is not usable")]
    BadPrediction,
    /// None of the edges seen is one of the map.
    #[error("none of {seen} edges seen is on the map")]
    AllUnknown {
        /// Edges seen.
        seen: usize,
    },
    /// Robot and edges leave the pose open.
    #[error("the edges do not fix the pose")]
    Singular,
    /// The residuals are too large for the pose to be right.
    #[error("residuals do not fit: chi-square {chi_squared:.1} with {pairs} edges")]
    Inconsistent {
        /// Sum of the squared residuals over their variances.
        chi_squared: f64,
        /// Edges paired.
        pairs: usize,
    },
    /// The pose lies farther from the prediction than it may.
    #[error("the pose lies {distance_m:.2} m from the prediction")]
    Jump {
        /// Meters.
        distance_m: f64,
    },
}

/// Finds the pose from the azimuths of edges of a map. Keeps its buffers.
#[derive(Clone, Debug)]
pub struct AzimuthLocalizer {
    rule: AzimuthRule,
    map: Vec<EdgeLandmark>,
    walls: Vec<Obstruction>,
    lever: LeverArm,
    joint: JointCompatibility,
    gates: Vec<f64>,
    visible: Vec<EdgeLandmark>,
    /// Number on the map of each visible edge.
    numbers: Vec<usize>,
    pairs: Vec<BearingPair>,
    edge_of_seen: Vec<Option<usize>>,
}

/// Poses that are tried around the prediction where the robot is lost.
const SAMPLES: u32 = 200;

impl AzimuthLocalizer {
    /// With a map, the walls that hide parts of it, and where the sensor's axis stands on the robot.
    #[must_use]
    pub fn new(map: Vec<EdgeLandmark>, walls: Vec<Obstruction>, lever: LeverArm, rule: AzimuthRule) -> Self {
        Self {
            joint: JointCompatibility::new(rule.joint, rule.max_seen),
            gates: (0..=rule.max_seen).map(|n| quantile(rule.probability, n)).collect(),
            visible: Vec::with_capacity(map.len()),
            numbers: Vec::with_capacity(map.len()),
            pairs: Vec::with_capacity(rule.max_seen as usize),
            edge_of_seen: Vec::with_capacity(rule.max_seen as usize),
            rule,
            map,
            walls,
            lever,
        }
    }

    /// The edges of the map.
    #[must_use]
    pub fn map(&self) -> &[EdgeLandmark] {
        &self.map
    }

    /// How many edges of the map the last call expected in view.
    #[must_use]
    pub fn visible(&self) -> usize {
        self.visible.len()
    }

    /// The edge of the map that each edge seen is, or `None`: of the last call.
    #[must_use]
    pub fn edge_of_seen(&self) -> &[Option<usize>] {
        &self.edge_of_seen
    }

    /// The pairs of the last call.
    #[must_use]
    pub fn pairs(&self) -> &[BearingPair] {
        &self.pairs
    }

    /// The pose, from what odometry predicts and what the picture shows.
    ///
    /// # Errors
    /// [`AzimuthProblem`] says why there is none.
    pub fn locate(&mut self, predicted: &Belief, seen: &[SeenBearing]) -> Result<AzimuthFix, AzimuthProblem> {
        self.pairs.clear();
        self.edge_of_seen.clear();
        self.edge_of_seen.resize(seen.len(), None);
        if seen.is_empty() {
            return Err(AzimuthProblem::NoEdges);
        }
        if !predicted.is_sound() {
            return Err(AzimuthProblem::BadPrediction);
        }
        self.look_from(&predicted.pose);
        self.joint.pair(predicted, self.lever, &self.visible, seen);
        for (number, (place, seen)) in self.joint.landmark_of_seen().iter().zip(seen).enumerate() {
            if let Some(place) = *place {
                self.edge_of_seen[number] = Some(self.numbers[place]);
                self.pairs.push(BearingPair { landmark: self.visible[place], seen: *seen });
            }
        }
        if self.pairs.is_empty() {
            return Err(AzimuthProblem::AllUnknown { seen: seen.len() });
        }
        let guess = self.joint.corrected(&predicted.pose);
        let found = most_likely_pose(&self.pairs, &guess, Some(predicted), &self.rule.solver, self.lever)
            .map_err(|_| AzimuthProblem::Singular)?;
        let (pairs, chi_squared) = (self.pairs.len(), found.chi_squared + found.from_prior);
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

    /// The pose where the prediction is not to be trusted: the best of many tries within three standard deviations of it, by the
    /// number of pairs and then the residuals. It takes as long as 200 calls of [`AzimuthLocalizer::locate`].
    ///
    /// # Errors
    /// [`AzimuthProblem`] of the prediction itself, where no try found a pose with three pairs.
    pub fn search(&mut self, wide: &Belief, seen: &[SeenBearing]) -> Result<AzimuthFix, AzimuthProblem> {
        let mut best = self.locate(wide, seen);
        let deviations = Vector3::from_fn(|i, _| wide.covariance[(i, i)].max(0.0).sqrt());
        // Tries overlap: each covers what lies between them.
        let share = 3.0 / f64::from(SAMPLES).cbrt();
        let narrow = wide.covariance * (share * share);
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
        // What belongs to the best one is told again.
        match best {
            Ok(fix) if fix.pairs >= 3 => self.locate(&Belief { covariance: narrow, ..fix.belief }, seen),
            _ => self.locate(wide, seen),
        }
    }

    /// The edges that walls do not hide.
    fn look_from(&mut self, pose: &Pose2) {
        self.visible.clear();
        self.numbers.clear();
        let sensor = pose.transform_point(Point2::from(self.lever));
        for (number, edge) in self.map.iter().enumerate() {
            let away = edge.position - sensor;
            let distance = away.norm();
            if !(distance > 0.0 && distance <= self.rule.farthest_m) {
                continue;
            }
            let short = (1.0 - self.rule.hiding_margin_m / distance).max(0.0);
            let ray = [sensor, sensor + away * short];
            if !self.walls.iter().any(|wall| segments_cross(ray, *wall)) {
                self.visible.push(*edge);
                self.numbers.push(number);
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
    let (middle, half) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
    (middle + half) / (middle - half).max(f64::MIN_POSITIVE)
}

/// The number `index` of van der Corput's sequence, in (0, 1).
fn halton(mut index: u32, base: u32) -> f64 {
    let (mut share, mut value) = (1.0, 0.0);
    while index > 0 {
        share /= f64::from(base);
        value += share * f64::from(index % base);
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

    fn look(edges: &[EdgeLandmark], pose: &Pose2) -> Vec<SeenBearing> {
        let see = |edge: &EdgeLandmark| SeenBearing {
            azimuth_rad: predict(edge, pose, LeverArm::zeros()).azimuth_rad,
            sign: edge.sign,
            sigma_rad: 0.005,
        };
        edges.iter().map(see).collect()
    }

    fn localizer(walls: Vec<Obstruction>) -> AzimuthLocalizer {
        AzimuthLocalizer::new(map(), walls, LeverArm::zeros(), AzimuthRule::default())
    }

    #[test]
    fn the_pose_is_found_among_unknown_edges() {
        let truth = Pose2::new(1.6, 2.2, 0.4);
        let mut seen = look(&map(), &truth);
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
    fn a_wall_hides_what_is_behind_it() {
        let truth = Pose2::new(1.6, 2.2, 0.4);
        // The corner at (4, 4) stands behind it, and the one at (3, 3) is its own end.
        let wall = [Point2::new(3.0, 3.0), Point2::new(2.8, 3.6)];
        let mut localizer = localizer(vec![wall]);
        localizer.look_from(&truth);
        assert!(!localizer.numbers.contains(&2) && localizer.numbers.contains(&8));
    }

    #[test]
    fn every_problem_has_its_name() {
        let truth = Pose2::new(1.6, 2.2, 0.4);
        let predicted = Belief::new(truth, 0.05, 0.03);
        let mut localizer = localizer(Vec::new());
        assert_eq!(localizer.locate(&predicted, &[]), Err(AzimuthProblem::NoEdges));
        let broken = Belief::new(Pose2 { x: f64::NAN, ..truth }, 0.05, 0.03);
        let seen = look(&map(), &truth);
        assert_eq!(localizer.locate(&broken, &seen), Err(AzimuthProblem::BadPrediction));
        let unknown = SeenBearing { azimuth_rad: 0.2, ..seen[0] };
        let tight = Belief::new(truth, 0.01, 0.005);
        assert_eq!(localizer.locate(&tight, &[unknown]), Err(AzimuthProblem::AllUnknown { seen: 1 }));
        let no_number = SeenBearing { azimuth_rad: f64::NAN, ..seen[0] };
        assert_eq!(localizer.locate(&tight, &[no_number]), Err(AzimuthProblem::AllUnknown { seen: 1 }));
        // Two edges do not fix a pose, but correct it.
        let fix = localizer.locate(&predicted, &seen[..2]).unwrap();
        assert!(fix.pairs == 2 && fix.belief.sigma_xy_m() > 0.02);
    }

    #[test]
    fn a_lost_robot_is_found_again() {
        let truth = Pose2::new(2.4, 1.1, -0.8);
        let seen = look(&map(), &truth);
        let lost = Belief::new(Pose2::new(1.9, 1.6, -0.4), 0.35, 0.3);
        let mut localizer = localizer(Vec::new());
        let fix = localizer.search(&lost, &seen).unwrap();
        assert!(fix.belief.pose.distance(&truth) < 0.02, "{:?}", fix.belief.pose);
        assert_eq!(fix.pairs, 9);
    }
}
