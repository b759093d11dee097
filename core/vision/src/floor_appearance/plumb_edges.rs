//! Plumb edges across the horizon: what crosses the horizon is taller than the camera, and stands on the floor where it ends below.

use super::features::Blocks;

/// Minimum step of the log intensity across an edge.
const MIN_STEP: f32 = 0.08;
/// Half rows of blocks above the horizon that an edge must cover.
const ABOVE: usize = 4;
/// Half rows in a row without the edge at which it ends.
const GAP: usize = 2;

/// Marks blocks below the horizon that a plumb edge crosses which comes from above it. Reuses its buffer.
#[derive(Clone, Debug, Default)]
pub struct PlumbEdges {
    is_crossed: Vec<bool>,
}

impl PlumbEdges {
    /// Finds the edges of an image with its horizon at this share of its height above the bottom; returns a flag for each block, row by
    /// row from the top.
    pub fn find(&mut self, blocks: &Blocks, horizon: f32) -> &[bool] {
        let grid = blocks.grid();
        self.is_crossed.clear();
        self.is_crossed.resize(grid.count(), false);
        let rows = 2 * grid.rows;
        let first = (rows as f32 * (1.0 - horizon)).max(0.0) as usize;
        if horizon >= 1.0 || first < ABOVE {
            return &self.is_crossed;
        }
        for column in 1..(2 * grid.columns).saturating_sub(1) {
            // Twice the step per half block, so that an edge within one counts as well.
            let step = |row: usize| {
                let levels = blocks.quarter_row(row);
                levels[column + 1] - levels[column - 1]
            };
            let above = (first - ABOVE..first).map(step);
            let sign = above.clone().sum::<f32>().signum();
            if !above.into_iter().all(|step| step * sign > MIN_STEP) {
                continue;
            }
            let (mut end, mut gap) = (first, 0);
            for row in first..rows {
                if step(row) * sign > MIN_STEP {
                    (end, gap) = (row + 1, 0);
                } else {
                    gap += 1;
                    if gap == GAP {
                        break;
                    }
                }
            }
            for row in first / 2..end / 2 {
                self.is_crossed[row * grid.columns + column / 2] = true;
            }
        }
        &self.is_crossed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_appearance::features::Picture;
    use yamabico_geometry::image::ImageView;

    /// Rows of blocks that are marked in a column of blocks.
    fn crossed(level: impl Fn(usize, usize) -> u8, column: usize, horizon: f32) -> Vec<usize> {
        let data: Vec<u8> = (0..128 * 128).map(|i| level(i % 128, i / 128)).collect();
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Gray(ImageView::new(&data, 128, 128, 128).unwrap()));
        let mut edges = PlumbEdges::default();
        let flags = edges.find(&blocks, horizon);
        (0..blocks.grid().rows).filter(|row| flags[row * blocks.grid().columns + column]).collect()
    }

    #[test]
    fn a_post_across_the_horizon_is_marked_to_its_foot() {
        let post = |u: usize, v: usize| if (40..60).contains(&u) && v < 96 { 60 } else { 140 };
        assert_eq!(crossed(post, 10, 0.5), (16..24).collect::<Vec<_>>());
        assert_eq!(crossed(post, 20, 0.5), Vec::<usize>::new());
        assert_eq!(crossed(post, 10, 1.2), Vec::<usize>::new(), "no horizon in view");
    }

    #[test]
    fn a_stripe_on_the_floor_and_a_low_box_are_not_marked() {
        let stripe = |u: usize, v: usize| if (40..60).contains(&u) && v > 70 { 60 } else { 140 };
        assert_eq!(crossed(stripe, 10, 0.5), Vec::<usize>::new());
    }
}
