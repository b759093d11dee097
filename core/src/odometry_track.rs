//! Where the robot was at an instant: the recent odometry.

use crate::geometry::{Pose2, Twist, angle_difference};
use crate::message::Odometry;
use crate::time::Time;

const CAPACITY: usize = 256;

/// What is stamped later than now by more than this (s) is refused.
pub const FUTURE_TOLERANCE_S: f64 = 0.02;

/// The newest readings, oldest overwritten first; never allocates.
#[derive(Clone, Debug)]
pub struct OdometryTrack {
    readings: [Reading; CAPACITY],
    len: usize,
    newest: usize,
}

/// One reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// When the encoders were read.
    pub stamp: Time,
    /// Robot in the odometry frame.
    pub pose: Pose2,
    /// Velocity, robot frame.
    pub twist: Twist,
}

impl Default for OdometryTrack {
    fn default() -> Self {
        Self { readings: [Reading::default(); CAPACITY], len: 0, newest: 0 }
    }
}

impl OdometryTrack {
    /// Takes one reading. One that is not finite, not newer than the last or later than `now` is ignored, and `false` is
    /// returned.
    pub fn push(&mut self, odometry: &Odometry, now: Time) -> bool {
        let reading = Reading {
            stamp: Time(odometry.stamp_ns),
            pose: Pose2::new(odometry.x, odometry.y, odometry.theta),
            twist: Twist::new(odometry.vx, odometry.vy, odometry.omega),
        };
        let is_newer = self.newest().is_none_or(|last| reading.stamp > last.stamp);
        let is_future = reading.stamp.seconds_after(now) > FUTURE_TOLERANCE_S;
        if !is_newer || is_future || !reading.pose.is_finite() || !reading.twist.is_finite() {
            return false;
        }
        self.newest = (self.newest + 1) % CAPACITY;
        self.readings[self.newest] = reading;
        self.len = (self.len + 1).min(CAPACITY);
        true
    }

    /// The newest reading; `None` where there is none.
    #[must_use]
    pub fn newest(&self) -> Option<&Reading> {
        (self.len > 0).then(|| &self.readings[self.newest])
    }

    /// The pose at an instant: between two readings along the arc that joins them, after the newest (or before the oldest)
    /// by its twist for at most half a second. `None` without a reading.
    #[must_use]
    pub fn pose_at(&self, at: Time) -> Option<Pose2> {
        const FARTHEST_S: f64 = 0.5;
        let mut later: Option<&Reading> = None;
        for back in 0..self.len {
            let reading = &self.readings[(self.newest + CAPACITY - back) % CAPACITY];
            if reading.stamp <= at {
                return Some(match later {
                    Some(later) => between(reading, later, at),
                    None => {
                        let ahead_s = at.seconds_after(reading.stamp).min(FARTHEST_S);
                        reading.pose.integrate(&reading.twist, ahead_s)
                    }
                });
            }
            later = Some(reading);
        }
        later.map(|oldest| {
            let back_s = at.seconds_after(oldest.stamp).max(-FARTHEST_S);
            oldest.pose.integrate(&oldest.twist, back_s)
        })
    }
}

fn between(earlier: &Reading, later: &Reading, at: Time) -> Pose2 {
    let span_s = later.stamp.seconds_after(earlier.stamp);
    let motion = earlier.pose.relative(&later.pose);
    earlier.pose.integrate(&Twist::logarithm(&motion, span_s), at.seconds_after(earlier.stamp))
}

/// How far the robot moved from one pose to another: meters of translation and radians of turning, never negative.
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
    fn poses_lie_between_and_beyond_readings() {
        let mut track = OdometryTrack::default();
        assert!(track.pose_at(Time::ZERO).is_none());
        for i in 0..400 {
            let seconds = 1.0 + 0.01 * f64::from(i);
            assert!(track.push(&reading(seconds, seconds - 1.0, 0.0), Time::from_secs_f64(seconds)));
        }
        let at = |seconds: f64| track.pose_at(Time::from_secs_f64(seconds)).unwrap().x;
        assert!((at(4.005) - 3.005).abs() < 1e-9);
        assert!((at(5.0) - 4.0).abs() < 1e-6, "beyond the newest by its twist");
        assert!((at(60.0) - 4.49).abs() < 1e-6, "but not for ever");
        assert!((at(2.4) - 1.4).abs() < 1e-6, "before the oldest that is kept");
    }

    #[test]
    fn nonsense_is_refused() {
        let mut track = OdometryTrack::default();
        let now = Time::from_secs_f64(2.0);
        assert!(track.push(&reading(1.0, 0.0, 0.0), now));
        assert!(!track.push(&reading(1.0, 5.0, 0.0), now) && !track.push(&reading(0.5, 5.0, 0.0), now));
        assert!(!track.push(&reading(2.0, f64::NAN, 0.0), now));
        assert!(!track.push(&reading(9.0, 5.0, 0.0), now), "from the future");
        assert_eq!(track.newest().map(|reading| reading.pose.x), Some(0.0));
    }
}
