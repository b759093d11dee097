//! Conductance between neighboring blocks: high within a surface, low across an edge.

use super::features::{Blocks, Feature};

/// Quantile of the differences within the foreground that is texture, not an edge.
const TEXTURE_QUANTILE: f32 = 0.75;
/// Quantile of the differences within the foreground that shows whether it is one surface.
const EDGE_QUANTILE: f32 = 0.95;
/// Range of the texture's difference of log intensity.
const INTENSITY_RANGE: (f32, f32) = (0.01, 0.2);
/// Added to the texture's difference of log intensity: noise.
const INTENSITY_NOISE: f32 = 0.01;
/// Range of the texture's difference of chromaticity.
const CHROMA_RANGE: (f32, f32) = (0.001, 0.02);
/// Added to the texture's difference of chromaticity: noise.
const CHROMA_NOISE: f32 = 0.002;
/// Weight of chromaticity relative to intensity.
const CHROMA_WEIGHT: f32 = 0.5;
/// Minimum conductance.
const MIN_CONDUCTANCE: f32 = 0.003;

/// Conductances between neighboring blocks, 0 to 1. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Boundaries {
    /// To the block on the right, row by row; the last of each row is 0.
    right: Vec<f32>,
    /// To the block below, row by row; the last row is 0.
    below: Vec<f32>,
    foreground_step: f32,
    steps: Vec<[f32; 2]>,
    sorted: Vec<f32>,
}

impl Boundaries {
    /// Measures the boundaries of an image. Differences as large as within the `foreground` (one flag a block) are texture.
    pub fn measure(&mut self, blocks: &Blocks, foreground: &[bool]) {
        let grid = blocks.grid();
        let (columns, count) = (grid.columns, grid.count());
        self.steps.clear();
        // To the right first, then below.
        for row in 0..grid.rows {
            let halves = [blocks.quarter_row(2 * row), blocks.quarter_row(2 * row + 1)];
            self.steps.extend((0..columns).map(|column| {
                if column + 1 == columns {
                    return [0.0; 2];
                }
                let i = row * columns + column;
                let step = |k: usize| {
                    let along = halves.map(|half| (half[2 * column + k + 1] - half[2 * column + k]).abs());
                    along[0].min(along[1])
                };
                [
                    step(0).max(step(1)).max(step(2)),
                    chroma_step(&blocks.features()[i], &blocks.features()[i + 1]),
                ]
            }));
        }
        for row in 0..grid.rows.saturating_sub(1) {
            let halves: [&[f32]; 4] = std::array::from_fn(|k| blocks.quarter_row(2 * row + k));
            self.steps.extend((0..columns).map(|column| {
                let i = row * columns + column;
                let step = |k: usize| {
                    let along = [0, 1]
                        .map(|half| (halves[k + 1][2 * column + half] - halves[k][2 * column + half]).abs());
                    along[0].min(along[1])
                };
                let below = &blocks.features()[i + columns];
                [step(0).max(step(1)).max(step(2)), chroma_step(&blocks.features()[i], below)]
            }));
        }
        let is_in = |i: usize| foreground.get(i).copied().unwrap_or(false);
        let texture = [0, 1].map(|cue| self.quantile(TEXTURE_QUANTILE, cue, columns, count, is_in));
        let is_seen = |i: usize| is_in(i) && !blocks.is_saturated()[i];
        self.foreground_step = self.quantile(EDGE_QUANTILE, 0, columns, count, is_seen);
        let intensity = texture[0].clamp(INTENSITY_RANGE.0, INTENSITY_RANGE.1) + INTENSITY_NOISE;
        let chroma = texture[1].clamp(CHROMA_RANGE.0, CHROMA_RANGE.1) + CHROMA_NOISE;
        let conductance = |step: &[f32; 2]| {
            let excess = (step[0] / intensity).powi(2) + CHROMA_WEIGHT * (step[1] / chroma).powi(2);
            (-0.5 * excess).exp() + MIN_CONDUCTANCE
        };
        self.right.clear();
        self.right.extend(self.steps[..count].iter().map(conductance));
        self.right.iter_mut().skip(columns.max(1) - 1).step_by(columns.max(1)).for_each(|last| *last = 0.0);
        self.below.clear();
        self.below.extend(self.steps[count..].iter().map(conductance));
        self.below.resize(count, 0.0);
    }

    /// Conductances to the blocks on the right, row by row from the top.
    #[must_use]
    pub fn right(&self) -> &[f32] {
        &self.right
    }

    /// Conductances to the blocks below, row by row from the top.
    #[must_use]
    pub fn below(&self) -> &[f32] {
        &self.below
    }

    /// Difference of log intensity that 5 % of the steps between blocks within the foreground exceed, saturated blocks left out; 0
    /// without a foreground.
    #[must_use]
    pub fn foreground_step(&self) -> f32 {
        self.foreground_step
    }

    /// Returns a quantile of a cue's differences between blocks that are in an area; 0 without any.
    fn quantile(
        &mut self,
        quantile: f32,
        cue: usize,
        columns: usize,
        count: usize,
        is_in: impl Fn(usize) -> bool,
    ) -> f32 {
        let is_inside = |i: usize| {
            if i < count {
                is_in(i) && !(i + 1).is_multiple_of(columns) && is_in(i + 1)
            } else {
                is_in(i - count) && is_in(i - count + columns)
            }
        };
        self.sorted.clear();
        self.sorted
            .extend(self.steps.iter().enumerate().filter(|(i, _)| is_inside(*i)).map(|(_, step)| step[cue]));
        if self.sorted.is_empty() {
            return 0.0;
        }
        let at = ((self.sorted.len() - 1) as f32 * quantile) as usize;
        *self.sorted.select_nth_unstable_by(at, f32::total_cmp).1
    }
}

fn chroma_step(a: &Feature, b: &Feature) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_appearance::features::Picture;
    use yamabico_geometry::image::ImageView;

    /// Conductances to the right and below of a block, with everything as foreground reference but the block's neighbors.
    fn measured(
        level: impl Fn(usize, usize) -> u8,
        foreground: impl Fn(usize, usize) -> bool,
    ) -> (Boundaries, usize) {
        let data: Vec<u8> = (0..128 * 96).map(|i| level(i % 128, i / 128)).collect();
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Gray(ImageView::new(&data, 128, 96, 128).unwrap()));
        let columns = blocks.grid().columns;
        let flags: Vec<bool> =
            (0..blocks.grid().count()).map(|i| foreground(i % columns, i / columns)).collect();
        let mut boundaries = Boundaries::default();
        boundaries.measure(&blocks, &flags);
        (boundaries, columns)
    }

    #[test]
    fn an_edge_disconnects_and_a_gradient_of_light_does_not() {
        let level = |u: usize, v: usize| if v < 50 { 60 } else { 100 + (u / 2) as u8 };
        let (boundaries, columns) = measured(level, |_, row| row > 18);
        assert!(boundaries.below()[12 * columns + 5] < 0.01 || boundaries.below()[11 * columns + 5] < 0.01);
        assert!(boundaries.below()[18 * columns + 5] > 0.9 && boundaries.right()[18 * columns + 5] > 0.3);
        assert_eq!(boundaries.right()[18 * columns + columns - 1], 0.0);
        assert_eq!(boundaries.below()[23 * columns + 4], 0.0);
    }

    #[test]
    fn the_floor_s_own_texture_is_no_edge() {
        let tiles = |u: usize, v: usize| if (u / 8 + v / 8).is_multiple_of(2) { 90 } else { 110 };
        let (textured, columns) = measured(tiles, |_, _| true);
        let (plain, _) = measured(tiles, |_, _| false);
        let at = 10 * columns + 9;
        assert!(
            textured.right()[at] > 20.0 * plain.right()[at],
            "{} {}",
            textured.right()[at],
            plain.right()[at]
        );
    }
}
