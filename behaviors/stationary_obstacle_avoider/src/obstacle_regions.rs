//! Which regions of the picture hold something that the map does not: more difference than was learned at this place.
//!
//! Ohya, Kosaka & Kak (1998): more than (1 + eps) N0. Differs from \[1\]: a floor below which no count is an obstacle, and
//! limits on how far away a place may have been learned.

use yamabico_core::geometry::{Pose2, angle_difference};

/// Farthest place whose thresholds are used, meters.
pub const FARTHEST_M: f64 = 1.0;
/// Largest difference of heading from the place whose thresholds are used, radians.
pub const LARGEST_TURN_RAD: f64 = std::f64::consts::FRAC_PI_6;
/// What a radian of heading counts when places are compared, meters.
pub const METERS_A_RADIAN: f64 = 1.0;

/// The index of the nearest of `places` (map frame) within [`FARTHEST_M`] and [`LARGEST_TURN_RAD`] of `pose`, the first of
/// equally near ones; `None` where none is, and for a pose that is not finite.
#[must_use]
pub fn nearest(places: impl Iterator<Item = Pose2>, pose: &Pose2) -> Option<usize> {
    let near = places.enumerate().filter_map(|(i, place)| {
        let turn = angle_difference(place.theta, pose.theta).abs();
        let (dx, dy) = (place.x - pose.x, place.y - pose.y);
        let is_near = dx * dx + dy * dy <= FARTHEST_M * FARTHEST_M && turn <= LARGEST_TURN_RAD;
        is_near.then(|| (i, dx * dx + dy * dy + (METERS_A_RADIAN * turn).powi(2)))
    });
    near.fold(None, |best: Option<(usize, f64)>, next| match best {
        Some(best) if best.1 <= next.1 => Some(best),
        _ => Some(next),
    })
    .map(|(i, _)| i)
}

/// How much difference is still no obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Share by which the learned count may be exceeded, 0 or more.
    pub epsilon: f64,
    /// Pixels that are never an obstacle.
    pub floor_px: f64,
}

impl Sensitivity {
    /// The largest count (px) that is no obstacle where `learned` was counted without one.
    #[must_use]
    pub fn limit(&self, learned: f64) -> f64 {
        ((1.0 + self.epsilon) * learned).max(self.floor_px)
    }

    /// Whether `count` is an obstacle: strictly more than [`Sensitivity::limit`].
    #[must_use]
    pub fn is_obstacle(&self, count: u32, learned: f64) -> bool {
        f64::from(count) > self.limit(learned)
    }
}
