//! A lidar LD19: packets of twelve points, ten turns a second.

use std::time::Instant;

use yamabico_serial::lidar::{POINTS, Packet};

use crate::plug::Device;

/// Number of points a second.
const RATE: f64 = 4500.0;

/// The lidar.
pub struct Ld19 {
    /// Range at an azimuth, m; the azimuth is in degrees, positive to the left.
    range_m: Box<dyn FnMut(f64) -> f64 + Send>,
    begun: Instant,
    sent: u64,
}

impl Ld19 {
    /// Returns a lidar that measures `range_m` at an azimuth in degrees, positive to the left, m; 0 without an echo.
    pub fn new(range_m: impl FnMut(f64) -> f64 + Send + 'static) -> Ld19 {
        Ld19 { range_m: Box::new(range_m), begun: Instant::now(), sent: 0 }
    }
}

impl Device for Ld19 {
    fn receive(&mut self, _: &[u8]) {}

    fn turn(&mut self, out: &mut Vec<u8>) {
        let points = POINTS as u64;
        while self.begun.elapsed().as_secs_f64() >= points as f64 / RATE * self.sent as f64 {
            let angle = |point: u64| ((self.sent * points + point) * 80 % 36_000) as u16;
            let mut packet = Packet {
                speed: 3600,
                angles: [angle(0), angle(points - 1)],
                distances: [0; POINTS],
                intensities: [180; POINTS],
                stamp_ms: (self.sent * points * 1000 / RATE as u64 % 30_000) as u16,
            };
            // Its angles are clockwise.
            packet.distances = std::array::from_fn(|point| {
                let range_m = (self.range_m)(360.0 - packet.angle_deg(point));
                (1e3 * range_m).round() as u16
            });
            out.extend(packet.encode());
            self.sent += 1;
        }
    }
}
