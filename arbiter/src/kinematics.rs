//! Body twist to wheel speeds and back.

use std::f64::consts::TAU;

use yamabico_core::drive::Wheels;
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Axes, Twist};

/// Relation between wheel speeds and the motion of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kinematics {
    /// Two wheels on one axle; the robot frame is in the middle of the axle.
    Differential {
        /// Distance between the contact points of the wheels, m.
        base_m: f64,
        /// Wheel radius, m.
        wheel_radius_m: f64,
        /// Maximum wheel speed, rad/s.
        max_wheel_radps: f64,
    },
    /// Omnidirectional wheels, evenly spaced on a circle about the robot frame, each rolling along the tangent.
    Omni {
        /// Number and placement of the wheels.
        wheels: OmniWheels,
        /// Radius of the circle, m.
        ring_radius_m: f64,
        /// Wheel radius, m.
        wheel_radius_m: f64,
        /// Maximum wheel speed, rad/s.
        max_wheel_radps: f64,
    },
    /// A drive that accepts body twists on these axes and controls its wheels itself.
    Body {
        /// Axes that it accepts.
        axes: Axes,
    },
}

/// Number and placement of omnidirectional wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OmniWheels {
    /// At 60, 180 and 300 degrees: the robot drives forward with one wheel behind.
    Three,
    /// At 45, 135, 225 and 315 degrees.
    Four,
}

/// Speeds of up to four wheels, rad/s. A positive speed of a differential drive's wheel (left, right) rolls forward, one of
/// an omni drive turns the robot left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSpeeds {
    rad_s: [f64; 4],
    count: usize,
}

impl WheelSpeeds {
    /// Wheel speeds from a slice of at most four, rad/s; more are ignored.
    pub fn new(rad_s: &[f64]) -> WheelSpeeds {
        let mut speeds = WheelSpeeds { rad_s: [0.0; 4], count: rad_s.len().min(4) };
        speeds.rad_s[..speeds.count].copy_from_slice(&rad_s[..speeds.count]);
        speeds
    }

    /// Speed of each wheel, rad/s.
    pub fn as_slice(&self) -> &[f64] {
        &self.rad_s[..self.count]
    }

    /// Largest magnitude, rad/s; zero without wheels.
    pub fn fastest(&self) -> f64 {
        self.as_slice().iter().fold(0.0, |max, speed| speed.abs().max(max))
    }
}

impl Kinematics {
    /// Kinematics of a drive with these axes and, if they are known, these wheels.
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

    /// Axes of the drive.
    pub fn axes(&self) -> Axes {
        match *self {
            Kinematics::Differential { .. } => Axes::PLANAR,
            Kinematics::Omni { .. } => Axes::ALL,
            Kinematics::Body { axes } => axes,
        }
    }

    /// Wheel speeds for `twist`; none for [`Kinematics::Body`].
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

    /// Scales `wanted` down until the wheels can reach every mixture of it and `current` that a ramp passes through.
    /// Lowering a component of the result stays within reach.
    ///
    /// For an omni drive, each wheel is assumed to roll the whole translation.
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
        // The wheel speed needed grows with the scale: constant at first, then with the component that first exceeds its
        // current value, then with both.
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
    /// Number of wheels.
    pub fn count(self) -> usize {
        match self {
            OmniWheels::Three => 3,
            OmniWheels::Four => 4,
        }
    }

    /// Azimuth of wheel `index` on the circle, rad from straight ahead, left positive.
    pub fn azimuth_rad(self, index: usize) -> f64 {
        (index as f64 + 0.5) * TAU / self.count() as f64
    }
}

/// Speed of translation, m/s.
pub(crate) fn translation(twist: Twist) -> f64 {
    twist.linear.hypotenuse(twist.lateral)
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

    /// Twist of the body for these wheel speeds, by least squares if there are more wheels than axes.
    fn twist_from_wheels(kinematics: Kinematics, speeds: &[f64]) -> Twist {
        match (kinematics, speeds) {
            (Kinematics::Differential { base_m, wheel_radius_m, .. }, &[left, right]) => {
                Twist::planar((left + right) * wheel_radius_m / 2.0, (right - left) * wheel_radius_m / base_m)
            }
            (Kinematics::Omni { wheels, ring_radius_m, wheel_radius_m, .. }, radps) => {
                // Evenly spaced tangents are orthogonal: the pseudo-inverse is the scaled transpose.
                let n = wheels.count() as f64;
                let mut twist = Twist::ZERO;
                for (i, speed) in radps.iter().enumerate() {
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

    fn assert_close(a: Twist, b: Twist) {
        for axis in yamabico_core::message::Axis::ALL {
            assert!((a.get(axis) - b.get(axis)).abs() < 1e-12, "{a:?} {b:?}");
        }
    }

    #[test]
    fn kinematics_follow_from_the_wheels_of_a_robot_file() {
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
    fn wheel_speeds_give_the_twist_back() {
        let twist = Twist { linear: 0.3, lateral: -0.2, angular: 0.7 };
        for (kinematics, twist) in [
            (omni(OmniWheels::Three), twist),
            (omni(OmniWheels::Four), twist),
            (DIFFERENTIAL, Twist::planar(0.3, -0.7)),
        ] {
            let speeds = kinematics.wheels_from_twist(twist);
            assert_close(twist_from_wheels(kinematics, speeds.as_slice()), twist);
        }
    }

    #[test]
    fn a_reachable_target_leaves_room_for_the_current_motion() {
        let spinning = Twist::planar(0.0, 4.0);
        let target = DIFFERENTIAL.reachable(Twist::planar(1.0, 0.0), spinning);
        assert!((target.linear - 0.2).abs() < 1e-12, "{target:?}");
        assert_eq!(DIFFERENTIAL.reachable(Twist::planar(1.0, 0.0), Twist::ZERO), Twist::planar(1.0, 0.0));
        let both = DIFFERENTIAL.reachable(Twist::planar(2.0, 10.0), Twist::ZERO);
        assert_close(both, Twist::planar(0.5, 2.5));
    }
}
