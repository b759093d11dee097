//! The newest command of the arbiter as the speeds of two wheels.

use yamabico_core::geometry::Twist;

pub use yamabico_core::drive::Commanded;

/// Slows a differential drive down on the same curve if a wheel would be faster than `max_mps`. Returns the speeds of the left
/// and the right wheel, m/s, of a robot with wheels `track_m` apart.
#[must_use]
pub fn wheel_speeds(twist: &Twist, track_m: f64, max_mps: f64) -> [f64; 2] {
    let turning = 0.5 * track_m * twist.angular;
    let wheels = [twist.linear - turning, twist.linear + turning];
    let fastest = wheels[0].abs().max(wheels[1].abs());
    let share = if fastest > max_mps { max_mps / fastest } else { 1.0 };
    wheels.map(|speed| speed * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_keep_the_curve_when_they_are_too_fast() {
        let [left, right] = wheel_speeds(&Twist::planar(0.2, 0.5), 0.2, 0.5);
        assert!((left - 0.15).abs() < 1e-12 && (right - 0.25).abs() < 1e-12);
        let [left, right] = wheel_speeds(&Twist::planar(1.0, 2.0), 0.2, 0.6);
        assert!((right - 0.6).abs() < 1e-12 && (left / right - 0.8 / 1.2).abs() < 1e-12);
    }
}
