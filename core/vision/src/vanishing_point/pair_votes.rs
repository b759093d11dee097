//! Votes of all pairs of lines for the cell in which they cross.

use super::lines::VotingLine;
use crate::vectorize::{self, Kernel};
use nalgebra::Vector2;

/// Sine of the minimum angle between two lines whose intersection votes.
const MIN_CROSSING_SINE: f32 = 0.05;

/// Cells of a vote grid in the image plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Corner of cell (0, 0) with the lowest coordinates, px.
    pub origin: Vector2<f32>,
    /// Size of a cell, px.
    pub cell: Vector2<f32>,
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Grid {
    /// Number of cells.
    pub(crate) fn count(&self) -> usize {
        self.columns * self.rows
    }
}

/// Accumulates votes of pairs. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct PairVotes {
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

impl PairVotes {
    /// Fills `cells`, row by row, with the votes of all pairs of `lines`: the shorter length times the sine of the angle
    /// between them, in the cell of their crossing, unless the crossing projects into one of the segments. `cells` gets
    /// one more cell at the end for crossings outside the grid.
    ///
    /// Differs from Kweon et al. (1991), where each edge votes along its whole line: the sum over pairs at a cell is
    /// half the square of the sum over edges, so it has the same, sharper peak in a fifth of the time.
    pub(crate) fn cast(&mut self, lines: &[VotingLine], grid: Grid, cells: &mut Vec<f32>) {
        cells.clear();
        cells.resize(grid.count() + 1, 0.0);
        self.cell_of.resize(lines.len(), 0);
        self.vote_of.resize(lines.len(), 0.0);
        self.voters.fill(lines);
        vectorize::run(Cast { votes: self, grid, cells });
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

struct Cast<'a> {
    votes: &'a mut PairVotes,
    grid: Grid,
    cells: &'a mut [f32],
}

impl Kernel for Cast<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { votes, grid, cells } = self;
        let PairVotes { voters, cell_of, vote_of } = votes;
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
    let (columns, rows) = (grid.columns as f32, grid.rows as f32);
    let outside = grid.count() as f32;
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
            & (column < columns)
            & (row >= 0.0)
            & (row < rows)
            & (sine.abs() > MIN_CROSSING_SINE)
            & outside_i
            & outside_j;
        let cell = if inside { row * columns + column } else { outside };
        cell_of[j] = cell as u32;
        vote_of[j] = iweight.min(weight[j]) * sine.abs();
    }
}
