use std::path::Path;

use nalgebra::{Matrix2, Point2};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use super::candidate_surfaces::SurfaceState;
use super::relink::LocatedEdge;
use crate::azimuth_profile::EdgeSign;
use yamabico_parameters::{FileError, FileKind, ParameterError, Problems};

/// File kind of maps of vertical edges.
pub const EDGE_MAP_FILE: FileKind = FileKind {
    key: "edge_map",
    what: "a map of vertical edges",
    schema: || schema_for!(EdgeMap),
    rules: |table| match table.clone().try_into::<EdgeMap>() {
        Ok(map) => map.rules(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Map of vertical edges, with the surfaces between them and free space.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EdgeMap {
    /// Vertical edges.
    #[serde(rename = "edge")]
    #[schemars(length(max = 2000))]
    pub edges: Vec<MapEdge>,
    /// Potential surfaces between pairs of edges.
    #[serde(rename = "surface")]
    #[schemars(length(max = 10_000))]
    pub surfaces: Vec<MapSurface>,
    /// Corners of the polygon that is known to be free, x and y.
    #[schemars(length(max = 4000), inner(inner(range(min = -1000.0, max = 1000.0))))]
    pub free_m: Vec<[f64; 2]>,
}

/// Vertical edge of a map.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapEdge {
    /// Number by which surfaces refer to the edge, unique.
    #[schemars(range(max = 1_000_000))]
    pub number: u32,
    /// Position x, y.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at_m: [f64; 2],
    /// Covariance xx, xy, yy.
    #[serde(default)]
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub covariance_m2: [f64; 3],
    /// Sign of the brightness change from right to left: 1 brighter, -1 darker, 0 unknown.
    #[serde(default)]
    #[schemars(range(min = -1, max = 1))]
    pub sign: i8,
    /// Number of frames in which the edge was observed.
    #[serde(default)]
    pub seen: u32,
}

/// Potential surface between two edges of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapSurface {
    /// Number of the right edge, as seen from the free side.
    #[schemars(range(max = 1_000_000))]
    pub right: u32,
    /// Number of the left edge, as seen from the free side.
    #[schemars(range(max = 1_000_000))]
    pub left: u32,
    /// State of the surface.
    #[serde(default)]
    pub state: SurfaceState,
}

impl MapEdge {
    /// Creates the map entry of a located edge.
    #[must_use]
    pub fn new(number: u32, edge: &LocatedEdge, seen: u32) -> Self {
        let (at, spread) = (edge.position, edge.covariance);
        Self {
            number,
            at_m: [at.x, at.y],
            covariance_m2: [spread.m11, spread.m12, spread.m22],
            sign: edge.sign.map_or(0, EdgeSign::value),
            seen,
        }
    }

    /// Position, covariance and sign of the edge.
    #[must_use]
    pub fn located(&self) -> LocatedEdge {
        let [xx, xy, yy] = self.covariance_m2;
        LocatedEdge {
            position: Point2::from(self.at_m),
            covariance: Matrix2::new(xx, xy, xy, yy),
            sign: EdgeSign::ALL.into_iter().find(|sign| sign.value() == self.sign),
        }
    }
}

impl EdgeMap {
    /// Reads and validates a map file.
    ///
    /// # Errors
    /// The file cannot be read, or its content is invalid.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        EDGE_MAP_FILE.load(path)
    }

    /// Parses and validates the text of a map file.
    ///
    /// # Errors
    /// All invalid content, with its location.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        EDGE_MAP_FILE.parse("the map", text)
    }

    /// Serializes the map as TOML without comments, lengths to 0.1 mm.
    #[must_use]
    pub fn to_toml(&self) -> String {
        use std::fmt::Write;
        let mut text = String::from("edge = [\n");
        // Writing to a string does not fail.
        for edge in &self.edges {
            let ([x, y], [xx, xy, yy]) = (edge.at_m, edge.covariance_m2);
            let _ = writeln!(
                text,
                "  {{ number = {}, at_m = [{x:.4}, {y:.4}], covariance_m2 = [{xx:e}, {xy:e}, {yy:e}], sign = {}, seen = {} }},",
                edge.number, edge.sign, edge.seen
            );
        }
        text.push_str("]\nsurface = [\n");
        for MapSurface { right, left, state } in &self.surfaces {
            let state = match state {
                SurfaceState::Unknown => "unknown",
                SurfaceState::Solid => "solid",
                SurfaceState::Empty => "empty",
                SurfaceState::Nearer => "nearer",
            };
            let _ = writeln!(text, "  {{ right = {right}, left = {left}, state = \"{state}\" }},");
        }
        text.push_str("]\nfree_m = [");
        for [x, y] in &self.free_m {
            let _ = write!(text, "[{x:.4}, {y:.4}], ");
        }
        text.push_str("]\n");
        text.replace("-0.0000", "0.0000").replace("], ]", "]]")
    }

    /// Edge with this number.
    #[must_use]
    pub fn edge(&self, number: u32) -> Option<&MapEdge> {
        self.edges.iter().find(|edge| edge.number == number)
    }

    /// Endpoints of all surfaces but open passages.
    pub fn walls(&self) -> impl Iterator<Item = [Point2<f64>; 2]> {
        let standing = self.surfaces.iter().filter(|surface| surface.state != SurfaceState::Empty);
        standing.filter_map(|surface| {
            let end = |number| self.edge(number).map(|edge| Point2::from(edge.at_m));
            Some([end(surface.right)?, end(surface.left)?])
        })
    }

    fn rules(&self) -> Vec<ParameterError> {
        if self.edges.is_empty() {
            return vec![
                ParameterError::new("edge", "is missing, and a map needs at least one edge")
                    .remedy("add a table [[edge]], or learn the map: `yamabico learn map`"),
            ];
        }
        let mut errors = Vec::new();
        let mut numbers = std::collections::HashSet::new();
        for (i, edge) in self.edges.iter().enumerate() {
            if !numbers.insert(edge.number) {
                let problem = format!("{} is already the number of another edge", edge.number);
                errors.push(ParameterError::new(format!("edge[{i}].number"), problem));
            }
            let [xx, xy, yy] = edge.covariance_m2;
            if xx < 0.0 || yy < 0.0 || xy * xy > xx * yy * (1.0 + 1e-9) {
                let problem = "is not positive semidefinite: give the variance of x, the covariance, and the variance of y";
                errors.push(ParameterError::new(format!("edge[{i}].covariance_m2"), problem));
            }
        }
        for (i, surface) in self.surfaces.iter().enumerate() {
            for (key, number) in [("right", surface.right), ("left", surface.left)] {
                if !numbers.contains(&number) {
                    let problem = format!("refers to edge {number}, which is not in the map");
                    errors.push(ParameterError::new(format!("surface[{i}].{key}"), problem));
                }
            }
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> EdgeMap {
        let edge = |number, x: f64, sign| MapEdge {
            number,
            at_m: [x, -1.25],
            covariance_m2: [1e-4, -2e-5, 3e-4],
            sign,
            seen: 17,
        };
        EdgeMap {
            edges: vec![edge(3, 2.0, 1), edge(7, -0.5, -1), edge(8, 0.0, 0)],
            surfaces: vec![
                MapSurface { right: 3, left: 7, state: SurfaceState::Solid },
                MapSurface { right: 7, left: 8, state: SurfaceState::Empty },
            ],
            free_m: vec![[0.0, 0.0], [1.5, 0.0], [1.5, 2.25]],
        }
    }

    #[test]
    fn a_map_survives_serialization() {
        let map = map();
        let text = map.to_toml();
        assert_eq!(EdgeMap::from_toml(&text).unwrap(), map, "{text}");
        assert_eq!(EdgeMap { free_m: Vec::new(), ..map.clone() }.to_toml().matches("free_m = []").count(), 1);
        let again = MapEdge::new(3, &map.edges[0].located(), 17);
        assert_eq!(again, map.edges[0]);
        assert_eq!(map.walls().count(), 1);
    }

    #[test]
    fn invalid_maps_are_rejected() {
        let broken = |change: fn(&mut EdgeMap)| {
            let mut map = map();
            change(&mut map);
            EdgeMap::from_toml(&map.to_toml()).unwrap_err().to_string()
        };
        assert!(broken(|map| map.edges[1].number = 3).contains("already the number of another edge"));
        assert!(broken(|map| map.surfaces[0].left = 99).contains("edge 99"));
        assert!(
            broken(|map| map.edges[0].covariance_m2 = [1e-4, 1.0, 1e-4])
                .contains("not positive semidefinite")
        );
        assert!(broken(|map| map.edges.clear()).contains("at least one edge"));
        assert!(broken(|map| map.edges[0].at_m[0] = 5000.0).contains("1000"));
    }
}
