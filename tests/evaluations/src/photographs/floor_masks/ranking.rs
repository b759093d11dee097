//! Pixels ranked by their log odds of floor.

/// Log odds beyond which pixels rank alike.
const LIMIT: f32 = 10.0;
/// Number of ranks.
const RANKS: usize = 4000;

/// Number of floor and other pixels by log odds.
#[derive(Clone)]
pub struct Ranking {
    floor: Vec<u64>,
    other: Vec<u64>,
    /// Floor pixels without log odds.
    missed: u64,
}

impl Default for Ranking {
    fn default() -> Self {
        Self { floor: vec![0; RANKS], other: vec![0; RANKS], missed: 0 }
    }
}

impl Ranking {
    /// Adds a pixel; `None` if its image was refused.
    pub fn add(&mut self, log_odds: Option<f32>, is_floor: bool) {
        match log_odds {
            Some(log_odds) => {
                let share = 0.5 + 0.5 * (log_odds / LIMIT).clamp(-1.0, 1.0);
                let rank = (share * (RANKS - 1) as f32) as usize;
                let counts = if is_floor { &mut self.floor } else { &mut self.other };
                counts[rank] += 1;
            }
            None => self.missed += u64::from(is_floor),
        }
    }

    /// Adds the pixels of another ranking.
    pub fn merge(&mut self, ranking: &Ranking) {
        for (mine, theirs) in [(&mut self.floor, &ranking.floor), (&mut self.other, &ranking.other)] {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
        self.missed += ranking.missed;
    }

    /// Returns the precision of the highest-ranked pixels that hold this share of the floor; `None` if they do not.
    pub fn precision_at(&self, recall: f64) -> Option<f64> {
        let all = self.floor.iter().sum::<u64>() + self.missed;
        let (mut both, mut found) = (0, 0);
        for (floor, other) in self.floor.iter().zip(&self.other).rev() {
            both += floor;
            found += floor + other;
            if found > 0 && both as f64 >= recall * all as f64 {
                return Some(both as f64 / found as f64);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn precision_falls_with_recall_and_refused_floor_counts() {
        let mut ranking = Ranking::default();
        for (log_odds, is_floor) in [(3.0, true), (2.0, true), (1.0, false), (-1.0, true), (-30.0, false)] {
            ranking.add(Some(log_odds), is_floor);
        }
        assert_eq!(ranking.precision_at(0.5), Some(1.0));
        assert_eq!(ranking.precision_at(0.9), Some(0.75));
        ranking.add(None, true);
        assert_eq!((ranking.precision_at(0.7), ranking.precision_at(0.9)), (Some(0.75), None));
        let mut both = Ranking::default();
        both.merge(&ranking);
        assert_eq!(both.precision_at(0.7), Some(0.75));
    }
}
