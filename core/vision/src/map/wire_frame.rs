//! Wire frame of a building: edges that a camera can see and walls that hide them.

use std::path::Path;

use nalgebra::{Point2, Point3, Vector2};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use yamabico_parameters::{FileError, FileKind, ParameterError, Problems};

/// File kind of wire-frame maps. The schema holds the ranges, `rules` the checks between entries.
pub const WIRE_FRAME_FILE: FileKind = FileKind {
    key: "map",
    what: "a map file",
    schema: || schema_for!(MapFile),
    rules: |table| match table.clone().try_into::<MapFile>() {
        Ok(file) => file.rules(),
        Err(error) => vec![ParameterError::new("", error.message())],
    },
};

/// Maximum extent of a building, m. A larger one is probably in millimeters.
const MAX_EXTENT_M: f64 = 1000.0;
/// Minimum extent of a building, m. A smaller one is probably in kilometers.
const MIN_EXTENT_M: f64 = 0.1;
/// Minimum length of an edge or wall, m.
const MIN_LENGTH_M: f64 = 0.001;
/// Maximum offset between the ends of a vertical edge in plan, or of a horizontal edge in height, m.
const ALIGNMENT_TOLERANCE_M: f64 = 0.001;

/// Building map: edges in space and walls in plan, map frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WireFrame {
    edges: Vec<Edge>,
    walls: Vec<Wall>,
}

/// Straight edge in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// First endpoint, map frame, m.
    pub from: Point3<f64>,
    /// Second endpoint, map frame, m.
    pub to: Point3<f64>,
    /// Orientation of the edge in space.
    pub kind: EdgeKind,
    /// Visual prominence of the edge.
    pub role: EdgeRole,
}

/// Visual prominence of an edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeRole {
    /// Prominent at any distance.
    #[default]
    Outline,
    /// Next to an outline, such as the inner edges of a door frame, and indistinguishable from it at a distance.
    Detail,
}

/// Orientation of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// Vertical.
    Vertical,
    /// Horizontal.
    Horizontal,
    /// Any other orientation.
    Other,
}

/// Wall in plan, from floor to ceiling, opaque and impassable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// First endpoint, map frame, m.
    pub from: Point2<f64>,
    /// Second endpoint, map frame, m.
    pub to: Point2<f64>,
}

impl Edge {
    /// Creates an outline between two points, map frame, m.
    #[must_use]
    pub fn between(from: Point3<f64>, to: Point3<f64>) -> Self {
        let run = to - from;
        let kind = if run.xy().norm() <= ALIGNMENT_TOLERANCE_M {
            EdgeKind::Vertical
        } else if run.z.abs() <= ALIGNMENT_TOLERANCE_M {
            EdgeKind::Horizontal
        } else {
            EdgeKind::Other
        };
        Self { from, to, kind, role: EdgeRole::Outline }
    }

    /// Returns the same edge as a detail.
    #[must_use]
    pub fn detail(self) -> Self {
        Self { role: EdgeRole::Detail, ..self }
    }

    /// Distance between the endpoints, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.to - self.from).norm()
    }
}

impl Wall {
    /// Returns true if the straight line from `start` to `end` crosses or touches the wall.
    fn is_crossed_by(&self, start: Point2<f64>, end: Point2<f64>) -> bool {
        let (line, wall) = (end - start, self.to - self.from);
        let cross = line.perp(&wall);
        if cross.abs() <= f64::EPSILON * line.norm() * wall.norm() {
            return false;
        }
        let between = self.from - start;
        let (t, s) = (between.perp(&wall) / cross, between.perp(&line) / cross);
        (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&s)
    }

    /// Distance of a point from the wall, m, never negative.
    #[must_use]
    pub fn distance(&self, point: Point2<f64>) -> f64 {
        let wall = self.to - self.from;
        let along = ((point - self.from).dot(&wall) / wall.norm_squared()).clamp(0.0, 1.0);
        (point - self.from - wall * along).norm()
    }

    /// True if each point of the wall is at least `distance_m` from a point along one of the axes.
    fn is_farther(&self, point: Point2<f64>, distance_m: f64) -> bool {
        let is_beside =
            |at: f64, from: f64, to: f64| at - from.max(to) >= distance_m || from.min(to) - at >= distance_m;
        is_beside(point.x, self.from.x, self.to.x) || is_beside(point.y, self.from.y, self.to.y)
    }
}

impl WireFrame {
    /// Creates a map without validation; [`WireFrame::from_toml`] validates.
    #[must_use]
    pub fn new(edges: Vec<Edge>, walls: Vec<Wall>) -> Self {
        Self { edges, walls }
    }

    /// Replaces all edges and walls; reuses the buffers.
    pub fn replace(&mut self, edges: &[Edge], walls: &[Wall]) {
        self.edges.clear();
        self.edges.extend_from_slice(edges);
        self.walls.clear();
        self.walls.extend_from_slice(walls);
    }

    /// Takes over the walls of `map` that come within `reach_m` (m) of a point, some that are farther, and no edges; reuses the
    /// buffers.
    pub fn take_walls_near(&mut self, map: &Self, point: Point2<f64>, reach_m: f64) {
        self.edges.clear();
        self.walls.clear();
        self.walls.extend(map.walls.iter().filter(|wall| !wall.is_farther(point, reach_m)));
    }

    /// Reads and validates a map file.
    ///
    /// # Errors
    /// The file cannot be read, or its content is invalid.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        WIRE_FRAME_FILE.load(path).map(MapFile::into)
    }

    /// Parses and validates the text of a map file.
    ///
    /// # Errors
    /// All invalid content, with its location.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        WIRE_FRAME_FILE.parse("the map", text).map(MapFile::into)
    }

    /// Serializes the map as TOML without comments, lengths to 1 mm.
    #[must_use]
    pub fn to_toml(&self) -> String {
        use std::fmt::Write;
        let mut text = String::from("edge = [\n");
        // Writing to a string does not fail.
        for Edge { from: a, to: b, role, .. } in &self.edges {
            let role = if *role == EdgeRole::Detail { ", role = \"detail\"" } else { "" };
            let _ = writeln!(
                text,
                "  {{ from_m = [{:.3}, {:.3}, {:.3}], to_m = [{:.3}, {:.3}, {:.3}]{role} }},",
                a.x, a.y, a.z, b.x, b.y, b.z
            );
        }
        text.push_str("]\nwall = [\n");
        for Wall { from: a, to: b } in &self.walls {
            let _ =
                writeln!(text, "  {{ from_m = [{:.3}, {:.3}], to_m = [{:.3}, {:.3}] }},", a.x, a.y, b.x, b.y);
        }
        text.push_str("]\n");
        text.replace("-0.000", "0.000")
    }

    /// Edges of the building.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Walls of the building.
    #[must_use]
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// Returns true if the straight line from `start` to `end` crosses no wall.
    #[must_use]
    pub fn is_open(&self, start: Point2<f64>, end: Point2<f64>) -> bool {
        !self.walls.iter().any(|wall| wall.is_crossed_by(start, end))
    }

    /// Distance from a point to the nearest wall, m; infinite without walls.
    #[must_use]
    pub fn clearance(&self, point: Point2<f64>) -> f64 {
        self.walls.iter().fold(f64::INFINITY, |nearest_m, wall| {
            // Most walls are farther away by their extent alone.
            if wall.is_farther(point, nearest_m) { nearest_m } else { nearest_m.min(wall.distance(point)) }
        })
    }
}

impl From<MapFile> for WireFrame {
    fn from(file: MapFile) -> Self {
        let point = Point3::from;
        let edge = |e: &EdgeEntry| Edge { role: e.role, ..Edge::between(point(e.from_m), point(e.to_m)) };
        let wall = |w: &WallEntry| Wall { from: Point2::from(w.from_m), to: Point2::from(w.to_m) };
        Self { edges: file.edges.iter().map(edge).collect(), walls: file.walls.iter().map(wall).collect() }
    }
}

/// Content of a map file. Lengths in m, map frame, x forward, y left, z up from the floor.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct MapFile {
    /// Display name; may be empty.
    name: String,
    /// Edges that a camera can see.
    #[serde(rename = "edge")]
    #[schemars(length(max = 20_000))]
    edges: Vec<EdgeEntry>,
    /// Walls in plan, which hide edges behind them.
    #[serde(rename = "wall")]
    #[schemars(length(max = 20_000))]
    walls: Vec<WallEntry>,
}

/// Straight edge in space.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct EdgeEntry {
    /// First endpoint x, y, z.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    from_m: [f64; 3],
    /// Second endpoint x, y, z.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    to_m: [f64; 3],
    /// Visual prominence.
    #[serde(default)]
    role: EdgeRole,
}

/// Wall in plan.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct WallEntry {
    /// First endpoint x, y.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    from_m: [f64; 2],
    /// Second endpoint x, y.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    to_m: [f64; 2],
}

impl MapFile {
    fn rules(&self) -> Vec<ParameterError> {
        if self.edges.is_empty() {
            return vec![
                ParameterError::new("edge", "is missing, and a map needs at least one edge")
                    .remedy("add edge = [{ from_m = [X, Y, Z], to_m = [X, Y, Z] }]"),
            ];
        }
        let mut errors = Vec::new();
        let extent = self.extent();
        if extent > MAX_EXTENT_M {
            errors.push(ParameterError::new(
                "edge",
                format!("extends over {extent:.0} m, but a building at most over {MAX_EXTENT_M} m: are these millimeters?"),
            ));
        } else if extent < MIN_EXTENT_M {
            errors.push(ParameterError::new(
                "edge",
                format!(
                    "extends over {extent} m, but a building at least over {MIN_EXTENT_M} m: are these kilometers?"
                ),
            ));
        }
        let mut seen = std::collections::HashMap::new();
        for (i, edge) in self.edges.iter().enumerate() {
            let (from, to) = (Point3::from(edge.from_m), Point3::from(edge.to_m));
            if (to - from).norm() < MIN_LENGTH_M {
                errors.push(ParameterError::new(
                    format!("edge[{i}].to_m"),
                    "equals `from_m`: an edge needs two distinct ends",
                ));
            }
            if let Some(other) = seen.insert(ends_in_millimeters(&edge.from_m, &edge.to_m), i) {
                errors.push(ParameterError::new(
                    format!("edge[{i}]"),
                    format!("duplicates edge[{other}]: remove one of them"),
                ));
            }
        }
        for (i, wall) in self.walls.iter().enumerate() {
            if (Vector2::from(wall.to_m) - Vector2::from(wall.from_m)).norm() < MIN_LENGTH_M {
                errors.push(ParameterError::new(
                    format!("wall[{i}].to_m"),
                    "equals `from_m`: a wall needs two distinct ends",
                ));
            }
        }
        errors
    }

    /// Maximum extent along an axis, m.
    fn extent(&self) -> f64 {
        let points = self.edges.iter().flat_map(|edge| [edge.from_m, edge.to_m]);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max)
    }
}

/// Both endpoints in whole millimeters, sorted.
fn ends_in_millimeters(from: &[f64; 3], to: &[f64; 3]) -> [[i64; 3]; 2] {
    let whole = |point: &[f64; 3]| point.map(|meters| (meters * 1000.0).round() as i64);
    let mut ends = [whole(from), whole(to)];
    ends.sort_unstable();
    ends
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOOR: &str = r#"edge = [
        { from_m = [6, 1, 0], to_m = [6, 1, 2.1] },
        { from_m = [6, 1, 2.1], to_m = [7, 1, 2.1] },
        { from_m = [6, 1, 0], to_m = [7, 1, 2.1], role = "detail" },
    ]
    wall = [{ from_m = [0, 1], to_m = [6, 1] }]"#;

    fn refusal(text: &str) -> String {
        WireFrame::from_toml(text).unwrap_err().to_string()
    }

    #[test]
    fn edges_are_classified_by_orientation() {
        let map = WireFrame::from_toml(DOOR).unwrap();
        let kinds: Vec<EdgeKind> = map.edges().iter().map(|edge| edge.kind).collect();
        assert_eq!(kinds, [EdgeKind::Vertical, EdgeKind::Horizontal, EdgeKind::Other]);
        assert_eq!(map.walls().len(), 1);
    }

    #[test]
    fn the_clearance_is_the_smallest_distance_and_near_walls_suffice_for_it() {
        let place = |i: usize| Point2::new((7 * i % 23) as f64 * 0.5, (11 * i % 17) as f64 * 0.4);
        let wall = |i: usize| Wall { from: place(i), to: place(i + 1) };
        let map = WireFrame::new(vec![], (0..40).map(wall).collect());
        let mut near = WireFrame::default();
        for at in (0..60).map(|i| Point2::new(i as f64 * 0.31 - 2.0, (i % 13) as f64 * 0.9 - 3.0)) {
            let distances = map.walls().iter().map(|wall| wall.distance(at));
            let nearest_m = distances.fold(f64::INFINITY, f64::min);
            assert_eq!(map.clearance(at), nearest_m, "{at}");
            near.take_walls_near(&map, at, nearest_m + 0.1);
            assert!(near.walls().len() < map.walls().len());
            assert_eq!(near.clearance(at), nearest_m, "{at}");
        }
        assert_eq!(WireFrame::default().clearance(Point2::origin()), f64::INFINITY);
    }

    #[test]
    fn a_map_survives_serialization() {
        let map = WireFrame::from_toml(DOOR).unwrap();
        assert_eq!(WireFrame::from_toml(&map.to_toml()).unwrap(), map);
    }

    #[test]
    fn wrong_units_are_reported() {
        let millimeters = "edge = [{ from_m = [0, 0, 0], to_m = [18000, 0, 0] }]";
        assert!(refusal(millimeters).contains("millimeters"));
        let kilometers = "edge = [{ from_m = [0, 0, 0], to_m = [0.018, 0, 0] }]";
        assert!(refusal(kilometers).contains("kilometers"));
    }

    #[test]
    fn invalid_maps_are_rejected() {
        assert!(refusal("name = \"empty\"").contains("at least one edge"));
        assert!(refusal("edge = []").contains("at least one edge"));
        let point =
            "edge = [{ from_m = [0, 0, 0], to_m = [1, 0, 0] }, { from_m = [2, 0, 0], to_m = [2, 0, 0] }]";
        assert!(refusal(point).contains("an edge needs two distinct ends"));
        let twice =
            "edge = [{ from_m = [0, 0, 0], to_m = [1, 0, 0] }, { from_m = [1, 0, 0], to_m = [0, 0, 0] }]";
        assert!(refusal(twice).contains("duplicates edge[0]"));
        for number in ["nan", "inf", "1e300"] {
            let text = format!("edge = [{{ from_m = [0, 0, 0], to_m = [{number}, 0, 0] }}]");
            assert!(WireFrame::from_toml(&text).is_err(), "{number}");
        }
        assert!(refusal("edge = [{ form_m = [0, 0, 0], to_m = [1, 0, 0] }]").contains("from_m"));
        let wall = format!("{DOOR}\n").replace("to_m = [6, 1] }", "to_m = [0, 1] }");
        assert!(refusal(&wall).contains("a wall needs two distinct ends"));
        assert!(matches!(WireFrame::read(Path::new("no/such.toml")), Err(FileError::Unreadable { .. })));
    }

    #[test]
    fn walls_block_lines() {
        let map = WireFrame::from_toml(DOOR).unwrap();
        let point = Point2::new;
        assert!(!map.is_open(point(3.0, 0.0), point(3.0, 2.0)));
        assert!(map.is_open(point(3.0, 0.0), point(3.0, 0.9)));
        assert!(map.is_open(point(6.5, 0.0), point(6.5, 2.0)));
        assert!(map.is_open(point(0.0, 1.0), point(6.0, 1.0)), "along the wall");
        assert!((map.clearance(point(3.0, 0.4)) - 0.6).abs() < 1e-12);
        assert!((map.clearance(point(7.0, 1.0)) - 1.0).abs() < 1e-12);
        assert_eq!(WireFrame::default().clearance(point(0.0, 0.0)), f64::INFINITY);
    }
}
