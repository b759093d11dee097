//! Recent odometry, from which the pose at any recent time is interpolated. A gyro replaces the turns of the wheels.

use crate::geometry::{Hypotenuse, Pose2, Twist, angle_difference};
use crate::gyro_track::GyroTrack;
use crate::message::{Imu, Odometry};
use crate::time::Time;

const CAPACITY: usize = 256;
/// Speed (m/s) and turn rate (rad/s) of the wheels below which the robot stands.
const STANDING: (f64, f64) = (0.002, 0.005);

/// A ring buffer of odometry readings. Never allocates.
#[derive(Clone, Debug)]
pub struct OdometryTrack {
    readings: [Reading; CAPACITY],
    len: usize,
    newest: usize,
    gyro: GyroTrack,
    /// Newest pose as the wheels measured it, and the pose in their frame of the frame of this track; none without a gyro.
    wheels: Pose2,
    correction: Option<Pose2>,
    /// True if the wheels stand.
    stands: bool,
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
        Self {
            readings: [Reading::default(); CAPACITY],
            len: 0,
            newest: 0,
            gyro: GyroTrack::default(),
            wheels: Pose2::IDENTITY,
            correction: None,
            stands: false,
        }
    }
}

impl OdometryTrack {
    /// Adds a reading. Returns false, and ignores the reading, if it is not finite, not newer than the last one, or from the
    /// future ([`Time::is_next`]).
    pub fn push(&mut self, odometry: &Odometry, now: Time) -> bool {
        let mut reading = Reading {
            stamp: Time(odometry.stamp_ns),
            pose: Pose2::new(odometry.x, odometry.y, odometry.theta),
            twist: Twist::new(odometry.vx, odometry.vy, odometry.omega),
        };
        let is_next = reading.stamp.is_next(self.newest().map(|last| last.stamp), now);
        if !is_next || !reading.pose.is_finite() || !reading.twist.is_finite() {
            return false;
        }
        if let Some(last) = self.newest().copied() {
            self.turn_by_gyro(&last, &mut reading);
        }
        self.wheels = Pose2::new(odometry.x, odometry.y, odometry.theta);
        let speed_mps = odometry.vx.hypotenuse(odometry.vy);
        self.stands = speed_mps < STANDING.0 && odometry.omega.abs() < STANDING.1;
        self.newest = (self.newest + 1) % CAPACITY;
        self.readings[self.newest] = reading;
        self.len = (self.len + 1).min(CAPACITY);
        true
    }

    /// Adds an inertial measurement; those up to a reading of the wheels must come before it. Its turn rate replaces that of the
    /// wheels, and its turns theirs where it has measured all the time between two readings: the poses then are in a frame of
    /// this track, which is that of the wheels at first. Its bias is learned while the wheels stand. Returns false if it is
    /// ignored, for the causes of [`OdometryTrack::push`].
    pub fn push_imu(&mut self, imu: &Imu, now: Time) -> bool {
        let stamp = Time(imu.stamp_ns);
        let turn_radps = imu.angular_velocity[2];
        let is_next = stamp.is_next(self.gyro.newest(), now) && turn_radps.is_finite();
        if is_next {
            self.gyro.push(stamp, turn_radps, self.stands);
        }
        is_next
    }

    /// Replaces the turn of a new reading by that of the gyro since the reading `last`, if it is known.
    fn turn_by_gyro(&mut self, last: &Reading, reading: &mut Reading) {
        let span_s = reading.stamp.seconds_after(last.stamp);
        let wheels = Twist::logarithm(&self.wheels.relative(&reading.pose), span_s);
        // The gyro of a robot that stands measures its bias alone.
        let stands = wheels.speed() < STANDING.0 && wheels.angular.abs() < STANDING.1;
        match self.gyro.turn_rad(last.stamp, reading.stamp).filter(|_| !stands) {
            Some(turn_rad) => {
                let arc = Twist { angular: turn_rad / span_s, ..wheels };
                let pose = last.pose.integrate(&arc, span_s);
                self.correction = Some(pose * reading.pose.inverse());
                reading.pose = pose;
                reading.twist.angular = arc.angular;
            }
            None => {
                reading.pose = self.correction.map_or(reading.pose, |correction| correction * reading.pose);
            }
        }
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

    fn imu(seconds: f64, turn_radps: f64) -> Imu {
        let stamp_ns = Time::from_secs_f64(seconds).0;
        Imu { stamp_ns, angular_velocity: [0.0, 0.0, turn_radps], ..Imu::default() }
    }

    /// Heading after a drive of 10 s whose true turn rate is 0.2 rad/s while the wheels measure 0.25, after standing for 4 s;
    /// the gyro has a bias of 0.03 and is silent during `gap_s`.
    fn heading_after(gap_s: std::ops::Range<f64>) -> f64 {
        let mut track = OdometryTrack::default();
        for step in 0..1400 {
            let seconds = 1.0 + 0.01 * f64::from(step);
            let now = Time::from_secs_f64(seconds);
            let driven_s = (seconds - 5.0).max(0.0);
            let turn_radps = if driven_s > 0.0 { 0.2 } else { 0.0 };
            if !gap_s.contains(&driven_s) {
                assert!(track.push_imu(&imu(seconds, turn_radps + 0.03), now));
            }
            if step % 2 == 0 {
                let twist = Twist::planar(if driven_s > 0.0 { 0.3 } else { 0.0 }, 1.25 * turn_radps);
                let pose = Pose2::IDENTITY.integrate(&twist, driven_s);
                assert!(track.push(&Odometry::new(now.0, &pose, &twist), now));
            }
        }
        track.newest().unwrap().pose.theta
    }

    #[test]
    fn a_gyro_measures_turns_better_than_wheels_that_slip() {
        let heading = heading_after(20.0..20.0);
        assert!((heading - 0.2 * 9.98).abs() < 0.02, "{heading}");
        let heading = heading_after(2.0..6.0);
        assert!(
            (heading - (0.2 * 9.98 + 0.05 * 4.0)).abs() < 0.03,
            "wheels turn while it is silent: {heading}"
        );
        let heading = heading_after(-10.0..20.0);
        assert!((heading - 0.25 * 9.98).abs() < 1e-9, "without a gyro the wheels count alone: {heading}");
    }

    #[test]
    fn invalid_inertial_measurements_are_refused() {
        let mut track = OdometryTrack::default();
        let now = Time::from_secs_f64(2.0);
        assert!(track.push_imu(&imu(1.0, 0.1), now));
        assert!(!track.push_imu(&imu(1.0, 0.1), now) && !track.push_imu(&imu(1.5, f64::NAN), now));
        assert!(!track.push_imu(&imu(9.0, 0.1), now), "stamped in the future");
    }
}
