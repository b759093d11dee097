//! Walls of a corridor that are joints of the floor: floor was seen beyond them.

use nalgebra::Point2;

/// Places along a wall: the first, m ahead of the robot, their distance, m, and their number.
const ALONG_M: (f64, f64) = (0.3, 0.1);
const ALONG: u32 = 18;
/// Places beyond it: the distance of the first, and their distance, m, and their number. Floor is seen up to a wall that stands there, and
/// through its open doors.
const BEYOND_M: (f64, f64) = (0.15, 0.075);
const BEYOND: u32 = 5;
/// Share of these places that shows floor from which there is no wall.
const MAX_SHARE: f64 = 0.75;

/// True if the wall at `wall_m` to the left of the corridor's axis is none, for a robot `along_m` along the corridor (m). `is_floor` is true
/// for places (corridor frame, m) that were seen as floor; `outward` is 1 for a wall to the left, -1 for one to the right.
pub(super) fn is_refuted(
    wall_m: f64,
    outward: f64,
    along_m: f64,
    is_floor: impl Fn(Point2<f64>) -> bool,
) -> bool {
    let place = |i: u32| {
        let (along, beyond) = (f64::from(i % ALONG), f64::from(i / ALONG));
        Point2::new(
            along_m + ALONG_M.0 + ALONG_M.1 * along,
            wall_m + outward * (BEYOND_M.0 + BEYOND_M.1 * beyond),
        )
    };
    let places = ALONG * BEYOND;
    let seen = (0..places).filter(|&i| is_floor(place(i))).count();
    seen as f64 > MAX_SHARE * f64::from(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_beyond_a_wall_refutes_it() {
        for outward in [1.0, -1.0] {
            let refuted = |to_m: f64, door: std::ops::Range<f64>| {
                is_refuted(outward * 0.8, outward, 5.0, |place| {
                    outward * place.y < to_m || door.contains(&place.x) && outward * place.y < to_m + 1.0
                })
            };
            assert!(refuted(1.5, 0.0..0.0));
            assert!(
                !refuted(0.8, 0.0..0.0) && !refuted(0.9, 0.0..0.0),
                "floor up to the wall, and a bit farther"
            );
            assert!(!refuted(0.8, 5.5..6.4), "an open door");
            assert!(
                !is_refuted(outward * 0.8, outward, 5.0, |place| outward * place.y > 0.8 && place.x > 6.0)
            );
        }
    }
}
