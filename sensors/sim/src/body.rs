//! A body that moves as its drive can: limited accelerations, exact arcs, and a brake of its own.

use yamabico_core::geometry::{Pose2, Twist};

/// What the drive can do, each for the linear, lateral and angular axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyLimits {
    /// Largest speed: m/s, m/s, rad/s; 0 for an axis that the drive does not have.
    pub speed: [f64; 3],
    /// Largest change of speed, per second squared.
    pub acceleration: [f64; 3],
    /// Deceleration of an emergency and of the watchdog, per second squared.
    pub emergency: [f64; 3],
    /// The body brakes by itself when no command has come for this long, seconds.
    pub watchdog_s: f64,
}

/// A moving body.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Where it is, world.
    pub pose: Pose2,
    /// How it moves, body frame.
    pub twist: Twist,
    limits: BodyLimits,
    wanted: [f64; 3],
    emergency: bool,
    since_command_s: f64,
}

impl Body {
    /// A body that stands at `pose`.
    #[must_use]
    pub fn new(pose: Pose2, limits: BodyLimits) -> Self {
        let since_command_s = f64::INFINITY;
        Self { pose, twist: Twist::ZERO, limits, wanted: [0.0; 3], emergency: false, since_command_s }
    }

    /// Takes a command; one that is not finite brakes as an emergency.
    pub fn command(&mut self, twist: &Twist, urgency: Urgency) {
        self.since_command_s = 0.0;
        let wanted = [twist.linear, twist.lateral, twist.angular];
        let sound = twist.is_finite();
        self.emergency = urgency == Urgency::Emergency || !sound;
        self.wanted = if sound { wanted } else { [0.0; 3] };
        for (w, top) in self.wanted.iter_mut().zip(self.limits.speed) {
            *w = w.clamp(-top, top);
        }
    }

    /// Where it would be and how it would move after `dt` seconds.
    #[must_use]
    pub fn stepped(&self, dt: f64) -> Self {
        let mut next = *self;
        next.since_command_s += dt;
        let silent = next.since_command_s > self.limits.watchdog_s;
        let wanted = if silent { [0.0; 3] } else { self.wanted };
        let rate = if silent || self.emergency { self.limits.emergency } else { self.limits.acceleration };
        let now = [self.twist.linear, self.twist.lateral, self.twist.angular];
        let [linear, lateral, angular] =
            [0, 1, 2].map(|i| now[i] + (wanted[i] - now[i]).clamp(-rate[i] * dt, rate[i] * dt));
        next.twist = Twist::new(linear, lateral, angular);
        let mean = Twist::new((now[0] + linear) / 2.0, (now[1] + lateral) / 2.0, (now[2] + angular) / 2.0);
        next.pose = self.pose.integrate(&mean, dt);
        next
    }
}

/// How hard a command may brake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// As in normal driving.
    Normal,
    /// As hard as the body can.
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
    fn it_speeds_up_no_faster_than_it_can_and_has_no_missing_axis() {
        let mut b = body();
        b.command(&Twist::new(5.0, 1.0, 0.0), Urgency::Normal);
        let after = run(b, 0.1);
        assert!((after.twist.linear - 0.05).abs() < 1e-12, "{:?}", after.twist);
        assert_eq!(after.twist.lateral, 0.0);
        assert!((after.pose.x - 0.0025).abs() < 1e-9);
    }

    #[test]
    fn it_stops_by_itself_when_commands_stop_and_on_nonsense() {
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
    fn a_turning_body_runs_on_a_circle() {
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
