//! Free cells and the number of free rings in each direction, from pixel counts.

use crate::polar_cells::ring_cells::RingCells;

/// Filter of the free cells over frames: a cell becomes blocked at once, but free only after several frames.
#[derive(Clone, Debug)]
pub struct FreeCells {
    directions: usize,
    /// Minimum count of each free cell; `u32::MAX` for cells that are not visible.
    min_px: Vec<u32>,
    /// Number of consecutive frames in which each cell was free, up to `frames`.
    streaks: Vec<u8>,
    frames: u8,
    rings: Vec<usize>,
}

impl FreeCells {
    /// Creates the filter for a template. A cell is free if at least the share `free_share` (0 to 1) of its pixels is
    /// set in `frames` consecutive frames.
    #[must_use]
    pub fn new(cells: &RingCells, free_share: f64, frames: u8) -> Self {
        let min_px = |(cell, &area): (usize, &u32)| {
            let is_enough = |&count: &u32| f64::from(count) / f64::from(area) >= free_share;
            if cells.is_shown(cell) { (0..=area).find(is_enough).unwrap_or(u32::MAX) } else { u32::MAX }
        };
        Self {
            directions: cells.directions(),
            min_px: cells.areas().iter().enumerate().map(min_px).collect(),
            streaks: vec![0; cells.areas().len()],
            frames: frames.max(1),
            rings: vec![0; cells.directions()],
        }
    }

    /// Updates the cells with the counts of a frame.
    pub fn update(&mut self, counts: &[u32]) {
        for ((streak, min_px), count) in self.streaks.iter_mut().zip(&self.min_px).zip(counts) {
            *streak = if count >= min_px { (*streak + 1).min(self.frames) } else { 0 };
        }
        for (direction, rings) in self.rings.iter_mut().enumerate() {
            let outward = self.streaks.iter().skip(direction).step_by(self.directions);
            *rings = outward.take_while(|&&streak| streak == self.frames).count();
        }
    }

    /// Marks every cell as blocked.
    pub fn reset(&mut self) {
        self.streaks.fill(0);
        self.rings.fill(0);
    }

    /// Returns the number of free rings of each direction, from the innermost outward.
    #[must_use]
    pub fn rings(&self) -> &[usize] {
        &self.rings
    }

    /// Returns the share of the innermost ring's cells, 0 to 1, that are blocked by the counts of a frame.
    #[must_use]
    pub fn blocked_inside(&self, counts: &[u32]) -> f64 {
        let blocked =
            counts.iter().zip(&self.min_px).take(self.directions).filter(|(count, min_px)| count < min_px);
        blocked.count() as f64 / self.directions as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::MirrorImage;

    #[test]
    fn a_cell_is_blocked_at_once_and_free_after_two_frames() {
        let image = MirrorImage::centered(256, 220);
        let cells = RingCells::new(&image, &[20.0, 50.0, 80.0, 105.0, 400.0], 8, 0.0).unwrap();
        let mut free = FreeCells::new(&cells, 0.5, 2);
        let all = cells.areas().to_vec();
        free.update(&all);
        assert_eq!(free.rings(), [0; 8]);
        free.update(&all);
        assert_eq!(free.rings(), [3; 8], "the last ring lies outside the image");
        let mut one = all.clone();
        one[8 + 5] /= 3;
        free.update(&one);
        assert_eq!(free.rings(), [3, 3, 3, 3, 3, 1, 3, 3]);
        free.update(&all);
        assert_eq!(free.rings()[5], 1);
        free.update(&all);
        assert_eq!(free.rings()[5], 3);
        one[..3].fill(0);
        assert_eq!(free.blocked_inside(&one), 3.0 / 8.0);
        free.reset();
        assert_eq!(free.rings(), [0; 8]);
    }
}
