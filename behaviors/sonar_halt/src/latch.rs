//! A latch that holds until enough readings in a row are clean.

/// Holds until enough clean readings came in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latch {
    clean: u32,
    needed: u32,
}

impl Latch {
    /// Returns a latch that holds, and releases after `needed` clean readings in a row.
    #[must_use]
    pub const fn holding(needed: u32) -> Self {
        Self { clean: 0, needed }
    }

    /// Returns a latch that does not hold; once tripped, it releases after `needed` clean readings in a row.
    #[must_use]
    pub const fn released(needed: u32) -> Self {
        Self { clean: needed, needed }
    }

    /// Counts a clean reading.
    pub fn clean(&mut self) {
        self.clean = self.clean.saturating_add(1).min(self.needed);
    }

    /// Holds from now on.
    pub fn trip(&mut self) {
        self.clean = 0;
    }

    /// Returns true while the latch holds.
    #[must_use]
    pub const fn is_holding(&self) -> bool {
        self.clean < self.needed
    }

    /// Number of clean readings still needed to release.
    #[must_use]
    pub const fn missing(&self) -> u32 {
        self.needed - self.clean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latch_counts_in_a_row() {
        let mut latch = Latch::holding(3);
        assert!(latch.is_holding() && !Latch::released(3).is_holding());
        for _ in 0..2 {
            latch.clean();
        }
        assert_eq!((latch.is_holding(), latch.missing()), (true, 1));
        latch.trip();
        for _ in 0..5 {
            latch.clean();
        }
        assert!(!latch.is_holding());
    }
}
