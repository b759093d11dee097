//! Things that move toward the robot by themselves, beam by beam; sector by sector in scans of many beams.

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
    /// it, and than its turning changes the range of a wall.
    #[must_use]
    pub fn soonest(&self) -> Option<Approach> {
        let approaches =
            self.ranges.iter().zip(&self.beams).filter_map(|(ranges, beam)| self.approach(ranges, beam));
        approaches.min_by(|a, b| a.time_s.total_cmp(&b.time_s))
    }

    fn approach(&self, ranges: &[f64; SCANS], beam: &Beam) -> Option<Approach> {
        let first = (*self.stamps.first()?)?;
        let times = self.stamps.iter().map(|stamp| stamp.map_or(0.0, |stamp| stamp.seconds_after(first)));
        let fit = RangeFit::new(times.zip(ranges.iter().copied()), f64::INFINITY)?;
        let (sin, cos) = beam.azimuth_rad.sin_cos();
        let own_mps = self.twists.iter().map(|twist| twist.linear * cos + twist.lateral * sin);
        let turn_radps = self.twists.iter().map(|twist| twist.angular.abs()).fold(0.0, f64::max);
        // A beam that turns slides along a wall; at 45 degrees of incidence its range changes by itself times the angle.
        let explained_mps = own_mps.fold(0.0, f64::max) + turn_radps * fit.range_m + MOVING_MPS;
        let is_moving = fit.echoes >= MIN_ECHOES
            && fit.residual_m <= MAX_RESIDUAL_M
            && fit.closing_mps > explained_mps
            && ranges[SCANS - 1].is_finite();
        let time_s = fit.time_to_contact_s().filter(|_| is_moving)?;
        Some(Approach { time_s: time_s.max(0.0), closing_mps: fit.closing_mps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::NO_ECHO;

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
