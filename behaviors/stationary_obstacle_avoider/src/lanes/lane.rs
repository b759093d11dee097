//! A lane beside the path, as it is rated.

/// Length from which a lane counts as free, m.
pub const FREE_M: f64 = 2.2;
/// Distance from obstacles that is kept where there is room, m beyond the clearance.
pub(super) const ROOM_M: f64 = 0.16;

/// A lane and what is known of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lane {
    /// Offset from the path, m, positive left.
    pub offset_m: f64,
    /// Length that is free from the robot on, m, at most the range of the stations.
    pub free_m: f64,
    /// Distance of the nearest obstacle from the lane, m.
    pub gap_m: f64,
    /// That distance on the part of the lane that the robot is about to drive, m.
    pub near_gap_m: f64,
    /// Room that is missing both to an obstacle and to a wall where the lane leads between them, m.
    pub squeeze_m: f64,
}

impl Lane {
    /// Room beside the part of the lane that the robot is about to drive, as a share of that which is kept where there is
    /// room: what is farther on, such as the end of a corridor, does not slow it down yet.
    #[must_use]
    pub fn room(&self, clearance_m: f64) -> f64 {
        ((self.near_gap_m - clearance_m) / ROOM_M).clamp(0.0, 1.0)
    }

    /// True if the lane is free over the whole length with some room beside it.
    #[must_use]
    pub fn is_open(&self, clearance_m: f64) -> bool {
        self.free_m >= FREE_M && self.gap_m >= clearance_m + 0.5 * ROOM_M
    }
}
