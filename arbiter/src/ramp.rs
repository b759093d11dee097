//! Acceleration and jerk limits between the current and the target speed.
//!
//! Translation moves in a straight line through the plane of velocities. Speeding up is limited in acceleration and jerk
//! and ends smoothly. Slowing down is limited in deceleration, and its onset in jerk; its end is not smoothed, and speeding
//! up is aborted at once: so a lower target never gives a higher speed than a higher target would.

use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Axes, Axis, Twist};
use yamabico_core::sensor::MotionLimits;

use crate::kinematics::translation;

/// Time steps and emergency axes of one step of a ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Time step for braking, s.
    pub braking_s: f64,
    /// Time step for speeding up, s.
    pub speeding_s: f64,
    /// Axes to bring to zero with the emergency deceleration, without jerk limit.
    pub emergency: Axes,
}

/// Twist commanded last, and its rate of change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp {
    velocity: Twist,
    /// Rate of the translation's speed, m/s^2; negative while slowing down.
    translation_rate: f64,
    /// Rate of the turn rate's magnitude, rad/s^2; negative while slowing down.
    angular_rate: f64,
}

/// Limits of one degree of freedom, SI units.
#[derive(Clone, Copy)]
struct Bounds {
    acceleration: f64,
    deceleration: f64,
    jerk: f64,
}

impl Ramp {
    /// Twist commanded last.
    pub fn velocity(&self) -> Twist {
        self.velocity
    }

    /// Moves one step towards `target`, within the limits of the axes in `drive_axes`, and returns the new twist.
    ///
    /// An axis in `step.emergency` brakes to zero, whatever the target is.
    pub fn advance(&mut self, target: Twist, step: Step, limits: &MotionLimits, drive_axes: Axes) -> Twist {
        self.translate(target, step, limits, drive_axes);
        self.turn(target.angular, step, limits);
        if !self.velocity.is_finite() {
            *self = Ramp::default();
        }
        self.velocity
    }

    fn translate(&mut self, target: Twist, step: Step, limits: &MotionLimits, drive_axes: Axes) {
        let plane = drive_axes.without(Axes::ANGULAR);
        let halted = step.emergency.intersection(plane);
        let brake = smallest(&limits.emergency, plane) * step.braking_s;
        if halted.is_empty() {
            let bounds = Bounds {
                acceleration: smallest(&limits.acceleration, plane),
                deceleration: smallest(&limits.deceleration, plane),
                jerk: smallest(&limits.jerk, plane),
            };
            let [x, y] = approach(
                [self.velocity.linear, self.velocity.lateral],
                [target.linear, target.lateral],
                &mut self.translation_rate,
                bounds,
                step,
            );
            (self.velocity.linear, self.velocity.lateral) = (x, y);
        } else if halted == plane {
            let speed = translation(self.velocity);
            let factor = if speed > brake { (speed - brake) / speed } else { 0.0 };
            self.velocity.linear *= factor;
            self.velocity.lateral *= factor;
            self.translation_rate = 0.0;
        } else {
            for axis in plane.iter() {
                let now = self.velocity.get(axis);
                let next = if halted.contains(axis) {
                    braked(now, brake)
                } else {
                    let bounds = Bounds::of(limits, axis);
                    approach([now, 0.0], [target.get(axis), 0.0], &mut self.translation_rate, bounds, step)[0]
                };
                self.velocity.set(axis, next);
            }
        }
    }

    fn turn(&mut self, target: f64, step: Step, limits: &MotionLimits) {
        self.velocity.angular = if step.emergency.contains(Axis::Angular) {
            self.angular_rate = 0.0;
            braked(self.velocity.angular, limits.emergency[Axis::Angular as usize] * step.braking_s)
        } else {
            let bounds = Bounds::of(limits, Axis::Angular);
            approach([self.velocity.angular, 0.0], [target, 0.0], &mut self.angular_rate, bounds, step)[0]
        };
    }
}

impl Bounds {
    fn of(limits: &MotionLimits, axis: Axis) -> Bounds {
        let i = axis as usize;
        Bounds {
            acceleration: limits.acceleration[i],
            deceleration: limits.deceleration[i],
            jerk: limits.jerk[i],
        }
    }
}

/// Speeds below this are zero, m/s or rad/s.
const STANDING: f64 = 1e-12;

/// Moves one step from velocity `now` towards `target` in a straight line.
fn approach(now: [f64; 2], target: [f64; 2], rate: &mut f64, bounds: Bounds, step: Step) -> [f64; 2] {
    let gap = [target[0] - now[0], target[1] - now[1]];
    let distance = gap[0].hypotenuse(gap[1]);
    if distance < STANDING {
        *rate = 0.0;
        return target;
    }
    let along = (now[0] * gap[0] + now[1] * gap[1]) / distance;
    let (length, reach) = if along < -STANDING {
        let dt = step.braking_s;
        let pace = ((-*rate).max(0.0) + bounds.jerk * dt).min(bounds.deceleration);
        *rate = -pace;
        // Up to the slowest point of the line; after it the robot speeds up again.
        (pace * dt, distance.min(-along))
    } else {
        let dt = step.speeding_s;
        let pace = (rate.max(0.0) + bounds.jerk * dt).min(bounds.acceleration).min(landing(
            distance,
            bounds.jerk,
            dt,
        ));
        *rate = pace;
        (pace * dt, distance)
    };
    if length >= distance && reach >= distance {
        *rate = 0.0;
        return target;
    }
    let part = length.min(reach) / distance;
    [now[0] + gap[0] * part, now[1] + gap[1] * part]
}

/// Maximum acceleration that `jerk` can still bring to zero within `distance`.
fn landing(distance: f64, jerk: f64, dt: f64) -> f64 {
    if jerk.is_finite() {
        jerk * ((dt * dt / 4.0 + 2.0 * distance / jerk).sqrt() - dt / 2.0)
    } else {
        f64::INFINITY
    }
}

/// Moves `now` towards zero by `change`, not past it.
fn braked(now: f64, change: f64) -> f64 {
    if now.abs() > change { now - change.copysign(now) } else { 0.0 }
}

/// Smallest entry of the axes in `among`; zero if there are none.
fn smallest(values: &[f64; 3], among: Axes) -> f64 {
    let smallest = among.iter().fold(f64::INFINITY, |smallest, axis| smallest.min(values[axis as usize]));
    if smallest == f64::INFINITY && among.is_empty() { 0.0 } else { smallest }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotionLimits = MotionLimits {
        speed: [1.0, 1.0, 2.0],
        acceleration: [0.5, 0.5, 2.0],
        deceleration: [1.0, 1.0, 3.0],
        emergency: [2.0, 2.0, 6.0],
        jerk: [5.0, 5.0, 20.0],
    };
    const DT: f64 = 0.02;

    fn comfort() -> Step {
        Step { braking_s: DT, speeding_s: DT, emergency: Axes::NONE }
    }

    fn moving(velocity: Twist) -> Ramp {
        Ramp { velocity, ..Ramp::default() }
    }

    #[test]
    fn speeds_up_within_acceleration_and_jerk_and_arrives() {
        let mut ramp = Ramp::default();
        let (mut speed, mut acceleration, mut ticks) = (0.0, 0.0, 0);
        while ramp.velocity().linear != 0.5 {
            let next = ramp.advance(Twist::planar(0.5, 0.0), comfort(), &LIMITS, Axes::PLANAR).linear;
            let now = (next - speed) / DT;
            assert!(now <= 0.5 + 1e-9 && now - acceleration <= 5.0 * DT + 1e-9, "{now} after {acceleration}");
            assert!(next >= speed && next <= 0.5);
            (speed, acceleration, ticks) = (next, now, ticks + 1);
            assert!(ticks < 100);
        }
        // 0.5 m/s at 0.5 m/s^2 takes 50 ticks, and the jerk another five at either end.
        assert!((52..=62).contains(&ticks), "{ticks}");
    }

    #[test]
    fn an_emergency_brakes_at_once_and_stops_at_zero() {
        let mut ramp = moving(Twist::planar(0.1, 0.3));
        let step = Step { emergency: Axes::ALL, ..comfort() };
        let next = ramp.advance(Twist::planar(1.0, 2.0), step, &LIMITS, Axes::PLANAR);
        assert!((next.linear - 0.06).abs() < 1e-12 && (next.angular - 0.18).abs() < 1e-12, "{next:?}");
        for _ in 0..5 {
            ramp.advance(Twist::planar(1.0, 2.0), step, &LIMITS, Axes::PLANAR);
        }
        assert_eq!(ramp.velocity(), Twist::ZERO);
    }

    #[test]
    fn comfort_braking_builds_up_with_jerk() {
        let mut ramp = moving(Twist::planar(0.5, 0.0));
        let first = ramp.advance(Twist::ZERO, comfort(), &LIMITS, Axes::PLANAR).linear;
        let second = ramp.advance(Twist::ZERO, comfort(), &LIMITS, Axes::PLANAR).linear;
        assert!((0.5 - first - 5.0 * DT * DT).abs() < 1e-12);
        assert!((first - second - 10.0 * DT * DT).abs() < 1e-12);
    }

    #[test]
    fn a_reversal_stops_at_zero_on_its_way() {
        let mut ramp = moving(Twist::planar(0.001, 0.0));
        let first = ramp.advance(Twist::planar(-1.0, 0.0), comfort(), &LIMITS, Axes::PLANAR);
        assert!(first.linear.abs() < 1e-15);
        assert!(ramp.advance(Twist::planar(-1.0, 0.0), comfort(), &LIMITS, Axes::PLANAR).linear < 0.0);
    }

    #[test]
    fn a_holonomic_robot_turns_its_velocity_along_a_straight_line() {
        let mut ramp = moving(Twist { linear: 0.5, ..Twist::ZERO });
        let target = Twist { lateral: 0.5, ..Twist::ZERO };
        for _ in 0..300 {
            let v = ramp.advance(target, comfort(), &LIMITS, Axes::ALL);
            assert!((v.linear + v.lateral - 0.5).abs() < 1e-9, "{v:?}");
        }
        assert_eq!(ramp.velocity(), target);
    }

    #[test]
    fn a_holonomic_robot_that_brakes_comes_to_stand() {
        for degrees in 0..360 {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let mut ramp = moving(Twist { linear: 0.4 * cos, lateral: 0.4 * sin, ..Twist::ZERO });
            for _ in 0..40 {
                ramp.advance(Twist::ZERO, comfort(), &LIMITS, Axes::ALL);
            }
            assert_eq!(ramp.velocity(), Twist::ZERO, "{degrees} degrees");
        }
    }

    #[test]
    fn a_halt_on_one_axis_leaves_the_other_to_its_ramp() {
        let mut ramp = moving(Twist { linear: 0.5, ..Twist::ZERO });
        let step = Step { emergency: Axes::LINEAR, ..comfort() };
        let v = ramp.advance(Twist { lateral: 0.5, ..Twist::ZERO }, step, &LIMITS, Axes::ALL);
        assert!((v.linear - (0.5 - 2.0 * DT)).abs() < 1e-12);
        assert!((v.lateral - 5.0 * DT * DT).abs() < 1e-12);
    }

    #[test]
    fn no_time_no_change_and_no_jerk_limit_no_wait() {
        let mut ramp = moving(Twist::planar(0.5, 0.0));
        let still = Step { braking_s: 0.0, speeding_s: 0.0, emergency: Axes::NONE };
        assert_eq!(ramp.advance(Twist::ZERO, still, &LIMITS, Axes::PLANAR), Twist::planar(0.5, 0.0));
        let limits = MotionLimits { jerk: [f64::INFINITY; 3], ..LIMITS };
        let mut ramp = Ramp::default();
        let v = ramp.advance(Twist::planar(0.5, 0.0), comfort(), &limits, Axes::PLANAR);
        assert!((v.linear - 0.5 * DT).abs() < 1e-12);
    }
}
