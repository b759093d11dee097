//! Coarse search: intersections of pairs of lines vote on a grid.

use super::lines::VotingLine;
use super::pair_votes::{Grid, PairVotes};
use nalgebra::Vector2;
use yamabico_geometry::camera::Intrinsics;

/// Number of columns of the grid.
const COLUMNS: usize = 160;
/// Number of rows of the grid.
const ROWS: usize = 90;

/// Vote grid over twice the width and 1.5 times the height of the image, 160 x 90 cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Votes {
    /// Votes, with one more cell at the end for intersections outside the grid.
    cells: Vec<f32>,
    smooth: Vec<f32>,
    pairs: PairVotes,
}

impl Votes {
    /// Accumulates the votes of all pairs of `lines`.
    pub(super) fn cast(&mut self, lines: &[VotingLine], camera: &Intrinsics) {
        self.pairs.cast(lines, grid(camera), &mut self.cells);
        self.blur();
    }

    /// Fills `peaks` with the centers (px) of the strongest cells, at most `count`, strongest first, none within
    /// `radius` cells of a stronger one.
    pub(super) fn peaks(
        &mut self,
        camera: &Intrinsics,
        count: usize,
        radius: usize,
        peaks: &mut Vec<Vector2<f64>>,
    ) {
        peaks.clear();
        let grid = grid(camera);
        let mut row_best: [f32; ROWS] = std::array::from_fn(|row| self.best_of_row(row));
        while peaks.len() < count {
            let (row, best) = row_best
                .iter()
                .enumerate()
                .fold((0, 0.0), |best, (row, &votes)| if votes > best.1 { (row, votes) } else { best });
            let cells = &self.smooth[row * COLUMNS..][..COLUMNS];
            let Some(column) = cells.iter().position(|&votes| votes == best && votes > 0.0) else { break };
            peaks.push(self.center_of_mass((column, row), &grid));
            // Suppresses the neighborhood of the peak by making it negative.
            let columns = column.saturating_sub(radius)..(column + radius + 1).min(COLUMNS);
            let rows = row.saturating_sub(radius)..(row + radius + 1).min(ROWS);
            for (row, best) in rows.clone().zip(&mut row_best[rows]) {
                for votes in &mut self.smooth[row * COLUMNS..][columns.clone()] {
                    *votes = -votes.abs();
                }
                *best = self.best_of_row(row);
            }
        }
    }

    fn best_of_row(&self, row: usize) -> f32 {
        let (lanes, _) = self.smooth[row * COLUMNS..][..COLUMNS].as_chunks::<8>();
        let mut best = [0.0_f32; 8];
        for lane in lanes {
            for (best, &votes) in best.iter_mut().zip(lane) {
                *best = if votes > *best { votes } else { *best };
            }
        }
        best.into_iter().fold(0.0, f32::max)
    }

    /// Centroid of the votes in the 3x3 cells around `cell`, px.
    fn center_of_mass(&self, cell: (usize, usize), grid: &Grid) -> Vector2<f64> {
        let mut sum = Vector2::zeros();
        let mut total = 0.0;
        for row in cell.1.saturating_sub(1)..(cell.1 + 2).min(ROWS) {
            for column in cell.0.saturating_sub(1)..(cell.0 + 2).min(COLUMNS) {
                let votes = self.smooth[row * COLUMNS + column].abs();
                sum += Vector2::new(column as f32 + 0.5, row as f32 + 0.5) * votes;
                total += votes;
            }
        }
        (grid.origin + (sum / total).component_mul(&grid.cell)).map(f64::from)
    }

    /// Smooths the grid by (1 2 1) in both directions.
    fn blur(&mut self) {
        self.smooth.resize(COLUMNS * ROWS, 0.0);
        for row in 0..ROWS {
            let (above, below) = (row.saturating_sub(1), (row + 1).min(ROWS - 1));
            let [a, b, c] = [above, row, below].map(|row| &self.cells[row * COLUMNS..][..COLUMNS]);
            let out = &mut self.smooth[row * COLUMNS..][..COLUMNS];
            for (u, out) in out.iter_mut().enumerate().take(COLUMNS - 1).skip(1) {
                let sum = |u: usize| a[u] + 2.0 * b[u] + c[u];
                *out = sum(u - 1) + 2.0 * sum(u) + sum(u + 1);
            }
        }
    }
}

fn grid(camera: &Intrinsics) -> Grid {
    let (width, height) = (camera.width as f32, camera.height as f32);
    Grid {
        origin: Vector2::new(-0.5 * width, -0.25 * height),
        cell: Vector2::new(2.0 * width / COLUMNS as f32, 1.5 * height / ROWS as f32),
        columns: COLUMNS,
        rows: ROWS,
    }
}
