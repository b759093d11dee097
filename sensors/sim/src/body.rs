//! Motion model of the robot's body: limited accelerations, exact arcs, and a watchdog that brakes.

use yamabico_core::geometry::{Hypotenuse, Pose2, Twist, wrap_angle};

/// Speed below which a turn is a turn in place, m/s.
const IN_PLACE_MPS: f64 = 0.02;

/// Limits of the drive, each for the linear, lateral and angular axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyLimits {
    /// Maximum speed: m/s, m/s, rad/s; 0 for an axis that the drive does not have.
    pub speed: [f64; 3],
    /// Maximum acceleration and deceleration: m/s^2, m/s^2, rad/s^2.
    pub acceleration: [f64; 3],
    /// Deceleration in an emergency and by the watchdog: m/s^2, m/s^2, rad/s^2.
    pub emergency: [f64; 3],
    /// Time without a command after which the body brakes, s.
    pub watchdog_s: f64,
    /// Fraction of a turn in place that the body does not make although the wheels roll: 0 without slip.
    pub turn_slip: f64,
}

/// A moving body.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Pose in the world frame.
    pub pose: Pose2,
    /// Twist of the wheels in the body frame.
    pub twist: Twist,
    /// Angle that the body has turned and the wheels have not measured, rad.
    pub skid_rad: f64,
    /// Angle by which the body skids in an emergency stop per speed lost, rad per m/s.
    skid_per_mps: f64,
    limits: BodyLimits,
    target: [f64; 3],
    is_emergency: bool,
    since_command_s: f64,
}

impl Body {
    /// Returns a body at rest at `pose`.
    #[must_use]
    pub fn new(pose: Pose2, limits: BodyLimits) -> Self {
        let since_command_s = f64::INFINITY;
        Self {
            pose,
            twist: Twist::ZERO,
            skid_rad: 0.0,
            skid_per_mps: 0.0,
            limits,
            target: [0.0; 3],
            is_emergency: false,
            since_command_s,
        }
    }

    /// Applies a command; one that is not finite is an emergency stop.
    pub fn command(&mut self, twist: &Twist, urgency: Urgency) {
        self.since_command_s = 0.0;
        let target = [twist.linear, twist.lateral, twist.angular];
        let is_finite = twist.is_finite();
        self.is_emergency = urgency == Urgency::Emergency || !is_finite;
        if !self.is_emergency {
            self.skid_per_mps = 0.0;
        }
        self.target = if is_finite { target } else { [0.0; 3] };
        for (speed, max) in self.target.iter_mut().zip(self.limits.speed) {
            *speed = speed.clamp(-max, max);
        }
    }

    /// Returns true while the body brakes for an emergency stop.
    #[must_use]
    pub fn is_emergency(&self) -> bool {
        self.is_emergency
    }

    /// Sets the angle (rad) by which the body will have skidded when it stands.
    pub fn skid(&mut self, angle_rad: f64) {
        let speed = self.twist.linear.hypotenuse(self.twist.lateral);
        self.skid_per_mps = if speed > 0.0 { angle_rad / speed } else { 0.0 };
    }

    /// Returns the body after `dt` seconds.
    #[must_use]
    pub fn stepped(&self, dt: f64) -> Self {
        let mut next = *self;
        next.since_command_s += dt;
        let timed_out = next.since_command_s > self.limits.watchdog_s;
        let target = if timed_out { [0.0; 3] } else { self.target };
        let hard = timed_out || self.is_emergency;
        let rate = if hard { self.limits.emergency } else { self.limits.acceleration };
        let now = [self.twist.linear, self.twist.lateral, self.twist.angular];
        let [linear, lateral, angular] =
            [0, 1, 2].map(|i| now[i] + (target[i] - now[i]).clamp(-rate[i] * dt, rate[i] * dt));
        next.twist = Twist::new(linear, lateral, angular);
        let mean = Twist::new((now[0] + linear) / 2.0, (now[1] + lateral) / 2.0, (now[2] + angular) / 2.0);
        next.pose = self.pose.integrate(&mean, dt);
        let turned_rad = self.slip_rad(&next.twist, &mean, hard, dt);
        if turned_rad != 0.0 {
            next.pose.theta = wrap_angle(next.pose.theta + turned_rad);
            next.skid_rad += turned_rad;
        }
        next
    }

    /// Returns the angle by which the body turns beyond the motion of its wheels in `dt` seconds, rad.
    fn slip_rad(&self, next: &Twist, mean: &Twist, hard: bool, dt: f64) -> f64 {
        let in_place = mean.linear.hypotenuse(mean.lateral) < IN_PLACE_MPS;
        let turning = if in_place { -self.limits.turn_slip * mean.angular * dt } else { 0.0 };
        let lost_mps =
            self.twist.linear.hypotenuse(self.twist.lateral) - next.linear.hypotenuse(next.lateral);
        let braking = if hard { self.skid_per_mps * lost_mps.max(0.0) } else { 0.0 };
        turning + braking
    }
}

/// Deceleration with which a command is applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// [`BodyLimits::acceleration`].
    Normal,
    /// [`BodyLimits::emergency`].
    Emergency,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body() -> Body {
        let limits = BodyLimits {
            speed: [1.0, 0.0, 2.0],
            acceleration: [0.5, 0.5, 2.0],
            emergency: [2.0, 2.0, 8.0],
            watchdog_s: 0.2,
            turn_slip: 0.0,
        };
        Body::new(Pose2::IDENTITY, limits)
    }

    fn run(mut b: Body, seconds: f64) -> Body {
        for _ in 0..(seconds / 0.005).round() as usize {
            b = b.stepped(0.005);
        }
        b
    }

    #[test]
    fn acceleration_and_missing_axes_are_limited() {
        let mut b = body();
        b.command(&Twist::new(5.0, 1.0, 0.0), Urgency::Normal);
        let after = run(b, 0.1);
        assert!((after.twist.linear - 0.05).abs() < 1e-12, "{:?}", after.twist);
        assert_eq!(after.twist.lateral, 0.0);
        assert!((after.pose.x - 0.0025).abs() < 1e-9);
    }

    #[test]
    fn it_stops_without_commands_and_on_nan() {
        let mut b = body();
        b.twist = Twist::new(0.4, 0.0, 0.0);
        b.command(&Twist::new(0.4, 0.0, 0.0), Urgency::Normal);
        assert!((run(b, 0.195).twist.linear - 0.4).abs() < 1e-12);
        let stopped = run(b, 0.42);
        assert_eq!(stopped.twist, Twist::ZERO);
        // 0.2 s at 0.4 m/s, then v^2 / 2a.
        assert!((stopped.pose.x - 0.12).abs() < 0.003, "{}", stopped.pose.x);
        b.command(&Twist::new(f64::NAN, 0.0, 0.0), Urgency::Normal);
        assert!(run(b, 0.2).twist.linear.abs() < 1e-12);
    }

    #[test]
    fn slip_turns_the_body_against_its_wheels() {
        let mut b = body();
        b.limits.turn_slip = 0.2;
        for _ in 0..200 {
            b.command(&Twist::new(0.0, 0.0, 0.5), Urgency::Normal);
            b = b.stepped(0.005);
        }
        let wheels = b.pose.theta - b.skid_rad;
        assert!((b.pose.theta - 0.8 * wheels).abs() < 1e-9 && wheels > 0.4, "{wheels}");

        let mut b = body();
        b.twist = Twist::new(0.4, 0.0, 0.0);
        b.command(&Twist::ZERO, Urgency::Emergency);
        b.skid(0.1);
        let stopped = run(b, 0.5);
        assert!((stopped.pose.theta - 0.1).abs() < 1e-9 && (stopped.skid_rad - 0.1).abs() < 1e-9);
    }

    #[test]
    fn a_turning_body_moves_on_a_circle() {
        let mut b = body();
        b.twist = Twist::new(0.5, 0.0, 1.0);
        let mut top = f64::MIN;
        for _ in 0..1000 {
            b.command(&Twist::new(0.5, 0.0, 1.0), Urgency::Normal);
            b = b.stepped(0.005);
            top = top.max(b.pose.y);
        }
        assert!((top - 1.0).abs() < 1e-4, "diameter is 2 v / omega: {top}");
    }
}
