//! Odometry of two wheels from the counts of their encoders.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Matrix3x2, Vector2};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::Odometry;
use yamabico_core::time::Time;

/// Variance of the distance per distance driven, m²/m; as in Chong and Kleeman (1997), of the size of indoor robots.
const DISTANCE_NOISE: f64 = 1e-4;
/// Variance of the heading per angle turned, rad²/rad.
const TURN_NOISE: f64 = 1e-3;
/// Variance of the heading per distance driven, rad²/m.
const DRIFT_NOISE: f64 = 2e-4;
/// Time over which the speed is averaged, s: one count in 15 ms would be a third of a slow speed.
const SPEED_WINDOW_S: f64 = 0.06;
/// Longest time between two readings whose counts are compared, s.
const MAX_GAP_S: f64 = 10.0;
/// Travel that a reading may exceed the fastest possible one by, m.
const TOLERANCE_M: f64 = 0.02;

/// Wheels and their encoders.
#[derive(Clone, Copy, Debug)]
pub struct WheelGeometry {
    /// Travel of a wheel per count, m.
    pub m_per_count: f64,
    /// Distance between the wheels, m.
    pub track_m: f64,
    /// Maximum speed of a wheel, m/s.
    pub max_mps: f64,
}

/// Pose, twist and covariance from counts. The pose drifts but never jumps: counts that no wheel can have made, such as
/// after a reset of the device, only widen the covariance.
#[derive(Clone, Debug)]
pub struct DeadReckoning {
    geometry: WheelGeometry,
    pose: Pose2,
    covariance: Matrix3<f64>,
    /// Time and counts of the last reading.
    last: Option<(f64, [i64; 2])>,
    /// Duration and travel of both wheels, s and m, of the readings that the speed is averaged over.
    recent: VecDeque<(f64, [f64; 2])>,
    /// Number of readings that were no motion of the wheels.
    jumps: u64,
}

impl DeadReckoning {
    /// Returns a robot at the origin of the odometry frame.
    #[must_use]
    pub fn new(geometry: WheelGeometry) -> DeadReckoning {
        let covariance = Matrix3::zeros();
        DeadReckoning {
            geometry,
            pose: Pose2::IDENTITY,
            covariance,
            last: None,
            recent: VecDeque::new(),
            jumps: 0,
        }
    }

    /// Takes a reading of the left and the right counter at `device_s`, s, on an even clock. `difference` subtracts two values
    /// of a counter that wraps.
    pub fn read(&mut self, device_s: f64, counts: [i64; 2], difference: fn(i64, i64) -> i64) {
        let Some((last_s, last)) = self.last.replace((device_s, counts)) else { return };
        let dt = device_s - last_s;
        let travel = [0, 1].map(|i| difference(counts[i], last[i]) as f64 * self.geometry.m_per_count);
        let max_m = self.geometry.max_mps * dt + TOLERANCE_M;
        let is_motion = (0.0..=MAX_GAP_S).contains(&dt) && travel.iter().all(|m| m.abs() <= max_m);
        if !is_motion {
            self.jumps += 1;
            self.recent.clear();
            self.widen(self.geometry.max_mps * dt.clamp(0.0, MAX_GAP_S));
            return;
        }
        if dt > 0.0 {
            self.recent.push_back((dt, travel));
        }
        while self.recent.iter().skip(1).map(|(dt, _)| dt).sum::<f64>() >= SPEED_WINDOW_S {
            self.recent.pop_front();
        }
        self.integrate(travel);
    }

    /// Returns the number of readings that were no motion of the wheels.
    #[must_use]
    pub fn jumps(&self) -> u64 {
        self.jumps
    }

    /// Returns the message of the last reading.
    #[must_use]
    pub fn odometry(&self, stamp: Time, sequence: u64) -> Odometry {
        let covariance = std::array::from_fn(|i| self.covariance[(i / 3, i % 3)]);
        Odometry { sequence, covariance, ..Odometry::new(stamp.0, &self.pose, &self.twist()) }
    }

    /// Returns the mean twist of the last readings.
    fn twist(&self) -> Twist {
        let seconds: f64 = self.recent.iter().map(|(dt, _)| dt).sum();
        if seconds <= 0.0 {
            return Twist::ZERO;
        }
        let [left, right] =
            [0, 1].map(|i| self.recent.iter().map(|(_, travel)| travel[i]).sum::<f64>() / seconds);
        Twist::planar(0.5 * (left + right), (right - left) / self.geometry.track_m)
    }

    /// Moves the pose along an arc, and propagates its covariance.
    fn integrate(&mut self, [left, right]: [f64; 2]) {
        let (ahead, turn) = (0.5 * (left + right), (right - left) / self.geometry.track_m);
        let (sin, cos) = (self.pose.theta + 0.5 * turn).sin_cos();
        let f = Matrix3::new(1.0, 0.0, -ahead * sin, 0.0, 1.0, ahead * cos, 0.0, 0.0, 1.0);
        let g = Matrix3x2::new(cos, -0.5 * ahead * sin, sin, 0.5 * ahead * cos, 0.0, 1.0);
        let distance = ahead.abs();
        let noise = Vector2::new(DISTANCE_NOISE * distance, TURN_NOISE * turn.abs() + DRIFT_NOISE * distance);
        let noise = nalgebra::Matrix2::from_diagonal(&noise);
        self.covariance = f * self.covariance * f.transpose() + g * noise * g.transpose();
        self.pose = self.pose.integrate(&Twist::planar(ahead, turn), 1.0);
    }

    /// Adds a motion of unknown direction and up to `distance_m` to the covariance.
    fn widen(&mut self, distance_m: f64) {
        let turn = distance_m / self.geometry.track_m;
        self.covariance[(0, 0)] += distance_m * distance_m;
        self.covariance[(1, 1)] += distance_m * distance_m;
        self.covariance[(2, 2)] += turn * turn;
    }
}

/// Subtracts two values of a counter of 16 bits that wraps.
#[must_use]
pub fn difference_of_16_bits(now: i64, before: i64) -> i64 {
    i64::from((now as i16).wrapping_sub(before as i16))
}

/// Subtracts two values of a counter of 32 bits that wraps.
#[must_use]
pub fn difference_of_32_bits(now: i64, before: i64) -> i64 {
    i64::from((now as i32).wrapping_sub(before as i32))
}

#[cfg(test)]
mod tests {
    use yamabico_core::geometry::Hypotenuse;

    use super::*;

    const WHEELS: WheelGeometry = WheelGeometry { m_per_count: 0.0005, track_m: 0.2, max_mps: 0.5 };

    fn wrapped(count: i64) -> i64 {
        i64::from(count as i16)
    }

    #[test]
    fn counters_wrap_both_ways() {
        assert_eq!(difference_of_16_bits(-32768, 32767), 1);
        assert_eq!(difference_of_16_bits(32767, -32768), -1);
        assert_eq!(difference_of_32_bits(i64::from(i32::MIN), i64::from(i32::MAX)), 1);
        for direction in [1, -1] {
            let mut wheels = DeadReckoning::new(WHEELS);
            // 100 000 counts of 0.5 mm, three times around.
            for i in 0..=10_000 {
                let count = wrapped(32_700 + direction * 10 * i);
                wheels.read(0.015 * i as f64, [count, count], difference_of_16_bits);
            }
            let odometry = wheels.odometry(Time::ZERO, 0);
            assert!((odometry.x - 50.0 * direction as f64).abs() < 1e-6, "{}", odometry.x);
            assert!((odometry.vx - direction as f64 / 3.0).abs() < 1e-6, "{}", odometry.vx);
            assert_eq!(wheels.jumps(), 0);
        }
    }

    #[test]
    fn a_circle_closes() {
        let mut wheels = DeadReckoning::new(WHEELS);
        let rounds = 2.0 * std::f64::consts::PI * 0.4 / 0.0005;
        for i in 0..=1000 {
            let share = rounds * f64::from(i) / 1000.0;
            let counts = [share * 0.75, share * 1.25].map(|count| count.round() as i64);
            wheels.read(0.05 * f64::from(i), counts, difference_of_32_bits);
        }
        let odometry = wheels.odometry(Time::ZERO, 0);
        assert!(odometry.x.hypotenuse(odometry.y) < 0.002 && odometry.theta.abs() < 0.01, "{odometry:?}");
        // A count more or less in the time of the mean.
        assert!((odometry.omega * 0.4 - odometry.vx).abs() < 0.03, "{odometry:?}");
    }

    #[test]
    fn a_reset_counter_does_not_move_the_robot() {
        let mut wheels = DeadReckoning::new(WHEELS);
        wheels.read(0.0, [9000, 9000], difference_of_16_bits);
        wheels.read(0.015, [9010, 9010], difference_of_16_bits);
        let before = wheels.odometry(Time::ZERO, 0);
        wheels.read(0.030, [0, 0], difference_of_16_bits);
        let after = wheels.odometry(Time::ZERO, 0);
        assert_eq!((after.x, after.y, after.theta), (before.x, before.y, before.theta));
        assert!(after.covariance[0] > before.covariance[0] && wheels.jumps() == 1);
        wheels.read(0.045, [10, 10], difference_of_16_bits);
        assert!((wheels.odometry(Time::ZERO, 0).x - before.x - 0.005).abs() < 1e-9);
        wheels.read(60.0, [12, 12], difference_of_16_bits);
        assert_eq!(wheels.jumps(), 2, "the counters may have wrapped in a minute");
    }
}
