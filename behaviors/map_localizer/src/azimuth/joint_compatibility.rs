use nalgebra::{Matrix3, RowVector3, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference, wrap_angle};

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing, may_match, predict_from};
use super::chi_square::quantile;
use crate::belief::Belief;

/// What may be paired.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRule {
    /// Share of the right pairs that the gates let pass, 0 to 1.
    pub probability: f64,
    /// Largest squared Mahalanobis distance of a pair under the pose that the pairs before it tell. Without a bound one
    /// wrong pair hides among many right ones.
    pub conditional_gate: f64,
    /// Most steps of the search; the best set found until then counts.
    pub max_nodes: u32,
}

impl Default for JointRule {
    fn default() -> Self {
        Self { probability: 0.99, conditional_gate: 10.83, max_nodes: 20_000 }
    }
}

/// What was paired.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pairing {
    /// How many pairs.
    pub pairs: usize,
    /// Their joint squared Mahalanobis distance, one degree of freedom a pair.
    pub distance_squared: f64,
    /// Whether all sets were looked at that could be better.
    pub is_complete: bool,
}

/// Pairs edges seen with edges of the map: the largest set that is jointly compatible with the belief, of several such the
/// one with the smallest distance (Neira & Tardos, 2001). Where the search is cut short, the best set until then counts. Keeps its
/// buffers.
///
/// Each edge seen is a scalar measurement of the same pose, so that the joint distance grows pair by pair by the innovation of
/// a Kalman filter: a step of the search costs the same however deep it is.
#[derive(Clone, Debug)]
pub struct JointCompatibility {
    rule: JointRule,
    gates: Vec<f64>,
    candidates: Vec<Candidate>,
    /// Candidates of each edge seen, as a range.
    ranges: Vec<[usize; 2]>,
    /// In which order edges are paired: fewest candidates first, or as they came.
    order: Vec<usize>,
    is_used: Vec<bool>,
    chosen: Vec<Option<usize>>,
    best: Vec<Option<usize>>,
    best_shift: Vector3<f64>,
    frames: Vec<Frame>,
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
struct Candidate {
    landmark: usize,
    innovation: f64,
    jacobian: RowVector3<f64>,
    /// Of the azimuth seen and of the landmark.
    noise: f64,
    /// Under the pose that the pairs chosen before tell.
    distance_squared: f64,
}

/// The pose after the pairs chosen so far, as a shift of the belief.
#[derive(Clone, Copy, Debug)]
struct Frame {
    shift: Vector3<f64>,
    covariance: Matrix3<f64>,
    pairs: usize,
    distance_squared: f64,
    /// The next candidate to be tried.
    next: usize,
}

impl JointCompatibility {
    /// For at most so many edges seen.
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
            frames: Vec::new(),
            predictions: Vec::new(),
        }
    }

    /// Pairs, and tells how well; [`JointCompatibility::landmark_of_seen`] tells what. Edges seen beyond the number that was
    /// allowed for are left alone, as are all where the belief is no number.
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
        if !belief.is_sound() {
            return Pairing { pairs: 0, distance_squared: 0.0, is_complete: true };
        }
        let count = seen.len().min(self.gates.len() - 1);
        self.gather(belief, lever, landmarks, &seen[..count]);
        self.search(belief, landmarks.len())
    }

    /// The number of the landmark of each edge seen, or `None`.
    #[must_use]
    pub fn landmark_of_seen(&self) -> &[Option<usize>] {
        &self.best
    }

    /// The belief's pose as the pairs correct it, to first order: where to begin with the most likely one.
    #[must_use]
    pub fn corrected(&self, pose: &Pose2) -> Pose2 {
        let by = self.best_shift;
        Pose2 { x: pose.x + by.x, y: pose.y + by.y, theta: wrap_angle(pose.theta + by.z) }
    }

    /// The numbers of the landmarks that each edge seen may be on its own, in no order.
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
                    self.candidates.push(Candidate {
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
            // What is beyond doubt first: it narrows down the rest.
            self.order.sort_by_key(|edge| ranges[*edge][1] - ranges[*edge][0]);
        }
    }

    fn search(&mut self, belief: &Belief, landmarks: usize) -> Pairing {
        let depth = self.order.len();
        self.is_used.clear();
        self.is_used.resize(landmarks, false);
        self.chosen.clear();
        self.chosen.resize(depth, None);
        self.frames.clear();
        self.frames.push(Frame {
            shift: Vector3::zeros(),
            covariance: belief.covariance,
            pairs: 0,
            distance_squared: 0.0,
            next: 0,
        });
        let mut best = Pairing { pairs: 0, distance_squared: f64::INFINITY, is_complete: true };
        let mut nodes = 0;
        while let Some(place) = self.frames.len().checked_sub(1) {
            if nodes >= self.rule.max_nodes {
                best.is_complete = false;
                break;
            }
            nodes += 1;
            self.release(place);
            let frame = self.frames[place];
            if place == depth {
                if is_better(&frame, frame.pairs, &best) {
                    (best.pairs, best.distance_squared) = (frame.pairs, frame.distance_squared);
                    self.best_shift = frame.shift;
                    self.keep_best();
                }
                self.frames.pop();
                continue;
            }
            if !is_better(&frame, frame.pairs + depth - place, &best) {
                self.frames.pop();
                continue;
            }
            self.advance(place);
        }
        if best.pairs == 0 {
            best.distance_squared = 0.0;
        }
        best
    }

    /// Takes back the pair that this place tried before.
    fn release(&mut self, place: usize) {
        if let Some(choice) = self.chosen.get_mut(place).and_then(Option::take) {
            self.is_used[self.candidates[choice].landmark] = false;
        }
    }

    /// Tries the next candidate of this place, and at last none.
    fn advance(&mut self, place: usize) {
        let [start, end] = self.ranges[self.order[place]];
        let frame = self.frames[place];
        if frame.next == 0 {
            // The nearest one first: a good set found early cuts short the search for better ones.
            let candidates = &mut self.candidates[start..end];
            for candidate in &mut *candidates {
                candidate.distance_squared = frame.distance_squared_of(candidate);
            }
            candidates.sort_unstable_by(|a, b| {
                a.distance_squared.total_cmp(&b.distance_squared).then(a.landmark.cmp(&b.landmark))
            });
        }
        let most = self.gates[frame.pairs + 1] - frame.distance_squared;
        for index in start + frame.next..end {
            let candidate = &self.candidates[index];
            let is_compatible = candidate.distance_squared <= most.min(self.rule.conditional_gate);
            if !is_compatible {
                break;
            }
            if !self.is_used[candidate.landmark] {
                self.is_used[candidate.landmark] = true;
                self.chosen[place] = Some(index);
                self.frames[place].next = index + 1 - start;
                self.frames.push(frame.with(candidate));
                return;
            }
        }
        let count = end - start;
        if frame.next <= count {
            self.frames[place].next = count + 1;
            self.frames.push(Frame { next: 0, ..frame });
        } else {
            self.frames.pop();
        }
    }

    fn keep_best(&mut self) {
        self.best.fill(None);
        for (edge, choice) in self.order.iter().zip(&self.chosen) {
            self.best[*edge] = choice.map(|index| self.candidates[index].landmark);
        }
    }
}

/// Whether a set that could reach so many pairs would beat the best one.
fn is_better(frame: &Frame, reach: usize, best: &Pairing) -> bool {
    reach > best.pairs || reach == best.pairs && frame.distance_squared < best.distance_squared
}

impl Frame {
    /// Squared distance of one more pair under the pose so far.
    #[inline]
    fn distance_squared_of(&self, candidate: &Candidate) -> f64 {
        let h = &candidate.jacobian;
        let innovation = candidate.innovation - (h * self.shift).x;
        innovation * innovation / ((h * self.covariance * h.transpose()).x + candidate.noise)
    }

    /// With one more pair.
    #[inline]
    fn with(&self, candidate: &Candidate) -> Self {
        let h = &candidate.jacobian;
        let spread = self.covariance * h.transpose();
        let innovation = candidate.innovation - (h * self.shift).x;
        let variance = (h * spread).x + candidate.noise;
        let gain = spread / variance;
        Self {
            shift: self.shift + gain * innovation,
            covariance: self.covariance - gain * spread.transpose(),
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
        let see = |edge: &EdgeLandmark| SeenBearing {
            azimuth_rad: predict(edge, pose, LeverArm::zeros()).azimuth_rad,
            sign: None,
            sigma_rad: 0.01,
        };
        landmarks.iter().map(see).collect()
    }

    fn landmarks() -> Vec<EdgeLandmark> {
        [(2.0, 0.1), (2.1, 0.5), (0.3, 2.0), (-1.8, 0.4), (-0.2, -2.2), (1.5, -1.4), (1.4, -1.6)]
            .map(|(x, y)| EdgeLandmark { position: Point2::new(x, y), sign: None, sigma_m: 0.0 })
            .to_vec()
    }

    #[test]
    fn no_landmark_is_paired_twice_and_the_set_passes_its_gate() {
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
    fn one_edge_goes_to_the_nearest() {
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
    fn a_search_that_is_cut_short_says_so() {
        let map = landmarks();
        let belief = Belief::new(Pose2::IDENTITY, 0.3, 0.3);
        let seen = seen_from(&map, &Pose2::IDENTITY);
        let rule = JointRule { max_nodes: 3, ..JointRule::default() };
        let pairing = JointCompatibility::new(rule, 20).pair(&belief, LeverArm::zeros(), &map, &seen);
        assert!(!pairing.is_complete);
    }
}
