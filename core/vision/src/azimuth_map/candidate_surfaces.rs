use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adjacency::AdjacencyTable;
use super::triangulation::Triangulated;

/// State of the space between two edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceState {
    /// Not tested.
    #[default]
    Unknown,
    /// A surface connects the edges.
    Solid,
    /// Open passage.
    Empty,
    /// An object in front hides it.
    Nearer,
}

/// Potential surface between two adjacent edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Numbers of the right and the left edge.
    pub edges: [u32; 2],
    /// Positions of the right and the left edge, map frame, m.
    pub ends: [Point2<f64>; 2],
}

/// Criteria for candidate surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceRule {
    /// Minimum number of frames in which the edges were adjacent.
    pub min_frames: u32,
    /// Maximum standard deviation of an edge's position, m.
    pub max_sigma_m: f64,
    /// Minimum width, m.
    pub min_width_m: f64,
}

impl Default for SurfaceRule {
    fn default() -> Self {
        Self { min_frames: 3, max_sigma_m: 0.15, min_width_m: 0.05 }
    }
}

/// Writes to `out` the adjacent pairs of located edges with no other edge observed between them.
pub fn candidate_surfaces(
    table: &AdjacencyTable,
    located: impl Fn(u32) -> Option<Triangulated>,
    rule: &SurfaceRule,
    out: &mut Vec<Surface>,
) {
    out.clear();
    let end = |number: u32| located(number).filter(|edge| edge.sigma_m() <= rule.max_sigma_m);
    for pair in table.pairs().iter().filter(|pair| pair.frames >= rule.min_frames && !pair.is_broken) {
        if let (Some(right), Some(left)) = (end(pair.right), end(pair.left)) {
            let ends = [right.position, left.position];
            if (ends[1] - ends[0]).norm() >= rule.min_width_m {
                out.push(Surface { edges: [pair.right, pair.left], ends });
            }
        }
    }
}
