//! Conversion of range scans to `foxglove.LaserScan`, whose rays leave one point at equal angles.

use foxglove::messages::{LaserScan, Pose};
use yamabico_core::message::{Beam, RangeScanHeader};

use super::frames::{BASE, timestamp, vector, yaw};

/// Maximum angle between rays that represent a sonar cone, rad.
const RAY_STEP_RAD: f64 = 2.5 * std::f64::consts::PI / 180.0;
/// Maximum number of rays of a scan.
const MAX_RAYS: f64 = 4096.0;

/// Converts a scan, in the robot frame; `None` without a beam whose direction is finite.
///
/// A narrow beam is one ray. A cone is a fan of rays with the cone's range; in overlapping cones the nearest echo counts. A
/// direction without an echo, or between the cones, has an infinite range. The rays leave the mean position of the sensors.
pub(super) fn laser_scan(header: &RangeScanHeader, beams: &[Beam]) -> Option<LaserScan> {
    let known = || beams.iter().filter(|beam| beam.azimuth_rad.is_finite() && beam.cone_rad.is_finite());
    let count = known().count();
    if count == 0 {
        return None;
    }
    let start = known().map(|beam| beam.azimuth_rad - half_cone(beam)).fold(f64::INFINITY, f64::min);
    let end = known().map(|beam| beam.azimuth_rad + half_cone(beam)).fold(f64::NEG_INFINITY, f64::max);
    let narrow = known().all(|beam| beam.cone_rad < RAY_STEP_RAD);
    let gaps = if narrow { (count - 1) as f64 } else { ((end - start) / RAY_STEP_RAD).ceil() };
    if gaps > MAX_RAYS {
        return None;
    }
    let step = if gaps > 0.0 { (end - start) / gaps } else { 0.0 };
    let mut ranges = vec![f64::INFINITY; gaps as usize + 1];
    for beam in known() {
        let Some(range) = beam.echo_m().filter(|range| range.is_finite()) else { continue };
        let ray = |azimuth: f64| if step > 0.0 { (azimuth - start) / step } else { 0.0 };
        let (first, last) = if narrow {
            (ray(beam.azimuth_rad).round(), ray(beam.azimuth_rad).round())
        } else {
            let (low, high) = (beam.azimuth_rad - half_cone(beam), beam.azimuth_rad + half_cone(beam));
            ((ray(low) - 1e-6).ceil(), (ray(high) + 1e-6).floor())
        };
        for nearest in ranges.iter_mut().take(last as usize + 1).skip(first as usize) {
            *nearest = nearest.min(range);
        }
    }
    let mean = |of: fn(&Beam) -> f64| known().map(of).sum::<f64>() / count as f64;
    Some(LaserScan {
        timestamp: Some(timestamp(header.stamp_ns)),
        frame_id: BASE.to_owned(),
        pose: Some(Pose {
            position: Some(vector(mean(|beam| beam.x_m), mean(|beam| beam.y_m), 0.0)),
            orientation: Some(yaw(0.0)),
        }),
        start_angle: start,
        end_angle: end,
        ranges,
        intensities: Vec::new(),
    })
}

fn half_cone(beam: &Beam) -> f64 {
    if beam.cone_rad < RAY_STEP_RAD { 0.0 } else { 0.5 * beam.cone_rad }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::NO_ECHO;

    fn beam(azimuth_deg: f64, cone_deg: f64, range_m: f64) -> Beam {
        let (azimuth_rad, cone_rad) = (azimuth_deg.to_radians(), cone_deg.to_radians());
        Beam { azimuth_rad, cone_rad, range_m, x_m: 0.2, ..Beam::default() }
    }

    fn scan(beams: &[Beam]) -> LaserScan {
        laser_scan(&RangeScanHeader::default(), beams).unwrap()
    }

    #[test]
    fn narrow_beams_are_rays() {
        let scan = scan(&[beam(30.0, 0.2, 3.0), beam(-30.0, 0.2, 1.0), beam(0.0, 0.2, 2.0)]);
        assert_eq!(scan.ranges, [1.0, 2.0, 3.0]);
        assert!((scan.start_angle + 30_f64.to_radians()).abs() < 1e-12);
        assert!((scan.end_angle - 30_f64.to_radians()).abs() < 1e-12);
        assert!((scan.pose.unwrap().position.unwrap().x - 0.2).abs() < 1e-12);
    }

    #[test]
    fn cones_are_fans_and_the_nearest_wins() {
        let silent = Beam { flags: NO_ECHO, ..beam(20.0, 25.0, 0.1) };
        let scan = scan(&[beam(-20.0, 25.0, 2.0), beam(0.0, 25.0, 1.0), silent]);
        let step = (scan.end_angle - scan.start_angle) / (scan.ranges.len() - 1) as f64;
        assert!(step <= RAY_STEP_RAD + 1e-12);
        for (i, &range) in scan.ranges.iter().enumerate() {
            let azimuth = (scan.start_angle + i as f64 * step).to_degrees();
            let expected = match azimuth {
                a if a < -12.6 => 2.0,
                a if (-12.4..12.4).contains(&a) => 1.0,
                a if a > 12.6 => f64::INFINITY,
                _ => continue,
            };
            assert_eq!(range, expected, "at {azimuth} degrees");
        }
    }

    #[test]
    fn hostile_beams_make_no_ray() {
        assert!(laser_scan(&RangeScanHeader::default(), &[]).is_none());
        assert!(laser_scan(&RangeScanHeader::default(), &[beam(f64::NAN, 25.0, 1.0)]).is_none());
        assert!(laser_scan(&RangeScanHeader::default(), &[beam(0.0, 1e9, 1.0)]).is_none());
        let scan = scan(&[beam(0.0, 25.0, f64::NAN)]);
        assert!(scan.ranges.iter().all(|range| range.is_infinite()));
    }
}
