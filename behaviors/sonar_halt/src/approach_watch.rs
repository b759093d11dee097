//! Things that move toward the robot by themselves, beam by beam; sector by sector in scans of many beams.

use yamabico_core::geometry::angle_difference;
use yamabico_core::message::{Beam, Twist};
use yamabico_core::range_scan::{MAX_SECTORS, sectors};
use yamabico_core::time::Time;

use crate::time_to_contact::RangeFit;

/// Number of scans that are fitted: 0.25 s at 20 Hz.
const SCANS: usize = 6;
/// Number of echoes among them that a fit requires. With 1 cm of noise at 20 Hz the closing speed is then known to 9 cm/s.
const MIN_ECHOES: usize = 5;
/// Speed above that of the robot itself from which something counts as moving, m/s.
const MOVING_MPS: f64 = 0.2;
/// Maximum distance of an echo from a straight approach, m. A larger one is a beam that passes from one thing to another.
const MAX_RESIDUAL_M: f64 = 0.05;
/// Maximum angle between two beams or sectors that tell the slope of a wall, rad. Sonars are wider apart.
const MAX_SPACING_RAD: f64 = 0.2;
/// Maximum distance of an echo from the line through the echoes beside it, m.
const MAX_BEND_M: f64 = 0.05;

/// Something that moves towards the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Time to contact with the sensor, s.
    pub time_s: f64,
    /// Closing speed, m/s.
    pub closing_mps: f64,
}

/// The last scans with the motion of the robot at each.
#[derive(Clone, Debug)]
pub struct ApproachWatch {
    /// Time of each scan, the newest last; none before the first scans.
    stamps: [Option<Time>; SCANS],
    /// Measured twist at each scan.
    twists: [Twist; SCANS],
    /// Newest scan.
    beams: Vec<Beam>,
    /// Range of each beam in each scan, m; infinite without an echo.
    ranges: Vec<[f64; SCANS]>,
}

impl Default for ApproachWatch {
    fn default() -> Self {
        Self {
            stamps: [None; SCANS],
            twists: [Twist::ZERO; SCANS],
            beams: Vec::with_capacity(MAX_SECTORS),
            ranges: Vec::with_capacity(MAX_SECTORS),
        }
    }
}

impl ApproachWatch {
    /// Adds a scan and the measured twist. Does not allocate.
    pub fn push(&mut self, stamp: Time, twist: Twist, beams: &[Beam]) {
        sectors(beams, &mut self.beams);
        if self.ranges.len() != self.beams.len() {
            self.forget();
            self.ranges.resize(self.beams.len(), [f64::INFINITY; SCANS]);
        }
        self.stamps.rotate_left(1);
        self.twists.rotate_left(1);
        self.stamps[SCANS - 1] = Some(stamp);
        self.twists[SCANS - 1] = twist;
        for (ranges, beam) in self.ranges.iter_mut().zip(&self.beams) {
            ranges.rotate_left(1);
            ranges[SCANS - 1] = beam.echo_m().filter(|range_m| range_m.is_finite()).unwrap_or(f64::INFINITY);
        }
    }

    /// Forgets all scans.
    pub fn forget(&mut self) {
        self.stamps = [None; SCANS];
    }

    /// Returns true if there are enough scans to tell what approaches.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.stamps[0].is_some()
    }

    /// Returns the approach with the shortest time to contact: of something that closes faster than the robot moves towards
    /// it, than its turning changes the range of a wall, and, in a scan of narrow beams, than a beam slides along a wall.
    #[must_use]
    pub fn soonest(&self) -> Option<Approach> {
        let approaches = (0..self.beams.len()).filter_map(|index| self.approach(index));
        approaches.min_by(|a, b| a.time_s.total_cmp(&b.time_s))
    }

    fn approach(&self, index: usize) -> Option<Approach> {
        let (ranges, beam) = (self.ranges.get(index)?, self.beams.get(index)?);
        let first = (*self.stamps.first()?)?;
        let times = self.stamps.iter().map(|stamp| stamp.map_or(0.0, |stamp| stamp.seconds_after(first)));
        let fit = RangeFit::new(times.zip(ranges.iter().copied()), f64::INFINITY)?;
        let (sin, cos) = beam.azimuth_rad.sin_cos();
        let own_mps = self.twists.iter().map(|twist| twist.linear * cos + twist.lateral * sin);
        let turn_radps = self.twists.iter().map(|twist| twist.angular.abs()).fold(0.0, f64::max);
        // A beam that turns slides along a wall; at 45 degrees of incidence its range changes by itself times the angle.
        let explained_mps = own_mps.fold(0.0, f64::max) + turn_radps * fit.range_m;
        let is_moving = fit.echoes >= MIN_ECHOES
            && fit.residual_m <= MAX_RESIDUAL_M
            && fit.closing_mps > explained_mps + MOVING_MPS
            && ranges[SCANS - 1].is_finite()
            && self.wall_closing_mps(index).is_none_or(|wall_mps| fit.closing_mps > wall_mps + MOVING_MPS);
        let time_s = fit.time_to_contact_s().filter(|_| is_moving)?;
        Some(Approach { time_s: time_s.max(0.0), closing_mps: fit.closing_mps })
    }

    /// Returns the mean speed (m/s) at which the robot's own motion closes a beam on the wall that it sees; `None` if it sees
    /// none. A beam that slides along a wall with the incidence i closes by up to 1 / cos i faster than the robot moves.
    fn wall_closing_mps(&self, index: usize) -> Option<f64> {
        let closings = (0..SCANS).filter_map(|scan| self.wall_closing_at_mps(index, scan));
        let (count, sum_mps) =
            closings.fold((0, 0.0), |(count, sum_mps), closing_mps| (count + 1, sum_mps + closing_mps));
        (count >= MIN_ECHOES).then(|| sum_mps / count as f64)
    }

    /// Returns the same speed in one scan.
    fn wall_closing_at_mps(&self, index: usize, scan: usize) -> Option<f64> {
        let (beam, twist) = (self.beams.get(index)?, self.twists.get(scan)?);
        let range_m = *self.ranges.get(index)?.get(scan)?;
        let (sin, cos) = beam.azimuth_rad.sin_cos();
        // Velocity of the sensor, along the beam and across it.
        let (x, y) = (twist.linear - twist.angular * beam.y_m, twist.lateral + twist.angular * beam.x_m);
        let (along_mps, across_mps) = (x * cos + y * sin, y * cos - x * sin);
        // At the end of a wall both neighbors are on one side.
        let slopes = [(1, -1), (1, 2), (-1, -2)]
            .into_iter()
            .filter_map(|(first, second)| self.wall_slope(index, scan, [first, second]));
        let closings = slopes.map(|slope| along_mps - slope * (across_mps / range_m + twist.angular));
        closings.max_by(f64::total_cmp)
    }

    /// Returns the slope of the range over the azimuth (m/rad) of a wall through the echoes of a beam and of the two that are
    /// `steps` beams away; `None` if the beams are far apart, or their echoes do not lie on a line.
    fn wall_slope(&self, index: usize, scan: usize, steps: [isize; 2]) -> Option<f64> {
        let (azimuth_rad, range_m) = (self.beams.get(index)?.azimuth_rad, self.ranges.get(index)?[scan]);
        let echo = |step: isize| {
            let at = (index as isize + step).rem_euclid(self.beams.len() as isize) as usize;
            let angle_rad = angle_difference(self.beams[at].azimuth_rad, azimuth_rad);
            let is_near = angle_rad.abs() <= MAX_SPACING_RAD * step.unsigned_abs() as f64;
            is_near.then(|| (angle_rad, 1.0 / self.ranges[at][scan]))
        };
        let ((a, at_a), (b, at_b)) = (echo(steps[0])?, echo(steps[1])?);
        // On a line the inverse range is u cos a + u' sin a; without an echo it is zero.
        let between = (a - b).sin();
        let inverse = (at_b * a.sin() - at_a * b.sin()) / between;
        let slope = -range_m * range_m * (at_a * b.cos() - at_b * a.cos()) / between;
        let is_line = at_a > 0.0 && at_b > 0.0 && (1.0 / inverse - range_m).abs() <= MAX_BEND_M;
        (is_line && slope.is_finite()).then_some(slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;
    use yamabico_core::geometry::Pose2;
    use yamabico_core::message::NO_ECHO;

    /// Watches a wall across the way, 1.5 m from where the robot starts, with a laser scanner of 360 beams, and a plate 0.4 m
    /// wide that comes from 0.3 m before the wall with this speed, m/s.
    fn scan_wall(twist: Twist, heading_rad: f64, plate_mps: Option<f64>) -> Option<Approach> {
        let mut watch = ApproachWatch::default();
        let mut pose = Pose2::new(0.0, 0.0, heading_rad);
        for i in 0..8 {
            let seconds = 0.05 * f64::from(i);
            let beams: Vec<Beam> = (0..360)
                .map(|degrees| {
                    let azimuth_rad = f64::from(degrees).to_radians();
                    let (sin, cos) = (pose.theta + azimuth_rad).sin_cos();
                    let range_to = |x: f64| if cos > 0.0 { (x - pose.x) / cos } else { f64::INFINITY };
                    let plate_m = plate_mps.map_or(f64::INFINITY, |speed| range_to(1.2 - speed * seconds));
                    let is_plate = (pose.y + plate_m * sin).abs() < 0.2;
                    let range_m = if is_plate { plate_m } else { range_to(1.5) };
                    let flags = if range_m < 4.0 { 0 } else { NO_ECHO };
                    Beam { azimuth_rad, range_m, cone_rad: TAU / 360.0, flags, ..Beam::default() }
                })
                .collect();
            watch.push(Time::from_secs_f64(seconds), twist, &beams);
            pose = pose.integrate(&twist, 0.05);
        }
        watch.soonest()
    }

    #[test]
    fn a_laser_scanner_tells_a_wall_at_an_angle_from_a_person() {
        for heading_deg in [0.0_f64, 30.0, -30.0, 60.0] {
            for turn_radps in [0.0, 0.3, -0.3] {
                let twist = Twist::planar(0.5, turn_radps);
                let wall = scan_wall(twist, heading_deg.to_radians(), None);
                assert_eq!(wall, None, "{heading_deg} degrees, {turn_radps} rad/s");
            }
        }
        for (speed_mps, heading_deg) in [(0.0, 0.0_f64), (0.5, 0.0), (0.5, 30.0), (0.5, -30.0)] {
            let heading_rad = heading_deg.to_radians();
            let person = scan_wall(Twist::planar(speed_mps, 0.0), heading_rad, Some(1.0)).unwrap();
            let closing_mps = speed_mps * heading_rad.cos() + 1.0;
            assert!((person.closing_mps - closing_mps).abs() < 0.15, "{heading_deg} degrees: {person:?}");
        }
    }

    /// Watches ranges at 20 Hz, none as no echo, of a beam at 35 degrees.
    fn watch(ranges: &[Option<f64>], twist: Twist) -> Option<Approach> {
        let mut watch = ApproachWatch::default();
        let mut beam = Beam { azimuth_rad: 35_f64.to_radians(), ..Beam::default() };
        for (i, range_m) in ranges.iter().enumerate() {
            beam.flags = if range_m.is_some() { 0 } else { NO_ECHO };
            beam.range_m = range_m.unwrap_or_default();
            watch.push(Time::from_secs_f64(0.05 * i as f64), twist, &[beam]);
        }
        watch.soonest()
    }

    fn closing(at_mps: f64) -> [Option<f64>; 8] {
        std::array::from_fn(|i| Some(1.5 - at_mps * 0.05 * i as f64))
    }

    #[test]
    fn a_person_is_told_from_a_wall_by_the_robots_own_motion() {
        let forward = Twist::planar(0.4, 0.0);
        assert_eq!(watch(&closing(0.33), forward), None, "a wall");
        let person = watch(&closing(1.0), forward).unwrap();
        assert!((person.time_s - 1.15).abs() < 1e-9 && (person.closing_mps - 1.0).abs() < 1e-9);
        assert_eq!(watch(&closing(1.0), Twist::planar(0.4, 0.6)), None, "its own turn explains it");
        assert_eq!(watch(&closing(-1.0), forward), None, "one that goes away");
    }

    #[test]
    fn a_beam_that_passes_from_one_thing_to_another_is_no_approach() {
        let mut jump = [Some(2.0); 8];
        jump[4..].fill(Some(1.4));
        assert_eq!(watch(&jump, Twist::ZERO), None);
    }

    #[test]
    fn one_lost_echo_is_allowed_and_two_are_not() {
        let mut ranges = closing(1.0);
        ranges[4] = None;
        assert!(watch(&ranges, Twist::ZERO).is_some());
        ranges[5] = None;
        assert!(watch(&ranges, Twist::ZERO).is_none());
        assert!(watch(&closing(1.0)[..4], Twist::ZERO).is_none(), "too few scans");
    }
}
