//! Obstacles that are not on the map, located from vertical edges seen from several positions.
//!
//! Yagi, Nishizawa & Yachida (1995) \[1\], section VI: edges that match none of the map's are tracked and located;
//! those that are stationary form obstacles, which a new path leads around. Differs from \[1\]: an edge straight ahead
//! of the robot has no parallax, so it is located at its foot on the floor.

use nalgebra::{Matrix2, Point2, Rotation2, Vector2};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Obstacle;
use yamabico_vision::azimuth_map::{
    EdgeMap, Inflation, LocatedEdge, LocusRule, LocusTracker, MapEdge, ObservedEdge, ObstacleClusters,
    inflate, is_explained,
};

/// Number of images with an edge above which it can count as an obstacle.
const MIN_SEEN: u32 = 15;
/// Maximum standard deviation of an edge's position, m.
const MAX_SIGMA_M: f64 = 0.10;
/// Distance to an edge of the map below which the two are the same edge, m.
const SAME_EDGE_M: f64 = 0.15;
/// Distance between edges below which they belong to one obstacle, m.
const LINK_M: f64 = 0.35;
/// Standard deviation of the azimuth of a tracked edge from image and pose together, rad.
const AZIMUTH_SIGMA_RAD: f64 = 0.005;
/// Maximum standard deviation of a foot's distance, m.
const MAX_FOOT_SIGMA_M: f64 = 0.15;
/// Number of images without an edge after which it is forgotten: a minute at 5 Hz. A thing may have left while hidden.
const FORGOTTEN_AFTER: u32 = 300;
/// Maximum number of edges; the nearest ones count.
pub const MAX_EDGES: usize = 32;

/// Vertical edge that is not on the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownEdge {
    /// Position in the map frame, m.
    pub position: Point2<f64>,
    /// Covariance of the position, m².
    pub covariance: Matrix2<f64>,
    /// Number of images in which the edge was seen.
    pub seen: u32,
}

/// Foot of an edge on the floor, from one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Distance from the camera's axis, m.
    pub distance_m: f64,
    /// Standard deviation of the distance, m.
    pub sigma_m: f64,
}

/// Position of a tracked edge from its last visible foot.
#[derive(Clone, Copy, Debug)]
struct FootPosition {
    locus: u32,
    position: Point2<f64>,
    covariance: Matrix2<f64>,
}

/// Tracker of the edges that are not on the map. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct UnknownEdges {
    map: Vec<LocatedEdge>,
    tracker: LocusTracker,
    feet: Vec<FootPosition>,
    edges: Vec<UnknownEdge>,
}

impl UnknownEdges {
    /// Creates a tracker that ignores the edges of this map.
    #[must_use]
    pub fn new(map: &EdgeMap) -> Self {
        let rule = LocusRule {
            sigma_rad: AZIMUTH_SIGMA_RAD,
            forgotten_after: FORGOTTEN_AFTER,
            ..LocusRule::default()
        };
        Self {
            map: map.edges.iter().map(MapEdge::located).collect(),
            tracker: LocusTracker::new(rule),
            feet: Vec::new(),
            edges: Vec::with_capacity(rule.max_loci),
        }
    }

    /// Forgets all edges: they were located from wrong poses.
    pub fn clear(&mut self) {
        self.tracker.clear();
        self.feet.clear();
        self.edges.clear();
    }

    /// Tracks the unmatched edges of an image. `feet` contains the visible foot of each edge, `camera` is the pose of
    /// the camera in the map frame.
    pub fn track(&mut self, seen: &[ObservedEdge], feet: &[Option<Foot>], camera: &Pose2) {
        self.tracker.update(seen, camera);
        let loci = self.tracker.loci();
        self.feet.retain(|known| loci.iter().any(|locus| locus.number == known.locus));
        for ((edge, foot), index) in seen.iter().zip(feet).zip(self.tracker.locus_of_observed()) {
            let usable = foot.as_ref().filter(|foot| foot.sigma_m <= MAX_FOOT_SIGMA_M);
            if let (Some(foot), Some(index)) = (usable, index) {
                let located =
                    foot_position(loci[*index].number, foot, camera, camera.theta + edge.azimuth_rad);
                match self.feet.iter_mut().find(|known| known.locus == located.locus) {
                    Some(known) => *known = located,
                    None => self.feet.push(located),
                }
            }
        }
        self.edges.clear();
        for locus in loci.iter().filter(|locus| locus.seen > MIN_SEEN) {
            let crossing = locus.located().filter(|edge| sigma_m(&edge.covariance) <= MAX_SIGMA_M);
            let foot = || {
                let foot = self.feet.iter().find(|known| known.locus == locus.number)?;
                let (position, covariance) = (foot.position, foot.covariance);
                Some(LocatedEdge { position, covariance, sign: Some(locus.sign) })
            };
            let Some(located) = crossing.or_else(foot) else { continue };
            if !is_explained(&self.map, &located, SAME_EDGE_M) {
                let (position, covariance) = (located.position, located.covariance);
                self.edges.push(UnknownEdge { position, covariance, seen: locus.seen });
            }
        }
        if self.edges.len() > MAX_EDGES {
            let distance = |edge: &UnknownEdge| (edge.position - camera.position()).norm_squared();
            self.edges.sort_unstable_by(|a, b| distance(a).total_cmp(&distance(b)));
            self.edges.truncate(MAX_EDGES);
        }
    }

    /// Returns the edges that are located precisely enough.
    #[must_use]
    pub fn edges(&self) -> &[UnknownEdge] {
        &self.edges
    }
}

impl UnknownEdge {
    /// Returns the maximum standard deviation of the position over all directions, m.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        sigma_m(&self.covariance)
    }
}

fn sigma_m(covariance: &Matrix2<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

fn foot_position(locus: u32, foot: &Foot, camera: &Pose2, bearing_rad: f64) -> FootPosition {
    let along = Vector2::new(bearing_rad.cos(), bearing_rad.sin());
    let across = Vector2::new(-along.y, along.x) * (foot.distance_m * AZIMUTH_SIGMA_RAD);
    let along_sigma = along * foot.sigma_m;
    FootPosition {
        locus,
        position: camera.position() + along * foot.distance_m,
        covariance: along_sigma * along_sigma.transpose() + across * across.transpose(),
    }
}

/// Obstacles formed by groups of unknown edges. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    clusters: ObstacleClusters,
    positions: Vec<Point2<f64>>,
    labels: Vec<usize>,
    list: Vec<Obstacle>,
    corners: Vec<Point2<f64>>,
}

impl Obstacles {
    /// Groups the edges into obstacles, listed as seen by a robot at this pose in the map frame.
    pub fn group(&mut self, edges: &[UnknownEdge], robot: &Pose2) {
        let robot_from_map = robot.inverse();
        let turn = Rotation2::new(robot_from_map.theta).into_inner();
        self.positions.clear();
        self.positions.extend(edges.iter().map(|edge| edge.position));
        self.labels.clear();
        self.labels.extend_from_slice(self.clusters.label(&self.positions, LINK_M, |_, _| false));
        self.list.clear();
        for (i, edge) in edges.iter().enumerate() {
            let others = (0..edges.len()).filter(|&j| self.labels[j] == self.labels[i]);
            let reach = others.map(|j| (self.positions[j] - self.positions[i]).norm()).fold(0.0, f64::max);
            let position = robot_from_map.transform_point(edge.position);
            let covariance = turn * edge.covariance * turn.transpose();
            self.list.push(Obstacle {
                x: position.x,
                y: position.y,
                radius_m: 0.5 * reach,
                covariance: [(0, 0), (0, 1), (1, 0), (1, 1)].map(|at| covariance[at]),
                confidence: 1.0 - f64::from(MIN_SEEN) / f64::from(edge.seen.max(MIN_SEEN)),
            });
        }
    }

    /// Returns one circle per edge in the robot frame, with half the distance to the farthest edge of the same obstacle as
    /// its radius.
    #[must_use]
    pub fn list(&self) -> &[Obstacle] {
        &self.list
    }

    /// Writes the convex hulls of the obstacles, inflated by the radius of the robot (m) and the uncertainty of the
    /// edges. The edges must be those of the last call of [`Obstacles::group`].
    pub fn inflate(&mut self, edges: &[UnknownEdge], robot_radius_m: f64, hulls: &mut Vec<Vec<Point2<f64>>>) {
        let mut count = 0;
        for first in 0..self.labels.len() {
            if self.labels[first] != first {
                continue;
            }
            let members = || (first..edges.len()).filter(|&i| self.labels[i] == first);
            let sigma_m = members().map(|i| edges[i].sigma_m()).fold(0.0, f64::max);
            let inflation = Inflation::of_robot(robot_radius_m, sigma_m);
            if hulls.len() == count {
                hulls.push(Vec::new());
            }
            inflate(members().map(|i| self.positions[i]), &inflation, &mut self.corners, &mut hulls[count]);
            count += 1;
        }
        hulls.truncate(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::geometry::wrap_angle;
    use yamabico_vision::azimuth_profile::EdgeSign;

    /// Tracks edges at these places by a camera that moves along x, 3 cm an image.
    fn track(edges: &mut UnknownEdges, places: &[Point2<f64>], images: std::ops::Range<u32>) {
        for image in images {
            let camera = Pose2::new(0.03 * f64::from(image), 0.0, 0.0);
            let see = |place: &Point2<f64>| {
                let away = place - camera.position();
                let azimuth_rad = wrap_angle(away.y.atan2(away.x));
                ObservedEdge { azimuth_rad, sign: EdgeSign::Darker, length_px: 60.0 }
            };
            let seen: Vec<_> = places.iter().map(see).collect();
            edges.track(&seen, &vec![None; seen.len()], &camera);
        }
    }

    #[test]
    fn an_edge_that_is_not_seen_for_long_is_forgotten() {
        let mut edges = UnknownEdges::new(&EdgeMap::default());
        let places = [Point2::new(1.0, 1.0), Point2::new(0.5, -1.2)];
        track(&mut edges, &places, 0..40);
        assert_eq!(edges.edges().len(), 2);
        track(&mut edges, &places[1..], 40..339);
        assert_eq!(edges.edges().len(), 2, "kept while it may be hidden");
        track(&mut edges, &places[1..], 339..345);
        assert_eq!(edges.edges().len(), 1);
        edges.clear();
        assert!(edges.edges().is_empty());
        track(&mut edges, &places[1..], 345..350);
        assert!(edges.edges().is_empty(), "begun anew");
    }

    #[test]
    fn the_nearest_of_many_edges_count() {
        let mut edges = UnknownEdges::new(&EdgeMap::default());
        // The farther the earlier, every 7 degrees.
        let place = |i: u32| {
            let (sin, cos) = (0.12 * f64::from(i)).sin_cos();
            Point2::new(0.6, 0.0) + Vector2::new(cos, sin) * (3.0 - 0.04 * f64::from(i))
        };
        let places: Vec<_> = (0..50).map(place).collect();
        track(&mut edges, &places, 0..40);
        assert_eq!(edges.edges().len(), MAX_EDGES);
        let camera = Point2::new(0.03 * 39.0, 0.0);
        let farthest_m = edges.edges().iter().map(|edge| (edge.position - camera).norm()).fold(0.0, f64::max);
        let nearer = places.iter().filter(|place| (*place - camera).norm() < farthest_m - 0.05).count();
        assert!(nearer < MAX_EDGES, "{nearer} places are nearer than {farthest_m} m");
    }
}
