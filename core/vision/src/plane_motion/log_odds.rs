//! Log odds that a grid cell holds a thing, from the points of each picture.
//!
//! Moravec & Elfes (1985).

/// Parameters of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellRules {
    /// Time constant of forgetting, s.
    pub tau_s: f64,
    /// Smallest log odds.
    pub min: f64,
    /// Largest log odds.
    pub max: f64,
    /// Maximum that one picture adds.
    pub hit_cap: f64,
    /// Maximum that one picture takes away.
    pub free_cap: f64,
    /// Weight of a point above the floor.
    pub above: f64,
    /// Weight of a point on the floor.
    pub floor: f64,
    /// Weight of a mirror image.
    pub below: f64,
    /// Log likelihood ratio from which a point counts fully.
    pub full_ratio: f64,
}

/// Log odds of a point with weight 1 that counts fully.
const FULL: f64 = 3.0;

impl Default for CellRules {
    fn default() -> Self {
        Self {
            tau_s: 12.0,
            min: -3.0,
            max: 8.0,
            hit_cap: 1.5,
            free_cap: 0.8,
            above: 1.0,
            floor: 0.6,
            below: 0.2,
            full_ratio: 12.0,
        }
    }
}

impl CellRules {
    /// Evidence of a point with this log likelihood ratio against the other classes, for the weight of its class.
    #[must_use]
    pub fn evidence(&self, weight: f64, log_ratio: f64) -> f64 {
        FULL * weight * log_ratio.min(self.full_ratio) / self.full_ratio
    }

    /// Factor on the log odds after `dt_s` seconds.
    #[must_use]
    pub fn decay(&self, dt_s: f64) -> f64 {
        (-dt_s / self.tau_s).exp()
    }

    /// Log odds after a picture whose points add up to `hit` for a thing and `free` for the floor.
    #[must_use]
    pub fn add(&self, log_odds: f64, hit: f64, free: f64) -> f64 {
        (log_odds + hit.min(self.hit_cap) - free.min(self.free_cap)).clamp(self.min, self.max)
    }
}
