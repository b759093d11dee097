use nalgebra::Point2;
use thiserror::Error;

use super::adjacency::AdjacencyTable;
use super::candidate_surfaces::{Surface, SurfaceRule, SurfaceState, candidate_surfaces};
use super::cyclic_matching::SeenEdge;
use super::free_space::{star_polygon, table_polygon};
use super::joint_adjustment::{Adjusted, AdjustmentError, BearingObservation, WayRule, adjust};
use super::locus::LocusRule;
use super::locus_tracker::LocusTracker;
use super::map_file::{EdgeMap, MapEdge, MapSurface};
use super::relink::{LocatedEdge, RelinkRule, relink};
use super::triangulation::Triangulated;
use crate::azimuth_profile::{AzimuthEdge, EdgeSign};
use crate::polygon::is_simple;
use yamabico_geometry::Pose2;

/// How a map is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapperRule {
    /// How edges are followed.
    pub loci: LocusRule,
    /// How places and edges are adjusted together.
    pub ways: WayRule,
    /// What may be a surface.
    pub surfaces: SurfaceRule,
    /// Which edges are one.
    pub relinking: RelinkRule,
    /// How sharp a point of an edge is seen, pixels, and the least standard deviation of an azimuth, radians.
    pub azimuth_sigma: (f64, f64),
    /// An edge of the map was seen in more pictures than this.
    pub min_seen: u32,
    /// An edge whose azimuths miss its place by more, as a root mean square in standard deviations, is none.
    pub max_misfit: f64,
    /// Pictures nearer to the last one than this are left out: meters, radians.
    pub key_frame: (f64, f64),
    /// Most pictures of a map; then every other one is forgotten.
    pub max_frames: usize,
}

impl Default for MapperRule {
    fn default() -> Self {
        let degrees = f64::to_radians;
        Self {
            loci: LocusRule { sigma_rad: degrees(1.0), min_gate_rad: degrees(4.0), ..LocusRule::default() },
            ways: WayRule::default(),
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

/// Why there is no map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MapperError {
    /// No edge was seen in enough pictures from enough places.
    #[error("no edge could be located: {frames} pictures, {loci} edges followed")]
    NoEdges {
        /// Pictures that were used.
        frames: usize,
        /// Edges that were followed.
        loci: usize,
    },
    /// They do not fit together.
    #[error("the edges cannot be adjusted: {0}")]
    Adjustment(#[from] AdjustmentError),
}

/// Puts a map together from the azimuths of edges along a way.
#[derive(Clone, Debug)]
pub struct Mapper {
    rule: MapperRule,
    tracker: LocusTracker,
    adjacency: AdjacencyTable,
    places: Vec<Pose2>,
    seen: Vec<SeenBy>,
    spare: Vec<SeenEdge>,
}

/// Locus `number` seen from a place.
#[derive(Clone, Copy, Debug)]
struct SeenBy {
    place: usize,
    number: u32,
    azimuth_rad: f64,
    sigma_rad: f64,
}

/// An edge that was located.
#[derive(Clone, Copy, Debug)]
struct Known {
    number: u32,
    sign: EdgeSign,
    seen: u32,
    position: Point2<f64>,
}

impl Mapper {
    /// An empty map.
    #[must_use]
    pub fn new(rule: MapperRule) -> Self {
        Self {
            tracker: LocusTracker::new(rule.loci),
            rule,
            adjacency: AdjacencyTable::default(),
            places: Vec::new(),
            seen: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Where the camera was by the odometry, a place for each picture that was used.
    #[must_use]
    pub fn places(&self) -> &[Pose2] {
        &self.places
    }

    /// Takes the edges of a picture and where the camera was by the odometry. A picture from nearly where the last one was
    /// changes nothing; nor does one from nowhere.
    pub fn take(&mut self, edges: &[AzimuthEdge], camera: &Pose2) {
        let (way_m, turn_rad) = self.rule.key_frame;
        let is_new = self.places.last().is_none_or(|last| {
            let moved = last.relative(camera);
            moved.x.hypot(moved.y) >= way_m || moved.theta.abs() >= turn_rad
        });
        if !is_new || !camera.is_finite() {
            return;
        }
        if self.places.len() >= self.rule.max_frames {
            self.thin_out();
        }
        let place = self.places.len();
        self.places.push(*camera);
        self.spare.clear();
        self.spare.extend(edges.iter().map(|edge| SeenEdge {
            azimuth_rad: edge.azimuth_rad,
            sign: edge.sign,
            length_px: edge.length_px,
        }));
        self.tracker.take(&self.spare, camera);
        let (point_px, min_rad) = self.rule.azimuth_sigma;
        let loci = self.tracker.loci();
        let matched = edges.iter().zip(self.tracker.locus_of_seen());
        let now = matched.filter_map(|(edge, locus)| {
            let number = loci[(*locus)?].number;
            let sigma_rad = edge.sigma_rad(point_px, min_rad);
            Some(SeenBy { place, number, azimuth_rad: edge.azimuth_rad, sigma_rad })
        });
        let first = self.seen.len();
        self.seen.extend(now);
        let bearing = |one: &SeenBy| (one.number, one.azimuth_rad + camera.theta);
        self.adjacency.take(self.seen[first..].iter().map(bearing));
    }

    /// The map: every edge that was located, adjusted together with the way; what may stand between them; and what is free.
    ///
    /// # Errors
    /// [`MapperError`].
    pub fn finish(&self) -> Result<EdgeMap, MapperError> {
        let mut known: Vec<Known> = self
            .tracker
            .loci()
            .iter()
            .filter(|locus| locus.seen > self.rule.min_seen)
            .filter_map(|locus| {
                let position = locus.position?.position;
                Some(Known { number: locus.number, sign: locus.sign, seen: locus.seen, position })
            })
            .collect();
        let nothing = MapperError::NoEdges { frames: self.places.len(), loci: self.tracker.loci().len() };
        if known.is_empty() {
            return Err(nothing);
        }
        let adjusted = self.adjusted(&known)?;
        // Where something near hides something far no edge stands: it wanders, and fits no place.
        let mut misfits = adjusted.misfits.iter();
        known.retain(|_| misfits.next().is_some_and(|misfit| *misfit <= self.rule.max_misfit));
        if known.is_empty() {
            return Err(nothing);
        }
        let adjusted = self.adjusted(&known)?;
        let edges = self.merged(&known, &adjusted);
        let surfaces = self.surfaces(&edges);
        let free_m = self.free(&edges).iter().map(|corner| [corner.x, corner.y]).collect();
        Ok(EdgeMap { edges, surfaces, free_m })
    }

    /// These edges and all places, fitted together.
    fn adjusted(&self, known: &[Known]) -> Result<Adjusted, AdjustmentError> {
        let positions: Vec<_> = known.iter().map(|edge| edge.position).collect();
        let observation = |one: &SeenBy| {
            let edge = known.iter().position(|edge| edge.number == one.number)?;
            let (azimuth_rad, sigma_rad) = (one.azimuth_rad, one.sigma_rad);
            Some(BearingObservation { place: one.place, edge, azimuth_rad, sigma_rad })
        };
        let seen: Vec<_> = self.seen.iter().filter_map(observation).collect();
        adjust(&self.places, &positions, &seen, &self.rule.ways)
    }

    /// The edges; those that were lost and found again are one.
    fn merged(&self, known: &[Known], adjusted: &Adjusted) -> Vec<MapEdge> {
        let mut edges: Vec<(u32, u32, LocatedEdge)> = Vec::new();
        for ((edge, position), covariance) in known.iter().zip(&adjusted.edges).zip(&adjusted.covariances) {
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
            let here = self.places.last().map_or(Point2::origin(), Pose2::position);
            star_polygon(here, &mut corners, &mut polygon);
        }
        polygon
    }

    /// Forgets every other place.
    fn thin_out(&mut self) {
        let mut number = 0;
        self.places.retain(|_| {
            number += 1;
            number % 2 == 1
        });
        self.seen.retain(|one| one.place % 2 == 0);
        self.seen.iter_mut().for_each(|one| one.place /= 2);
        self.rule.key_frame.0 *= 2.0;
        self.rule.key_frame.1 *= 2.0;
    }
}
