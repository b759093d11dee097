//! How far a robot drives on before it stands.

use yamabico_core::sensor::Robot;

/// From a command to the wheels and from a decision to the next, seconds.
pub const COMMAND_S: f64 = 0.04;

/// Distance (m) from the robot's center to what it still stops `margin_m` before, driving at `speed_mps`: the way until the
/// next picture is taken and delivered (`picture_age_s` at most) and obeyed, the way of braking in normal driving, the robot's circle and the margin.
/// Infinite for a robot that does not brake.
#[must_use]
pub fn stopping_distance_m(speed_mps: f64, margin_m: f64, robot: &Robot, picture_age_s: f64) -> f64 {
    let reaction_s = picture_age_s + COMMAND_S;
    let braking_m = speed_mps * speed_mps / (2.0 * robot.limits.deceleration[0].max(0.0));
    // Braking begins gently: half the time that the deceleration takes to build up counts as reaction.
    let build_up_s = robot.limits.deceleration[0] / robot.limits.jerk[0];
    let gentle_s = if build_up_s.is_finite() { 0.5 * build_up_s } else { 0.0 };
    speed_mps * (reaction_s + gentle_s) + braking_m + robot.radius_m + margin_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_counts() {
        let mut robot = Robot::default();
        let way_m = stopping_distance_m(0.4, 0.3, &robot, 0.14);
        assert!((way_m - (0.4 * (0.18 + 0.08) + 0.1 + 0.25 + 0.3)).abs() < 1e-12, "{way_m}");
        robot.limits.deceleration[0] = 0.0;
        assert_eq!(stopping_distance_m(0.4, 0.3, &robot, 0.14), f64::INFINITY);
    }
}
