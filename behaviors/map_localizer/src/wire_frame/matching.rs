//! Which segments of a picture may be which edges of the map: near in the picture and in Hough's space.

use nalgebra::{Matrix2, Matrix3, Vector2};
use yamabico_vision::map::{Edge, ExpectedEdge, WireFrame};
use yamabico_vision::segments::Segment;

use super::association::{Association, AssociationRule, Candidate};
use super::consensus::{Witness, agree};
use super::projected_line::{LineCamera, ProjectedLine};
use crate::belief::{Belief, gate_distance};

/// How near a segment must be to an edge's image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gates {
    /// Difference of direction that is always allowed, rad, and the most that doubt of the pose adds up to.
    pub angle_rad: [f64; 2],
    /// Distance of the segment's middle from the line that is always allowed, pixels, and the most.
    pub offset_px: [f64; 2],
    /// Least share of the segment that lies along the edge.
    pub overlap: f64,
    /// In standard deviations, where that is more than what is always allowed.
    pub sigmas: f64,
    /// The pairing.
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

/// How uncertain a segment's ends are, as measurements of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineNoise {
    /// Of an end across the line, pixels.
    pub sigma_px: f64,
    /// Of the edge's place on the map, meters.
    pub map_sigma_m: f64,
    /// Factor on the variance, from how well earlier measurements agreed.
    pub scale: f64,
    /// Factor on the variance where a measurement moves the belief, >= 1: pictures from nearly one place err alike.
    pub repetition: f64,
}

impl LineNoise {
    /// The covariance of both ends' distances for an edge at this depth (m), pixels squared.
    #[must_use]
    pub fn of(&self, focal_px: f64, depth_m: f64) -> Matrix2<f64> {
        let of_map = focal_px * self.map_sigma_m / depth_m;
        let variance = self.scale * (self.sigma_px.powi(2) + of_map.powi(2));
        Matrix2::new(variance, 0.0, 0.0, variance)
    }
}

/// A segment that belongs to an expected edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Number among the expected edges.
    pub expected: usize,
    /// Number among the segments.
    pub segment: usize,
    /// Squared Mahalanobis distance at the prior.
    pub distance_squared: f64,
}

/// Matches; keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct Matcher {
    candidates: Vec<Candidate>,
    witnesses: Vec<Witness>,
    association: Association,
    matches: Vec<Match>,
    near: usize,
}

/// What is matched.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The map.
    pub map: &'a WireFrame,
    /// What of it should be in view.
    pub expected: &'a [ExpectedEdge],
    /// What is seen, undistorted.
    pub segments: &'a [Segment],
    /// The camera.
    pub camera: &'a LineCamera,
    /// Focal length, pixels.
    pub focal_px: f64,
}

impl Scene<'_> {
    /// The edge behind an expected one.
    #[must_use]
    pub fn edge(&self, expected: &ExpectedEdge) -> Option<&Edge> {
        self.map.edges().get(expected.edge)
    }
}

impl Matcher {
    /// Pairs expected edges and segments one to one, by ascending distance.
    ///
    /// Differs from the plain nearest neighbors of the prior: distances are those from the pose that most of the candidates
    /// agree on, so that a wrong pair does not draw the others after it.
    pub fn pair(&mut self, scene: &Scene<'_>, belief: &Belief, noise: &LineNoise, gates: &Gates) -> &[Match] {
        self.gather(scene, belief, noise, gates);
        if let Some(agreement) = agree(&belief.covariance, &self.witnesses) {
            for (candidate, witness) in self.candidates.iter_mut().zip(&self.witnesses) {
                let mut residual = witness.residual;
                residual.distance_px += residual.jacobian * agreement.shift;
                let noise = Matrix2::from_diagonal_element(witness.variance);
                candidate.distance_squared = gate_distance(&residual, &agreement.covariance, &noise);
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

    /// Every segment in the strip of an edge is a candidate.
    fn gather(&mut self, scene: &Scene<'_>, belief: &Belief, noise: &LineNoise, gates: &Gates) {
        self.candidates.clear();
        self.witnesses.clear();
        self.near = 0;
        let view = scene.camera.at(&belief.pose);
        for (number, expected) in scene.expected.iter().enumerate() {
            let Some(line) = scene.edge(expected).and_then(|edge| view.project(edge)) else { continue };
            let noise = noise.of(scene.focal_px, expected.depth_m);
            let begin = self.candidates.len();
            let strip = Strip::new(expected, &line, &belief.covariance, gates);
            for (segment_number, segment) in scene.segments.iter().enumerate() {
                if !strip.holds(segment, &belief.covariance, gates) {
                    continue;
                }
                self.candidates.push(Candidate {
                    edge: number,
                    line: segment_number,
                    distance_squared: f64::INFINITY,
                });
            }
            self.near += usize::from(self.candidates.len() > begin);
            keep_longest_of_each_line(&mut self.candidates, begin, scene.segments);
            self.witnesses.extend(self.candidates[begin..].iter().map(|candidate| {
                let segment = &scene.segments[candidate.line];
                Witness { residual: line.residual([segment.p0, segment.p1]), variance: noise.m11 }
            }));
        }
    }

    /// The last pairs.
    #[must_use]
    pub fn matches(&self) -> &[Match] {
        &self.matches
    }

    /// Edges that had a segment near them in the last call, within the gate or not.
    #[must_use]
    pub fn edges_with_segments_near(&self) -> usize {
        self.near
    }
}

/// The neighborhood of an expected edge in the picture.
struct Strip<'a> {
    line: &'a ProjectedLine,
    direction: Vector2<f64>,
    from: Vector2<f64>,
    length: f64,
    largest_sine: f64,
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
        let [least, most] = gates.angle_rad;
        let run = expected.to - expected.from;
        let length = run.norm();
        Self {
            line,
            direction: run / length,
            from: expected.from,
            length,
            largest_sine: (gates.sigmas * sigma_angle).max(least).min(most).sin(),
            overlap: gates.overlap,
        }
    }

    fn holds(&self, segment: &Segment, covariance: &Matrix3<f64>, gates: &Gates) -> bool {
        if self.line.normal().perp(&segment.normal).abs() > self.largest_sine {
            return false;
        }
        let middle = segment.midpoint();
        let coefficients = &self.line.coefficients;
        let offset_px = (coefficients.dot(&middle.push(1.0))).abs();
        let [least, most] = gates.offset_px;
        if offset_px > most {
            return false;
        }
        let place = |p: Vector2<f64>| self.direction.dot(&(p - self.from));
        let (s0, s1) = (place(segment.p0), place(segment.p1));
        let overlap = s0.max(s1).min(self.length) - s0.min(s1).max(0.0);
        if overlap < self.overlap * segment.length {
            return false;
        }
        if offset_px <= least {
            return true;
        }
        let (_, slope) = self.line.distance(middle);
        offset_px <= gates.sigmas * slope.dot(&(covariance * slope)).max(0.0).sqrt()
    }
}

/// Of the candidates of one edge from `begin` on, keeps the longest of those that lie on one image line: pieces of one line
/// are no rivals.
fn keep_longest_of_each_line(candidates: &mut Vec<Candidate>, begin: usize, segments: &[Segment]) {
    const SAME_LINE_PX: f64 = 1.5;
    const SAME_DIRECTION: f64 = 0.035;
    let is_piece = |short: &Segment, long: &Segment| {
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
        if !candidates[begin..kept].iter().any(|other| is_piece(segment, &segments[other.line])) {
            candidates[kept] = candidate;
            kept += 1;
        }
    }
    candidates.truncate(kept);
}
