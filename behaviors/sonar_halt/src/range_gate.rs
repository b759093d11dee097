//! The gate that judges by range alone, whatever the direction.

use yamabico_core::message::{Axes, Beam};

use crate::reading::{Reading, TRANSLATION, echoes, is_within};

/// One gate for all beams. An echo in the robot's circle halts at any range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeGate {
    /// Range below which an echo halts, measured from the sensor, m. An echo at exactly this range is clean.
    pub gate_m: f64,
    /// Distance from the robot's center below which an echo also forbids turning in place, m.
    pub turning_radius_m: f64,
}

impl RangeGate {
    /// Classifies one scan. Does not panic on any input.
    #[must_use]
    pub fn read(&self, beams: &[Beam]) -> Reading {
        let Some(echoes) = echoes(beams) else { return Reading::Malformed };
        let mut nearest: Option<f64> = None;
        let mut stops = TRANSLATION;
        for (beam, range_m) in echoes {
            let is_inside = is_within(self.turning_radius_m, beam, range_m);
            if is_inside || range_m < self.gate_m {
                nearest = Some(nearest.map_or(range_m, |best| best.min(range_m)));
            }
            if is_inside {
                stops = Axes::ALL;
            }
        }
        nearest.map_or(Reading::Clean, |range_m| Reading::Echo { range_m, path_m: None, stops })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::NO_ECHO;

    const GATE: RangeGate = RangeGate { gate_m: 0.5, turning_radius_m: 0.3 };

    fn beam(range_m: f64) -> Beam {
        Beam { range_m, x_m: 0.2, cone_rad: 0.4, ..Beam::default() }
    }

    fn echo(range_m: f64, stops: Axes) -> Reading {
        Reading::Echo { range_m, path_m: None, stops }
    }

    #[test]
    fn the_gate_is_strict() {
        assert_eq!(GATE.read(&[beam(0.5), beam(2.0)]), Reading::Clean);
        assert_eq!(GATE.read(&[beam(2.0), beam(0.499), beam(0.4999)]), echo(0.499, TRANSLATION));
    }

    #[test]
    fn no_echo_is_clean_whatever_its_number() {
        let silent = Beam { flags: NO_ECHO, range_m: f64::NAN, ..Beam::default() };
        assert_eq!(GATE.read(&[silent]), Reading::Clean);
    }

    #[test]
    fn nonsense_is_not_clean() {
        for range in [f64::NAN, f64::INFINITY, -0.1] {
            assert_eq!(GATE.read(&[beam(2.0), beam(range)]), Reading::Malformed);
        }
        assert_eq!(GATE.read(&[]), Reading::Malformed);
        let crooked = Beam { azimuth_rad: f64::NAN, ..beam(0.4) };
        assert_eq!(GATE.read(&[crooked]), echo(0.4, Axes::ALL));
    }

    #[test]
    fn what_stands_in_the_turning_circle_closes_it() {
        let gate = RangeGate { gate_m: 0.2, ..GATE };
        let central = Beam { x_m: 0.0, ..beam(0.25) };
        assert_eq!(gate.read(&[central]), echo(0.25, Axes::ALL), "beyond the gate");
        assert_eq!(GATE.read(&[beam(0.05)]), echo(0.05, Axes::ALL));
        let sideways = Beam { azimuth_rad: 1.5, y_m: 0.1, ..beam(0.08) };
        assert_eq!(GATE.read(&[beam(0.4), sideways]), echo(0.08, Axes::ALL));
    }
}
