//! Ground beside the path ahead that nothing has shown to be floor.
//!
//! A thing near the robot fills the lower border of the picture, gives no echo at most angles, and what is known of it fades. Where it
//! stands no floor was ever seen: lanes over floor that was seen are better.

use nalgebra::Point2;

use super::stations::{PathAhead, STATION_M, station_m};

/// Stations that are looked at: 0.21 to 1.09 m ahead.
const FIRST: usize = 2;
const COUNT: usize = 12;
/// Side of a place, m, and number of places on each side of the path.
const PLACE_M: f64 = 0.05;
const ASIDE: usize = 28;
const PLACES: usize = 2 * ASIDE + 1;
/// Places on each side of a lane that belong to it: the robot, and some room.
const LANE_PLACES: usize = 6;

/// Ground beside the path ahead.
#[derive(Clone, Debug)]
pub struct UnseenGround {
    /// Numbers of the unseen places right of each place, for each station.
    right: [[u8; PLACES + 1]; COUNT],
}

impl Default for UnseenGround {
    /// Floor everywhere.
    fn default() -> Self {
        Self { right: [[0; PLACES + 1]; COUNT] }
    }
}

impl UnseenGround {
    /// Looks at the places beside the stations of `path`; `is_floor` is true for places (robot frame, m) that were seen as floor.
    #[must_use]
    pub fn of(path: &PathAhead, is_floor: impl Fn(Point2<f64>) -> bool) -> Self {
        let mut ground = Self::default();
        for (right, station) in ground.right.iter_mut().zip(&path.stations[FIRST..]) {
            for place in 0..PLACES {
                let offset_m = (place as f64 - ASIDE as f64) * PLACE_M;
                right[place + 1] = right[place] + u8::from(!is_floor(station.beside(offset_m)));
            }
        }
        ground
    }

    /// Length of a lane that is unseen, m; where half of its width is unseen, half of the length counts. `lateral_m` returns the lane's
    /// distance to the left of the path at a distance ahead, m.
    #[must_use]
    pub fn length_m(&self, lateral_m: impl Fn(f64) -> f64) -> f64 {
        let unseen = |(i, right): (usize, &[u8; PLACES + 1])| {
            let place = (lateral_m(station_m(FIRST + i)) / PLACE_M).round() + ASIDE as f64;
            let place = place.clamp(0.0, (PLACES - 1) as f64) as usize;
            let (from, to) = (place.saturating_sub(LANE_PLACES), (place + LANE_PLACES + 1).min(PLACES));
            f64::from(right[to] - right[from]) / (to - from) as f64
        };
        STATION_M * self.right.iter().enumerate().map(unseen).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lane_counts_as_far_as_it_leads_over_unseen_ground() {
        let is_floor = |place: Point2<f64>| !((0.5..0.74).contains(&place.x) && place.y > 0.12);
        let ground = UnseenGround::of(&PathAhead::default(), is_floor);
        let length_m = |offset_m: f64| ground.length_m(|_| offset_m);
        assert_eq!(length_m(-0.2), 0.0);
        assert!((length_m(0.5) - 0.24).abs() < 1e-9, "{}", length_m(0.5));
        assert!((length_m(0.15) - 0.24 * 7.0 / 13.0).abs() < 1e-9, "{}", length_m(0.15));
        assert!((length_m(9.0) - 0.24).abs() < 1e-9, "beyond what is looked at, as at its border");
        assert_eq!(ground.length_m(|ahead_m| if ahead_m > 0.9 { 0.4 } else { -0.3 }), 0.0, "behind it");
        assert_eq!(UnseenGround::default().length_m(|_| 0.4), 0.0);
    }
}
