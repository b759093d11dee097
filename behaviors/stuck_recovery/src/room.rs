//! Room around the robot, from the sonar and from known obstacles.

use yamabico_core::geometry::{Hypotenuse, angle_difference};
use yamabico_core::message::{Beam, Obstacle};

/// Distance to keep from an obstacle in passing, m.
const PASSING_M: f64 = 0.05;

/// Distance from the footprint to the nearest echo or obstacle in each direction from the robot's center, m; infinite for a direction that is in
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

    /// Reads a scan of a robot of `radius_m`.
    #[must_use]
    pub fn of(beams: &[Beam], radius_m: f64) -> Self {
        let nearest = |center_deg: f64, half_width_deg: f64| {
            let covers = |azimuth_rad: f64| {
                angle_difference(azimuth_rad, center_deg.to_radians()).abs() < half_width_deg.to_radians()
            };
            let rooms = beams.iter().map(|beam| toward(beam, radius_m));
            // `f64::min` ignores the NaN of the start.
            rooms
                .filter(|(azimuth_rad, _)| covers(*azimuth_rad))
                .fold(f64::NAN, |nearest_m, (_, room_m)| nearest_m.min(room_m))
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

/// Direction of a beam's echo from the robot's center, rad, and its distance from a footprint of `radius_m`, m; without an echo, the
/// direction of the beam, and infinity.
fn toward(beam: &Beam, radius_m: f64) -> (f64, f64) {
    let Some(range_m) = beam.echo_m() else { return (beam.azimuth_rad, f64::INFINITY) };
    let (sin, cos) = beam.azimuth_rad.sin_cos();
    let (x, y) = (beam.x_m + range_m * cos, beam.y_m + range_m * sin);
    (y.atan2(x), x.hypotenuse(y) - radius_m)
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
        let room = Room::of(&[beam(-35.0, 0.8), beam(0.0, 0.6), silent], 0.0);
        assert_eq!((room.ahead_m, room.left_m, room.right_m), (0.6, f64::INFINITY, 0.8));
        assert!(room.behind_m.is_nan());
        assert_eq!(room.wider_side(-1.0), 1.0);
        assert_eq!(Room::of(&[], 0.0).wider_side(-1.0), -1.0);
        assert!((Room::of(&[beam(-170.0, 0.3)], 0.0).behind_m - 0.3).abs() < 1e-9);
    }

    #[test]
    fn the_room_counts_from_the_footprint() {
        for degrees in [0.0_f64, 50.0, -50.0, 180.0] {
            let azimuth_rad = degrees.to_radians();
            let center = Beam { azimuth_rad, range_m: 0.35, ..Beam::default() };
            let (sin, cos) = azimuth_rad.sin_cos();
            let rim = Beam { range_m: 0.15, x_m: 0.2 * cos, y_m: 0.2 * sin, ..center };
            for beam in [center, rim] {
                let room = Room::of(&[beam], 0.2);
                let nearest_m = [room.ahead_m, room.left_m, room.right_m, room.behind_m]
                    .into_iter()
                    .fold(f64::INFINITY, f64::min);
                assert!((nearest_m - 0.15).abs() < 1e-9, "{degrees} degrees: {room:?}");
            }
        }
        let behind = Beam { azimuth_rad: std::f64::consts::PI, range_m: 0.5, x_m: 0.2, ..Beam::default() };
        assert!((Room::of(&[behind], 0.2).behind_m - 0.1).abs() < 1e-9, "from a laser scanner at the front");
        let beside = Beam { azimuth_rad: 0.0, range_m: 0.02, x_m: 0.05, y_m: 0.15, ..Beam::default() };
        assert!(Room::of(&[beside], 0.2).ahead_m.is_nan(), "it looks ahead at what is aside");
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
