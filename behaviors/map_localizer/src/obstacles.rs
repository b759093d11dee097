//! What stands in the way that the map does not tell of: edges that are seen from several places and are not the map's.
//!
//! Yagi, Nishizawa & Yachida (1995), section VI: edges without a partner on the map are followed and located; those that stay
//! where they are make obstacles, which a new path leads around. Differs from \[1\]: what the robot drives straight at has no
//! parallax, and is placed where its foot is seen on the floor.

use nalgebra::{Matrix2, Point2, Vector2};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Obstacle;
use yamabico_vision::azimuth_map::{
    EdgeMap, Inflation, LocatedEdge, LocusRule, LocusTracker, MapEdge, ObstacleClusters, SeenEdge, explains,
    inflate,
};

/// An edge is believed once it was seen in more pictures than this ...
const MIN_SEEN: u32 = 15;
/// ... and is located as well as this, meters.
const MAX_SIGMA_M: f64 = 0.10;
/// An edge of the map nearer than this (m) to it explains it.
const SAME_EDGE_M: f64 = 0.15;
/// Edges nearer to each other than this (m) belong to one obstacle.
const LINK_M: f64 = 0.35;
/// Standard deviation of the azimuth of an edge that is followed, rad: of the picture and of the pose.
const AZIMUTH_SIGMA_RAD: f64 = 0.005;
/// A foot is believed only as near as this to where it is, meters.
const MAX_FOOT_SIGMA_M: f64 = 0.15;
/// Most edges that are told.
pub const MAX_EDGES: usize = 32;

/// An edge that is not the map's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownEdge {
    /// On the map, meters.
    pub position: Point2<f64>,
    /// Of the position, square meters.
    pub covariance: Matrix2<f64>,
    /// Pictures that it was seen in.
    pub seen: u32,
}

/// Where an edge stands on the floor, from one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// From the camera's axis, meters.
    pub distance_m: f64,
    /// Its standard deviation, meters.
    pub sigma_m: f64,
}

/// The foot that an edge was last seen with.
#[derive(Clone, Copy, Debug)]
struct Standing {
    locus: u32,
    position: Point2<f64>,
    covariance: Matrix2<f64>,
}

/// Follows the edges that the map does not explain. Keeps its buffers.
#[derive(Clone, Debug)]
pub struct UnknownEdges {
    map: Vec<LocatedEdge>,
    tracker: LocusTracker,
    standing: Vec<Standing>,
    edges: Vec<UnknownEdge>,
}

impl UnknownEdges {
    /// With the map that explains edges.
    #[must_use]
    pub fn new(map: &EdgeMap) -> Self {
        let rule = LocusRule { sigma_rad: AZIMUTH_SIGMA_RAD, ..LocusRule::default() };
        Self {
            map: map.edges.iter().map(MapEdge::located).collect(),
            tracker: LocusTracker::new(rule),
            standing: Vec::new(),
            edges: Vec::with_capacity(MAX_EDGES),
        }
    }

    /// Takes what a picture shows beside the map, seen from this pose of the camera on the map, and the feet of these edges
    /// where they are seen.
    pub fn take(&mut self, seen: &[SeenEdge], feet: &[Option<Foot>], camera: &Pose2) {
        self.tracker.take(seen, camera);
        let loci = self.tracker.loci();
        self.standing.retain(|standing| loci.iter().any(|locus| locus.number == standing.locus));
        for ((edge, foot), place) in seen.iter().zip(feet).zip(self.tracker.locus_of_seen()) {
            let good = foot.as_ref().filter(|foot| foot.sigma_m <= MAX_FOOT_SIGMA_M);
            if let (Some(foot), Some(place)) = (good, place) {
                let standing = standing(loci[*place].number, foot, camera, camera.theta + edge.azimuth_rad);
                match self.standing.iter_mut().find(|known| known.locus == standing.locus) {
                    Some(known) => *known = standing,
                    None => self.standing.push(standing),
                }
            }
        }
        self.edges.clear();
        for locus in loci.iter().filter(|locus| locus.seen > MIN_SEEN) {
            let crossing = locus.located().filter(|edge| sigma_m(&edge.covariance) <= MAX_SIGMA_M);
            let foot = || {
                let standing = self.standing.iter().find(|known| known.locus == locus.number)?;
                let (position, covariance) = (standing.position, standing.covariance);
                Some(LocatedEdge { position, covariance, sign: Some(locus.sign) })
            };
            let Some(located) = crossing.or_else(foot) else { continue };
            if self.edges.len() < MAX_EDGES && !explains(&self.map, &located, SAME_EDGE_M) {
                let (position, covariance) = (located.position, located.covariance);
                self.edges.push(UnknownEdge { position, covariance, seen: locus.seen });
            }
        }
    }

    /// Those that stand where they are known to.
    #[must_use]
    pub fn edges(&self) -> &[UnknownEdge] {
        &self.edges
    }

    /// All that are followed.
    #[must_use]
    pub fn tracker(&self) -> &LocusTracker {
        &self.tracker
    }
}

impl UnknownEdge {
    /// The larger standard deviation of the position, meters.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        sigma_m(&self.covariance)
    }
}

fn sigma_m(covariance: &Matrix2<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

fn standing(locus: u32, foot: &Foot, camera: &Pose2, bearing_rad: f64) -> Standing {
    let along = Vector2::new(bearing_rad.cos(), bearing_rad.sin());
    let across = Vector2::new(-along.y, along.x) * (foot.distance_m * AZIMUTH_SIGMA_RAD);
    let along_sigma = along * foot.sigma_m;
    Standing {
        locus,
        position: camera.position() + along * foot.distance_m,
        covariance: along_sigma * along_sigma.transpose() + across * across.transpose(),
    }
}

/// Groups edges into obstacles. Keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    clusters: ObstacleClusters,
    places: Vec<Point2<f64>>,
    labels: Vec<usize>,
    told: Vec<Obstacle>,
    corners: Vec<Point2<f64>>,
}

impl Obstacles {
    /// Takes the edges that are known.
    pub fn take(&mut self, edges: &[UnknownEdge]) {
        self.places.clear();
        self.places.extend(edges.iter().map(|edge| edge.position));
        self.labels.clear();
        self.labels.extend_from_slice(self.clusters.label(&self.places, LINK_M, |_, _| false));
        self.told.clear();
        for (i, edge) in edges.iter().enumerate() {
            let others = (0..edges.len()).filter(|&j| self.labels[j] == self.labels[i]);
            let reach = others.map(|j| (self.places[j] - self.places[i]).norm()).fold(0.0, f64::max);
            let covariance = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|at| edge.covariance[at]);
            self.told.push(Obstacle {
                x: edge.position.x,
                y: edge.position.y,
                radius_m: 0.5 * reach,
                covariance,
                confidence: 1.0 - f64::from(MIN_SEEN) / f64::from(edge.seen.max(MIN_SEEN)),
            });
        }
    }

    /// One for each edge, which reaches half way to the farthest one of the same obstacle.
    #[must_use]
    pub fn told(&self) -> &[Obstacle] {
        &self.told
    }

    /// Their hulls, so much larger that the center of a robot of this radius (m) may go anywhere outside of them. Call after
    /// [`Obstacles::take`] with the same edges.
    pub fn grow(&mut self, edges: &[UnknownEdge], robot_radius_m: f64, grown: &mut Vec<Vec<Point2<f64>>>) {
        let mut count = 0;
        for first in 0..self.labels.len() {
            if self.labels[first] != first {
                continue;
            }
            let of_group = || (first..edges.len()).filter(|&i| self.labels[i] == first);
            let sigma_m = of_group().map(|i| edges[i].sigma_m()).fold(0.0, f64::max);
            let inflation = Inflation::of_robot(robot_radius_m, sigma_m);
            if grown.len() == count {
                grown.push(Vec::new());
            }
            inflate(of_group().map(|i| self.places[i]), &inflation, &mut self.corners, &mut grown[count]);
            count += 1;
        }
        grown.truncate(count);
    }
}
