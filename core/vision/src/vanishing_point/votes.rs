//! Coarse search: intersections of pairs of lines vote on a grid.

use super::lines::VotingLine;
use crate::vectorize::{self, Kernel};
use nalgebra::Vector2;
use yamabico_geometry::camera::Intrinsics;

/// Number of columns of the grid.
const COLUMNS: usize = 160;
/// Number of rows of the grid.
const ROWS: usize = 90;
/// Sine of the minimum angle between two lines whose intersection votes.
const MIN_CROSSING_SINE: f32 = 0.05;

/// Vote grid over twice the width and 1.5 times the height of the image, 160 x 90 cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Votes {
    /// Votes, with one more cell at the end for intersections outside the grid.
    cells: Vec<f32>,
    smooth: Vec<f32>,
    voters: Voters,
    cell_of: Vec<u32>,
    vote_of: Vec<f32>,
}

/// Voting lines as structure of arrays.
#[derive(Clone, Debug, Default)]
struct Voters {
    normal_u: Vec<f32>,
    normal_v: Vec<f32>,
    rho: Vec<f32>,
    /// Position of the midpoint along the line.
    middle: Vec<f32>,
    half_length: Vec<f32>,
    weight: Vec<f32>,
}

/// Position of cell (0, 0) and size of a cell, px.
#[derive(Clone, Copy, Debug)]
struct Grid {
    origin: Vector2<f32>,
    cell: Vector2<f32>,
}

impl Votes {
    /// Accumulates the votes of all pairs of `lines`.
    ///
    /// Differs from Kweon et al. (1991), where each edge votes along its whole line: the sum over pairs at a cell is
    /// half the square of the sum over edges, so it has the same, sharper peak in a fifth of the time.
    pub(super) fn cast(&mut self, lines: &[VotingLine], camera: &Intrinsics) {
        self.cells.clear();
        self.cells.resize(COLUMNS * ROWS + 1, 0.0);
        self.cell_of.resize(lines.len(), 0);
        self.vote_of.resize(lines.len(), 0.0);
        self.voters.fill(lines);
        let grid = grid(camera);
        vectorize::run(Cast { votes: self, grid });
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

/// Accessor of one property of a line.
type Property = fn(&VotingLine) -> f64;

impl Voters {
    fn fill(&mut self, lines: &[VotingLine]) {
        let columns: [(&mut Vec<f32>, Property); 6] = [
            (&mut self.normal_u, |l| l.normal.x),
            (&mut self.normal_v, |l| l.normal.y),
            (&mut self.rho, |l| l.rho),
            (&mut self.middle, |l| l.normal.x * l.midpoint.y - l.normal.y * l.midpoint.x),
            (&mut self.half_length, |l| 0.5 * l.length),
            (&mut self.weight, |l| l.length),
        ];
        for (column, value) in columns {
            column.clear();
            column.extend(lines.iter().map(|line| value(line) as f32));
        }
    }
}

fn grid(camera: &Intrinsics) -> Grid {
    let (width, height) = (camera.width as f32, camera.height as f32);
    Grid {
        origin: Vector2::new(-0.5 * width, -0.25 * height),
        cell: Vector2::new(2.0 * width / COLUMNS as f32, 1.5 * height / ROWS as f32),
    }
}

struct Cast<'a> {
    votes: &'a mut Votes,
    grid: Grid,
}

impl Kernel for Cast<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { votes, grid } = self;
        let Votes { cells, voters, cell_of, vote_of, .. } = votes;
        let count = voters.rho.len();
        for i in 1..count {
            let (cell_of, vote_of) = (&mut cell_of[..i], &mut vote_of[..i]);
            cross(voters, i, &grid, cell_of, vote_of);
            for (&cell, &vote) in cell_of.iter().zip(vote_of.iter()) {
                if let Some(sum) = cells.get_mut(cell as usize) {
                    *sum += vote;
                }
            }
        }
    }
}

/// Computes cell and weight of the intersections of line `i` with all lines before it.
#[inline(always)]
fn cross(voters: &Voters, i: usize, grid: &Grid, cell_of: &mut [u32], vote_of: &mut [f32]) {
    let (normal_u, normal_v, rho) = (&voters.normal_u[..i], &voters.normal_v[..i], &voters.rho[..i]);
    let (middle, half, weight) = (&voters.middle[..i], &voters.half_length[..i], &voters.weight[..i]);
    let (iu, iv, irho, imiddle) = (voters.normal_u[i], voters.normal_v[i], voters.rho[i], voters.middle[i]);
    let (ihalf, iweight) = (voters.half_length[i], voters.weight[i]);
    let per_u = 1.0 / grid.cell.x;
    let per_v = 1.0 / grid.cell.y;
    let outside = (COLUMNS * ROWS) as f32;
    let (cell_of, vote_of) = (&mut cell_of[..i], &mut vote_of[..i]);
    for j in 0..i {
        let sine = iu * normal_v[j] - iv * normal_u[j];
        let inverse = 1.0 / sine;
        let u = (irho * normal_v[j] - iv * rho[j]) * inverse;
        let v = (iu * rho[j] - irho * normal_u[j]) * inverse;
        // A straight edge never contains its own vanishing point.
        let outside_i = (iu * v - iv * u - imiddle).abs() >= ihalf;
        let outside_j = (normal_u[j] * v - normal_v[j] * u - middle[j]).abs() >= half[j];
        let column = ((u - grid.origin.x) * per_u).floor();
        let row = ((v - grid.origin.y) * per_v).floor();
        let inside = (column >= 0.0)
            & (column < COLUMNS as f32)
            & (row >= 0.0)
            & (row < ROWS as f32)
            & (sine.abs() > MIN_CROSSING_SINE)
            & outside_i
            & outside_j;
        let cell = if inside { row * COLUMNS as f32 + column } else { outside };
        cell_of[j] = cell as u32;
        vote_of[j] = iweight.min(weight[j]) * sine.abs();
    }
}
