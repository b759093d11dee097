//! The class of one scan.

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

/// Returns the minimum distance (m) from the robot's center to the points of the cone at this range; minus infinity if the
/// beam's geometry is not finite.
pub(crate) fn distance_from_center(beam: &Beam, range_m: f64) -> f64 {
    let distance_at = |part: f64| {
        let azimuth = beam.azimuth_rad + part * 0.5 * beam.cone_rad;
        (beam.x_m + range_m * azimuth.cos()).hypot(beam.y_m + range_m * azimuth.sin())
    };
    [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().map(distance_at).fold(f64::INFINITY, |nearest, distance| {
        if distance.is_nan() { f64::NEG_INFINITY } else { nearest.min(distance) }
    })
}
