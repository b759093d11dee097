//! The gate, which classifies one scan, and the latch, which holds a halt until enough scans in a row are clean.

use yamabico_core::message::Beam;

/// Ranges below which an echo matters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Range below which an echo halts, measured from the sensor, m. An echo at exactly this range is clean.
    pub gate_m: f64,
    /// Distance from the robot's center below which an echo forbids turning in place, m.
    pub turning_radius_m: f64,
}

/// The class of one scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// No echo inside the gate.
    Clean,
    /// At least one echo inside the gate.
    Echo {
        /// Range of the nearest echo, measured from its sensor, m.
        range_m: f64,
        /// Permission to turn in place.
        turning: Turning,
    },
    /// No beams, or a range that is negative or not finite: no evidence of free space.
    Malformed,
}

/// Permission to turn in place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turning {
    /// No echo inside the circle that turning requires.
    Open,
    /// An echo inside that circle, or no valid scan.
    Closed,
}

impl Gate {
    /// Classifies one scan. Does not panic on any input.
    #[must_use]
    pub fn read(&self, beams: &[Beam]) -> Reading {
        if beams.is_empty() {
            return Reading::Malformed;
        }
        let mut nearest: Option<f64> = None;
        let mut turning = Turning::Open;
        for beam in beams {
            let Some(range_m) = beam.echo_m() else { continue };
            if !range_m.is_finite() || range_m < 0.0 {
                return Reading::Malformed;
            }
            if range_m < self.gate_m {
                nearest = Some(nearest.map_or(range_m, |best| best.min(range_m)));
            }
            // A NaN in the beam's geometry compares false, and so forbids turning.
            let is_outside = distance_from_center(beam, range_m) > self.turning_radius_m;
            if !is_outside {
                turning = Turning::Closed;
            }
        }
        nearest.map_or(Reading::Clean, |range_m| Reading::Echo { range_m, turning })
    }
}

/// Holds a halt until enough clean readings came in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latch {
    clean: u32,
    needed: u32,
}

impl Latch {
    /// Returns a latch that holds, and releases after `needed` clean readings in a row.
    #[must_use]
    pub const fn new(needed: u32) -> Self {
        Self { clean: 0, needed }
    }

    /// Counts a clean reading.
    pub fn clean(&mut self) {
        self.clean = self.clean.saturating_add(1).min(self.needed);
    }

    /// Holds from now on.
    pub fn trip(&mut self) {
        self.clean = 0;
    }

    /// Returns true while the latch holds.
    #[must_use]
    pub const fn is_holding(&self) -> bool {
        self.clean < self.needed
    }

    /// Number of clean readings still needed to release.
    #[must_use]
    pub const fn missing(&self) -> u32 {
        self.needed - self.clean
    }
}

/// Returns the minimum distance (m) from the robot's center to the points of the cone at this range.
fn distance_from_center(beam: &Beam, range_m: f64) -> f64 {
    let distance_at = |part: f64| {
        let azimuth = beam.azimuth_rad + part * 0.5 * beam.cone_rad;
        (beam.x_m + range_m * azimuth.cos()).hypot(beam.y_m + range_m * azimuth.sin())
    };
    [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().map(distance_at).fold(f64::INFINITY, |nearest, distance| {
        if distance.is_nan() { f64::NEG_INFINITY } else { nearest.min(distance) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::NO_ECHO;

    const GATE: Gate = Gate { gate_m: 0.5, turning_radius_m: 0.3 };

    fn beam(range_m: f64) -> Beam {
        Beam { range_m, x_m: 0.2, cone_rad: 0.4, ..Beam::default() }
    }

    #[test]
    fn the_gate_is_strict() {
        assert_eq!(GATE.read(&[beam(0.5), beam(2.0)]), Reading::Clean);
        let echo = GATE.read(&[beam(2.0), beam(0.499), beam(0.4999)]);
        assert_eq!(echo, Reading::Echo { range_m: 0.499, turning: Turning::Open });
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
        assert_eq!(GATE.read(&[crooked]), Reading::Echo { range_m: 0.4, turning: Turning::Closed });
    }

    #[test]
    fn what_stands_in_the_turning_circle_closes_it() {
        assert!(matches!(GATE.read(&[beam(0.05)]), Reading::Echo { turning: Turning::Closed, .. }));
        let sideways = Beam { azimuth_rad: 1.5, y_m: 0.1, ..beam(0.08) };
        assert!(matches!(GATE.read(&[beam(0.4), sideways]), Reading::Echo { turning: Turning::Closed, .. }));
    }

    #[test]
    fn the_latch_counts_in_a_row() {
        let mut latch = Latch::new(3);
        assert!(latch.is_holding());
        for _ in 0..2 {
            latch.clean();
        }
        assert_eq!((latch.is_holding(), latch.missing()), (true, 1));
        latch.trip();
        for _ in 0..5 {
            latch.clean();
        }
        assert!(!latch.is_holding());
    }
}
