use nalgebra::Point2;
use thiserror::Error;

use super::adjacency::AdjacencyTable;
use super::candidate_surfaces::{Surface, SurfaceRule, SurfaceState, candidate_surfaces};
use super::cyclic_matching::ObservedEdge;
use super::free_space::{star_polygon, table_polygon};
use super::joint_adjustment::{Adjusted, AdjustmentError, AdjustmentRule, BearingObservation, adjust};
use super::locus::LocusRule;
use super::locus_tracker::LocusTracker;
use super::map_file::{EdgeMap, MapEdge, MapSurface};
use super::relink::{LocatedEdge, RelinkRule, relink};
use super::triangulation::Triangulated;
use crate::azimuth_profile::{AzimuthEdge, EdgeSign};
use crate::polygon::is_simple;
use yamabico_geometry::{Hypotenuse, Pose2};

/// Parameters of mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapperRule {
    /// Parameters of edge tracking.
    pub loci: LocusRule,
    /// Noise model of the joint adjustment.
    pub adjustment: AdjustmentRule,
    /// Criteria for candidate surfaces.
    pub surfaces: SurfaceRule,
    /// Criteria for merging duplicate edges.
    pub relinking: RelinkRule,
    /// Standard deviation of an edge point, pixels, and minimum standard deviation of an azimuth, rad.
    pub azimuth_sigma: (f64, f64),
    /// Number of frames that must be exceeded for an edge to enter the map.
    pub min_seen: u32,
    /// Maximum root mean square azimuth residual of an edge in the map, standard deviations.
    pub max_misfit: f64,
    /// Minimum distance between key frames: m, or rad.
    pub key_frame: (f64, f64),
    /// Maximum number of key frames. Beyond it, every other observation is dropped.
    pub max_frames: usize,
}

impl Default for MapperRule {
    fn default() -> Self {
        let degrees = f64::to_radians;
        Self {
            loci: LocusRule { sigma_rad: degrees(1.0), min_gate_rad: degrees(4.0), ..LocusRule::default() },
            adjustment: AdjustmentRule::default(),
            surfaces: SurfaceRule::default(),
            relinking: RelinkRule::default(),
            azimuth_sigma: (0.3, degrees(0.05)),
            min_seen: 4,
            max_misfit: 1.5,
            key_frame: (0.02, degrees(3.0)),
            max_frames: 200,
        }
    }
}

/// Reason why there is no map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MapperError {
    /// No edge was observed in enough frames from enough positions.
    #[error(
        "no edge could be located in {frames} frames with {loci} tracked edges: drive a path with more parallax"
    )]
    NoEdges {
        /// Number of key frames.
        frames: usize,
        /// Number of tracked edges.
        loci: usize,
    },
    /// The joint adjustment failed.
    #[error("the edges cannot be adjusted: {0}")]
    Adjustment(#[from] AdjustmentError),
}

/// Builds a map from the azimuths of edges along a path.
#[derive(Clone, Debug)]
pub struct Mapper {
    rule: MapperRule,
    tracker: LocusTracker,
    adjacency: AdjacencyTable,
    poses: Vec<Pose2>,
    seen: Vec<LocusObservation>,
    spare: Vec<ObservedEdge>,
}

/// Observation of locus `number` from a pose.
#[derive(Clone, Copy, Debug)]
struct LocusObservation {
    pose: usize,
    number: u32,
    azimuth_rad: f64,
    sigma_rad: f64,
}

/// Locus with a position.
#[derive(Clone, Copy, Debug)]
struct LocatedLocus {
    number: u32,
    sign: EdgeSign,
    seen: u32,
    position: Point2<f64>,
}

impl Mapper {
    /// Creates an empty mapper.
    #[must_use]
    pub fn new(rule: MapperRule) -> Self {
        Self {
            tracker: LocusTracker::new(rule.loci),
            rule,
            adjacency: AdjacencyTable::default(),
            poses: Vec::new(),
            seen: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Camera poses of the key frames according to odometry.
    #[must_use]
    pub fn poses(&self) -> &[Pose2] {
        &self.poses
    }

    /// Adds a frame: its edges and the camera pose according to odometry. Ignores a frame close to the last key frame,
    /// and a pose that is not finite.
    pub fn add_frame(&mut self, edges: &[AzimuthEdge], camera: &Pose2) {
        let (distance_m, turn_rad) = self.rule.key_frame;
        let is_new = self.poses.last().is_none_or(|last| {
            let moved = last.relative(camera);
            moved.x.hypotenuse(moved.y) >= distance_m || moved.theta.abs() >= turn_rad
        });
        if !is_new || !camera.is_finite() {
            return;
        }
        if self.poses.len() >= self.rule.max_frames {
            self.thin_out();
        }
        let pose = self.poses.len();
        self.poses.push(*camera);
        self.spare.clear();
        self.spare.extend(edges.iter().map(|edge| ObservedEdge {
            azimuth_rad: edge.azimuth_rad,
            sign: edge.sign,
            length_px: edge.length_px,
        }));
        self.tracker.update(&self.spare, camera);
        let (point_px, min_rad) = self.rule.azimuth_sigma;
        let loci = self.tracker.loci();
        let matched = edges.iter().zip(self.tracker.locus_of_observed());
        let now = matched.filter_map(|(edge, locus)| {
            let number = loci[(*locus)?].number;
            let sigma_rad = edge.sigma_rad(point_px, min_rad);
            Some(LocusObservation { pose, number, azimuth_rad: edge.azimuth_rad, sigma_rad })
        });
        let first = self.seen.len();
        self.seen.extend(now);
        let bearing =
            |observation: &LocusObservation| (observation.number, observation.azimuth_rad + camera.theta);
        self.adjacency.update(self.seen[first..].iter().map(bearing));
    }

    /// Builds the map: all located edges, jointly adjusted with the path, the surfaces between them, and free space.
    ///
    /// # Errors
    /// [`MapperError`].
    pub fn finish(&self) -> Result<EdgeMap, MapperError> {
        let mut located: Vec<LocatedLocus> = self
            .tracker
            .loci()
            .iter()
            .filter(|locus| locus.seen > self.rule.min_seen)
            .filter_map(|locus| {
                let position = locus.position?.position;
                Some(LocatedLocus { number: locus.number, sign: locus.sign, seen: locus.seen, position })
            })
            .collect();
        let no_edges = MapperError::NoEdges { frames: self.poses.len(), loci: self.tracker.loci().len() };
        if located.is_empty() {
            return Err(no_edges);
        }
        let adjusted = self.adjusted(&located)?;
        // An occlusion boundary between a near and a far object is not a fixed edge: it moves with the robot and fits
        // no position.
        let mut misfits = adjusted.misfits.iter();
        located.retain(|_| misfits.next().is_some_and(|misfit| *misfit <= self.rule.max_misfit));
        if located.is_empty() {
            return Err(no_edges);
        }
        let adjusted = self.adjusted(&located)?;
        let edges = self.merged(&located, &adjusted);
        let surfaces = self.surfaces(&edges);
        let free_m = self.free(&edges).iter().map(|corner| [corner.x, corner.y]).collect();
        Ok(EdgeMap { edges, surfaces, free_m })
    }

    /// Adjusts these edges and all poses jointly.
    fn adjusted(&self, located: &[LocatedLocus]) -> Result<Adjusted, AdjustmentError> {
        let positions: Vec<_> = located.iter().map(|edge| edge.position).collect();
        let observation = |observation: &LocusObservation| {
            let edge = located.iter().position(|edge| edge.number == observation.number)?;
            let (azimuth_rad, sigma_rad) = (observation.azimuth_rad, observation.sigma_rad);
            Some(BearingObservation { pose: observation.pose, edge, azimuth_rad, sigma_rad })
        };
        let seen: Vec<_> = self.seen.iter().filter_map(observation).collect();
        adjust(&self.poses, &positions, &seen, &self.rule.adjustment)
    }

    /// Map edges, with duplicates from lost and recovered tracks merged.
    fn merged(&self, located: &[LocatedLocus], adjusted: &Adjusted) -> Vec<MapEdge> {
        let mut edges: Vec<(u32, u32, LocatedEdge)> = Vec::new();
        for ((edge, position), covariance) in located.iter().zip(&adjusted.edges).zip(&adjusted.covariances) {
            let here = LocatedEdge { position: *position, covariance: *covariance, sign: Some(edge.sign) };
            let twin = edges
                .iter_mut()
                .find_map(|old| relink(&old.2, &here, &self.rule.relinking).map(|both| (old, both)));
            match twin {
                Some((old, both)) => {
                    old.1 += edge.seen;
                    old.2 = both;
                }
                None => edges.push((edge.number, edge.seen, here)),
            }
        }
        edges.iter().map(|(number, seen, edge)| MapEdge::new(*number, edge, *seen)).collect()
    }

    fn surfaces(&self, edges: &[MapEdge]) -> Vec<MapSurface> {
        let located = |number: u32| {
            let edge = edges.iter().find(|edge| edge.number == number)?.located();
            Some(Triangulated {
                position: edge.position,
                covariance: edge.covariance,
                chi_squared: 0.0,
                parallax_rad: 0.0,
                sightings: 0,
            })
        };
        let mut found: Vec<Surface> = Vec::new();
        candidate_surfaces(&self.adjacency, located, &self.rule.surfaces, &mut found);
        let surface = |surface: &Surface| {
            let [right, left] = surface.edges;
            MapSurface { right, left, state: SurfaceState::Unknown }
        };
        found.iter().map(surface).collect()
    }

    fn free(&self, edges: &[MapEdge]) -> Vec<Point2<f64>> {
        let mut polygon = Vec::new();
        let at =
            |number: u32| edges.iter().find(|edge| edge.number == number).map(|edge| Point2::from(edge.at_m));
        table_polygon(&self.adjacency, at, &mut polygon);
        if !is_simple(&polygon) {
            let mut corners: Vec<_> = edges.iter().map(|edge| Point2::from(edge.at_m)).collect();
            let here = self.poses.last().map_or(Point2::origin(), Pose2::position);
            star_polygon(here, &mut corners, &mut polygon);
        }
        polygon
    }

    /// Drops every other key frame.
    fn thin_out(&mut self) {
        let mut number = 0;
        self.poses.retain(|_| {
            number += 1;
            number % 2 == 1
        });
        self.seen.retain(|observation| observation.pose % 2 == 0);
        self.seen.iter_mut().for_each(|observation| observation.pose /= 2);
        self.rule.key_frame.0 *= 2.0;
        self.rule.key_frame.1 *= 2.0;
    }
}
