//! Room around the robot, from the sonar and from known obstacles.

use yamabico_core::geometry::angle_difference;
use yamabico_core::message::{Beam, Obstacle};

/// Distance to keep from an obstacle in passing, m.
const PASSING_M: f64 = 0.05;

/// Range of the nearest echo in each direction, or distance from the footprint to an obstacle, m; infinite for a direction that is in
/// view and free, NaN for one that nothing covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Straight ahead.
    pub ahead_m: f64,
    /// Ahead to the left.
    pub left_m: f64,
    /// Ahead to the right.
    pub right_m: f64,
    /// Behind.
    pub behind_m: f64,
}

impl Room {
    /// No direction is in view.
    pub const UNKNOWN: Room =
        Room { ahead_m: f64::NAN, left_m: f64::NAN, right_m: f64::NAN, behind_m: f64::NAN };

    /// Reads a scan.
    #[must_use]
    pub fn of(beams: &[Beam]) -> Self {
        let nearest = |center_deg: f64, half_width_deg: f64| {
            let covers = |beam: &&Beam| {
                let offset = angle_difference(beam.azimuth_rad, center_deg.to_radians());
                offset.abs() < half_width_deg.to_radians()
            };
            // `f64::min` ignores the NaN of the start.
            let ranges = beams.iter().filter(covers).map(|beam| beam.echo_m().unwrap_or(f64::INFINITY));
            ranges.fold(f64::NAN, f64::min)
        };
        Self {
            ahead_m: nearest(0.0, 15.0),
            left_m: nearest(50.0, 35.0),
            right_m: nearest(-50.0, 35.0),
            behind_m: nearest(180.0, 45.0),
        }
    }

    /// Lessens the room straight ahead and behind by obstacles (robot frame) in the way of a robot of `radius_m`: sonars miss what
    /// they meet at an angle. Where no beam looks ahead, the room there stays unknown.
    #[must_use]
    pub fn limited_by(mut self, obstacles: &[Obstacle], radius_m: f64) -> Self {
        for obstacle in
            obstacles.iter().filter(|obstacle| obstacle.y.abs() < obstacle.radius_m + radius_m + PASSING_M)
        {
            let room_m = obstacle.x.abs() - obstacle.radius_m - radius_m;
            if obstacle.x < 0.0 {
                self.behind_m = self.behind_m.min(room_m);
            } else if !self.ahead_m.is_nan() {
                self.ahead_m = self.ahead_m.min(room_m);
            }
        }
        self
    }

    /// Returns the side with more room: 1 for the left, -1 for the right, `otherwise` if they are equal or not in view.
    #[must_use]
    pub fn wider_side(&self, otherwise: f64) -> f64 {
        if self.left_m > self.right_m {
            1.0
        } else if self.right_m > self.left_m {
            -1.0
        } else {
            otherwise
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::NO_ECHO;

    #[test]
    fn directions_without_a_beam_are_unknown() {
        let beam =
            |degrees: f64, range_m| Beam { azimuth_rad: degrees.to_radians(), range_m, ..Beam::default() };
        let silent = Beam { flags: NO_ECHO, ..beam(35.0, 0.0) };
        let room = Room::of(&[beam(-35.0, 0.8), beam(0.0, 0.6), silent]);
        assert_eq!((room.ahead_m, room.left_m, room.right_m), (0.6, f64::INFINITY, 0.8));
        assert!(room.behind_m.is_nan());
        assert_eq!(room.wider_side(-1.0), 1.0);
        assert_eq!(Room::of(&[]).wider_side(-1.0), -1.0);
        assert_eq!(Room::of(&[beam(-170.0, 0.3)]).behind_m, 0.3);
    }

    #[test]
    fn obstacles_in_the_way_lessen_the_room() {
        let obstacle = |x, y| Obstacle { x, y, radius_m: 0.1, ..Obstacle::default() };
        let silent = Room { ahead_m: f64::INFINITY, ..Room::UNKNOWN };
        let room = silent.limited_by(&[obstacle(0.8, 0.3), obstacle(1.2, 0.0), obstacle(-0.7, -0.1)], 0.2);
        assert!((room.ahead_m - 0.5).abs() < 1e-9 && (room.behind_m - 0.4).abs() < 1e-9, "{room:?}");
        let passed = silent.limited_by(&[obstacle(0.8, 0.4), obstacle(f64::NAN, 0.0)], 0.2);
        assert!(passed.ahead_m.is_infinite() && passed.behind_m.is_nan(), "{passed:?}");
        assert!(Room::UNKNOWN.limited_by(&[obstacle(0.8, 0.0)], 0.2).ahead_m.is_nan());
    }
}
