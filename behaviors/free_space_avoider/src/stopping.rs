//! Stopping distance of the robot.

use yamabico_core::sensor::Robot;

/// Delay between a proposal and the motion of the wheels, s.
pub const COMMAND_S: f64 = 0.04;

/// Returns the minimum distance (m) of an obstacle from the robot's center at which the robot, driving at `speed_mps`,
/// still stops `margin_m` before it: distance driven until the next frame takes effect (`max_frame_age_s` is its
/// maximum age), braking distance in normal driving, radius, and margin. Infinite for a robot that does not brake.
#[must_use]
pub fn stopping_distance_m(speed_mps: f64, margin_m: f64, robot: &Robot, max_frame_age_s: f64) -> f64 {
    let reaction_s = max_frame_age_s + COMMAND_S;
    let braking_m = speed_mps * speed_mps / (2.0 * robot.limits.deceleration[0].max(0.0));
    // The jerk limit delays braking by half the time in which the deceleration builds up.
    let build_up_s = robot.limits.deceleration[0] / robot.limits.jerk[0];
    let delay_s = if build_up_s.is_finite() { 0.5 * build_up_s } else { 0.0 };
    speed_mps * (reaction_s + delay_s) + braking_m + robot.radius_m + margin_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_counts() {
        let mut robot = Robot::default();
        let distance_m = stopping_distance_m(0.4, 0.3, &robot, 0.14);
        assert!((distance_m - (0.4 * (0.18 + 0.08) + 0.1 + 0.25 + 0.3)).abs() < 1e-12, "{distance_m}");
        robot.limits.deceleration[0] = 0.0;
        assert_eq!(stopping_distance_m(0.4, 0.3, &robot, 0.14), f64::INFINITY);
    }
}
