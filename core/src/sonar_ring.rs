//! Geometry of a ring of sonars, each of which looks away from the robot's center.

use crate::behavior::ParameterError;
use crate::message::Beam;

/// Sonars of a ring, as robot files describe them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingGeometry<'a> {
    /// Directions, degrees, positive to the left.
    pub azimuths_deg: &'a [f64],
    /// Opening angle of each, degrees.
    pub cone_deg: f64,
    /// Distance of each from the robot's center, in its direction, m.
    pub from_center_m: f64,
    /// Minimum and maximum range, m.
    pub range_m: [f64; 2],
}

impl RingGeometry<'_> {
    /// Checks directions and ranges.
    ///
    /// # Errors
    /// The key to change: `azimuths_deg` or `max_m`.
    pub fn check(&self) -> Result<(), ParameterError> {
        if self.range_m[1] <= self.range_m[0] {
            return Err(ParameterError::new("max_m", "must be above min_m"));
        }
        let is_direction = |azimuth_deg: &f64| (-180.0..=180.0).contains(azimuth_deg);
        if self.azimuths_deg.is_empty() || !self.azimuths_deg.iter().all(is_direction) {
            let problem = "needs at least one azimuth; each must be -180 to 180 degrees";
            return Err(ParameterError::new("azimuths_deg", problem));
        }
        Ok(())
    }

    /// One beam for each sonar, without a range.
    #[must_use]
    pub fn beams(&self) -> Vec<Beam> {
        let beam = |azimuth_deg: &f64| {
            let azimuth_rad = azimuth_deg.to_radians();
            let (sin, cos) = azimuth_rad.sin_cos();
            let (x_m, y_m) = (self.from_center_m * cos, self.from_center_m * sin);
            Beam { azimuth_rad, cone_rad: self.cone_deg.to_radians(), x_m, y_m, ..Beam::default() }
        };
        self.azimuths_deg.iter().map(beam).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sonars_look_away_from_the_center() {
        let ring = RingGeometry {
            azimuths_deg: &[0.0, 90.0, -180.0],
            cone_deg: 30.0,
            from_center_m: 0.2,
            range_m: [0.02, 3.0],
        };
        assert!(ring.check().is_ok());
        let at: Vec<[f64; 2]> = ring.beams().iter().map(|beam| [beam.x_m, beam.y_m]).collect();
        for (at, expected) in at.iter().zip([[0.2, 0.0], [0.0, 0.2], [-0.2, 0.0]]) {
            assert!((at[0] - expected[0]).abs() < 1e-12 && (at[1] - expected[1]).abs() < 1e-12, "{at:?}");
        }
    }

    #[test]
    fn contradictions_name_their_key() {
        let good = RingGeometry {
            azimuths_deg: &[20.0, -20.0],
            cone_deg: 25.0,
            from_center_m: 0.1,
            range_m: [0.02, 3.0],
        };
        let refused = [
            (RingGeometry { range_m: [0.2, 0.2], ..good }, "max_m"),
            (RingGeometry { azimuths_deg: &[], ..good }, "azimuths_deg"),
            (RingGeometry { azimuths_deg: &[0.0, 181.0], ..good }, "azimuths_deg"),
            (RingGeometry { azimuths_deg: &[f64::NAN], ..good }, "azimuths_deg"),
        ];
        for (ring, key) in refused {
            assert!(ring.check().unwrap_err().to_string().contains(key), "{ring:?}");
        }
    }
}
