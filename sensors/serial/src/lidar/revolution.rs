//! Revolutions of a lidar, put together from its packets, and their message.

use std::f64::consts::TAU;

use yamabico_core::geometry::wrap_angle;
use yamabico_core::message::{Beam, NO_ECHO, RangeScanHeader};
use yamabico_core::time::Time;

use super::packet::{POINTS, Packet};
use crate::stamps::Stamper;

/// Time of the lidar at which its clock wraps, ms.
const WRAP_MS: i64 = 30_000;
/// Angle between two packets that may be missing, degrees; a larger gap is a lost packet.
const MAX_GAP_DEG: f64 = 4.0;

/// Mount and range of a lidar.
#[derive(Clone, Copy, Debug)]
pub struct Mounting {
    /// Position forward and left of the robot's center, m.
    pub position_m: [f64; 2],
    /// Direction of its zero angle in the robot frame, rad, positive to the left.
    pub yaw_rad: f64,
    /// Minimum and maximum range, m.
    pub range_m: [f64; 2],
    /// Number of beams of a scan.
    pub beams: usize,
}

/// A scan in the robot frame.
pub type Scan = (RangeScanHeader, Vec<Beam>);

/// Revolution in progress.
#[derive(Clone, Debug)]
pub struct Revolution {
    mounting: Mounting,
    /// Shortest range of each beam, m: NaN if the lidar has not looked there, infinite without an echo.
    ranges: Vec<f64>,
    /// Stamp of its first packet.
    begun: Option<Time>,
    /// Last angle of the last packet, degrees.
    last_deg: Option<f64>,
    is_whole: bool,
    device_ms: i64,
    last_ms: Option<u16>,
    stamper: Stamper,
    sequence: u64,
    incomplete: u64,
}

impl Revolution {
    /// Returns an empty revolution.
    #[must_use]
    pub fn new(mounting: Mounting) -> Revolution {
        Revolution {
            mounting,
            ranges: vec![f64::NAN; mounting.beams],
            begun: None,
            last_deg: None,
            is_whole: false,
            device_ms: 0,
            last_ms: None,
            stamper: Stamper::default(),
            sequence: 0,
            incomplete: 0,
        }
    }

    /// Number of revolutions that lacked a packet, and were dropped.
    #[must_use]
    pub fn incomplete(&self) -> u64 {
        self.incomplete
    }

    /// Takes in a packet. Returns the scan of the revolution that it completes, unless packets were lost in it: a direction
    /// that the lidar has not looked in is not free.
    pub fn push(&mut self, packet: &Packet, arrival: Time) -> Option<Scan> {
        let stamp = self.stamp(packet.stamp_ms, arrival);
        let first_deg = packet.angle_deg(0);
        let gap_deg = self.last_deg.map_or(360.0, |last| (first_deg - last).rem_euclid(360.0));
        self.is_whole &= gap_deg <= MAX_GAP_DEG;
        let mut scan = None;
        let mut before_deg = self.last_deg.unwrap_or(360.0);
        for i in 0..POINTS {
            let angle_deg = packet.angle_deg(i);
            if angle_deg < before_deg {
                scan = self.finish(stamp);
                // The first revolution lacks its beginning, and one after a gap, too: that one counts as lost.
                self.begun = self.last_deg.map(|_| stamp);
                self.is_whole = gap_deg <= MAX_GAP_DEG;
            }
            before_deg = angle_deg;
            self.add(angle_deg, packet.distances[i], packet.intensities[i]);
        }
        self.last_deg = Some(before_deg);
        scan
    }

    fn stamp(&mut self, stamp_ms: u16, arrival: Time) -> Time {
        let stepped = self.last_ms.map_or(0, |last| i64::from(stamp_ms) - i64::from(last));
        self.device_ms += if stepped < 0 { stepped + WRAP_MS } else { stepped };
        self.last_ms = Some(stamp_ms);
        self.stamper.stamp(1e-3 * self.device_ms as f64, arrival)
    }

    /// Enters a point, clockwise from ahead, into its beam.
    fn add(&mut self, clockwise_deg: f64, distance_mm: u16, intensity: u8) {
        let share = (-clockwise_deg).rem_euclid(360.0) / 360.0;
        let count = self.ranges.len();
        let Some(beam) = self.ranges.get_mut((share * count as f64).round() as usize % count.max(1)) else {
            return;
        };
        let range_m = f64::from(distance_mm) / 1000.0;
        let [min_m, max_m] = self.mounting.range_m;
        let is_echo = intensity > 0 && (min_m..=max_m).contains(&range_m);
        // NaN gives way to any range.
        *beam = beam.min(if is_echo { range_m } else { f64::INFINITY });
    }

    /// Ends the revolution at `stamp`, and begins an empty one.
    fn finish(&mut self, stamp: Time) -> Option<Scan> {
        let scan = self.begun.map(|begun| self.scan(begun + stamp.since(begun) / 2));
        self.ranges.fill(f64::NAN);
        self.incomplete += u64::from(scan == Some(None));
        scan.flatten()
    }

    /// Returns the message, stamped in the middle of the measurement, as with an exposure; `None` if packets were lost. This is the
    /// only place that makes it.
    fn scan(&mut self, middle: Time) -> Option<Scan> {
        let is_whole = self.is_whole && self.ranges.iter().all(|range_m| !range_m.is_nan());
        let Mounting { position_m: [x_m, y_m], yaw_rad, range_m: [min_m, max_m], .. } = self.mounting;
        let step_rad = TAU / self.ranges.len() as f64;
        let beams = self.ranges.iter().enumerate().map(|(i, range_m)| Beam {
            azimuth_rad: wrap_angle(step_rad * i as f64 + yaw_rad),
            cone_rad: step_rad,
            range_m: range_m.min(max_m),
            x_m,
            y_m,
            flags: if range_m.is_finite() { 0 } else { NO_ECHO },
            reserved: 0,
        });
        if !is_whole {
            return None;
        }
        // A missing number would count as a scan that was measured and lost.
        self.sequence += 1;
        let header = RangeScanHeader { stamp_ns: middle.0, sequence: self.sequence, min_m, max_m };
        Some((header, beams.collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::packet::FULL_TURN;

    /// Packets of a lidar that turns ten times a second, with an echo at `range_mm(angle)`, degrees clockwise.
    fn packets(count: u16, range_mm: impl Fn(f64) -> u16) -> Vec<(Packet, Time)> {
        let packet = |i: u16| {
            let angle =
                |point: u16| ((u32::from(i) * 12 + u32::from(point)) * 80 % u32::from(FULL_TURN)) as u16;
            let mut packet = Packet {
                speed: 3600,
                angles: [angle(0), angle(11)],
                distances: [0; POINTS],
                intensities: [200; POINTS],
                stamp_ms: (29_900 + u32::from(i) * 12 / 5 % 30_000) as u16 % 30_000,
            };
            packet.distances = std::array::from_fn(|point| range_mm(packet.angle_deg(point)));
            (packet, Time::from_secs_f64(100.0 + 0.0024 * f64::from(i)))
        };
        (0..count).map(packet).collect()
    }

    fn mounting(yaw_deg: f64) -> Mounting {
        Mounting {
            position_m: [0.1, 0.0],
            yaw_rad: f64::to_radians(yaw_deg),
            range_m: [0.05, 8.0],
            beams: 240,
        }
    }

    #[test]
    fn angles_become_counterclockwise() {
        // An obstacle at the right, 90 degrees clockwise.
        let range = |angle: f64| if (angle - 90.0).abs() < 3.0 { 500 } else { 0 };
        let scans_of = |yaw_deg| {
            let mut revolution = Revolution::new(mounting(yaw_deg));
            let scans =
                packets(200, range).into_iter().filter_map(|(packet, at)| revolution.push(&packet, at));
            let scans: Vec<Scan> = scans.collect();
            assert!((3..=5).contains(&scans.len()) && revolution.incomplete() == 0, "{}", scans.len());
            scans
        };
        for (yaw_deg, expected_deg) in [(0.0, -90.0), (180.0, 90.0)] {
            for (header, beams) in scans_of(yaw_deg) {
                assert_eq!((beams.len(), header.max_m), (240, 8.0));
                for beam in beams {
                    let off_deg =
                        wrap_angle(beam.azimuth_rad - f64::to_radians(expected_deg)).to_degrees().abs();
                    match beam.echo_m() {
                        Some(range_m) => assert!(range_m == 0.5 && off_deg < 4.0, "{off_deg}"),
                        None => assert!(off_deg > 1.5, "{off_deg}"),
                    }
                }
            }
        }
    }

    #[test]
    fn stamps_are_in_the_middle_of_the_turn() {
        let mut revolution = Revolution::new(mounting(0.0));
        let scans = packets(200, |_| 1000)
            .into_iter()
            .filter_map(|(packet, at)| Some((revolution.push(&packet, at)?, at)));
        for ((header, _), arrival) in scans {
            let age_s = arrival.seconds_after(Time(header.stamp_ns));
            assert!((0.04..0.06).contains(&age_s), "{age_s}");
        }
    }

    #[test]
    fn a_turn_that_lacks_a_packet_is_dropped() {
        let mut revolution = Revolution::new(mounting(0.0));
        let all = packets(200, |_| 1000);
        let with_loss = all.iter().enumerate().filter(|(i, _)| *i != 90);
        let scans = with_loss.filter_map(|(_, (packet, at))| revolution.push(packet, *at)).count();
        assert_eq!(revolution.incomplete(), 1);
        assert!((2..=4).contains(&scans), "{scans}");
    }
}
