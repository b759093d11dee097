//! Decision whether a region of the image holds an obstacle: its edges differ from the map by more than was learned
//! at this place.
//!
//! Ohya, Kosaka & Kak (1998): a region is an obstacle if its count exceeds (1 + eps) N0. Differs from \[1\]: a
//! minimum count for an obstacle, and limits on the distance and heading from the place where a threshold was
//! learned.

use yamabico_core::geometry::{Pose2, angle_difference};

/// Maximum distance to a place whose thresholds apply, m.
pub const MAX_DISTANCE_M: f64 = 1.0;
/// Maximum difference of heading to a place whose thresholds apply, rad.
pub const MAX_TURN_RAD: f64 = std::f64::consts::FRAC_PI_6;
/// Distance that is equivalent to one radian of heading when places are compared, m.
pub const METERS_A_RADIAN: f64 = 1.0;

/// Returns the index of the nearest of `places` (map frame) within [`MAX_DISTANCE_M`] and [`MAX_TURN_RAD`] of `pose`,
/// the first of equally near ones; `None` if there is none, or if `pose` is not finite.
#[must_use]
pub fn nearest(places: impl Iterator<Item = Pose2>, pose: &Pose2) -> Option<usize> {
    let near = places.enumerate().filter_map(|(i, place)| {
        let turn = angle_difference(place.theta, pose.theta).abs();
        let (dx, dy) = (place.x - pose.x, place.y - pose.y);
        let is_near = dx * dx + dy * dy <= MAX_DISTANCE_M * MAX_DISTANCE_M && turn <= MAX_TURN_RAD;
        is_near.then(|| (i, dx * dx + dy * dy + (METERS_A_RADIAN * turn).powi(2)))
    });
    near.fold(None, |best: Option<(usize, f64)>, next| match best {
        Some(best) if best.1 <= next.1 => Some(best),
        _ => Some(next),
    })
    .map(|(i, _)| i)
}

/// Margin by which a measurement may exceed the learned one without indicating an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Fraction by which the learned value may be exceeded, at least 0.
    pub epsilon: f64,
    /// Minimum limit: values up to this one never indicate an obstacle. In the unit of the measurement.
    pub min_limit: f64,
}

impl Sensitivity {
    /// Returns the largest value that is not an obstacle, given the value `learned` in the empty building.
    #[must_use]
    pub fn limit(&self, learned: f64) -> f64 {
        ((1.0 + self.epsilon) * learned).max(self.min_limit)
    }

    /// Returns true if `count` is strictly greater than [`Sensitivity::limit`].
    #[must_use]
    pub fn is_obstacle(&self, count: u32, learned: f64) -> bool {
        f64::from(count) > self.limit(learned)
    }
}
