//! From counts to how far each direction is free.

use yamabico_vision::ring_cells::RingCells;

/// Which cells are free, from frame to frame: a cell is blocked at once, and free again only after some frames.
#[derive(Clone, Debug)]
pub struct FreeCells {
    directions: usize,
    /// Of each cell, the least count that is free; out of reach where the cell is not shown.
    min_px: Vec<u32>,
    /// For so many frames each cell has been free, up to `frames`.
    streaks: Vec<u8>,
    frames: u8,
    rings: Vec<usize>,
}

impl FreeCells {
    /// Cells of this template, free where this share (0 to 1) of the pixels is set in so many frames one after the other.
    #[must_use]
    pub fn new(cells: &RingCells, free_share: f64, frames: u8) -> Self {
        let least = |(cell, &area): (usize, &u32)| {
            let is_enough = |&count: &u32| f64::from(count) / f64::from(area) >= free_share;
            if cells.is_shown(cell) { (0..=area).find(is_enough).unwrap_or(u32::MAX) } else { u32::MAX }
        };
        Self {
            directions: cells.directions(),
            min_px: cells.areas().iter().enumerate().map(least).collect(),
            streaks: vec![0; cells.areas().len()],
            frames: frames.max(1),
            rings: vec![0; cells.directions()],
        }
    }

    /// Takes the counts of a frame.
    pub fn update(&mut self, counts: &[u32]) {
        for ((streak, least), count) in self.streaks.iter_mut().zip(&self.min_px).zip(counts) {
            *streak = if count >= least { (*streak + 1).min(self.frames) } else { 0 };
        }
        for (direction, rings) in self.rings.iter_mut().enumerate() {
            let outwards = self.streaks.iter().skip(direction).step_by(self.directions);
            *rings = outwards.take_while(|&&streak| streak == self.frames).count();
        }
    }

    /// Takes every cell for blocked.
    pub fn forget(&mut self) {
        self.streaks.fill(0);
        self.rings.fill(0);
    }

    /// Of each direction, the free rings from the innermost outwards.
    #[must_use]
    pub fn rings(&self) -> &[usize] {
        &self.rings
    }

    /// Whether a cell is free.
    #[must_use]
    pub fn is_free(&self, cell: usize) -> bool {
        self.streaks.get(cell).is_some_and(|&streak| streak == self.frames)
    }

    /// The share of these cells' directions whose innermost cell was blocked in the frame of these counts, 0 to 1.
    #[must_use]
    pub fn blocked_inside(&self, counts: &[u32]) -> f64 {
        let blocked =
            counts.iter().zip(&self.min_px).take(self.directions).filter(|(count, least)| count < least);
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
        assert_eq!(free.rings(), [3; 8], "the last ring lies outside the picture");
        let mut one = all.clone();
        one[8 + 5] /= 3;
        free.update(&one);
        assert_eq!(free.rings(), [3, 3, 3, 3, 3, 1, 3, 3]);
        free.update(&all);
        assert_eq!(free.rings()[5], 1);
        free.update(&all);
        assert_eq!((free.rings()[5], free.is_free(13), free.is_free(31)), (3, true, false));
        one[..3].fill(0);
        assert_eq!(free.blocked_inside(&one), 3.0 / 8.0);
        free.forget();
        assert_eq!(free.rings(), [0; 8]);
    }
}
