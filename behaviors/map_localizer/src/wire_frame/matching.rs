//! Matching of image segments with expected edges that are close in the image and in Hough space.

use nalgebra::{Matrix2, Matrix3, Vector2};
use yamabico_vision::map::{Edge, ExpectedEdge, WireFrame};
use yamabico_vision::segments::Segment;

use super::association::{Association, AssociationRule, Candidate};
use super::consensus::{WeightedResidual, find_consensus};
use super::projected_line::{LineCamera, ProjectedLine};
use crate::belief::{Belief, gate_distance};

/// Gates for a segment to be a candidate of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gates {
    /// Lower and upper bound of the gate on the difference in direction, rad.
    pub angle_rad: [f64; 2],
    /// Lower and upper bound of the gate on the distance of the segment's midpoint from the line, px.
    pub offset_px: [f64; 2],
    /// Minimum fraction of the segment that overlaps the edge.
    pub overlap: f64,
    /// Width of the gates between their bounds, in standard deviations.
    pub sigmas: f64,
    /// Limits of the association.
    pub association: AssociationRule,
}

impl Default for Gates {
    fn default() -> Self {
        Self {
            angle_rad: [3_f64.to_radians(), 15_f64.to_radians()],
            offset_px: [4.0, 60.0],
            overlap: 0.3,
            sigmas: 3.0,
            association: AssociationRule::default(),
        }
    }
}

/// Noise model of the ends of a segment, measured as distances from an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineNoise {
    /// Standard deviation of an end across the line, px.
    pub sigma_px: f64,
    /// Standard deviation of the edge on the map, m.
    pub map_sigma_m: f64,
    /// Factor on the variance in gates and updates, adapted to the consistency of earlier measurements.
    pub scale: f64,
    /// Additional factor on the variance in updates only, >= 1: errors of images taken close to each other are
    /// correlated.
    pub correlation: f64,
}

impl LineNoise {
    /// Returns the covariance of the distances of both ends from an edge at this depth (m), px².
    #[must_use]
    pub fn covariance(&self, focal_px: f64, depth_m: f64) -> Matrix2<f64> {
        let map_sigma_px = focal_px * self.map_sigma_m / depth_m;
        let variance = self.scale * (self.sigma_px.powi(2) + map_sigma_px.powi(2));
        Matrix2::new(variance, 0.0, 0.0, variance)
    }
}

/// Pair of an expected edge and a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index of the expected edge.
    pub expected: usize,
    /// Index of the segment.
    pub segment: usize,
    /// Squared Mahalanobis distance at the prior.
    pub distance_squared: f64,
}

/// Matcher of segments with expected edges. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Matcher {
    candidates: Vec<Candidate>,
    measurements: Vec<WeightedResidual>,
    association: Association,
    matches: Vec<Match>,
    edges_with_candidates: usize,
}

/// Input of the matcher: map, image and camera.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Map.
    pub map: &'a WireFrame,
    /// Edges of the map that are expected in view.
    pub expected: &'a [ExpectedEdge],
    /// Segments of the image, undistorted.
    pub segments: &'a [Segment],
    /// Camera on the robot.
    pub camera: &'a LineCamera,
    /// Focal length, px.
    pub focal_px: f64,
}

impl Scene<'_> {
    /// Returns the map edge of an expected edge.
    #[must_use]
    pub fn edge(&self, expected: &ExpectedEdge) -> Option<&Edge> {
        self.map.edges().get(expected.edge)
    }
}

impl Matcher {
    /// Pairs expected edges and segments one to one, by ascending distance.
    ///
    /// Differs from nearest neighbors at the prior: distances are evaluated at the consensus of the candidates, so that
    /// a wrong pair does not attract the others.
    pub fn pair(&mut self, scene: &Scene<'_>, belief: &Belief, noise: &LineNoise, gates: &Gates) -> &[Match] {
        self.gather(scene, belief, noise, gates);
        if let Some(consensus) = find_consensus(&belief.covariance, &self.measurements) {
            for (candidate, measurement) in self.candidates.iter_mut().zip(&self.measurements) {
                let mut residual = measurement.residual;
                residual.distance_px += residual.jacobian * consensus.shift;
                let noise = Matrix2::from_diagonal_element(measurement.variance);
                candidate.distance_squared = gate_distance(&residual, &consensus.covariance, &noise);
            }
        }
        let pairs = self.association.pair(&self.candidates, &gates.association);
        self.matches.clear();
        self.matches.extend(pairs.iter().map(|pair| Match {
            expected: pair.edge,
            segment: pair.line,
            distance_squared: pair.distance_squared,
        }));
        &self.matches
    }

    /// Collects all segments within the gates of each edge as candidates.
    fn gather(&mut self, scene: &Scene<'_>, belief: &Belief, noise: &LineNoise, gates: &Gates) {
        self.candidates.clear();
        self.measurements.clear();
        self.edges_with_candidates = 0;
        let view = scene.camera.at(&belief.pose);
        for (number, expected) in scene.expected.iter().enumerate() {
            let Some(line) = scene.edge(expected).and_then(|edge| view.project(edge)) else { continue };
            let noise = noise.covariance(scene.focal_px, expected.depth_m);
            let begin = self.candidates.len();
            let strip = Strip::new(expected, &line, &belief.covariance, gates);
            for (segment_number, segment) in scene.segments.iter().enumerate() {
                if !strip.contains(segment, &belief.covariance, gates) {
                    continue;
                }
                self.candidates.push(Candidate {
                    edge: number,
                    line: segment_number,
                    distance_squared: f64::INFINITY,
                });
            }
            self.edges_with_candidates += usize::from(self.candidates.len() > begin);
            keep_longest_of_each_line(&mut self.candidates, begin, scene.segments);
            self.measurements.extend(self.candidates[begin..].iter().map(|candidate| {
                let segment = &scene.segments[candidate.line];
                WeightedResidual { residual: line.residual([segment.p0, segment.p1]), variance: noise.m11 }
            }));
        }
    }

    /// Returns the pairs of the last call of [`Matcher::pair`].
    #[must_use]
    pub fn matches(&self) -> &[Match] {
        &self.matches
    }

    /// Returns the number of edges that had at least one candidate in the last call of [`Matcher::pair`].
    #[must_use]
    pub fn edges_with_candidates(&self) -> usize {
        self.edges_with_candidates
    }
}

/// Neighborhood of an expected edge in the image.
struct Strip<'a> {
    line: &'a ProjectedLine,
    direction: Vector2<f64>,
    from: Vector2<f64>,
    length: f64,
    max_sine: f64,
    overlap: f64,
}

impl<'a> Strip<'a> {
    fn new(
        expected: &ExpectedEdge,
        line: &'a ProjectedLine,
        covariance: &Matrix3<f64>,
        gates: &Gates,
    ) -> Self {
        let slope = line.alpha_jacobian();
        let sigma_angle = slope.dot(&(covariance * slope)).max(0.0).sqrt();
        let [min, max] = gates.angle_rad;
        let run = expected.to - expected.from;
        let length = run.norm();
        Self {
            line,
            direction: run / length,
            from: expected.from,
            length,
            max_sine: (gates.sigmas * sigma_angle).max(min).min(max).sin(),
            overlap: gates.overlap,
        }
    }

    fn contains(&self, segment: &Segment, covariance: &Matrix3<f64>, gates: &Gates) -> bool {
        if self.line.normal().perp(&segment.normal).abs() > self.max_sine {
            return false;
        }
        let middle = segment.midpoint();
        let coefficients = &self.line.coefficients;
        let offset_px = (coefficients.dot(&middle.push(1.0))).abs();
        let [min, max] = gates.offset_px;
        if offset_px > max {
            return false;
        }
        let along = |p: Vector2<f64>| self.direction.dot(&(p - self.from));
        let (s0, s1) = (along(segment.p0), along(segment.p1));
        let overlap = s0.max(s1).min(self.length) - s0.min(s1).max(0.0);
        if overlap < self.overlap * segment.length {
            return false;
        }
        if offset_px <= min {
            return true;
        }
        let (_, slope) = self.line.distance(middle);
        offset_px <= gates.sigmas * slope.dot(&(covariance * slope)).max(0.0).sqrt()
    }
}

/// Keeps the longest of the collinear candidates of one edge, from `begin` on: fragments of one line do not make each
/// other ambiguous.
fn keep_longest_of_each_line(candidates: &mut Vec<Candidate>, begin: usize, segments: &[Segment]) {
    const SAME_LINE_PX: f64 = 1.5;
    const SAME_DIRECTION: f64 = 0.035;
    let is_fragment = |short: &Segment, long: &Segment| {
        short.normal.perp(&long.normal).abs() < SAME_DIRECTION
            && long.distance(short.midpoint()).abs() < SAME_LINE_PX
    };
    candidates[begin..].sort_unstable_by(|a, b| {
        segments[b.line].length.total_cmp(&segments[a.line].length).then(a.line.cmp(&b.line))
    });
    let mut kept = begin;
    for i in begin..candidates.len() {
        let candidate = candidates[i];
        let segment = &segments[candidate.line];
        if !candidates[begin..kept].iter().any(|other| is_fragment(segment, &segments[other.line])) {
            candidates[kept] = candidate;
            kept += 1;
        }
    }
    candidates.truncate(kept);
}
