//! Odometry from the joints of two driven wheels.

use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::Odometry;

use crate::config::WheelsConfig;

/// Longest time between two readings over which a speed is computed, s.
const MAX_GAP_S: f64 = 1.0;

/// Pose of a robot whose wheels are at the angles of the last reading.
#[derive(Clone, Debug)]
pub struct Wheels {
    config: WheelsConfig,
    pose: Pose2,
    last: Option<Reading>,
}

/// Angles of the wheels, rad.
#[derive(Clone, Copy, Debug)]
struct Reading {
    stamp_ns: u64,
    left_rad: f64,
    right_rad: f64,
}

impl Wheels {
    /// Returns the robot at the origin of its odometry.
    #[must_use]
    pub fn new(config: WheelsConfig) -> Self {
        Self { config, pose: Pose2::IDENTITY, last: None }
    }

    /// Moves the robot by the angles that the wheels have turned. `None` for a reading without both wheels, and for one that is
    /// not newer than the last.
    pub fn odometry(&mut self, stamp_ns: u64, angles: &[(String, f64)]) -> Option<Odometry> {
        let angle =
            |joint: &str| angles.iter().find(|(name, _)| name == joint).map(|(_, angle_rad)| *angle_rad);
        let (left_rad, right_rad) = (angle(&self.config.left)?, angle(&self.config.right)?);
        let last = self.last.replace(Reading { stamp_ns, left_rad, right_rad });
        let mut twist = Twist::ZERO;
        if let Some(last) = last {
            let elapsed_s = stamp_ns.checked_sub(last.stamp_ns).filter(|elapsed| *elapsed > 0)? as f64 * 1e-9;
            let left_m = (left_rad - last.left_rad) * self.config.radius_m;
            let right_m = (right_rad - last.right_rad) * self.config.radius_m;
            let arc = Twist::planar(0.5 * (left_m + right_m), (right_m - left_m) / self.config.track_m);
            self.pose = self.pose.integrate(&arc, 1.0);
            if elapsed_s <= MAX_GAP_S {
                twist = Twist::planar(arc.linear / elapsed_s, arc.angular / elapsed_s);
            }
        }
        Some(Odometry::new(stamp_ns, &self.pose, &twist))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wheels() -> Wheels {
        let table = "topic = '/joint_states'\nleft = 'l'\nright = 'r'\nradius_m = 0.1\ntrack_m = 0.4";
        Wheels::new(toml::from_str(table).unwrap())
    }

    #[test]
    fn turned_wheels_are_a_driven_arc() {
        let mut wheels = wheels();
        let mut at = |ms: u64, left: f64, right: f64| {
            wheels.odometry(
                ms * 1_000_000,
                &[("r".to_owned(), right), ("l".to_owned(), left), ("arm".to_owned(), 9.0)],
            )
        };
        assert_eq!(at(1000, 50.0, -7.0).unwrap().x, 0.0, "the first angles are the origin");
        let straight = at(1100, 51.0, -6.0).unwrap();
        assert!(
            (straight.x - 0.1).abs() < 1e-12 && (straight.vx - 1.0).abs() < 1e-9 && straight.omega == 0.0
        );
        let turned = at(1200, 50.0, -5.0).unwrap();
        assert!(
            (turned.theta - 0.5).abs() < 1e-12 && turned.vx.abs() < 1e-9 && (turned.omega - 5.0).abs() < 1e-9
        );
        assert!(at(1200, 51.0, -5.0).is_none(), "not newer");
        assert_eq!(at(9000, 52.0, -4.0).unwrap().vx, 0.0, "no speed over a long gap");
    }

    #[test]
    fn a_reading_without_both_wheels_is_left_out() {
        assert!(wheels().odometry(1, &[("l".to_owned(), 1.0)]).is_none());
    }
}
