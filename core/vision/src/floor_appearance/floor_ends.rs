//! End of the floor in each column of blocks, with the evidence of all columns.

use super::boundaries::Boundaries;

/// Share of a block's log odds that counts: neighboring blocks are no independent evidence.
const EVIDENCE: f32 = 0.25;
/// Weight of the edge at which the floor ends, per unit of negative log conductance.
const EDGE_WEIGHT: f32 = 0.6;
/// Maximum negative log conductance of an edge.
const MAX_EDGE: f32 = 3.0;
/// Log likelihood that is lost over each row in which neighboring columns differ without an edge between them.
const JUMP: f32 = 0.8;
/// Likelihood of any end, whatever the end in the neighboring column, relative to the same end.
const ANYWHERE: f32 = 2e-4;

/// Ends of the floor: each column is floor from the bottom up to one end. Ends lie at edges, and neighboring columns end in the
/// same row, unless an edge separates them. Reuses its buffers.
///
/// The columns are a chain, whose marginals a forward and a backward pass compute exactly.
#[derive(Clone, Debug, Default)]
pub struct FloorEnds {
    /// Likelihood of each end (number of rows of floor) of each column by the column alone.
    own: Vec<f32>,
    /// Likelihood of each end of each column by the columns to its left.
    from_left: Vec<f32>,
    /// Likelihood by the columns to the right of the column at hand.
    from_right: Vec<f32>,
    product: Vec<f32>,
    /// Per column and row from the bottom: share of the likelihood that remains over one row of difference to the next column.
    shares: Vec<f32>,
    floor: Vec<f32>,
}

impl FloorEnds {
    /// Returns the probability of floor of each block, row by row from the top. `log_odds` are the blocks' own.
    pub fn solve(&mut self, columns: usize, boundaries: &Boundaries, log_odds: &[f32]) -> &[f32] {
        let rows = log_odds.len() / columns.max(1);
        let ends = rows + 1;
        self.measure(columns, boundaries, log_odds);
        self.floor.clear();
        self.floor.resize(log_odds.len(), 0.0);
        for (buffer, count) in
            [(&mut self.from_left, columns * ends), (&mut self.from_right, ends), (&mut self.product, ends)]
        {
            buffer.clear();
            buffer.resize(count, 1.0);
        }
        for column in 1..columns {
            let (before, after) = self.from_left.split_at_mut(column * ends);
            multiply(
                &self.own[(column - 1) * ends..][..ends],
                &before[(column - 1) * ends..],
                &mut self.product,
            );
            pass_on(&self.product, &self.shares[(column - 1) * rows..][..rows], &mut after[..ends]);
        }
        for column in (0..columns).rev() {
            let own = &self.own[column * ends..][..ends];
            multiply(own, &self.from_right, &mut self.product);
            let left = &self.from_left[column * ends..][..ends];
            let sum = self.product.iter().zip(left).map(|(product, left)| product * left).sum::<f32>();
            let mut higher = sum;
            for (row, (product, left)) in self.product.iter().zip(left).take(rows).enumerate() {
                higher -= product * left;
                self.floor[(rows - 1 - row) * columns + column] =
                    (higher / sum.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            }
            if column > 0 {
                pass_on(&self.product, &self.shares[(column - 1) * rows..][..rows], &mut self.from_right);
            }
        }
        &self.floor
    }

    /// Computes the likelihoods of each column alone, and the shares between columns.
    fn measure(&mut self, columns: usize, boundaries: &Boundaries, log_odds: &[f32]) {
        let rows = log_odds.len() / columns.max(1);
        self.own.clear();
        self.shares.clear();
        for column in 0..columns {
            let at = |row: usize| (rows - 1 - row) * columns + column;
            let first = self.own.len();
            let mut sum = 0.0;
            self.own.push(0.0);
            for row in 0..rows {
                sum += EVIDENCE * log_odds[at(row)];
                // The conductance to the block above is that of the block above to the one below it.
                let edge = if row + 1 == rows { 0.0 } else { -boundaries.below()[at(row + 1)].ln() };
                self.own.push(sum + EDGE_WEIGHT * edge.clamp(0.0, MAX_EDGE));
                self.shares.push((-JUMP * boundaries.right()[at(row)]).exp());
            }
            let own = &mut self.own[first..];
            let highest = own.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            own.iter_mut().for_each(|log| *log = (*log - highest).exp());
        }
    }
}

fn multiply(a: &[f32], b: &[f32], product: &mut [f32]) {
    product.iter_mut().zip(a.iter().zip(b)).for_each(|(product, (a, b))| *product = a * b);
}

/// Computes the likelihoods of the ends of a column from those of its neighbor; `shares` remain over each row of difference.
fn pass_on(from: &[f32], shares: &[f32], to: &mut [f32]) {
    let everywhere = ANYWHERE * from.iter().sum::<f32>();
    let mut lower = 0.0;
    for (end, (to, from)) in to.iter_mut().zip(from).enumerate() {
        lower = if end == 0 { *from } else { lower * shares[end - 1] + from };
        *to = lower + everywhere;
    }
    let mut higher = 0.0;
    let mut sum = 0.0;
    for (end, (to, from)) in to.iter_mut().zip(from).enumerate().rev() {
        *to += higher;
        sum += *to;
        if end > 0 {
            higher = (higher + from) * shares[end - 1];
        }
    }
    let scale = 1.0 / sum.max(f32::MIN_POSITIVE);
    to.iter_mut().for_each(|to| *to *= scale);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_appearance::features::{Blocks, Picture};
    use yamabico_geometry::image::ImageView;

    /// Number of columns and rows of blocks of the pictures.
    const BLOCKS: usize = 32;

    fn boundaries(level: impl Fn(usize, usize) -> u8) -> Boundaries {
        let data: Vec<u8> = (0..128 * 128).map(|i| level(i % 128, i / 128)).collect();
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Gray(ImageView::new(&data, 128, 128, 128).unwrap()));
        assert_eq!((blocks.grid().columns, blocks.grid().rows), (BLOCKS, BLOCKS));
        let mut boundaries = Boundaries::default();
        boundaries.measure(&blocks, &vec![false; BLOCKS * BLOCKS]);
        boundaries
    }

    #[test]
    fn the_floor_ends_at_the_edge_nearby_and_stays_ended() {
        // The evidence ends in row 14, the edge is above row 12.
        let boundaries = boundaries(|_, v| if v < 12 * 4 { 40 } else { 140 });
        let own: Vec<f32> = (0..BLOCKS * BLOCKS)
            .map(|i| if i / BLOCKS >= 14 || i / BLOCKS == 3 { 1.0 } else { -1.0 })
            .collect();
        let mut ends = FloorEnds::default();
        let floor = ends.solve(BLOCKS, &boundaries, &own);
        let at = |row: usize| floor[row * BLOCKS + 9];
        assert!(at(12) > 0.6 && at(11) < 0.2, "{} {}", at(12), at(11));
        assert!(at(31) > 0.99 && at(3) < 0.01, "floor above something that stands on it is not connected");
        assert!((1..BLOCKS).all(|row| at(row) >= at(row - 1)), "each column has one end");
    }

    #[test]
    fn a_column_without_evidence_follows_its_neighbors_unless_an_edge_separates_it() {
        let own: Vec<f32> = (0..BLOCKS * BLOCKS)
            .map(|i| match (i % BLOCKS, i / BLOCKS >= 16) {
                (10..14, _) => 0.0,
                (_, true) => 3.0,
                (_, false) => -3.0,
            })
            .collect();
        let mut ends = FloorEnds::default();
        let plain = ends.solve(BLOCKS, &boundaries(|_, _| 100), &own)[20 * BLOCKS + 12];
        let post = boundaries(|u, v| if (40..56).contains(&u) && v < 96 { 200 } else { 100 });
        let behind = ends.solve(BLOCKS, &post, &own)[20 * BLOCKS + 12];
        assert!(plain > 0.95 && behind < 0.6, "{plain} {behind}");
    }

    #[test]
    fn no_columns_are_no_floor() {
        let mut ends = FloorEnds::default();
        assert!(ends.solve(0, &Boundaries::default(), &[]).is_empty());
    }
}
