//! Grids of corners, as they were found: what is kept of one, and whether it is a board.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::homography::{apply, homography};
use super::saddle_points::SaddlePoint;

/// Share of a border row that must be in view; a sparser one is not part of the grid.
const MIN_ROW: f64 = 0.4;
/// Mean distance of the corners of a grid from their places, as a share of their distance from each other, above which it is none.
const MAX_IRREGULARITY: f64 = 0.08;

/// Grid of corners: position on the grid to index among the saddle points.
pub type Nodes = BTreeMap<[i32; 2], usize>;

/// Removes border rows of which few corners are in view, such as a stray point beside the board.
pub fn trimmed(mut nodes: Nodes) -> Nodes {
    loop {
        if nodes.is_empty() {
            return nodes;
        }
        let (low, high) = bounds(&nodes);
        let sparse = [0, 1].into_iter().find_map(|axis| {
            let length = f64::from(high[1 - axis] - low[1 - axis] + 1);
            let count = |value: i32| nodes.keys().filter(|node| node[axis] == value).count() as f64;
            [low[axis], high[axis]]
                .into_iter()
                .find(|value| count(*value) < MIN_ROW * length)
                .map(|value| (axis, value))
        });
        let Some((axis, value)) = sparse else { return nodes };
        nodes.retain(|node, _| node[axis] != value);
    }
}

/// Returns true if the points of a grid lie on a plane at equal distances, but for the distortion of a lens. Grids in noise do not.
pub fn is_regular(nodes: &Nodes, points: &[SaddlePoint]) -> bool {
    let on_grid: Vec<Vector2<f64>> = nodes.keys().map(|node| Vector2::from(node.map(f64::from))).collect();
    let at: Vec<Vector2<f64>> = nodes.values().map(|&index| points[index].at).collect();
    let Some(image_from_grid) = homography(&on_grid, &at) else { return false };
    let spacing = |node: Vector2<f64>| {
        let side = |step: Vector2<f64>| {
            (apply(&image_from_grid, node + step) - apply(&image_from_grid, node)).norm()
        };
        side(Vector2::x()).min(side(Vector2::y()))
    };
    let off = |(node, at): (&Vector2<f64>, &Vector2<f64>)| {
        (apply(&image_from_grid, *node) - at).norm() / spacing(*node)
    };
    let mean = on_grid.iter().zip(&at).map(off).sum::<f64>() / at.len() as f64;
    mean < MAX_IRREGULARITY
}

/// Lowest and highest positions on a grid.
pub fn bounds(nodes: &Nodes) -> ([i32; 2], [i32; 2]) {
    let start = ([i32::MAX; 2], [i32::MIN; 2]);
    nodes.keys().fold(start, |(low, high), node| {
        ([low[0].min(node[0]), low[1].min(node[1])], [high[0].max(node[0]), high[1].max(node[1])])
    })
}

/// Numbers of corners along the longer and the shorter side of a grid.
pub fn sides(nodes: &Nodes) -> [usize; 2] {
    if nodes.is_empty() {
        return [0; 2];
    }
    let (low, high) = bounds(nodes);
    let [a, b] = [0, 1].map(|axis| (high[axis] - low[axis] + 1) as usize);
    [a.max(b), a.min(b)]
}
