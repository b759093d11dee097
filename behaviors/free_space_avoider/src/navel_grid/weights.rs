//! Three sums of what intrudes into the way ahead: reasons to go right, to go left and to stop.

/// Of each column of the paper's grid, the cells that the way ahead covers.
pub const PAPER_PROFILE: [u32; 17] = [1, 1, 2, 3, 4, 5, 6, 7, 7, 7, 6, 5, 4, 3, 2, 1, 1];

/// Weights of a wall at the wheels on the paper's grid, either side.
const FULL_SIDE: f64 = 219.0;
/// The same, ahead.
const FULL_AHEAD: f64 = 266.0;

/// What counts how much.
#[derive(Clone, Debug, PartialEq)]
pub struct Sets {
    /// Of each column from the left, the cells (from the bottom) that the way ahead covers.
    pub profile: Vec<u32>,
    /// Weight of each column as a reason to go right: heaviest at the left.
    pub right: Vec<f64>,
    /// Weight of each column as a reason to go left: heaviest at the right.
    pub left: Vec<f64>,
    /// Weight of each column as a reason not to go ahead: heaviest in the middle.
    pub ahead: Vec<f64>,
}

/// The sums, in the units of the paper's grid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weights {
    /// Reasons to go right (the paper's R): what stands in the left part of the way. A wall at the wheels gives 219.
    pub right: f64,
    /// Reasons to go left (the paper's L): what stands in the right part of the way. A wall at the wheels gives 219.
    pub left: f64,
    /// Reasons not to go ahead (the paper's S): what stands in the middle of the way. A wall at the wheels gives 266.
    pub ahead: f64,
}

impl Sets {
    /// The sets of Abdelfatah et al. for 17 x 9 cells.
    ///
    /// Differs from \[1\]: the set for the right is printed with 16 numbers; the mirror image of the one for the left is the
    /// only symmetric completion that can give the published sums.
    #[must_use]
    pub fn paper() -> Self {
        Self::shaped(&PAPER_PROFILE)
    }

    /// The sets for another grid, where the way ahead covers so many cells of each column. The weight of a column follows
    /// from its place in the picture as in the paper; all are scaled so that a wall at the wheels weighs as much as there,
    /// and the paper's limits hold for any grid. `None` for a way that covers no cell.
    #[must_use]
    pub fn for_profile(profile: &[u32]) -> Option<Self> {
        let mut sets = Self::shaped(profile);
        let nothing_free = vec![0; profile.len()];
        let full = sets.weigh(&nothing_free);
        let side = 2.0 * FULL_SIDE / (full.right + full.left);
        let ahead = FULL_AHEAD / full.ahead;
        if !(side.is_finite() && ahead.is_finite()) {
            return None;
        }
        sets.right.iter_mut().for_each(|weight| *weight *= side);
        sets.left.iter_mut().for_each(|weight| *weight *= side);
        sets.ahead.iter_mut().for_each(|weight| *weight *= ahead);
        Some(sets)
    }

    /// How many cells of a column are taken of those that the way covers, given its free cells from the bottom.
    #[must_use]
    pub fn intrusion(&self, column: usize, free: u32) -> u32 {
        self.profile.get(column).map_or(0, |covered| covered.saturating_sub(free))
    }

    /// The sums for a navigation profile: of each column from the left, the free cells from the bottom.
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

    /// The weights of the paper at the places of these columns.
    fn shaped(profile: &[u32]) -> Self {
        let step = PAPER_PROFILE.len() as f64 / profile.len() as f64;
        // The paper's column (0 to 16) at the place of each of ours; its sets are straight lines, cut off.
        let at = |column: usize| (column as f64 + 0.5) * step - 0.5;
        let set = |weight: fn(f64) -> f64| (0..profile.len()).map(|column| weight(at(column))).collect();
        Self {
            profile: profile.to_vec(),
            right: set(|place| (11.0 - place).clamp(0.0, 10.0)),
            left: set(|place| (place - 5.0).clamp(0.0, 10.0)),
            ahead: set(|place| (7.0 - (place - 8.0).abs()).clamp(0.0, 6.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sets_are_the_printed_ones_and_mirror_each_other() {
        let sets = Sets::paper();
        let ahead = [0, 0, 1, 2, 3, 4, 5, 6, 6, 6, 5, 4, 3, 2, 1, 0, 0].map(f64::from);
        let left = [0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10].map(f64::from);
        let mut right = left;
        right.reverse();
        assert_eq!((sets.ahead.as_slice(), sets.left.as_slice()), (&ahead[..], &left[..]));
        assert_eq!(sets.right, right);
        assert_eq!(Sets::for_profile(&PAPER_PROFILE), Some(sets));
    }

    #[test]
    fn the_published_sums_of_a_chair_come_out() {
        let free = [9, 9, 9, 9, 9, 9, 5, 5, 4, 5, 9, 9, 9, 9, 9, 9, 9];
        assert_eq!(Sets::paper().weigh(&free), Weights { right: 26.0, left: 22.0, ahead: 47.0 });
    }

    #[test]
    fn a_wall_weighs_the_same_on_every_grid() {
        let fine: Vec<u32> = PAPER_PROFILE.iter().flat_map(|&cells| [2 * cells, 2 * cells]).collect();
        let (coarse, fine) = (Sets::paper(), Sets::for_profile(&fine).unwrap());
        for free in 0..=9 {
            let (a, b) = (coarse.weigh(&[free; 17]), fine.weigh(&[2 * free; 34]));
            assert!(
                (a.right - b.right).abs() < 3.0 && (a.ahead - b.ahead).abs() < 3.0,
                "{free}: {a:?} {b:?}"
            );
            assert!((b.right - b.left).abs() < 1e-9);
        }
        assert_eq!(Sets::for_profile(&[0; 17]), None);
        assert_eq!(Sets::for_profile(&[]), None);
    }
}
