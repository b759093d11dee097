//! Growth of a grid of corners from a seed: neighbors lie where those before them predict them.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::grid_nodes::Nodes;
use super::saddle_points::SaddlePoint;

/// Maximum distance of a corner from its prediction, as a share of the distance to its neighbor.
const MAX_OFF: f64 = 0.3;
/// Minimum cosine between the lines of neighbors.
const MIN_COSINE: f64 = 0.85;
/// Smallest ratio of the contrasts of neighbors.
const MIN_CONTRAST_RATIO: f64 = 0.3;

/// Grows grids among saddle points.
#[derive(Clone, Debug)]
pub struct CornerGrid<'a> {
    points: &'a [SaddlePoint],
    /// Points by cells of the image.
    cells: BTreeMap<[i32; 2], Vec<usize>>,
}

/// Side of a cell of the image, px.
const CELL_PX: f64 = 16.0;
/// Number of points near the seed that are tried as its first neighbors along each line.
const MAX_FIRST: usize = 3;

impl<'a> CornerGrid<'a> {
    /// Sorts the points into cells.
    #[must_use]
    pub fn new(points: &'a [SaddlePoint]) -> Self {
        let mut cells: BTreeMap<[i32; 2], Vec<usize>> = BTreeMap::new();
        for (index, point) in points.iter().enumerate() {
            cells.entry(cell(point.at)).or_default().push(index);
        }
        Self { points, cells }
    }

    /// Grows the grid of the point `seed`, among points of which `is_free` holds.
    #[must_use]
    pub fn grow(&self, seed: usize, is_free: &dyn Fn(usize) -> bool) -> Nodes {
        let lines = self.points[seed].lines;
        let mut best = Nodes::from([([0, 0], seed)]);
        for right in self.along(seed, lines[0], is_free) {
            for down in self.along(seed, lines[1], is_free) {
                let at = |index: usize| self.points[index].at;
                let spacing = (at(right) - at(seed)).norm().min((at(down) - at(seed)).norm());
                let predicted = at(right) + at(down) - at(seed);
                let Some(last) = self.nearest(predicted, MAX_OFF * spacing, right, is_free) else { continue };
                if [seed, right, down].contains(&last) || right == down {
                    continue;
                }
                let mut nodes =
                    Nodes::from([([0, 0], seed), ([1, 0], right), ([0, 1], down), ([1, 1], last)]);
                self.extend(&mut nodes, is_free);
                if nodes.len() > best.len() {
                    best = nodes;
                }
            }
        }
        best
    }

    /// Extends a grid by all neighbors that lie where they are predicted.
    fn extend(&self, nodes: &mut Nodes, is_free: &dyn Fn(usize) -> bool) {
        let mut open: Vec<[i32; 2]> = nodes.keys().copied().collect();
        let mut taken: std::collections::BTreeSet<usize> = nodes.values().copied().collect();
        while let Some(from) = open.pop() {
            for step in [[1, 0], [-1, 0], [0, 1], [0, -1]] {
                let to = add(from, step);
                if nodes.contains_key(&to) {
                    continue;
                }
                let Some((predicted, spacing)) = self.predict(nodes, from, step) else { continue };
                let is_new = |index: usize| is_free(index) && !taken.contains(&index);
                if let Some(found) = self.nearest(predicted, MAX_OFF * spacing, nodes[&from], &is_new) {
                    nodes.insert(to, found);
                    taken.insert(found);
                    open.push(to);
                    // Corners that could not be predicted before may be now.
                    open.push(from);
                }
            }
        }
    }

    /// Predicts the neighbor of the node `from` in the direction `step`, with the distance between them, px: by the row behind it, else
    /// by the parallel row beside it.
    #[must_use]
    pub fn predict(&self, nodes: &Nodes, from: [i32; 2], step: [i32; 2]) -> Option<(Vector2<f64>, f64)> {
        let at = |node: [i32; 2]| nodes.get(&node).map(|&index| self.points[index].at);
        let here = at(from)?;
        let back = [-step[0], -step[1]];
        if let Some(behind) = at(add(from, back)) {
            let stride = here - behind;
            let bend =
                at(add(add(from, back), back)).map_or(Vector2::zeros(), |far| here - 2.0 * behind + far);
            // A board in perspective changes its stride by a constant ratio at most; larger bends are errors.
            let bend = if bend.norm() < 0.3 * stride.norm() { bend } else { Vector2::zeros() };
            return Some((here + stride + bend, stride.norm()));
        }
        let side = [step[1], step[0]];
        [side, [-side[0], -side[1]]].into_iter().find_map(|side| {
            let beside = add(from, side);
            let stride = at(add(beside, step))? - at(beside)?;
            Some((here + stride, stride.norm()))
        })
    }

    /// Points nearest to `from` along its line, to both sides, nearest first.
    fn along(&self, from: usize, line: Vector2<f64>, is_free: &dyn Fn(usize) -> bool) -> Vec<usize> {
        let here = &self.points[from];
        let mut near: Vec<(f64, usize)> = Vec::new();
        for (index, point) in self.points.iter().enumerate() {
            let offset = point.at - here.at;
            let distance = offset.norm();
            let is_along = distance > 3.0 && offset.dot(&line).abs() > 0.95 * distance;
            if index != from && is_along && is_free(index) && are_neighbors(here, point) {
                near.push((distance, index));
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(MAX_FIRST);
        near.into_iter().map(|(_, index)| index).collect()
    }

    /// Point nearest to a predicted position that may be the neighbor of the point `of`.
    fn nearest(
        &self,
        predicted: Vector2<f64>,
        radius: f64,
        of: usize,
        is_free: &dyn Fn(usize) -> bool,
    ) -> Option<usize> {
        let radius = radius.max(2.0);
        let (low, high) = (cell(predicted.add_scalar(-radius)), cell(predicted.add_scalar(radius)));
        let mut best: Option<(f64, usize)> = None;
        // A prediction far outside of the image has no cells to visit.
        if high[0] - low[0] > 200 || high[1] - low[1] > 200 {
            return None;
        }
        for row in low[1]..=high[1] {
            for column in low[0]..=high[0] {
                for &index in self.cells.get(&[column, row]).into_iter().flatten() {
                    let distance = (self.points[index].at - predicted).norm();
                    let is_nearer = distance <= radius && best.is_none_or(|(least, _)| distance < least);
                    if is_nearer && is_free(index) && are_neighbors(&self.points[of], &self.points[index]) {
                        best = Some((distance, index));
                    }
                }
            }
        }
        best.map(|(_, index)| index)
    }
}

/// Returns true if the lines of two points agree, and their contrasts.
fn are_like(a: &SaddlePoint, b: &SaddlePoint) -> bool {
    let best = |line: Vector2<f64>| line.dot(&b.lines[0]).abs().max(line.dot(&b.lines[1]).abs());
    let ratio = a.contrast.min(b.contrast) / a.contrast.max(b.contrast);
    ratio > MIN_CONTRAST_RATIO && a.lines.iter().all(|line| best(*line) > MIN_COSINE)
}

/// Returns true if two points may be joined by the side of a square: black and white are exchanged.
fn are_neighbors(a: &SaddlePoint, b: &SaddlePoint) -> bool {
    // The lines of `b` may be in the other order, which exchanges black and white once more.
    let is_same_order = a.lines[0].dot(&b.lines[0]).abs() > a.lines[0].dot(&b.lines[1]).abs();
    let is_exchanged = (a.is_dark_between == b.is_dark_between) != is_same_order;
    is_exchanged && are_like(a, b)
}

fn add(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn cell(at: Vector2<f64>) -> [i32; 2] {
    [at.x, at.y].map(|value| (value / CELL_PX).floor().clamp(-1e6, 1e6) as i32)
}
