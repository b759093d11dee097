//! A building as the edges that a camera can see and the walls that hide them.

use std::path::Path;

use nalgebra::{Point2, Point3, Vector2};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use yamabico_parameters::{BuildError, FileKind, Problems};

/// Map files, as behaviors name them: the ranges are in the schema, the rules tell what makes no building.
pub const WIRE_FRAME_FILE: FileKind = FileKind {
    key: "map",
    what: "a map file",
    schema: || schema_for!(MapFile),
    rules: |table| match table.clone().try_into::<MapFile>() {
        Ok(file) => file.rules(),
        Err(error) => vec![BuildError::new("", error.message())],
    },
};

/// Larger than this (m) is no building, but millimeters.
const LARGEST_M: f64 = 1000.0;
/// Smaller than this (m) is no building either.
const SMALLEST_M: f64 = 0.1;
/// Shorter edges and walls (m) have no direction.
const SHORTEST_M: f64 = 0.001;
/// An edge is upright or level where its ends differ by no more (m) in plan or in height.
const LEVEL_M: f64 = 0.001;

/// A building: edges in space and walls in plan, both in the map frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WireFrame {
    edges: Vec<Edge>,
    walls: Vec<Wall>,
}

/// A straight edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// One end, meters, map frame.
    pub from: Point3<f64>,
    /// The other end.
    pub to: Point3<f64>,
    /// Its direction in space.
    pub kind: EdgeKind,
    /// How well it is seen.
    pub role: EdgeRole,
}

/// How well an edge is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeRole {
    /// It stands out, also from afar.
    #[default]
    Outline,
    /// It runs beside an outline, such as the inner edges of a door frame, and from afar cannot be told from it.
    Detail,
}

/// Which way an edge runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// Upright.
    Vertical,
    /// Level.
    Horizontal,
    /// Neither.
    Other,
}

/// A wall in plan, from floor to ceiling: nothing is seen through it, and nobody walks through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, meters, map frame.
    pub from: Point2<f64>,
    /// The other end.
    pub to: Point2<f64>,
}

/// Why there is no map.
#[derive(Debug, Error)]
pub enum MapError {
    /// The file cannot be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// Something in it is wrong; every mistake with its line.
    #[error("{0}")]
    Wrong(#[from] Problems),
}

impl Edge {
    /// The outline between two points, map frame, meters.
    #[must_use]
    pub fn between(from: Point3<f64>, to: Point3<f64>) -> Self {
        let run = to - from;
        let kind = if run.xy().norm() <= LEVEL_M {
            EdgeKind::Vertical
        } else if run.z.abs() <= LEVEL_M {
            EdgeKind::Horizontal
        } else {
            EdgeKind::Other
        };
        Self { from, to, kind, role: EdgeRole::Outline }
    }

    /// The same edge as a detail beside an outline.
    #[must_use]
    pub fn detail(self) -> Self {
        Self { role: EdgeRole::Detail, ..self }
    }

    /// Distance between its ends, meters.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.to - self.from).norm()
    }
}

impl Wall {
    /// Whether the straight way from `start` to `end` crosses it (touching counts).
    #[must_use]
    pub fn is_crossed_by(&self, start: Point2<f64>, end: Point2<f64>) -> bool {
        let (way, wall) = (end - start, self.to - self.from);
        let cross = way.perp(&wall);
        if cross.abs() <= f64::EPSILON * way.norm() * wall.norm() {
            return false;
        }
        let between = self.from - start;
        let (t, s) = (between.perp(&wall) / cross, between.perp(&way) / cross);
        (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&s)
    }

    /// Distance of a point from it, meters, never negative.
    #[must_use]
    pub fn distance(&self, point: Point2<f64>) -> f64 {
        let wall = self.to - self.from;
        let along = ((point - self.from).dot(&wall) / wall.norm_squared()).clamp(0.0, 1.0);
        (point - self.from - wall * along).norm()
    }
}

impl WireFrame {
    /// A map of these edges and walls, which are taken as they are; [`WireFrame::from_toml`] is the way that checks.
    #[must_use]
    pub fn new(edges: Vec<Edge>, walls: Vec<Wall>) -> Self {
        Self { edges, walls }
    }

    /// Reads and checks a map file.
    ///
    /// # Errors
    /// A file that cannot be read, or everything that is wrong in it.
    pub fn read(path: &Path) -> Result<Self, MapError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|error| MapError::Unreadable { path: name.clone(), reason: error.to_string() })?;
        Ok(Self::parse(&name, &text)?)
    }

    /// Reads and checks a map file's text.
    ///
    /// # Errors
    /// Everything that is wrong in it, with its place.
    pub fn from_toml(text: &str) -> Result<Self, Problems> {
        Self::parse("the map", text)
    }

    /// Its text as a map file, numbers to the millimeter, without a comment.
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

    /// The edges.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The walls.
    #[must_use]
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// Whether the straight way from `start` to `end` crosses no wall.
    #[must_use]
    pub fn is_open(&self, start: Point2<f64>, end: Point2<f64>) -> bool {
        !self.walls.iter().any(|wall| wall.is_crossed_by(start, end))
    }

    /// Distance from a point to the nearest wall, meters; infinite without walls.
    #[must_use]
    pub fn clearance(&self, point: Point2<f64>) -> f64 {
        self.walls.iter().map(|wall| wall.distance(point)).fold(f64::INFINITY, f64::min)
    }

    fn parse(name: &str, text: &str) -> Result<Self, Problems> {
        let table = WIRE_FRAME_FILE.read(name, text)?;
        let file: MapFile = table.try_into().unwrap_or_default();
        let point = Point3::from;
        Ok(Self {
            edges: file
                .edges
                .iter()
                .map(|e| Edge { role: e.role, ..Edge::between(point(e.from_m), point(e.to_m)) })
                .collect(),
            walls: file
                .walls
                .iter()
                .map(|w| Wall { from: Point2::from(w.from_m), to: Point2::from(w.to_m) })
                .collect(),
        })
    }
}

/// What a map file says: meters, map frame, x forward, y left, z up from the floor.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct MapFile {
    /// Name for people; may be empty.
    name: String,
    /// Edges that a camera can see.
    #[serde(rename = "edge")]
    #[schemars(length(max = 20_000))]
    edges: Vec<EdgeEntry>,
    /// Walls in plan, which hide what is behind them.
    #[serde(rename = "wall")]
    #[schemars(length(max = 20_000))]
    walls: Vec<WallEntry>,
}

/// A straight edge.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct EdgeEntry {
    /// One end: x, y, z, meters, each -1000000 to 1000000.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    from_m: [f64; 3],
    /// The other end: x, y, z, meters, each -1000000 to 1000000.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    to_m: [f64; 3],
    /// How well it is seen, default outline.
    #[serde(default)]
    role: EdgeRole,
}

/// A wall.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct WallEntry {
    /// One end: x, y, meters, each -1000000 to 1000000.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    from_m: [f64; 2],
    /// The other end: x, y, meters, each -1000000 to 1000000.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    to_m: [f64; 2],
}

impl MapFile {
    fn rules(&self) -> Vec<BuildError> {
        if self.edges.is_empty() {
            return vec![BuildError::new("edge", "is missing: a map needs at least one edge to see")];
        }
        let mut broken = Vec::new();
        let extent = self.extent();
        if extent > LARGEST_M {
            broken.push(BuildError::new(
                "edge",
                format!("extends over {extent:.0} m, and a building over at most {LARGEST_M} m: are these millimeters?"),
            ));
        } else if extent < SMALLEST_M {
            broken.push(BuildError::new(
                "edge",
                format!(
                    "extends over {extent} m only, and a building over more than {SMALLEST_M} m: are these kilometers?"
                ),
            ));
        }
        let mut seen = std::collections::HashMap::new();
        for (i, edge) in self.edges.iter().enumerate() {
            let (from, to) = (Point3::from(edge.from_m), Point3::from(edge.to_m));
            if (to - from).norm() < SHORTEST_M {
                broken.push(BuildError::new(format!("edge[{i}].to_m"), "is where the edge begins"));
            }
            if let Some(other) = seen.insert(ends_in_millimeters(&edge.from_m, &edge.to_m), i) {
                broken.push(BuildError::new(format!("edge[{i}]"), format!("is the same as edge[{other}]")));
            }
        }
        for (i, wall) in self.walls.iter().enumerate() {
            if (Vector2::from(wall.to_m) - Vector2::from(wall.from_m)).norm() < SHORTEST_M {
                broken.push(BuildError::new(format!("wall[{i}].to_m"), "is where the wall begins"));
            }
        }
        broken
    }

    /// The largest extent along an axis, meters.
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

/// Both ends in whole millimeters, the smaller one first.
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
    fn edges_know_their_direction() {
        let map = WireFrame::from_toml(DOOR).unwrap();
        let kinds: Vec<EdgeKind> = map.edges().iter().map(|edge| edge.kind).collect();
        assert_eq!(kinds, [EdgeKind::Vertical, EdgeKind::Horizontal, EdgeKind::Other]);
        assert_eq!(map.walls().len(), 1);
    }

    #[test]
    fn what_is_written_is_read_again() {
        let map = WireFrame::from_toml(DOOR).unwrap();
        assert_eq!(WireFrame::from_toml(&map.to_toml()).unwrap(), map);
    }

    #[test]
    fn wrong_units_are_told() {
        let millimeters = "edge = [{ from_m = [0, 0, 0], to_m = [18000, 0, 0] }]";
        assert!(refusal(millimeters).contains("millimeters"));
        let kilometers = "edge = [{ from_m = [0, 0, 0], to_m = [0.018, 0, 0] }]";
        assert!(refusal(kilometers).contains("kilometers"));
    }

    #[test]
    fn nonsense_is_refused_with_its_place() {
        assert!(refusal("name = \"empty\"").contains("at least one edge"));
        assert!(refusal("edge = []").contains("at least one edge"));
        let point =
            "edge = [{ from_m = [0, 0, 0], to_m = [1, 0, 0] }, { from_m = [2, 0, 0], to_m = [2, 0, 0] }]";
        assert!(refusal(point).contains("where the edge begins"));
        let twice =
            "edge = [{ from_m = [0, 0, 0], to_m = [1, 0, 0] }, { from_m = [1, 0, 0], to_m = [0, 0, 0] }]";
        assert!(refusal(twice).contains("the same as edge[0]"));
        for number in ["nan", "inf", "1e300"] {
            let text = format!("edge = [{{ from_m = [0, 0, 0], to_m = [{number}, 0, 0] }}]");
            assert!(WireFrame::from_toml(&text).is_err(), "{number}");
        }
        assert!(refusal("edge = [{ form_m = [0, 0, 0], to_m = [1, 0, 0] }]").contains("from_m"));
        let wall = format!("{DOOR}\n").replace("to_m = [6, 1] }", "to_m = [0, 1] }");
        assert!(refusal(&wall).contains("where the wall begins"));
        assert!(matches!(WireFrame::read(Path::new("no/such.toml")), Err(MapError::Unreadable { .. })));
    }

    #[test]
    fn walls_stop_ways() {
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
