//! Bearing-only mapping of vertical edges: tracking over frames, triangulation, and a map of edges, the surfaces
//! between them, and free space.
//!
//! Yagi, Nishizawa & Yachida (1995). Positions are in the map frame, m. Azimuths are in the sensor frame; the pose of a
//! [`Sighting`] transforms them to the map.

mod adjacency;
mod candidate_surfaces;
mod cyclic_matching;
mod free_space;
mod joint_adjustment;
mod locus;
mod locus_tracker;
mod map_file;
mod mapper;
mod relink;
mod surface_check;
mod triangulation;
mod unknown_obstacles;
mod visibility_graph;

pub use adjacency::{AdjacencyTable, Neighbors};
pub use candidate_surfaces::{Surface, SurfaceRule, SurfaceState, candidate_surfaces};
pub use cyclic_matching::{CyclicMatcher, MatchingRule, ObservedEdge, PredictedEdge};
pub use free_space::{star_polygon, table_polygon};
pub use joint_adjustment::{Adjusted, AdjustmentError, AdjustmentRule, BearingObservation, adjust};
pub use locus::{Locus, LocusRule, LocusState};
pub use locus_tracker::LocusTracker;
pub use map_file::{EDGE_MAP_FILE, EdgeMap, MapEdge, MapSurface};
pub use mapper::{Mapper, MapperError, MapperRule};
pub use relink::{LocatedEdge, RelinkRule, is_explained, relink};
pub use surface_check::{RangeReading, ReadingClass, SurfaceCheck, SurfaceCheckRule};
pub use triangulation::{
    Sighting, Triangulated, TriangulationError, TriangulationRule, least_squares_crossing,
    most_likely_crossing, parallax_rad, triangulate,
};
pub use unknown_obstacles::{Inflation, ObstacleClusters, inflate};
pub use visibility_graph::{PathError, VisibilityGraph};
