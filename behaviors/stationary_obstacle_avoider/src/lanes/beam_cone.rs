//! The core of a sonar's beam, in which most of its energy is.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Beam;

use super::AHEAD_RAD;

/// Share of a beam's opening angle that its core has.
const CORE_SHARE: f64 = 0.6;
/// Directions in which the core is sampled.
const FAN: usize = 9;

/// Log odds of the cone before an echo, and of a cone without one.
const BEFORE_ECHO: f32 = -0.3;
const SILENCE: f32 = -0.1;
/// Distance before an echo that is not free, m.
const ECHO_DEPTH_M: f64 = 0.1;
/// Range up to which a cone is free, m.
const MAX_FREE_M: f64 = 2.6;
/// Range up to which an echo of a beam that looks ahead or aside marks its arc, m.
const MAX_ECHO_M: (f64, f64) = (1.6, 0.6);

/// Core of a beam in the odometry frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct BeamCone {
    sensor: Pose2,
    half_rad: f64,
}

impl BeamCone {
    /// Most places that an arc has.
    pub(super) const ARC: usize = FAN;

    /// Log odds of the arc of an echo.
    pub(super) const ECHO: f32 = 1.0;

    /// Core of a beam of a scan taken at `robot` (odometry frame); none if its opening angle is not finite.
    pub(super) fn new(beam: &Beam, robot: &Pose2) -> Option<Self> {
        let sensor = *robot * Pose2::new(beam.x_m, beam.y_m, beam.azimuth_rad);
        beam.cone_rad.is_finite().then_some(Self { sensor, half_rad: 0.5 * CORE_SHARE * beam.cone_rad })
    }

    /// Places `range_m` away from the sensor, odometry frame, m.
    pub(super) fn arc(self, range_m: f64) -> impl Iterator<Item = Point2<f64>> {
        (0..FAN).map(move |i| {
            let azimuth = self.half_rad * (2.0 * i as f64 / (FAN - 1) as f64 - 1.0);
            self.sensor.transform_point(Point2::new(range_m * azimuth.cos(), range_m * azimuth.sin()))
        })
    }

    /// Middle of the arc of the echo of a beam of a scan taken at `robot` (odometry frame), m; none without an echo, or where not all of the
    /// arc is `counted`.
    pub(super) fn echo_on(
        beam: &Beam,
        robot: &Pose2,
        counted: impl Fn(Point2<f64>) -> bool,
    ) -> Option<Point2<f64>> {
        let echo_m = beam.echo_m().filter(|echo_m| echo_m.is_finite())?;
        let cone = Self::new(beam, robot)?;
        cone.arc(echo_m).all(counted).then(|| cone.sensor.transform_point(Point2::new(echo_m, 0.0)))
    }

    /// Places in steps of `step_m` (m) that are free before an echo at `echo_m` (m, infinite without one), odometry frame, m, and their log
    /// odds.
    pub(super) fn free(self, echo_m: f64, step_m: f64) -> (impl Iterator<Item = Point2<f64>>, f32) {
        let odds = if echo_m.is_finite() { BEFORE_ECHO } else { SILENCE };
        (self.up_to((echo_m - ECHO_DEPTH_M).min(MAX_FREE_M), step_m), odds)
    }

    /// True if an echo of this beam at `echo_m` (m) is near enough to mark its arc.
    pub(super) fn marks(beam: &Beam, echo_m: f64) -> bool {
        echo_m < if beam.azimuth_rad.abs() <= AHEAD_RAD { MAX_ECHO_M.0 } else { MAX_ECHO_M.1 }
    }

    /// Places up to `range_m` away from the sensor, in steps of `step_m`, odometry frame, m.
    fn up_to(self, range_m: f64, step_m: f64) -> impl Iterator<Item = Point2<f64>> {
        (1..=(range_m / step_m) as usize).flat_map(move |step| self.arc(step as f64 * step_m))
    }
}

#[cfg(test)]
mod tests {
    use yamabico_core::message::NO_ECHO;

    use super::*;

    #[test]
    fn places_lie_in_the_core_of_the_beam_up_to_their_range() {
        let beam = Beam { x_m: 0.2, azimuth_rad: 0.5, cone_rad: 0.6, ..Beam::default() };
        let robot = Pose2::new(1.0, 2.0, -0.5);
        let cone = BeamCone::new(&beam, &robot).unwrap();
        let sensor = robot.transform_point(Point2::new(0.2, 0.0));
        let off =
            |place: Point2<f64>| ((place - sensor).norm(), (place - sensor).y.atan2((place - sensor).x));
        for (range_m, azimuth) in cone.arc(1.5).map(off) {
            assert!((range_m - 1.5).abs() < 1e-9 && azimuth.abs() < 0.18 + 1e-9);
        }
        let ranges: Vec<f64> = cone.up_to(0.26, 0.1).map(|place| off(place).0).collect();
        assert_eq!(ranges.len(), 2 * BeamCone::ARC);
        assert!(ranges.iter().all(|range_m| *range_m < 0.21), "{ranges:?}");
        assert!(cone.up_to(-1.0, 0.1).next().is_none());
        assert!(BeamCone::new(&Beam { cone_rad: f64::NAN, ..beam }, &robot).is_none());
    }

    #[test]
    fn an_echo_lies_on_floor_where_all_of_its_arc_does() {
        let beam = Beam { x_m: 0.2, cone_rad: 0.6, range_m: 0.8, ..Beam::default() };
        let echo_on = |beam: &Beam, from_m: f64| {
            BeamCone::echo_on(beam, &Pose2::IDENTITY, |place| place.y > from_m && place.x > 0.9)
        };
        assert!((echo_on(&beam, -0.2).expect("an echo") - Point2::new(1.0, 0.0)).norm() < 1e-9);
        assert_eq!(echo_on(&beam, -0.1), None, "not at its right end");
        for bad in [Beam { flags: NO_ECHO, ..beam }, Beam { range_m: f64::NAN, ..beam }] {
            assert_eq!(echo_on(&bad, -0.2), None);
        }
    }
}
