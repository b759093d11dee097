//! Body twist to wheel speeds and back.

use std::f64::consts::TAU;

use yamabico_core::drive::Wheels;
use yamabico_core::message::{Axes, Twist};

/// How a drive turns wheel speeds into motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kinematics {
    /// Two wheels on one axle, with the robot frame in the middle of the axle.
    Differential {
        /// Distance between the wheels' points of contact, meters.
        base_m: f64,
        /// Wheel radius, meters.
        wheel_radius_m: f64,
        /// Largest wheel speed, rad/s.
        max_wheel_radps: f64,
    },
    /// Omnidirectional wheels, evenly spaced on a circle about the robot frame, each rolling along the tangent.
    Omni {
        /// How many.
        wheels: OmniWheels,
        /// Radius of the circle, meters.
        ring_radius_m: f64,
        /// Wheel radius, meters.
        wheel_radius_m: f64,
        /// Largest wheel speed, rad/s.
        max_wheel_radps: f64,
    },
    /// The drive takes body twists on these axes and sees to its wheels itself.
    Body {
        /// The axes that it takes.
        axes: Axes,
    },
}

/// Number and place of omnidirectional wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OmniWheels {
    /// At 60, 180 and 300 degrees, so that the robot drives forward with one wheel behind.
    Three,
    /// At 45, 135, 225 and 315 degrees.
    Four,
}

/// Speeds of up to four wheels, rad/s; a positive wheel of a differential drive rolls forward (left, right), one of an omni
/// drive turns the robot to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSpeeds {
    rad_s: [f64; 4],
    count: usize,
}

impl WheelSpeeds {
    /// From one speed a wheel, at most four, rad/s.
    pub fn new(rad_s: &[f64]) -> WheelSpeeds {
        let mut speeds = WheelSpeeds { rad_s: [0.0; 4], count: rad_s.len().min(4) };
        speeds.rad_s[..speeds.count].copy_from_slice(&rad_s[..speeds.count]);
        speeds
    }

    /// One speed a wheel, rad/s.
    pub fn as_slice(&self) -> &[f64] {
        &self.rad_s[..self.count]
    }

    /// The fastest, rad/s; zero without wheels.
    pub fn fastest(&self) -> f64 {
        self.as_slice().iter().fold(0.0, |most, speed| speed.abs().max(most))
    }
}

impl Kinematics {
    /// The kinematics of a drive that has these axes and, where they are known, these wheels.
    pub fn new(axes: Axes, wheels: Option<&Wheels>) -> Kinematics {
        let Some(wheels) = wheels else { return Kinematics::Body { axes } };
        let (wheel_radius_m, max_wheel_radps) = (wheels.radius_m, wheels.max_radps);
        let omni = |count| Kinematics::Omni {
            wheels: count,
            ring_radius_m: wheels.from_center_m,
            wheel_radius_m,
            max_wheel_radps,
        };
        match wheels.count {
            2 => Kinematics::Differential {
                base_m: 2.0 * wheels.from_center_m,
                wheel_radius_m,
                max_wheel_radps,
            },
            3 => omni(OmniWheels::Three),
            _ => omni(OmniWheels::Four),
        }
    }

    /// The axes that the drive has.
    pub fn axes(&self) -> Axes {
        match *self {
            Kinematics::Differential { .. } => Axes::PLANAR,
            Kinematics::Omni { .. } => Axes::ALL,
            Kinematics::Body { axes } => axes,
        }
    }

    /// What the wheels do for `twist`; no wheels for [`Kinematics::Body`].
    pub fn wheels_from_twist(&self, twist: Twist) -> WheelSpeeds {
        match *self {
            Kinematics::Differential { base_m, wheel_radius_m, .. } => {
                let turn = twist.angular * base_m / 2.0;
                WheelSpeeds::new(&[
                    (twist.linear - turn) / wheel_radius_m,
                    (twist.linear + turn) / wheel_radius_m,
                ])
            }
            Kinematics::Omni { wheels, ring_radius_m, wheel_radius_m, .. } => {
                let mut speeds = WheelSpeeds { rad_s: [0.0; 4], count: wheels.count() };
                for (i, speed) in speeds.rad_s[..wheels.count()].iter_mut().enumerate() {
                    let (sin, cos) = wheels.azimuth_rad(i).sin_cos();
                    *speed = (-sin * twist.linear + cos * twist.lateral + ring_radius_m * twist.angular)
                        / wheel_radius_m;
                }
                speeds
            }
            Kinematics::Body { .. } => WheelSpeeds::new(&[]),
        }
    }

    /// The motion of the body for these wheel speeds, by least squares where there are more wheels than axes; zero where
    /// their number does not fit the drive.
    pub fn twist_from_wheels(&self, speeds: &WheelSpeeds) -> Twist {
        match (*self, speeds.as_slice()) {
            (Kinematics::Differential { base_m, wheel_radius_m, .. }, &[left, right]) => {
                Twist::planar((left + right) * wheel_radius_m / 2.0, (right - left) * wheel_radius_m / base_m)
            }
            (Kinematics::Omni { wheels, ring_radius_m, wheel_radius_m, .. }, rad_s)
                if rad_s.len() == wheels.count() =>
            {
                // Evenly spaced tangents are orthogonal: the pseudo-inverse is the scaled transpose.
                let n = wheels.count() as f64;
                let mut twist = Twist::ZERO;
                for (i, speed) in rad_s.iter().enumerate() {
                    let (sin, cos) = wheels.azimuth_rad(i).sin_cos();
                    twist.linear -= sin * speed * wheel_radius_m * 2.0 / n;
                    twist.lateral += cos * speed * wheel_radius_m * 2.0 / n;
                    twist.angular += speed * wheel_radius_m / (n * ring_radius_m);
                }
                twist
            }
            _ => Twist::ZERO,
        }
    }

    /// The largest multiple of `twist`, at most itself, that the wheels can roll: the same curve, driven slower.
    pub fn saturate(&self, twist: Twist) -> Twist {
        let (Kinematics::Differential { max_wheel_radps, .. } | Kinematics::Omni { max_wheel_radps, .. }) =
            *self
        else {
            return twist;
        };
        let fastest = self.wheels_from_twist(twist).fastest();
        if fastest <= max_wheel_radps { twist } else { scaled(twist, max_wheel_radps / fastest) }
    }

    /// The same curve as `wanted`, slowed until the wheels can roll every mixture of it and `current` that a ramp passes
    /// through. Lowering a component of `wanted` afterwards stays within reach.
    ///
    /// An omni drive counts its translation as if each wheel had to roll all of it.
    pub fn reachable(&self, wanted: Twist, current: Twist) -> Twist {
        let (rim_mps, lever_m) = match *self {
            Kinematics::Differential { base_m, wheel_radius_m, max_wheel_radps } => {
                (max_wheel_radps * wheel_radius_m, base_m / 2.0)
            }
            Kinematics::Omni { ring_radius_m, wheel_radius_m, max_wheel_radps, .. } => {
                (max_wheel_radps * wheel_radius_m, ring_radius_m)
            }
            Kinematics::Body { .. } => return wanted,
        };
        let along = translation(wanted);
        let around = wanted.angular.abs() * lever_m;
        let (along_now, around_now) = (translation(current), current.angular.abs() * lever_m);
        if along.max(along_now) + around.max(around_now) <= rim_mps {
            return wanted;
        }
        // The demand grows with the scale: nothing, then the one that first exceeds what is driven now, then both.
        let both = rim_mps / (along + around);
        let along_only = (rim_mps - around_now) / along;
        let around_only = (rim_mps - along_now) / around;
        let scale = if both * along >= along_now && both * around >= around_now {
            both
        } else if along_only * along >= along_now && along_only * around <= around_now {
            along_only
        } else if around_only * around >= around_now && around_only * along <= along_now {
            around_only
        } else {
            0.0
        };
        if scale.is_finite() { scaled(wanted, scale.clamp(0.0, 1.0)) } else { Twist::ZERO }
    }
}

impl OmniWheels {
    /// How many wheels.
    pub fn count(self) -> usize {
        match self {
            OmniWheels::Three => 3,
            OmniWheels::Four => 4,
        }
    }

    /// Where wheel `index` stands on the circle, radians from straight ahead, left positive.
    pub fn azimuth_rad(self, index: usize) -> f64 {
        (index as f64 + 0.5) * TAU / self.count() as f64
    }
}

/// Speed of translation, m/s.
pub(crate) fn translation(twist: Twist) -> f64 {
    twist.linear.hypot(twist.lateral)
}

/// `twist` times `factor` on every axis.
pub(crate) fn scaled(twist: Twist, factor: f64) -> Twist {
    Twist { linear: twist.linear * factor, lateral: twist.lateral * factor, angular: twist.angular * factor }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIFFERENTIAL: Kinematics =
        Kinematics::Differential { base_m: 0.4, wheel_radius_m: 0.1, max_wheel_radps: 10.0 };

    fn omni(wheels: OmniWheels) -> Kinematics {
        Kinematics::Omni { wheels, ring_radius_m: 0.2, wheel_radius_m: 0.05, max_wheel_radps: 20.0 }
    }

    fn assert_close(a: Twist, b: Twist) {
        for axis in yamabico_core::message::Axis::ALL {
            assert!((a.get(axis) - b.get(axis)).abs() < 1e-12, "{a:?} {b:?}");
        }
    }

    #[test]
    fn the_wheels_of_a_robot_file_are_taken_over() {
        let pair = Wheels { count: 2, from_center_m: 0.2, radius_m: 0.1, max_radps: 10.0 };
        assert_eq!(Kinematics::new(Axes::PLANAR, Some(&pair)), DIFFERENTIAL);
        let ring = Wheels { count: 3, radius_m: 0.05, max_radps: 20.0, ..pair };
        assert_eq!(Kinematics::new(Axes::ALL, Some(&ring)), omni(OmniWheels::Three));
        assert_eq!(Kinematics::new(Axes::PLANAR, None), Kinematics::Body { axes: Axes::PLANAR });
    }

    #[test]
    fn a_left_turn_rolls_the_right_wheel_faster() {
        let wheels = DIFFERENTIAL.wheels_from_twist(Twist::planar(0.5, 1.0));
        let [left, right] = *wheels.as_slice() else { panic!() };
        assert!((left - 3.0).abs() < 1e-12 && (right - 7.0).abs() < 1e-12);
    }

    #[test]
    fn three_wheels_drive_forward_without_the_rear_one() {
        let wheels = omni(OmniWheels::Three).wheels_from_twist(Twist::planar(0.1, 0.0));
        let [left, rear, right] = *wheels.as_slice() else { panic!() };
        assert!(rear.abs() < 1e-12 && left < 0.0 && (left + right).abs() < 1e-12);
    }

    #[test]
    fn wheels_and_twist_go_there_and_back() {
        for kinematics in [omni(OmniWheels::Three), omni(OmniWheels::Four)] {
            let twist = Twist { linear: 0.3, lateral: -0.2, angular: 0.7 };
            assert_close(kinematics.twist_from_wheels(&kinematics.wheels_from_twist(twist)), twist);
        }
        let twist = Twist::planar(0.3, -0.7);
        assert_close(DIFFERENTIAL.twist_from_wheels(&DIFFERENTIAL.wheels_from_twist(twist)), twist);
        assert_eq!(DIFFERENTIAL.twist_from_wheels(&WheelSpeeds::new(&[1.0, 2.0, 3.0])), Twist::ZERO);
    }

    #[test]
    fn saturation_keeps_the_curve() {
        let slow = DIFFERENTIAL.saturate(Twist::planar(2.0, 1.0));
        assert!((slow.linear / slow.angular - 2.0).abs() < 1e-12);
        assert!((DIFFERENTIAL.wheels_from_twist(slow).fastest() - 10.0).abs() < 1e-12);
        assert_eq!(DIFFERENTIAL.saturate(Twist::planar(0.5, 1.0)), Twist::planar(0.5, 1.0));
    }

    #[test]
    fn what_is_reachable_leaves_room_for_what_is_driven_now() {
        let spinning = Twist::planar(0.0, 4.0);
        let target = DIFFERENTIAL.reachable(Twist::planar(1.0, 0.0), spinning);
        assert!((target.linear - 0.2).abs() < 1e-12, "{target:?}");
        assert_eq!(DIFFERENTIAL.reachable(Twist::planar(1.0, 0.0), Twist::ZERO), Twist::planar(1.0, 0.0));
        let both = DIFFERENTIAL.reachable(Twist::planar(2.0, 10.0), Twist::ZERO);
        assert_close(both, Twist::planar(0.5, 2.5));
    }
}
