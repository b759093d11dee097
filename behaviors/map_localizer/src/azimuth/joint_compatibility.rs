use nalgebra::{Matrix3, RowVector3, Vector3};
use yamabico_core::geometry::angle_difference;

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
    pub most_nodes: u32,
}

impl Default for JointRule {
    fn default() -> Self {
        Self { probability: 0.99, conditional_gate: 10.83, most_nodes: 20_000 }
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
    pub fn new(rule: JointRule, most_seen: u32) -> Self {
        let gates = (0..=most_seen).map(|n| if n == 0 { 0.0 } else { quantile(rule.probability, n) });
        Self {
            rule,
            gates: gates.collect(),
            candidates: Vec::new(),
            ranges: Vec::new(),
            order: Vec::new(),
            is_used: Vec::new(),
            chosen: Vec::new(),
            best: Vec::new(),
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
                let distance_squared = innovation * innovation / (prediction.variance + own);
                if distance_squared <= gate && may_match(landmarks[number].sign, edge.sign) {
                    self.candidates.push(Candidate {
                        landmark: number,
                        innovation,
                        jacobian: prediction.jacobian,
                        noise: own + prediction.landmark_variance,
                        distance_squared,
                    });
                }
            }
            let range = &mut self.candidates[start..];
            range.sort_unstable_by(|a, b| {
                a.distance_squared.total_cmp(&b.distance_squared).then(a.landmark.cmp(&b.landmark))
            });
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
            if nodes >= self.rule.most_nodes {
                best.is_complete = false;
                break;
            }
            nodes += 1;
            self.release(place);
            let frame = self.frames[place];
            if place == depth {
                if is_better(&frame, frame.pairs, &best) {
                    (best.pairs, best.distance_squared) = (frame.pairs, frame.distance_squared);
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
        for index in start + frame.next..end {
            let candidate = &self.candidates[index];
            if self.is_used[candidate.landmark] {
                continue;
            }
            if let Some(next) = frame.with(candidate, &self.gates, self.rule.conditional_gate) {
                self.is_used[candidate.landmark] = true;
                self.chosen[place] = Some(index);
                self.frames[place].next = index + 1 - start;
                self.frames.push(next);
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
    /// With one more pair; `None` where that is not compatible.
    #[inline]
    fn with(&self, candidate: &Candidate, gates: &[f64], conditional_gate: f64) -> Option<Self> {
        let h = &candidate.jacobian;
        let spread = self.covariance * h.transpose();
        let innovation = candidate.innovation - (h * self.shift).x;
        let variance = (h * spread).x + candidate.noise;
        let own = innovation * innovation / variance;
        let distance_squared = self.distance_squared + own;
        if !(own <= conditional_gate && distance_squared <= gates[self.pairs + 1]) {
            return None;
        }
        let gain = spread / variance;
        Some(Self {
            shift: self.shift + gain * innovation,
            covariance: self.covariance - gain * spread.transpose(),
            pairs: self.pairs + 1,
            distance_squared,
            next: 0,
        })
    }
}
