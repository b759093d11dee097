//! Hypotheses of a corridor's vanishing point: peaks of the votes, refined and scored.

use super::picture::{Picture, WIDTH};
use super::scene_lines::MAX_VOTERS;
use super::support;
use crate::vanishing_point::pair_votes::{Grid, PairVotes};
use crate::vanishing_point::{RefineRule, VotingLine, refine};
use nalgebra::{Matrix2, Vector2};

/// Size of a cell, px.
const CELL_PX: f64 = 8.0;
/// Number of peaks that are refined.
pub const MAX_HYPOTHESES: usize = 8;
/// Cells around a peak, to each side, in which no other peak is taken.
const PEAK_RADIUS: usize = 3;
/// Distance below which two refined points are one, px.
const SAME_POINT_PX: f64 = 5.0;

/// Parameters of the refinement.
pub const REFINE: RefineRule = RefineRule {
    sigma_end_px: 0.5,
    sigma_floor_px: 2.0,
    gate_min_px: 2.0,
    first_gate_px: 8.0,
    min_eigen_ratio: 1e-3,
    step_px: 1e-3,
    max_rounds: 20,
};

/// Point at which lines meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis {
    /// Position, pixels of an image 640 px wide.
    pub point: Vector2<f64>,
    /// Covariance of the position, px^2.
    pub covariance: Matrix2<f64>,
    /// Supporting length, px, reduced if the supporters are nearly parallel.
    pub score: f64,
}

/// Finds hypotheses, without a presumed horizon or center. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct HypothesisSearch {
    votes: PairVotes,
    cells: Vec<f32>,
    scratch: Vec<f32>,
    row_best: Vec<f32>,
    near: Vec<VotingLine>,
    inliers: Vec<usize>,
    kappas: Vec<f64>,
    found: Vec<Hypothesis>,
}

impl HypothesisSearch {
    /// Finds at most [`MAX_HYPOTHESES`] points at which `voters` meet, in the order of their votes.
    pub fn find(&mut self, voters: &[VotingLine], picture: &Picture) -> &[Hypothesis] {
        self.found.clear();
        self.found.reserve(MAX_HYPOTHESES);
        self.near.reserve(MAX_VOTERS.saturating_sub(self.near.len()));
        self.inliers.reserve(MAX_VOTERS.saturating_sub(self.inliers.len()));
        self.kappas.reserve(MAX_VOTERS.saturating_sub(self.kappas.len()));
        if voters.len() < 2 {
            return &self.found;
        }
        let grid = grid(picture);
        self.votes.cast(voters, grid, &mut self.cells);
        self.cells.truncate(grid.count());
        for _ in 0..2 {
            smooth(&mut self.cells, &mut self.scratch, grid.columns);
        }
        self.row_best.clear();
        self.row_best.extend(self.cells.chunks_exact(grid.columns).map(largest));
        for _ in 0..MAX_HYPOTHESES {
            let Some(peak) = self.take_peak(&grid) else { break };
            let Some(found) = self.hypothesis(voters, peak) else { continue };
            let is_new = |other: &Hypothesis| (other.point - found.point).norm() >= SAME_POINT_PX;
            if self.found.iter().all(is_new) {
                self.found.push(found);
            }
        }
        &self.found
    }

    /// Hypotheses of the last search.
    #[must_use]
    pub fn found(&self) -> &[Hypothesis] {
        &self.found
    }

    /// Refines a point and scores it; `None` if fewer than two lines meet there or if they are nearly parallel.
    pub fn hypothesis(&mut self, voters: &[VotingLine], start: Vector2<f64>) -> Option<Hypothesis> {
        self.near.clear();
        self.near.extend(voters.iter().filter(|line| !line.straddles(start)));
        let refined = refine(&self.near, start, &REFINE, &mut self.inliers).ok()?;
        support::kappas(voters, refined.pixel, &mut self.kappas);
        let score = support::score(voters, &self.kappas);
        Some(Hypothesis { point: refined.pixel, covariance: refined.covariance, score })
    }

    /// Takes the center of the strongest cell and clears the cells around it; `None` without a vote.
    fn take_peak(&mut self, grid: &Grid) -> Option<Vector2<f64>> {
        let best = largest(&self.row_best);
        if best <= 0.0 {
            return None;
        }
        let row = self.row_best.iter().position(|&votes| votes == best)?;
        let column = self.cells[row * grid.columns..].iter().position(|&votes| votes == best)?;
        let columns = column.saturating_sub(PEAK_RADIUS)..(column + PEAK_RADIUS + 1).min(grid.columns);
        for row in row.saturating_sub(PEAK_RADIUS)..(row + PEAK_RADIUS + 1).min(grid.rows) {
            let cells = &mut self.cells[row * grid.columns..][..grid.columns];
            cells[columns.clone()].fill(0.0);
            self.row_best[row] = largest(cells);
        }
        let cell = Vector2::new(column as f64 + 0.5, row as f64 + 0.5);
        Some(grid.origin.map(f64::from) + cell * CELL_PX)
    }
}

/// Returns the grid over twice the width and the height of the image.
fn grid(picture: &Picture) -> Grid {
    Grid {
        origin: Vector2::new(-0.5 * WIDTH, -0.5 * picture.height).map(|value| value as f32),
        cell: Vector2::repeat(CELL_PX as f32),
        columns: (2.0 * WIDTH / CELL_PX) as usize,
        rows: (2.0 * picture.height / CELL_PX) as usize,
    }
}

fn largest(cells: &[f32]) -> f32 {
    let (lanes, rest) = cells.as_chunks::<8>();
    let mut best = [0.0_f32; 8];
    for lane in lanes {
        for (best, &votes) in best.iter_mut().zip(lane) {
            *best = if votes > *best { votes } else { *best };
        }
    }
    best.iter().chain(rest).fold(0.0, |best, &votes| if votes > best { votes } else { best })
}

/// Smooths the grid by (1 2 1)/4 in both directions. Cells outside count as zero.
fn smooth(cells: &mut [f32], scratch: &mut Vec<f32>, columns: usize) {
    let rows = cells.len() / columns;
    scratch.clear();
    scratch.resize(cells.len(), 0.0);
    for (row, out) in scratch.chunks_exact_mut(columns).enumerate() {
        let of = |row: usize| &cells[row * columns..][..columns];
        for (out, &here) in out.iter_mut().zip(of(row)) {
            *out = 0.5 * here;
        }
        for near in [row.checked_sub(1), Some(row + 1).filter(|&next| next < rows)].into_iter().flatten() {
            for (out, &near) in out.iter_mut().zip(of(near)) {
                *out += 0.25 * near;
            }
        }
    }
    for (out, from) in cells.chunks_exact_mut(columns).zip(scratch.chunks_exact(columns)) {
        let last = columns - 1;
        for (out, near) in out[1..].iter_mut().zip(from.windows(3)) {
            *out = 0.25 * near[0] + 0.5 * near[1] + 0.25 * near[2];
        }
        out[0] = 0.5 * from[0] + 0.25 * from[1];
        out[last] = 0.25 * from[last - 1] + 0.5 * from[last];
    }
}
