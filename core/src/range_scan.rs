//! Range scans of laser scanners: their conversion to beams, and their reduction to few wide ones.

use std::f64::consts::PI;

use crate::geometry::{Pose2, angle_difference, wrap_angle};
use crate::message::{Beam, NO_ECHO};

/// Maximum number of beams of a range scan.
pub const MAX_BEAMS: usize = 2048;
/// Maximum number of beams that [`sectors`] leaves.
pub const MAX_SECTORS: usize = 64;

/// Geometry of a laser scanner: ranges at equal angles from one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaserScanner {
    /// Direction of the first range in the scanner's frame, rad.
    pub first_rad: f64,
    /// Angle from one range to the next, rad; negative for a scanner that turns clockwise.
    pub step_rad: f64,
    /// Minimum range, m.
    pub min_m: f64,
    /// Maximum range, m.
    pub max_m: f64,
    /// Pose of the scanner on the robot.
    pub mount: Pose2,
}

/// Cause why a scan gives no beams.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LaserError {
    /// The geometry is not finite, or the limits of the range are not in order.
    #[error("a scan whose angles or range limits are invalid")]
    Geometry,
    /// There are too many ranges, or none.
    #[error("a scan of {0} ranges, and not of 1 to {MAX_BEAMS}")]
    Count(usize),
    /// No range is a measurement: the scanner is covered or failed.
    #[error("a scan of {0} ranges without a measurement")]
    Blind(usize),
}

impl LaserScanner {
    /// Appends one beam per range to `beams`, by the rules of REP 117: an infinite range, or one above the maximum, is no echo;
    /// minus infinity is an echo nearer than the minimum range. A NaN, or a number below the minimum, is no measurement, and
    /// counts as no echo. Nothing is appended on failure.
    ///
    /// # Errors
    /// [`LaserError`].
    pub fn beams(
        &self,
        ranges: impl ExactSizeIterator<Item = f32> + Clone,
        beams: &mut Vec<Beam>,
    ) -> Result<(), LaserError> {
        let LaserScanner { first_rad, step_rad, min_m, max_m, mount } = *self;
        let is_finite = [first_rad, step_rad, min_m, max_m].iter().all(|number| number.is_finite());
        if !is_finite || !mount.is_finite() || !(0.0..=max_m).contains(&min_m) {
            return Err(LaserError::Geometry);
        }
        let count = ranges.len();
        if !(1..=MAX_BEAMS).contains(&count) {
            return Err(LaserError::Count(count));
        }
        if !ranges.clone().any(|range| f64::from(range) >= min_m || range == f32::NEG_INFINITY) {
            return Err(LaserError::Blind(count));
        }
        beams.extend(ranges.enumerate().map(|(i, range)| {
            let range_m = f64::from(range);
            let echo_m = match range_m {
                f64::NEG_INFINITY => Some(min_m),
                _ => (min_m..=max_m).contains(&range_m).then_some(range_m),
            };
            Beam {
                azimuth_rad: wrap_angle(first_rad + i as f64 * step_rad + mount.theta),
                cone_rad: step_rad.abs(),
                range_m: echo_m.unwrap_or(max_m),
                x_m: mount.x,
                y_m: mount.y,
                flags: if echo_m.is_some() { 0 } else { NO_ECHO },
                reserved: 0,
            }
        }));
        Ok(())
    }
}

/// Writes at most [`MAX_SECTORS`] beams to `sectors`: those of the scan if they are no more, else one for each group of
/// neighbors, with a cone over all of them and the nearest echo in it. So an obstacle is never narrower or farther away
/// than in the scan. A malformed range or direction stays malformed. Does not allocate if `sectors` has the capacity.
pub fn sectors(beams: &[Beam], sectors: &mut Vec<Beam>) {
    sectors.clear();
    let group = beams.len().div_ceil(MAX_SECTORS).max(1);
    sectors.extend(beams.chunks(group).map(sector));
}

fn sector(group: &[Beam]) -> Beam {
    let [first, .., _] = group else { return group.first().copied().unwrap_or_default() };
    let half = |beam: &Beam| 0.5 * beam.cone_rad;
    // Borders relative to the first beam's direction.
    let offset = |beam: &Beam| angle_difference(beam.azimuth_rad, first.azimuth_rad);
    let right = group.iter().map(|beam| offset(beam) - half(beam)).fold(f64::INFINITY, nan_or(f64::min));
    let left = group.iter().map(|beam| offset(beam) + half(beam)).fold(f64::NEG_INFINITY, nan_or(f64::max));
    let nearest_m = group.iter().filter_map(Beam::echo_m).reduce(nan_or(f64::min));
    Beam {
        azimuth_rad: wrap_angle(first.azimuth_rad + 0.5 * (left + right)),
        cone_rad: (left - right).min(2.0 * PI),
        range_m: nearest_m.unwrap_or(first.range_m),
        flags: if nearest_m.is_some() { 0 } else { NO_ECHO },
        ..*first
    }
}

/// Returns `of`, but NaN if one of the numbers is.
fn nan_or(of: fn(f64, f64) -> f64) -> impl Fn(f64, f64) -> f64 {
    move |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { of(a, b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, TAU};

    fn scanner(count: usize) -> LaserScanner {
        LaserScanner {
            first_rad: -PI,
            step_rad: TAU / count as f64,
            min_m: 0.2,
            max_m: 5.0,
            mount: Pose2::new(0.1, 0.0, FRAC_PI_2),
        }
    }

    #[test]
    fn ranges_become_beams_by_the_rules_of_rep_117() {
        let ranges = [1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.0, 7.0];
        let mut beams = Vec::new();
        scanner(6).beams(ranges.into_iter(), &mut beams).unwrap();
        let echoes: Vec<Option<f64>> = beams.iter().map(Beam::echo_m).collect();
        assert_eq!(echoes, [Some(1.0), None, Some(0.2), None, None, None]);
        assert!((beams[0].azimuth_rad + FRAC_PI_2).abs() < 1e-12 && beams[0].x_m == 0.1);
        assert!((beams[3].azimuth_rad - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn scans_that_say_nothing_are_refused() {
        let mut beams = Vec::new();
        let mut refused = |scanner: LaserScanner, ranges: &[f32]| {
            scanner.beams(ranges.iter().copied(), &mut beams).unwrap_err()
        };
        assert_eq!(refused(scanner(3), &[0.0, f32::NAN, 0.1]), LaserError::Blind(3));
        assert_eq!(refused(scanner(3), &[]), LaserError::Count(0));
        assert_eq!(refused(scanner(3), &[1.0; MAX_BEAMS + 1]), LaserError::Count(MAX_BEAMS + 1));
        assert_eq!(refused(LaserScanner { first_rad: f64::NAN, ..scanner(3) }, &[1.0]), LaserError::Geometry);
        assert_eq!(refused(LaserScanner { max_m: 0.1, ..scanner(3) }, &[1.0]), LaserError::Geometry);
        assert!(beams.is_empty());
    }

    #[test]
    fn sectors_keep_the_nearest_echo_and_cover_all_directions() {
        for count in [360, 720, 2048] {
            let mut beams = Vec::new();
            let far = std::iter::repeat_n(3.0, count).enumerate();
            let ranges: Vec<f32> = far.map(|(i, far)| if i == count / 3 { 0.5 } else { far }).collect();
            scanner(count).beams(ranges.into_iter(), &mut beams).unwrap();
            let mut few = Vec::with_capacity(MAX_SECTORS);
            sectors(&beams, &mut few);
            assert!(few.len() <= MAX_SECTORS && few.capacity() == MAX_SECTORS);
            let covered: f64 = few.iter().map(|sector| sector.cone_rad).sum();
            assert!((covered - TAU).abs() < 1e-9, "{covered}");
            let near: Vec<&Beam> = few.iter().filter(|sector| sector.range_m < 1.0).collect();
            let [near] = near.as_slice() else { panic!("{} sectors are near", near.len()) };
            let off = angle_difference(near.azimuth_rad, beams[count / 3].azimuth_rad).abs();
            assert!(off <= 0.5 * near.cone_rad, "{off}");
        }
    }

    #[test]
    fn few_beams_stay_as_they_are_and_malformed_ones_malformed() {
        let beam = Beam { range_m: 1.0, cone_rad: 0.4, ..Beam::default() };
        let (beams, mut few) = (vec![beam; MAX_SECTORS], Vec::new());
        sectors(&beams, &mut few);
        assert_eq!(few, beams);
        sectors(&[], &mut few);
        assert!(few.is_empty());
        let mut beams = vec![beam; 3 * MAX_SECTORS];
        (beams[1].range_m, beams[4].azimuth_rad) = (f64::NAN, f64::NAN);
        beams[6..9].fill(Beam { flags: NO_ECHO, ..beam });
        sectors(&beams, &mut few);
        assert!(few[0].range_m.is_nan() && few[1].azimuth_rad.is_nan());
        assert_eq!((few[2].echo_m(), few[3].echo_m()), (None, Some(1.0)));
    }
}
