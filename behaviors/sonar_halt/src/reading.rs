//! The class of one scan.

use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Axes, Beam};

/// Forward and sideways motion.
pub const TRANSLATION: Axes = Axes::LINEAR.union(Axes::LATERAL);

/// The class of one scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// No echo forbids a motion.
    Clean,
    /// At least one echo forbids a motion.
    Echo {
        /// Range of the echo that is reached first, measured from its sensor, m.
        range_m: f64,
        /// Length of the path until the footprint touches it, m; none if the gate judges by range alone.
        path_m: Option<f64>,
        /// Axes that it forbids.
        stops: Axes,
    },
    /// No beams, or a range that is negative or not finite: no evidence of free space.
    Malformed,
}

/// Returns the echoes of a scan, or `None` if the scan is malformed.
pub(crate) fn echoes(beams: &[Beam]) -> Option<impl Iterator<Item = (&Beam, f64)>> {
    let is_sound = |beam: &Beam| beam.echo_m().is_none_or(|range_m| range_m.is_finite() && range_m >= 0.0);
    let are_sound = !beams.is_empty() && beams.iter().all(is_sound);
    are_sound.then(|| beams.iter().filter_map(|beam| Some((beam, beam.echo_m()?))))
}

/// Returns true if a point of the cone at this range may lie within `radius_m` (m) of the robot's center; also if the beam's
/// geometry is not finite.
pub(crate) fn is_within(radius_m: f64, beam: &Beam, range_m: f64) -> bool {
    let is_finite = beam.azimuth_rad.is_finite() && beam.cone_rad.is_finite();
    if is_finite && range_m - beam.x_m.hypotenuse(beam.y_m) > radius_m {
        return false;
    }
    let is_near = |part: f64| {
        let azimuth = beam.azimuth_rad + part * 0.5 * beam.cone_rad;
        let distance_m = (beam.x_m + range_m * azimuth.cos()).hypotenuse(beam.y_m + range_m * azimuth.sin());
        distance_m.is_nan() || distance_m <= radius_m
    };
    [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().any(is_near)
}
