use nalgebra::{Matrix3, RowVector3, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing, may_match, predict_from};
use super::chi_square::quantile;
use crate::belief::Belief;

/// Limits of the pairing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRule {
    /// Probability that the gates accept a correct set of pairs, 0 to 1.
    pub probability: f64,
    /// Maximum squared Mahalanobis distance of a pair given the pairs before it. Without this limit, one wrong pair can
    /// hide among many correct ones.
    pub conditional_gate: f64,
    /// Maximum number of nodes of the search tree; after that the best set so far is returned.
    pub max_nodes: u32,
}

impl Default for JointRule {
    fn default() -> Self {
        Self { probability: 0.99, conditional_gate: 10.83, max_nodes: 20_000 }
    }
}

/// Result of the pairing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pairing {
    /// Number of pairs.
    pub pairs: usize,
    /// Joint squared Mahalanobis distance, one degree of freedom per pair.
    pub distance_squared: f64,
    /// True if the search finished within [`JointRule::max_nodes`].
    pub is_complete: bool,
}

/// Joint compatibility branch and bound (Neira & Tardos, 2001): finds the largest set of pairs of observed edges and
/// map edges that is jointly compatible with the belief, and among these the set with the smallest distance. Reuses its
/// buffers.
///
/// Each observed edge is a scalar measurement of the same pose, so the joint distance grows by the normalized
/// innovation of a Kalman filter per pair, and the cost of a node does not depend on its depth.
#[derive(Clone, Debug)]
pub struct JointCompatibility {
    rule: JointRule,
    gates: Vec<f64>,
    candidates: Vec<BearingCandidate>,
    /// Range of the candidates of each observed edge.
    ranges: Vec<[usize; 2]>,
    /// Order in which observed edges are paired: fewest candidates first, or unsorted without a conditional gate.
    order: Vec<usize>,
    is_used: Vec<bool>,
    chosen: Vec<Option<usize>>,
    best: Vec<Option<usize>>,
    best_shift: Vector3<f64>,
    nodes: Vec<Node>,
    predictions: Vec<Prediction>,
}

#[derive(Clone, Copy, Debug)]
struct Prediction {
    azimuth_rad: f64,
    jacobian: RowVector3<f64>,
    variance: f64,
    landmark_variance: f64,
}

#[derive(Clone, Copy, Debug)]
struct BearingCandidate {
    landmark: usize,
    innovation: f64,
    jacobian: RowVector3<f64>,
    /// Variance of the observed azimuth and the landmark together, rad².
    noise: f64,
    /// Squared Mahalanobis distance given the pairs chosen before.
    distance_squared: f64,
}

/// Node of the search tree: the belief after the pairs chosen so far.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Shift of the prior pose.
    shift: Vector3<f64>,
    covariance: Matrix3<f64>,
    pairs: usize,
    distance_squared: f64,
    /// Next candidate to try.
    next: usize,
}

impl JointCompatibility {
    /// Creates a pairing for at most `max_seen` observed edges.
    #[must_use]
    pub fn new(rule: JointRule, max_seen: u32) -> Self {
        let gates = (0..=max_seen).map(|n| if n == 0 { 0.0 } else { quantile(rule.probability, n) });
        Self {
            rule,
            gates: gates.collect(),
            candidates: Vec::new(),
            ranges: Vec::new(),
            order: Vec::new(),
            is_used: Vec::new(),
            chosen: Vec::new(),
            best: Vec::new(),
            best_shift: Vector3::zeros(),
            nodes: Vec::new(),
            predictions: Vec::new(),
        }
    }

    /// Pairs observed edges with landmarks; [`JointCompatibility::landmark_of_seen`] returns the pairs. Edges in excess
    /// of the maximum stay unpaired, as do all edges if the belief is invalid.
    pub fn pair(
        &mut self,
        belief: &Belief,
        lever: LeverArm,
        landmarks: &[EdgeLandmark],
        seen: &[SeenBearing],
    ) -> Pairing {
        self.best.clear();
        self.best.resize(seen.len(), None);
        self.best_shift = Vector3::zeros();
        if !belief.is_valid() {
            return Pairing { pairs: 0, distance_squared: 0.0, is_complete: true };
        }
        let count = seen.len().min(self.gates.len() - 1);
        self.gather(belief, lever, landmarks, &seen[..count]);
        self.search(belief, landmarks.len())
    }

    /// Returns the index of the landmark of each observed edge, or `None`.
    #[must_use]
    pub fn landmark_of_seen(&self) -> &[Option<usize>] {
        &self.best
    }

    /// Returns the pose corrected by the pairs to first order: the initial guess of the optimization.
    #[must_use]
    pub fn corrected(&self, pose: &Pose2) -> Pose2 {
        let by = self.best_shift;
        Pose2 { x: pose.x + by.x, y: pose.y + by.y, theta: wrap_angle(pose.theta + by.z) }
    }

    /// Returns the indices of the individually compatible landmarks of an observed edge, unsorted.
    pub fn candidates_of(&self, seen: usize) -> impl Iterator<Item = usize> {
        let [start, end] = self.ranges.get(seen).copied().unwrap_or([0, 0]);
        self.candidates[start..end].iter().map(|candidate| candidate.landmark)
    }

    fn gather(&mut self, belief: &Belief, lever: LeverArm, landmarks: &[EdgeLandmark], seen: &[SeenBearing]) {
        let (sin, cos) = belief.pose.theta.sin_cos();
        self.predictions.clear();
        self.predictions.extend(landmarks.iter().map(|landmark| {
            let found = predict_from(landmark, &belief.pose, [sin, cos], lever);
            let variance = (found.jacobian * belief.covariance * found.jacobian.transpose()).x;
            Prediction {
                azimuth_rad: found.azimuth_rad,
                jacobian: found.jacobian,
                variance: variance + found.landmark_variance,
                landmark_variance: found.landmark_variance,
            }
        }));
        self.candidates.clear();
        self.ranges.clear();
        let gate = self.gates.get(1).copied().unwrap_or(0.0);
        for edge in seen {
            let start = self.candidates.len();
            let own = edge.sigma_rad * edge.sigma_rad;
            for (number, prediction) in self.predictions.iter().enumerate() {
                let innovation = angle_difference(edge.azimuth_rad, prediction.azimuth_rad);
                let squared = innovation * innovation;
                let variance = prediction.variance + own;
                if squared <= gate * variance && may_match(landmarks[number].sign, edge.sign) {
                    self.candidates.push(BearingCandidate {
                        landmark: number,
                        innovation,
                        jacobian: prediction.jacobian,
                        noise: own + prediction.landmark_variance,
                        distance_squared: squared / variance,
                    });
                }
            }
            self.ranges.push([start, self.candidates.len()]);
        }
        self.order.clear();
        self.order.extend((0..seen.len()).filter(|edge| self.ranges[*edge][0] < self.ranges[*edge][1]));
        if self.rule.conditional_gate.is_finite() {
            let ranges = &self.ranges;
            // Unambiguous edges first: they narrow the gates of the others.
            self.order.sort_by_key(|edge| ranges[*edge][1] - ranges[*edge][0]);
        }
    }

    fn search(&mut self, belief: &Belief, landmarks: usize) -> Pairing {
        let depth = self.order.len();
        self.is_used.clear();
        self.is_used.resize(landmarks, false);
        self.chosen.clear();
        self.chosen.resize(depth, None);
        self.nodes.clear();
        self.nodes.push(Node {
            shift: Vector3::zeros(),
            covariance: belief.covariance,
            pairs: 0,
            distance_squared: 0.0,
            next: 0,
        });
        let mut best = Pairing { pairs: 0, distance_squared: f64::INFINITY, is_complete: true };
        let mut visited = 0;
        while let Some(level) = self.nodes.len().checked_sub(1) {
            if visited >= self.rule.max_nodes {
                best.is_complete = false;
                break;
            }
            visited += 1;
            self.release(level);
            let node = self.nodes[level];
            if level == depth {
                if is_better(&node, node.pairs, &best) {
                    (best.pairs, best.distance_squared) = (node.pairs, node.distance_squared);
                    self.best_shift = node.shift;
                    self.keep_best();
                }
                self.nodes.pop();
                continue;
            }
            if !is_better(&node, node.pairs + depth - level, &best) {
                self.nodes.pop();
                continue;
            }
            self.advance(level);
        }
        if best.pairs == 0 {
            best.distance_squared = 0.0;
        }
        best
    }

    /// Undoes the pair tried before at this level.
    fn release(&mut self, level: usize) {
        if let Some(choice) = self.chosen.get_mut(level).and_then(Option::take) {
            self.is_used[self.candidates[choice].landmark] = false;
        }
    }

    /// Tries the next candidate at this level, and no pair as the last option.
    fn advance(&mut self, level: usize) {
        let [start, end] = self.ranges[self.order[level]];
        let node = self.nodes[level];
        if node.next == 0 {
            // Nearest candidate first: a good set found early prunes the rest of the tree.
            let candidates = &mut self.candidates[start..end];
            for candidate in &mut *candidates {
                candidate.distance_squared = node.distance_squared_of(candidate);
            }
            candidates.sort_unstable_by(|a, b| {
                a.distance_squared.total_cmp(&b.distance_squared).then(a.landmark.cmp(&b.landmark))
            });
        }
        let remaining = self.gates[node.pairs + 1] - node.distance_squared;
        for index in start + node.next..end {
            let candidate = &self.candidates[index];
            let is_compatible = candidate.distance_squared <= remaining.min(self.rule.conditional_gate);
            if !is_compatible {
                break;
            }
            if !self.is_used[candidate.landmark] {
                self.is_used[candidate.landmark] = true;
                self.chosen[level] = Some(index);
                self.nodes[level].next = index + 1 - start;
                self.nodes.push(node.with(candidate));
                return;
            }
        }
        let count = end - start;
        if node.next <= count {
            self.nodes[level].next = count + 1;
            self.nodes.push(Node { next: 0, ..node });
        } else {
            self.nodes.pop();
        }
    }

    fn keep_best(&mut self) {
        self.best.fill(None);
        for (edge, choice) in self.order.iter().zip(&self.chosen) {
            self.best[*edge] = choice.map(|index| self.candidates[index].landmark);
        }
    }
}

/// Returns true if a node that can reach at most `max_pairs` pairs may beat the best set.
fn is_better(node: &Node, max_pairs: usize, best: &Pairing) -> bool {
    max_pairs > best.pairs || max_pairs == best.pairs && node.distance_squared < best.distance_squared
}

impl Node {
    /// Returns the squared Mahalanobis distance of a candidate given the pairs so far.
    #[inline]
    fn distance_squared_of(&self, candidate: &BearingCandidate) -> f64 {
        let h = &candidate.jacobian;
        let innovation = candidate.innovation - (h * self.shift).x;
        innovation * innovation / ((h * self.covariance * h.transpose()).x + candidate.noise)
    }

    /// Returns the node with one more pair.
    #[inline]
    fn with(&self, candidate: &BearingCandidate) -> Self {
        let h = &candidate.jacobian;
        let cross = self.covariance * h.transpose();
        let innovation = candidate.innovation - (h * self.shift).x;
        let variance = (h * cross).x + candidate.noise;
        let gain = cross / variance;
        Self {
            shift: self.shift + gain * innovation,
            covariance: self.covariance - gain * cross.transpose(),
            pairs: self.pairs + 1,
            distance_squared: self.distance_squared + innovation * innovation / variance,
            next: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::azimuth::predict;
    use nalgebra::Point2;

    fn seen_from(landmarks: &[EdgeLandmark], pose: &Pose2) -> Vec<SeenBearing> {
        let bearing = |edge: &EdgeLandmark| SeenBearing {
            azimuth_rad: predict(edge, pose, LeverArm::zeros()).azimuth_rad,
            sign: None,
            sigma_rad: 0.01,
        };
        landmarks.iter().map(bearing).collect()
    }

    fn landmarks() -> Vec<EdgeLandmark> {
        [(2.0, 0.1), (2.1, 0.5), (0.3, 2.0), (-1.8, 0.4), (-0.2, -2.2), (1.5, -1.4), (1.4, -1.6)]
            .map(|(x, y)| EdgeLandmark { position: Point2::new(x, y), sign: None, sigma_m: 0.0 })
            .to_vec()
    }

    #[test]
    fn landmarks_are_paired_once_and_the_set_passes_its_gate() {
        let map = landmarks();
        let belief = Belief::new(Pose2::new(0.04, -0.03, 0.05), 0.08, 0.1);
        let mut seen = seen_from(&map, &Pose2::IDENTITY);
        seen.push(SeenBearing { azimuth_rad: seen[0].azimuth_rad + 0.005, ..seen[0] });
        for conditional_gate in [10.83, f64::INFINITY] {
            let rule = JointRule { conditional_gate, ..JointRule::default() };
            let mut joint = JointCompatibility::new(rule, 20);
            let pairing = joint.pair(&belief, LeverArm::zeros(), &map, &seen);
            let mut chosen: Vec<_> = joint.landmark_of_seen().iter().flatten().copied().collect();
            assert_eq!(chosen.len(), pairing.pairs);
            assert!(pairing.distance_squared <= quantile(0.99, pairing.pairs as u32));
            chosen.sort_unstable();
            chosen.dedup();
            assert_eq!(chosen.len(), pairing.pairs);
            assert_eq!(pairing.pairs, map.len());
        }
    }

    #[test]
    fn a_single_edge_is_paired_with_the_nearest_landmark() {
        let map = landmarks();
        let belief = Belief::new(Pose2::IDENTITY, 0.1, 0.2);
        let seen = seen_from(&map[1..2], &Pose2::new(0.0, 0.0, 0.05));
        let mut joint = JointCompatibility::new(JointRule::default(), 20);
        assert_eq!(joint.pair(&belief, LeverArm::zeros(), &map, &seen).pairs, 1);
        let h = |i: usize| predict(&map[i], &belief.pose, LeverArm::zeros());
        let distance = |i: usize| {
            let off = angle_difference(seen[0].azimuth_rad, h(i).azimuth_rad);
            off * off / ((h(i).jacobian * belief.covariance * h(i).jacobian.transpose()).x + 1e-4)
        };
        let nearest = (0..map.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        assert_eq!(joint.landmark_of_seen(), [nearest]);
        assert!(joint.candidates_of(0).count() >= 2);
    }

    #[test]
    fn a_truncated_search_is_reported() {
        let map = landmarks();
        let belief = Belief::new(Pose2::IDENTITY, 0.3, 0.3);
        let seen = seen_from(&map, &Pose2::IDENTITY);
        let rule = JointRule { max_nodes: 3, ..JointRule::default() };
        let pairing = JointCompatibility::new(rule, 20).pair(&belief, LeverArm::zeros(), &map, &seen);
        assert!(!pairing.is_complete);
    }
}
