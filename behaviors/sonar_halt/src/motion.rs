//! The motion that the robot has and the one that is wished.

use yamabico_core::behavior::Inputs;
use yamabico_core::message::Twist;
use yamabico_core::sensor::MotionLimits;
use yamabico_core::time::Time;

use crate::{DECISION, ODOMETRY};

/// Motion of the robot as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Measured twist.
    pub measured: Option<Twist>,
    /// Twist that the behaviors would get without halts.
    pub wished: Option<Twist>,
}

impl Motion {
    /// Reads the newest odometry and decision. One that is older than `max_age_s`, from the future or not finite is ignored.
    #[must_use]
    pub fn read(inputs: &Inputs<'_>, max_age_s: f64) -> Self {
        let known = |stamp_ns: u64, twist: Twist| {
            let (now, stamp) = (inputs.now(), Time(stamp_ns));
            let is_usable = now.seconds_after(stamp) <= max_age_s && !stamp.is_future(now);
            (twist.is_finite() && is_usable).then_some(twist)
        };
        let odometry = inputs.latest(&ODOMETRY).map(|odometry| *odometry.header);
        let decision = inputs.latest(&DECISION).map(|decision| *decision.header);
        Self {
            measured: odometry.and_then(|odometry| {
                known(odometry.stamp_ns, Twist::new(odometry.vx, odometry.vy, odometry.omega))
            }),
            wished: decision.and_then(|decision| known(decision.stamp_ns, decision.wished)),
        }
    }

    /// Returns the measured and the wished twist, `None` if the robot's motion is not known. An unknown wish is to drive
    /// straight ahead at full speed.
    #[must_use]
    pub fn twists(&self, limits: &MotionLimits) -> Option<[Twist; 2]> {
        let [linear, lateral, angular] = limits.speed;
        let within = |speed: f64, limit: f64| speed.min(limit).max(-limit);
        let wished = self.wished.map_or(Twist::planar(linear, 0.0), |wished| {
            Twist::new(
                within(wished.linear, linear),
                within(wished.lateral, lateral),
                within(wished.angular, angular),
            )
        });
        self.measured.map(|measured| [measured, wished])
    }
}
