//! Gate that halts for echoes on the swept path within the stopping distance.

use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Axes, Axis, Beam, Twist};

use crate::reading::{Reading, TRANSLATION, echoes, is_within};
use crate::swept_path::SweptPath;

/// Distance between two points of an echo's arc, m.
const STEP_M: f64 = 0.01;
/// Speed below which a robot stands, m/s.
const STANDING_MPS: f64 = 0.02;

/// Distance that the robot needs to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoppingDistance {
    /// Time from an echo until the robot brakes, s.
    pub reaction_s: f64,
    /// Deceleration, m/s^2.
    pub deceleration_mps2: f64,
    /// Distance that must remain after the stop, m.
    pub reserve_m: f64,
}

impl StoppingDistance {
    /// Returns the stopping distance (m) from this speed, with the reserve.
    #[must_use]
    pub fn from_speed_m(&self, speed_mps: f64) -> f64 {
        let braking_m = speed_mps * speed_mps / (2.0 * self.deceleration_mps2);
        speed_mps.abs() * self.reaction_s + braking_m + self.reserve_m
    }
}

/// A gate along the path of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweptGate {
    /// Radius of the footprint with its margin, m.
    pub radius_m: f64,
    /// Distance from the robot's center below which an echo forbids turning in place, m.
    pub turning_radius_m: f64,
    /// Distance that the robot needs to stop.
    pub stopping: StoppingDistance,
}

impl SweptGate {
    /// Classifies one scan for a robot with the motions `twists`, such as the measured twist and the wish. A standstill
    /// counts only where no other motion is given: a robot that stands may leave what it touches. Does not panic on any input.
    #[must_use]
    pub fn read(&self, beams: &[Beam], twists: &[Twist]) -> Reading {
        let Some(echoes) = echoes(beams) else { return Reading::Malformed };
        let mut first: Option<(f64, f64)> = None;
        let mut turning: Option<f64> = None;
        // A speed that is not a number counts as a motion.
        let stands = |twist: &Twist| twist.speed() < STANDING_MPS;
        let all_stand = twists.iter().all(stands);
        for (beam, range_m) in echoes {
            for twist in twists.iter().filter(|twist| all_stand || !stands(twist)) {
                if let Some(path_m) = self.blocked_after_m(beam, range_m, twist)
                    && first.is_none_or(|(shortest_m, _)| path_m < shortest_m)
                {
                    first = Some((path_m, range_m));
                }
            }
            if is_within(self.turning_radius_m, beam, range_m) {
                turning = Some(turning.map_or(range_m, |nearest| nearest.min(range_m)));
            }
        }
        let axes = |translates: bool, turns: bool| match (translates, turns) {
            (true, true) => Axes::ALL,
            (true, false) => TRANSLATION,
            (false, _) => Axes::from(Axis::Angular),
        };
        match (first, turning) {
            (Some((path_m, range_m)), turning) => {
                Reading::Echo { range_m, path_m: Some(path_m), stops: axes(true, turning.is_some()) }
            }
            (None, Some(range_m)) => Reading::Echo { range_m, path_m: None, stops: axes(false, true) },
            (None, None) => Reading::Clean,
        }
    }

    /// Returns the length of the path (m) until contact with an echo if the robot could not stop before it.
    fn blocked_after_m(&self, beam: &Beam, range_m: f64, twist: &Twist) -> Option<f64> {
        let path = SweptPath::new(twist, self.radius_m);
        let stopping_m = self.stopping.from_speed_m(path.speed_mps());
        // The path is at least as long as the straight line to the echo.
        let is_far = range_m - beam.x_m.hypotenuse(beam.y_m) - self.radius_m > stopping_m;
        if is_far {
            return None;
        }
        path.approach_to_echo_m(beam, range_m, STEP_M).filter(|&path_m| path_m <= stopping_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GATE: SweptGate = SweptGate {
        radius_m: 0.28,
        turning_radius_m: 0.23,
        stopping: StoppingDistance { reaction_s: 0.15, deceleration_mps2: 1.0, reserve_m: 0.1 },
    };

    fn beam(azimuth_deg: f64, range_m: f64) -> Beam {
        let azimuth_rad = azimuth_deg.to_radians();
        let (y_m, x_m) = azimuth_rad.sin_cos();
        Beam { azimuth_rad, range_m, cone_rad: 0.384, x_m: 0.2 * x_m, y_m: 0.2 * y_m, ..Beam::default() }
    }

    fn stops(beams: &[Beam], twists: &[Twist]) -> Axes {
        match GATE.read(beams, twists) {
            Reading::Clean => Axes::NONE,
            Reading::Echo { stops, .. } => stops,
            Reading::Malformed => panic!("malformed"),
        }
    }

    #[test]
    fn a_wall_beside_the_path_is_clean_and_one_across_it_is_not() {
        let forward = Twist::planar(0.4, 0.0);
        assert_eq!(stops(&[beam(35.0, 0.45), beam(-35.0, 0.45)], &[forward]), Axes::NONE);
        assert_eq!(stops(&[beam(0.0, 0.3)], &[forward]), TRANSLATION);
        assert_eq!(stops(&[beam(0.0, 0.3)], &[Twist::ZERO, forward]), TRANSLATION, "the wish counts");
    }

    #[test]
    fn the_robot_may_leave_what_it_almost_touches_but_not_turn_beside_it() {
        let touching = beam(0.0, 0.02);
        assert_eq!(stops(&[touching], &[Twist::planar(0.1, 0.0)]), Axes::ALL);
        assert_eq!(stops(&[touching], &[Twist::planar(-0.1, 0.0)]), Axes::from(Axis::Angular));
        assert_eq!(stops(&[beam(0.0, 0.06)], &[Twist::planar(-0.1, 0.0)]), Axes::NONE);
        assert_eq!(
            stops(&[beam(0.0, 0.06)], &[Twist::ZERO, Twist::planar(-0.1, 0.0)]),
            Axes::NONE,
            "from a standstill"
        );
        let moving = [Twist::planar(0.1, 0.0), Twist::planar(-0.1, 0.0)];
        assert_eq!(stops(&[beam(0.0, 0.06)], &moving), TRANSLATION, "it stops first");
    }

    #[test]
    fn a_robot_that_stands_and_wants_to_stand_halts_for_nothing_outside_its_disc() {
        assert_eq!(stops(&[beam(0.0, 0.1)], &[Twist::ZERO]), Axes::NONE);
        assert_eq!(stops(&[beam(0.0, 0.06)], &[Twist::ZERO]), TRANSLATION);
    }
}
