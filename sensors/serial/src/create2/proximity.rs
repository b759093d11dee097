//! Range scan from the robot's touch, cliff and light sensors, so that a behavior for sonars halts the robot by them.

use yamabico_core::message::{Beam, NO_ECHO, RangeScanHeader};

use super::stream::Readings;

/// Radius of the robot, m: its sensors are at the rim.
pub(crate) const RADIUS_M: f64 = 0.17;
/// Range that is reported for something that the light bumper sees, m. It sees light walls from about 0.1 m and dark ones later:
/// the signal tells the material as much as the distance.
const NEAR_M: f64 = 0.05;
/// Maximum range that the scan claims, m.
pub(crate) const MAX_M: f64 = 0.1;
/// Directions of the light bumper's sensors, from the left to the right, degrees (Open Interface Specification, figure of the
/// sensors; read off the drawing).
const LIGHTS_DEG: [f64; 6] = [65.0, 38.0, 13.0, -13.0, -38.0, -65.0];
/// Directions of the cliff sensors, from the left to the right, degrees.
const CLIFFS_DEG: [f64; 4] = [60.0, 20.0, -20.0, -60.0];
/// Direction of the wall sensor, degrees.
const WALL_DEG: f64 = -80.0;
/// Directions of the two halves of the bumper, left and right, degrees, and the opening angle of each.
const BUMPERS_DEG: [f64; 2] = [45.0, -45.0];
const BUMPER_CONE_DEG: f64 = 90.0;
/// Opening angle of the other sensors, degrees.
const CONE_DEG: f64 = 25.0;

/// Number of beams.
pub(crate) const BEAMS: usize = LIGHTS_DEG.len() + CLIFFS_DEG.len() + 1 + BUMPERS_DEG.len();

/// Scan of the sensors around the robot's front.
pub(crate) struct Proximity;

impl Proximity {
    /// Returns a scan: contact, a cliff or a dropped wheel at the rim, walls and obstacles at 5 cm from it.
    pub fn scan(readings: &Readings, stamp_ns: u64, sequence: u64) -> (RangeScanHeader, Vec<Beam>) {
        let header = RangeScanHeader { stamp_ns, sequence, min_m: 0.0, max_m: MAX_M };
        let bit = |bits: u8, i: usize| bits >> i & 1 != 0;
        let mut beams = Vec::with_capacity(BEAMS);
        for (i, azimuth_deg) in LIGHTS_DEG.into_iter().enumerate() {
            beams.push(beam(azimuth_deg, CONE_DEG, bit(readings.near, i).then_some(NEAR_M)));
        }
        for (is_cliff, azimuth_deg) in readings.cliffs.into_iter().zip(CLIFFS_DEG) {
            beams.push(beam(azimuth_deg, CONE_DEG, is_cliff.then_some(0.0)));
        }
        beams.push(beam(WALL_DEG, CONE_DEG, readings.wall.then_some(NEAR_M)));
        // A dropped wheel, bits 2 and 3, counts as contact at its side. The right side comes first in the bits.
        for (side, azimuth_deg) in BUMPERS_DEG.into_iter().enumerate() {
            let touches = bit(readings.bumps, 1 - side) || bit(readings.bumps, 3 - side);
            beams.push(beam(azimuth_deg, BUMPER_CONE_DEG, touches.then_some(0.0)));
        }
        (header, beams)
    }
}

fn beam(azimuth_deg: f64, cone_deg: f64, echo_m: Option<f64>) -> Beam {
    let azimuth_rad = azimuth_deg.to_radians();
    let (sin, cos) = azimuth_rad.sin_cos();
    Beam {
        azimuth_rad,
        cone_rad: cone_deg.to_radians(),
        range_m: echo_m.unwrap_or(MAX_M),
        x_m: RADIUS_M * cos,
        y_m: RADIUS_M * sin,
        flags: if echo_m.is_some() { 0 } else { NO_ECHO },
        reserved: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_are_on_their_sides() {
        let echoes = |readings: Readings| {
            let (_, beams) = Proximity::scan(&readings, 1, 1);
            assert_eq!(beams.len(), BEAMS);
            let echoes =
                beams.iter().filter_map(|beam| Some((beam.azimuth_rad.to_degrees().round(), beam.echo_m()?)));
            echoes.collect::<Vec<_>>()
        };
        assert_eq!(echoes(Readings::default()), []);
        assert_eq!(echoes(Readings { bumps: 0b0001, ..Readings::default() }), [(-45.0, 0.0)], "right bumper");
        assert_eq!(
            echoes(Readings { bumps: 0b1000, ..Readings::default() }),
            [(45.0, 0.0)],
            "left wheel dropped"
        );
        assert_eq!(echoes(Readings { near: 1, ..Readings::default() }), [(65.0, NEAR_M)]);
        let cliff = Readings { cliffs: [true, false, false, false], ..Readings::default() };
        assert_eq!(echoes(cliff), [(60.0, 0.0)]);
        assert_eq!(echoes(Readings { wall: true, ..Readings::default() }), [(-80.0, NEAR_M)]);
    }
}
