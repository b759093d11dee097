use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::adjacency::AdjacencyTable;
use super::triangulation::Triangulated;

/// What is known of what may stand between two edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceState {
    /// Not tested.
    #[default]
    Unknown,
    /// Something stands there.
    Solid,
    /// A passage.
    Empty,
    /// Something stands in front of it.
    Nearer,
}

/// A surface that may stand between two neighboring edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Numbers of the right and of the left edge.
    pub edges: [u32; 2],
    /// Their positions.
    pub ends: [Point2<f64>; 2],
}

/// What may be a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceRule {
    /// In how many pictures its edges were neighbors, at least.
    pub min_frames: u32,
    /// Largest standard deviation of its edges, meters.
    pub max_sigma_m: f64,
    /// Least width, meters.
    pub min_width_m: f64,
}

impl Default for SurfaceRule {
    fn default() -> Self {
        Self { min_frames: 3, max_sigma_m: 0.15, min_width_m: 0.05 }
    }
}

/// Writes to `out` the pairs of edges that nothing was seen between.
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
