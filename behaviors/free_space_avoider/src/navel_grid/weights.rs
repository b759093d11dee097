//! Weighted sums of the obstacle cells in the path ahead: against going left, going right, and going forward.

/// Number of cells that the path ahead covers in each column of the paper's grid (Abdelfatah et al.).
pub const PAPER_PROFILE: [u32; 17] = [1, 1, 2, 3, 4, 5, 6, 7, 7, 7, 6, 5, 4, 3, 2, 1, 1];

/// Sum on either side if every cell of the path is an obstacle, for the paper's grid.
const MAX_SIDE: f64 = 219.0;
/// Sum ahead if every cell of the path is an obstacle, for the paper's grid.
const MAX_AHEAD: f64 = 266.0;

/// Weights of the grid's columns.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightSets {
    /// Number of cells, from the bottom, that the path ahead covers in each column from the left.
    pub profile: Vec<u32>,
    /// Weight of each column in favor of going right, highest on the left.
    pub right: Vec<f64>,
    /// Weight of each column in favor of going left, highest on the right.
    pub left: Vec<f64>,
    /// Weight of each column against going forward, highest in the middle.
    pub ahead: Vec<f64>,
}

/// Weighted sums of obstacle cells, on the scale of the paper's grid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weights {
    /// Obstacles in the left part of the path, in favor of going right (R in the paper), up to 219.
    pub right: f64,
    /// Obstacles in the right part of the path, in favor of going left (L in the paper), up to 219.
    pub left: f64,
    /// Obstacles in the middle of the path, against going forward (S in the paper), up to 266.
    pub ahead: f64,
}

impl WeightSets {
    /// Returns the sets of Abdelfatah et al. for 17 x 9 cells.
    ///
    /// Differs from \[1\]: the set for the right is printed with 16 numbers; it is replaced by the mirror image of the
    /// set for the left, the only symmetric completion that gives the published sums.
    #[must_use]
    pub fn paper() -> Self {
        Self::shaped(&PAPER_PROFILE)
    }

    /// Returns the sets for another grid; `profile` is the number of cells that the path ahead covers in each column.
    /// The weight of a column follows from its relative position as in the paper. All weights are scaled to the paper's
    /// maximum sums, so that the paper's limits hold for any grid. `None` if the path covers no cell.
    #[must_use]
    pub fn for_profile(profile: &[u32]) -> Option<Self> {
        let mut sets = Self::shaped(profile);
        let nothing_free = vec![0; profile.len()];
        let full = sets.weigh(&nothing_free);
        let side = 2.0 * MAX_SIDE / (full.right + full.left);
        let ahead = MAX_AHEAD / full.ahead;
        if !(side.is_finite() && ahead.is_finite()) {
            return None;
        }
        sets.right.iter_mut().for_each(|weight| *weight *= side);
        sets.left.iter_mut().for_each(|weight| *weight *= side);
        sets.ahead.iter_mut().for_each(|weight| *weight *= ahead);
        Some(sets)
    }

    /// Returns the number of cells that are not free among those that the path covers in a column; `free` is the number
    /// of free cells from the bottom.
    #[must_use]
    pub fn intrusion(&self, column: usize, free: u32) -> u32 {
        self.profile.get(column).map_or(0, |covered| covered.saturating_sub(free))
    }

    /// Returns the sums for a navigation profile: the number of free cells from the bottom of each column from the
    /// left.
    #[must_use]
    pub fn weigh(&self, free: &[u32]) -> Weights {
        let mut weights = Weights::default();
        for (column, &free) in free.iter().enumerate().take(self.profile.len()) {
            let intrusion = f64::from(self.intrusion(column, free));
            weights.right += intrusion * self.right[column];
            weights.left += intrusion * self.left[column];
            weights.ahead += intrusion * self.ahead[column];
        }
        weights
    }

    /// Returns the weights of the paper at the positions of these columns.
    fn shaped(profile: &[u32]) -> Self {
        let step = PAPER_PROFILE.len() as f64 / profile.len() as f64;
        // Position in the paper's columns, 0 to 16. The paper's sets are clipped straight lines.
        let at = |column: usize| (column as f64 + 0.5) * step - 0.5;
        let set = |weight: fn(f64) -> f64| (0..profile.len()).map(|column| weight(at(column))).collect();
        Self {
            profile: profile.to_vec(),
            right: set(|position| (11.0 - position).clamp(0.0, 10.0)),
            left: set(|position| (position - 5.0).clamp(0.0, 10.0)),
            ahead: set(|position| (7.0 - (position - 8.0).abs()).clamp(0.0, 6.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sets_are_the_printed_ones_and_mirror_each_other() {
        let sets = WeightSets::paper();
        let ahead = [0, 0, 1, 2, 3, 4, 5, 6, 6, 6, 5, 4, 3, 2, 1, 0, 0].map(f64::from);
        let left = [0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10].map(f64::from);
        let mut right = left;
        right.reverse();
        assert_eq!((sets.ahead.as_slice(), sets.left.as_slice()), (&ahead[..], &left[..]));
        assert_eq!(sets.right, right);
        assert_eq!(WeightSets::for_profile(&PAPER_PROFILE), Some(sets));
    }

    #[test]
    fn the_sums_of_the_paper_s_chair_are_reproduced() {
        let free = [9, 9, 9, 9, 9, 9, 5, 5, 4, 5, 9, 9, 9, 9, 9, 9, 9];
        assert_eq!(WeightSets::paper().weigh(&free), Weights { right: 26.0, left: 22.0, ahead: 47.0 });
    }

    #[test]
    fn a_wall_weighs_the_same_on_every_grid() {
        let fine: Vec<u32> = PAPER_PROFILE.iter().flat_map(|&cells| [2 * cells, 2 * cells]).collect();
        let (coarse, fine) = (WeightSets::paper(), WeightSets::for_profile(&fine).unwrap());
        for free in 0..=9 {
            let (a, b) = (coarse.weigh(&[free; 17]), fine.weigh(&[2 * free; 34]));
            assert!(
                (a.right - b.right).abs() < 3.0 && (a.ahead - b.ahead).abs() < 3.0,
                "{free}: {a:?} {b:?}"
            );
            assert!((b.right - b.left).abs() < 1e-9);
        }
        assert_eq!(WeightSets::for_profile(&[0; 17]), None);
        assert_eq!(WeightSets::for_profile(&[]), None);
    }
}
