//! Test of whether the foreground, which is presumed to be floor while nothing was learned, is one surface.

use super::boundaries::Boundaries;
use super::features::Blocks;

/// Step of log intensity within the foreground, a factor of 1.35, at which it is as likely two surfaces as one.
const STEP: f32 = 0.3;
/// Power of the step in the odds of two surfaces.
const POWER: i32 = 8;
/// Mean number of stretches of two tones along a half row of blocks from which on they are a pattern: tiles, stripes.
const PATTERN_STRETCHES: f32 = 6.0;

/// Returns the probability that the foreground (one flag a block) is one surface: a step of brightness within it makes two of it,
/// unless both tones alternate along the picture's bottom.
#[must_use]
pub fn one_surface(blocks: &Blocks, boundaries: &Boundaries, foreground: &[bool]) -> f32 {
    if mean_stretches(blocks, foreground) >= PATTERN_STRETCHES {
        return 1.0;
    }
    1.0 / (1.0 + (boundaries.foreground_step() / STEP).powi(POWER))
}

/// Returns the mean number of stretches that are brighter or darker than the middle between the foreground's darkest and
/// brightest part, along the half rows of the foreground over the whole width.
fn mean_stretches(blocks: &Blocks, foreground: &[bool]) -> f32 {
    let grid = blocks.grid();
    let rows = (0..grid.rows).filter(|row| foreground[row * grid.columns..][..grid.columns].contains(&true));
    let half_rows =
        || rows.clone().flat_map(|row| [2 * row, 2 * row + 1].map(|half| (row, blocks.quarter_row(half))));
    let (mut darkest, mut brightest) = (f32::INFINITY, f32::NEG_INFINITY);
    for (row, levels) in half_rows() {
        for (half, level) in levels.iter().enumerate() {
            if foreground[row * grid.columns + half / 2] {
                (darkest, brightest) = (darkest.min(*level), brightest.max(*level));
            }
        }
    }
    let middle = 0.5 * (darkest + brightest);
    let (mut stretches, mut count) = (0, 0);
    for (_, levels) in half_rows() {
        stretches += 1 + levels.windows(2).filter(|pair| (pair[0] > middle) != (pair[1] > middle)).count();
        count += 1;
    }
    stretches as f32 / count.max(1) as f32
}
