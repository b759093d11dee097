//! Recent odometry, from which the pose at any recent time is interpolated.

use crate::geometry::{Pose2, Twist, angle_difference};
use crate::message::Odometry;
use crate::time::Time;

const CAPACITY: usize = 256;

/// A ring buffer of odometry readings. Never allocates.
#[derive(Clone, Debug)]
pub struct OdometryTrack {
    readings: [Reading; CAPACITY],
    len: usize,
    newest: usize,
}

/// One odometry reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Time at which the encoders were read.
    pub stamp: Time,
    /// Pose in the odometry frame.
    pub pose: Pose2,
    /// Velocity in the robot frame.
    pub twist: Twist,
}

impl Default for OdometryTrack {
    fn default() -> Self {
        Self { readings: [Reading::default(); CAPACITY], len: 0, newest: 0 }
    }
}

impl OdometryTrack {
    /// Adds a reading. Returns false, and ignores the reading, if it is not finite, not newer than the last one, or from the
    /// future ([`Time::is_next`]).
    pub fn push(&mut self, odometry: &Odometry, now: Time) -> bool {
        let reading = Reading {
            stamp: Time(odometry.stamp_ns),
            pose: Pose2::new(odometry.x, odometry.y, odometry.theta),
            twist: Twist::new(odometry.vx, odometry.vy, odometry.omega),
        };
        let is_next = reading.stamp.is_next(self.newest().map(|last| last.stamp), now);
        if !is_next || !reading.pose.is_finite() || !reading.twist.is_finite() {
            return false;
        }
        self.newest = (self.newest + 1) % CAPACITY;
        self.readings[self.newest] = reading;
        self.len = (self.len + 1).min(CAPACITY);
        true
    }

    /// Returns the newest reading, or `None` if there is none.
    #[must_use]
    pub fn newest(&self) -> Option<&Reading> {
        (self.len > 0).then(|| &self.readings[self.newest])
    }

    /// Returns the pose at time `at`, or `None` without readings. Between two readings the pose is interpolated on the
    /// arc that joins them; outside of them it is extrapolated with the nearest reading's twist for at most 0.5 s.
    #[must_use]
    pub fn pose_at(&self, at: Time) -> Option<Pose2> {
        const MAX_EXTRAPOLATION_S: f64 = 0.5;
        let mut later: Option<&Reading> = None;
        for back in 0..self.len {
            let reading = &self.readings[(self.newest + CAPACITY - back) % CAPACITY];
            if reading.stamp <= at {
                return Some(match later {
                    Some(later) => between(reading, later, at),
                    None => {
                        let ahead_s = at.seconds_after(reading.stamp).min(MAX_EXTRAPOLATION_S);
                        reading.pose.integrate(&reading.twist, ahead_s)
                    }
                });
            }
            later = Some(reading);
        }
        later.map(|oldest| {
            let back_s = at.seconds_after(oldest.stamp).max(-MAX_EXTRAPOLATION_S);
            oldest.pose.integrate(&oldest.twist, back_s)
        })
    }
}

fn between(earlier: &Reading, later: &Reading, at: Time) -> Pose2 {
    let span_s = later.stamp.seconds_after(earlier.stamp);
    let motion = earlier.pose.relative(&later.pose);
    earlier.pose.integrate(&Twist::logarithm(&motion, span_s), at.seconds_after(earlier.stamp))
}

/// Returns the distance (m) and the absolute rotation (rad) between two poses.
#[must_use]
pub fn travel(from: &Pose2, to: &Pose2) -> (f64, f64) {
    (from.distance(to), angle_difference(to.theta, from.theta).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(seconds: f64, x: f64, theta: f64) -> Odometry {
        Odometry { stamp_ns: Time::from_secs_f64(seconds).0, x, theta, vx: 1.0, ..Odometry::default() }
    }

    #[test]
    fn poses_are_interpolated_and_extrapolated() {
        let mut track = OdometryTrack::default();
        assert!(track.pose_at(Time::ZERO).is_none());
        for i in 0..400 {
            let seconds = 1.0 + 0.01 * f64::from(i);
            assert!(track.push(&reading(seconds, seconds - 1.0, 0.0), Time::from_secs_f64(seconds)));
        }
        let at = |seconds: f64| track.pose_at(Time::from_secs_f64(seconds)).unwrap().x;
        assert!((at(4.005) - 3.005).abs() < 1e-9);
        assert!((at(5.0) - 4.0).abs() < 1e-6, "extrapolated with the newest twist");
        assert!((at(60.0) - 4.49).abs() < 1e-6, "for half a second at most");
        assert!((at(2.4) - 1.4).abs() < 1e-6, "extrapolated before the oldest reading");
    }

    #[test]
    fn invalid_readings_are_refused() {
        let mut track = OdometryTrack::default();
        let now = Time::from_secs_f64(2.0);
        assert!(track.push(&reading(1.0, 0.0, 0.0), now));
        assert!(!track.push(&reading(1.0, 5.0, 0.0), now) && !track.push(&reading(0.5, 5.0, 0.0), now));
        assert!(!track.push(&reading(2.0, f64::NAN, 0.0), now));
        assert!(!track.push(&reading(9.0, 5.0, 0.0), now), "stamped in the future");
        assert_eq!(track.newest().map(|reading| reading.pose.x), Some(0.0));
    }
}
