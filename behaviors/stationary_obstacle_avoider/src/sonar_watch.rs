//! Newest range scan, and whether an echo in it is on the robot's path; a silent, lost or malformed scan counts as one.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use yamabico_core::behavior::{Inputs, Slot};
use yamabico_core::geometry::wrap_angle;
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::range_scan::{MAX_SECTORS, sectors};
use yamabico_core::time::Time;

/// Newest scan of sonars, or of a laser scanner with its beams in sectors. Without beams it counts as an echo.
#[derive(Clone, Debug)]
pub struct SonarWatch {
    beams: Vec<Beam>,
    newest: Option<Time>,
}

impl Default for SonarWatch {
    fn default() -> Self {
        Self { beams: Vec::with_capacity(MAX_SECTORS), newest: None }
    }
}

impl SonarWatch {
    /// Reads the new scans. Returns true if the state machine must take a step: after a new scan, a lost one, or a
    /// silence longer than `stale_s`.
    pub fn update(&mut self, inputs: &Inputs<'_>, slot: &Slot<RangeScanHeader>, stale_s: f64) -> bool {
        let mut must_step = false;
        let now = inputs.now();
        for scan in inputs.fresh(slot) {
            let stamp = Time(scan.header.stamp_ns);
            if !stamp.is_next(self.newest, now) {
                continue;
            }
            must_step = true;
            self.newest = Some(stamp);
            sectors(scan.items, &mut self.beams);
        }
        let is_silent = self.newest.is_none_or(|newest| now.seconds_after(newest) > stale_s);
        if is_silent || inputs.lost(slot) > 0 {
            self.beams.clear();
            must_step = true;
        }
        must_step
    }

    /// Returns true if an echo nearer than `gate_m` (m, from its sensor) may be on the straight strip ahead that
    /// extends `half_width_m` (m) to each side of the robot, or if there is no scan. A range that is NaN counts.
    #[must_use]
    pub fn has_echo(&self, gate_m: f64, half_width_m: f64) -> bool {
        let is_on_path = |beam: &Beam| {
            let echo_m = beam.echo_m().filter(|&range_m| range_m < gate_m || range_m.is_nan());
            echo_m.is_some_and(|range_m| reaches_strip(beam, range_m, half_width_m))
        };
        self.is_silent() || self.beams.iter().any(is_on_path)
    }

    /// Returns the range of the nearest echo of a beam whose azimuth lies in `azimuths` (rad), m from its sensor; infinite
    /// without one. An echo whose range or azimuth is NaN has the range 0.
    #[must_use]
    pub fn nearest_m(&self, azimuths: Range<f64>) -> f64 {
        let range_m = |beam: &Beam| {
            let azimuth = wrap_angle(beam.azimuth_rad);
            let is_inside = azimuth.is_nan() || azimuths.contains(&azimuth);
            let range_m = beam.echo_m().filter(|_| is_inside)?;
            Some(if azimuth.is_nan() || range_m.is_nan() { 0.0 } else { range_m })
        };
        self.beams.iter().filter_map(range_m).fold(f64::INFINITY, f64::min)
    }

    /// Returns true if there are no beams: the newest scan is stale, lost or empty.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.beams.is_empty()
    }

    /// Returns the beams of the newest scan.
    #[must_use]
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// Returns the stamp of the newest scan.
    #[must_use]
    pub fn newest(&self) -> Option<Time> {
        self.newest
    }
}

/// Returns true if a point of the beam's cone at `range_m` is on the strip ahead of half width `half_width_m`, m; also
/// if the geometry of the beam or the range is NaN.
fn reaches_strip(beam: &Beam, range_m: f64, half_width_m: f64) -> bool {
    let axis = wrap_angle(beam.azimuth_rad);
    let (right, left) = (axis - 0.5 * beam.cone_rad, axis + 0.5 * beam.cone_rad);
    let is_behind = right > FRAC_PI_2 || left < -FRAC_PI_2;
    let lateral_m = |azimuth: f64| beam.y_m + range_m * azimuth.clamp(-FRAC_PI_2, FRAC_PI_2).sin();
    let is_beside = lateral_m(right) > half_width_m || lateral_m(left) < -half_width_m;
    !is_behind && !is_beside
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::NO_ECHO;

    fn beam(azimuth_deg: f64, range_m: f64) -> Beam {
        let azimuth_rad = azimuth_deg.to_radians();
        let (sin, cos) = azimuth_rad.sin_cos();
        let cone_rad = 22_f64.to_radians();
        Beam { azimuth_rad, cone_rad, range_m, x_m: 0.2 * cos, y_m: 0.2 * sin, ..Beam::default() }
    }

    fn has_echo(beams: &[Beam], half_width_m: f64) -> bool {
        SonarWatch { beams: beams.to_vec(), newest: None }.has_echo(0.5, half_width_m)
    }

    #[test]
    fn an_echo_counts_where_its_cone_reaches_the_path() {
        assert!(has_echo(&[beam(35.0, 2.0), beam(0.0, 0.49)], 0.23));
        assert!(!has_echo(&[beam(35.0, 2.0), beam(0.0, 0.5)], 0.23), "the gate is strict");
        // 24 degrees to the side, 0.12 m at 0.3 m: the inner side of the cone is 0.24 m beside the center.
        for side in [1.0, -1.0] {
            assert!(!has_echo(&[beam(side * 35.0, 0.3)], 0.23));
            assert!(has_echo(&[beam(side * 35.0, 0.3)], 0.25) && has_echo(&[beam(side * 35.0, 0.2)], 0.23));
            assert!(has_echo(&[beam(side * 10.0, 0.3)], 0.23));
            assert!(!has_echo(&[beam(side * 90.0, 0.2)], 0.23) && has_echo(&[beam(side * 90.0, 0.02)], 0.23));
        }
    }

    #[test]
    fn an_echo_from_behind_is_not_on_the_path() {
        assert!(!has_echo(&[beam(180.0, 0.2), beam(-150.0, 0.2), beam(210.0, 0.1)], 0.23));
    }

    #[test]
    fn the_nearest_echo_of_a_sector_is_found() {
        let nearest_m =
            |beams: &[Beam]| SonarWatch { beams: beams.to_vec(), newest: None }.nearest_m(-0.3..0.3);
        assert_eq!(nearest_m(&[beam(0.0, 0.8), beam(10.0, 0.7), beam(30.0, 0.2)]), 0.7);
        assert_eq!(nearest_m(&[Beam { flags: NO_ECHO, ..beam(0.0, 0.4) }]), f64::INFINITY);
        assert_eq!(nearest_m(&[beam(0.0, 0.8), beam(5.0, f64::NAN)]), 0.0);
        assert_eq!(nearest_m(&[Beam { azimuth_rad: f64::NAN, ..beam(0.0, 0.8) }]), 0.0);
        assert_eq!(nearest_m(&[beam(60.0, f64::NAN)]), f64::INFINITY);
    }

    #[test]
    fn silence_and_malformed_beams_count_as_echoes() {
        assert!(has_echo(&[], 0.23) && SonarWatch::default().has_echo(0.5, 0.23));
        let malformed =
            [beam(0.0, f64::NAN), beam(0.0, -1.0), Beam { azimuth_rad: f64::NAN, ..beam(0.0, 0.3) }];
        for beam in malformed {
            assert!(has_echo(&[beam], 0.23), "{beam:?}");
        }
        assert!(!has_echo(&[Beam { flags: NO_ECHO, ..beam(0.0, f64::NAN) }], 0.23));
    }
}
