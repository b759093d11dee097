//! Steering law that brings the robot to the centerline of the corridor and keeps it there.
//!
//! Kweon et al. (1991), section 4. Differs from the paper: continuous, instead of stopping, looking, moving to the center
//! and turning back.

/// Gains of the convergence to the target line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centering {
    /// Distance over which a lateral offset decays, m.
    pub length_m: f64,
    /// Damping ratio; 1 is critical.
    pub damping: f64,
    /// Lateral offset at which the steering saturates, m.
    pub largest_offset_m: f64,
    /// Maximum turn rate, rad/s.
    pub largest_turn_radps: f64,
}

impl Default for Centering {
    fn default() -> Self {
        Self { length_m: 1.0, damping: 1.0, largest_offset_m: 0.6, largest_turn_radps: 0.8 }
    }
}

impl Centering {
    /// Returns the turn rate (rad/s, positive to the left) for a robot at `heading` (rad, positive left of the axis) and `lateral_m`
    /// left of its line, at forward speed `speed_mps` >= 0. Zero at standstill; see [`align_in_place`].
    #[must_use]
    pub fn turn_rate(&self, speed_mps: f64, heading: f64, lateral_m: f64) -> f64 {
        let offset = lateral_m.clamp(-self.largest_offset_m, self.largest_offset_m);
        let heading_term = 2.0 * self.damping * speed_mps / self.length_m * heading;
        let offset_term = speed_mps / (self.length_m * self.length_m) * offset * sinc(heading);
        (-heading_term - offset_term).clamp(-self.largest_turn_radps, self.largest_turn_radps)
    }

    /// Returns how far a `heading` (rad) is from those that lead along the corridor, or from `lateral_m` left of its line back to that,
    /// rad.
    #[must_use]
    pub fn astray(&self, heading: f64, lateral_m: f64) -> f64 {
        let offset = lateral_m.clamp(-self.largest_offset_m, self.largest_offset_m);
        let approach = -offset / (2.0 * self.damping * self.length_m);
        heading - heading.clamp(approach.min(0.0), approach.max(0.0))
    }
}

/// Returns the turn rate (rad/s) that turns a standing robot toward `target` (rad) from `heading` (rad), at most `largest_radps`.
#[must_use]
pub fn align_in_place(heading: f64, target: f64, largest_radps: f64) -> f64 {
    (-yamabico_core::geometry::angle_difference(heading, target)).clamp(-largest_radps, largest_radps)
}

/// Signed distances (m) from the robot to the walls: the left one positive, the right one negative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Walls {
    /// Distance to the left wall, positive; `None` if it is not visible.
    pub left_m: Option<f64>,
    /// Distance to the right wall, negative; `None` if it is not visible.
    pub right_m: Option<f64>,
}

impl Walls {
    /// Returns the distance between the walls, m; `None` unless both are visible.
    #[must_use]
    pub fn width_m(&self) -> Option<f64> {
        Some(self.left_m? - self.right_m?)
    }

    /// Returns the robot's offset (m) to the left of the target line: the middle between two walls; half the remembered
    /// width from a single wall, or `single_wall_target_m` without a remembered width; zero without a visible wall.
    #[must_use]
    pub fn lateral_left_of_target(&self, remembered_width_m: Option<f64>, single_wall_target_m: f64) -> f64 {
        let keep = remembered_width_m.map_or(single_wall_target_m, |width| 0.5 * width);
        match (self.left_m, self.right_m) {
            (Some(left), Some(right)) => -0.5 * (left + right),
            (Some(left), None) => keep - left,
            (None, Some(right)) => -keep - right,
            (None, None) => 0.0,
        }
    }

    /// Returns the distance to the nearer wall, m; infinite if none is visible.
    #[must_use]
    pub fn nearest_m(&self) -> f64 {
        self.left_m.map_or(f64::INFINITY, f64::abs).min(self.right_m.map_or(f64::INFINITY, f64::abs))
    }
}

/// Returns the maximum forward speed (m/s) of a robot whose heading is `astray` (rad, see [`Centering::astray`]), with this clearance
/// (m, from the footprint to the nearest wall): at most `cruise_mps`, 0.3 of it if it is 0.35 rad astray, and 0.5 m/s times the root
/// of the clearance over 0.3 m.
#[must_use]
pub fn allowed_speed(cruise_mps: f64, astray: f64, clearance_m: f64) -> f64 {
    let by_heading = cruise_mps * (1.0 - astray.abs() / 0.5).max(0.3);
    let by_clearance = 0.5 * (clearance_m.max(0.0) / 0.3).sqrt();
    by_heading.min(by_clearance).min(cruise_mps)
}

fn sinc(angle: f64) -> f64 {
    if angle.abs() < 1e-4 { 1.0 - angle * angle / 6.0 } else { angle.sin() / angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_that_leads_back_to_the_line_is_not_astray() {
        let law = Centering::default();
        for (heading, lateral_m, astray) in [
            (0.0, 0.5, 0.0),
            (-0.2, 0.5, 0.0),
            (-0.35, 0.5, -0.1),
            (0.2, 0.5, 0.2),
            (0.2, 0.0, 0.2),
            (0.4, -9.0, 0.1),
        ] {
            let found = law.astray(heading, lateral_m);
            assert!((found - astray).abs() < 1e-12, "{found} at {heading} rad, {lateral_m} m");
            assert!((law.astray(-heading, -lateral_m) + astray).abs() < 1e-12);
        }
    }

    #[test]
    fn the_loop_converges_without_overshoot() {
        let law = Centering::default();
        for speed in [0.1, 0.4, 0.6] {
            let (mut y, mut heading, dt) = (0.4_f64, 0.1_f64, 0.02);
            let mut lowest = f64::INFINITY;
            for _ in 0..(10.0 / speed / dt) as usize {
                heading += law.turn_rate(speed, heading, y) * dt;
                y += speed * heading.sin() * dt;
                lowest = lowest.min(y);
            }
            assert!(y.abs() < 0.003, "{speed} m/s ends at {y} m");
            assert!(lowest > -0.01, "overshoot {lowest}");
        }
    }

    #[test]
    fn speed_falls_with_heading_and_clearance() {
        assert_eq!(allowed_speed(0.4, 0.0, f64::INFINITY), 0.4);
        assert!((allowed_speed(0.4, 0.25, 1.0) - 0.2).abs() < 1e-12);
        assert!((allowed_speed(0.4, -1.0, 1.0) - 0.12).abs() < 1e-12);
        assert!((allowed_speed(0.5, 0.0, 0.075) - 0.25).abs() < 1e-12);
        assert_eq!(allowed_speed(0.4, 0.0, -0.1), 0.0);
    }

    #[test]
    fn single_walls_keep_their_distance() {
        let left = Walls { left_m: Some(0.8), right_m: None };
        assert!(
            (left.lateral_left_of_target(None, 0.6) + 0.2).abs() < 1e-12,
            "too far from the wall on the left"
        );
        let right = Walls { left_m: None, right_m: Some(-0.5) };
        assert!(
            (right.lateral_left_of_target(None, 0.6) + 0.1).abs() < 1e-12,
            "too near the wall on the right"
        );
        assert_eq!(Walls::default().lateral_left_of_target(Some(2.0), 0.6), 0.0);
        assert_eq!(right.nearest_m(), 0.5);
        assert!(Walls::default().nearest_m().is_infinite());
    }

    #[test]
    fn standing_robot_turns_to_its_target() {
        assert_eq!(Centering::default().turn_rate(0.0, 0.3, 0.5), 0.0);
        assert!((align_in_place(0.3, 0.0, 0.8) + 0.3).abs() < 1e-12);
        assert_eq!(align_in_place(3.0, -3.0, 0.2), 0.2);
    }
}
