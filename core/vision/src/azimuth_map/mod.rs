//! Vertical edges of the surroundings, known by their azimuths alone: followed from picture to picture, located from
//! several places, and put together to a map of edges, of what may stand between them, and of free space.
//!
//! Yagi, Nishizawa & Yachida (1995). Positions are those of the map in meters; azimuths are those of the sensor's frame,
//! which the pose of a [`Sighting`] brings to the map.

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
pub use cyclic_matching::{CyclicMatcher, ExpectedEdge, MatchingRule, SeenEdge};
pub use free_space::{star_polygon, table_polygon};
pub use joint_adjustment::{Adjusted, AdjustmentError, BearingObservation, WayRule, adjust};
pub use locus::{Locus, LocusRule, LocusState};
pub use locus_tracker::LocusTracker;
pub use map_file::{EDGE_MAP_FILE, EdgeMap, MapEdge, MapSurface};
pub use mapper::{Mapper, MapperError, MapperRule};
pub use relink::{LocatedEdge, RelinkRule, explains, relink};
pub use surface_check::{RangeReading, ReadingClass, SurfaceCheck, SurfaceCheckRule};
pub use triangulation::{
    Sighting, Triangulated, TriangulationError, TriangulationRule, least_squares_crossing,
    most_likely_crossing, parallax_rad, triangulate,
};
pub use unknown_obstacles::{Inflation, ObstacleClusters, inflate};
pub use visibility_graph::{PathError, VisibilityGraph};
