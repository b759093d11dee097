//! Votes of the blocks of an image: floor, not floor, or none.

use super::features::BlockGrid;

/// Log odds below which a block is not floor.
const OTHER_LOG_ODDS: f32 = -1.0;
/// Log odds of blocks outside of the grid.
const OUTSIDE: f32 = -0.5;

/// Vote of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vote {
    /// Floor.
    Floor,
    /// Not floor.
    Other,
    /// Undecided.
    None,
}

/// Log odds of floor of the blocks of an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorVotes {
    pub(super) grid: BlockGrid,
    pub(super) is_color: bool,
    pub(super) log_odds: Vec<f32>,
}

impl FloorVotes {
    /// Returns the position of the blocks in the image.
    #[must_use]
    pub fn grid(&self) -> BlockGrid {
        self.grid
    }

    /// Log odds that each block is floor, about -9 to 9, row by row from the top.
    #[must_use]
    pub fn log_odds(&self) -> &[f32] {
        &self.log_odds
    }

    /// Returns the weight of these votes beside other evidence: 1, and 0.5 for a gray image.
    #[must_use]
    pub fn weight(&self) -> f32 {
        if self.is_color { 1.0 } else { 0.5 }
    }

    /// Returns the vote of a block; none outside of the grid.
    #[must_use]
    pub fn vote(&self, column: usize, row: usize) -> Vote {
        let is_inside = column < self.grid.columns && row < self.grid.rows;
        vote(if is_inside { self.log_odds[row * self.grid.columns + column] } else { OUTSIDE })
    }

    /// Returns the vote of the block at a pixel; beyond the outermost blocks, that of the nearest one.
    #[must_use]
    pub fn at_pixel(&self, u: usize, v: usize) -> Vote {
        vote(self.block_log_odds_at_pixel(u, v))
    }

    /// Returns the log odds of the block at a pixel; beyond the outermost blocks, those of the nearest one. Without blocks, undecided.
    #[must_use]
    pub fn block_log_odds_at_pixel(&self, u: usize, v: usize) -> f32 {
        let BlockGrid { columns, rows, side_px, left_px, top_px } = self.grid;
        if self.log_odds.is_empty() {
            return OUTSIDE;
        }
        let column = (u.saturating_sub(left_px) / side_px).min(columns - 1);
        let row = (v.saturating_sub(top_px) / side_px).min(rows - 1);
        self.log_odds[row * columns + column]
    }

    /// Returns the log odds at a pixel, interpolated between the centers of blocks; beyond the outermost ones, those of the nearest
    /// one. Without blocks, undecided.
    #[must_use]
    pub fn log_odds_at_pixel(&self, u: usize, v: usize) -> f32 {
        let BlockGrid { columns, rows, side_px, left_px, top_px } = self.grid;
        if self.log_odds.is_empty() {
            return OUTSIDE;
        }
        let place = |pixel: usize, first_px: usize, count: usize| {
            let blocks = (pixel as f32 - first_px as f32 + 0.5) / side_px as f32 - 0.5;
            let blocks = blocks.clamp(0.0, (count - 1) as f32);
            let before = (blocks as usize).min(count.saturating_sub(2));
            (before, (before + 1).min(count - 1), blocks - before as f32)
        };
        let ((left, right, across), (above, below, down)) =
            (place(u, left_px, columns), place(v, top_px, rows));
        let row = |row: usize| {
            let row = &self.log_odds[row * columns..][..columns];
            row[left] + across * (row[right] - row[left])
        };
        row(above) + down * (row(below) - row(above))
    }
}

fn vote(log_odds: f32) -> Vote {
    if log_odds > 0.0 {
        Vote::Floor
    } else if log_odds < OTHER_LOG_ODDS {
        Vote::Other
    } else {
        Vote::None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_lie_between_blocks_or_count_to_the_nearest() {
        let grid = BlockGrid { columns: 2, rows: 2, side_px: 4, left_px: 1, top_px: 3 };
        let votes = FloorVotes { grid, is_color: true, log_odds: vec![-2.0, -0.5, 1.0, 2.0] };
        assert_eq!(
            (votes.vote(0, 0), votes.vote(1, 0), votes.vote(1, 1)),
            (Vote::Other, Vote::None, Vote::Floor)
        );
        assert_eq!(votes.vote(2, 0), Vote::None);
        assert_eq!(
            [(0, 0), (99, 0), (0, 99), (99, 99)].map(|(u, v)| votes.log_odds_at_pixel(u, v)),
            [-2.0, -0.5, 1.0, 2.0]
        );
        assert_eq!([(4, 6), (5, 7)].map(|(u, v)| votes.at_pixel(u, v)), [Vote::Other, Vote::Floor]);
        // 3/8 and 5/8 of the way from the first center to the last, in both directions.
        assert_eq!([(4, 6), (5, 7)].map(|(u, v)| votes.log_odds_at_pixel(u, v)), [-0.382_812_5, 0.617_187_5]);
        assert_eq!(FloorVotes::default().at_pixel(3, 3), Vote::None);
    }
}
