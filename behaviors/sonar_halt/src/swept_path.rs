//! The path that the footprint sweeps, and its length until the footprint touches a point or an echo.
//!
//! The footprint is a disc about the robot's center. With constant twist the center moves on an arc about the turning center
//! at the distance v / omega to the side, or straight ahead. The disc touches a point when its center is one radius away.

use std::f64::consts::TAU;

use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Beam, Twist};

/// Ratio of speed to turn rate (m/rad) above which an arc counts as straight.
const STRAIGHT_M: f64 = 1e6;

/// Maximum number of points that represent an echo.
const MAX_POINTS: f64 = 2000.0;

/// Path of a disc that moves with constant twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweptPath {
    /// Speed, m/s.
    speed_mps: f64,
    /// Turn rate, rad/s, positive to the left.
    turn_radps: f64,
    /// Unit vector of the translation, robot frame; zero at a standstill.
    direction: [f64; 2],
    radius_m: f64,
}

impl SweptPath {
    /// Creates the path of a disc of this radius (m) about the robot's center.
    #[must_use]
    pub fn new(twist: &Twist, radius_m: f64) -> Self {
        let speed_mps = twist.linear.hypotenuse(twist.lateral);
        let direction =
            if speed_mps > 0.0 { [twist.linear / speed_mps, twist.lateral / speed_mps] } else { [0.0; 2] };
        Self { speed_mps, turn_radps: twist.angular, direction, radius_m }
    }

    /// Returns the speed, m/s.
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Returns the length of the path (m) until the disc touches `point` (m, robot frame): zero for a point in the disc or
    /// one that is not finite, `None` if never.
    #[must_use]
    pub fn contact_m(&self, point: [f64; 2]) -> Option<f64> {
        let distance_m = point[0].hypotenuse(point[1]);
        if distance_m <= self.radius_m || !distance_m.is_finite() {
            return Some(0.0);
        }
        if self.speed_mps <= 0.0 {
            return None;
        }
        let [ux, uy] = self.direction;
        let (x, y) = (point[0] * ux + point[1] * uy, point[1] * ux - point[0] * uy);
        let radius_m = self.radius_m;
        if self.turn_radps.abs() * STRAIGHT_M < self.speed_mps {
            return (y.abs() <= radius_m && x > 0.0).then(|| x - (radius_m * radius_m - y * y).sqrt());
        }
        // The point seen from the turning center, at the angle `bearing` from the robot in the direction of travel.
        let center_y = self.speed_mps / self.turn_radps;
        let arc_m = center_y.abs();
        let from_center_m = x.hypotenuse(y - center_y);
        let cosine = (from_center_m * from_center_m + arc_m * arc_m - radius_m * radius_m)
            / (2.0 * from_center_m * arc_m);
        if cosine.abs() > 1.0 || cosine.is_nan() {
            return None;
        }
        let bearing = (arc_m * x).atan2(center_y * (center_y - y)).rem_euclid(TAU);
        let length_m = arc_m * (bearing - cosine.acos());
        Some(if length_m < 0.0 { length_m + TAU * arc_m } else { length_m })
    }

    /// Returns true if the motion begins by increasing the distance to `point` (m, robot frame), or by keeping it.
    #[must_use]
    pub fn leaves(&self, point: [f64; 2]) -> bool {
        self.speed_mps > 0.0 && point[0] * self.direction[0] + point[1] * self.direction[1] <= 0.0
    }

    /// Returns the length of the path (m) until the disc touches the echo of `beam` at `range_m`, `None` if never. The echo
    /// may come from any point of the cone at this range; the points are about `step_m` apart.
    #[must_use]
    pub fn contact_with_echo_m(&self, beam: &Beam, range_m: f64, step_m: f64) -> Option<f64> {
        shortest(echo_points(beam, range_m, step_m).map(|point| self.contact_m(point)))
    }

    /// Same as [`contact_with_echo_m`](Self::contact_with_echo_m), but ignores points inside the disc from which the motion
    /// leads away.
    #[must_use]
    pub fn approach_to_echo_m(&self, beam: &Beam, range_m: f64, step_m: f64) -> Option<f64> {
        let ahead = echo_points(beam, range_m, step_m)
            .filter(|point| point[0].hypotenuse(point[1]) > self.radius_m || !self.leaves(*point));
        shortest(ahead.map(|point| self.contact_m(point)))
    }
}

fn shortest(lengths: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    lengths.flatten().min_by(f64::total_cmp)
}

/// Points of a beam's cone at `range_m`, robot frame.
fn echo_points(beam: &Beam, range_m: f64, step_m: f64) -> impl Iterator<Item = [f64; 2]> + use<> {
    let half = 0.5 * beam.cone_rad;
    let steps = 2.0 * (half * range_m / step_m).ceil().clamp(0.0, MAX_POINTS);
    let Beam { azimuth_rad, cone_rad, x_m, y_m, .. } = *beam;
    let (first, step) = if steps > 0.0 { (-half, cone_rad / steps) } else { (0.0, 0.0) };
    (0..=steps as u32).map(move |i| {
        let azimuth = azimuth_rad + first + f64::from(i) * step;
        [x_m + range_m * azimuth.cos(), y_m + range_m * azimuth.sin()]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(linear: f64, lateral: f64, angular: f64) -> SweptPath {
        SweptPath::new(&Twist::new(linear, lateral, angular), 0.28)
    }

    #[test]
    fn a_sideways_path_is_a_forward_path_turned_by_a_right_angle() {
        for angular in [0.0, 0.7, -0.7] {
            let forward = path(0.4, 0.0, angular).contact_m([0.5, 0.05]).unwrap();
            let sideways = path(0.0, 0.4, angular).contact_m([-0.05, 0.5]).unwrap();
            assert!((forward - sideways).abs() < 1e-12);
        }
    }

    #[test]
    fn contact_lies_one_radius_from_the_point() {
        for (twist, point) in [([0.4, 0.0, 0.8], [0.5, 0.4]), ([-0.3, 0.1, 0.5], [-0.6, 0.0])] {
            let twist = Twist::new(twist[0], twist[1], twist[2]);
            let length = SweptPath::new(&twist, 0.28).contact_m(point).unwrap();
            let pose = yamabico_core::geometry::Pose2::default().integrate(&twist, length / twist.speed());
            assert!(((pose.x - point[0]).hypotenuse(pose.y - point[1]) - 0.28).abs() < 1e-9);
        }
    }

    #[test]
    fn an_echo_in_the_disc_does_not_count_for_a_motion_that_leaves_it() {
        let near = Beam { x_m: 0.2, cone_rad: 0.4, ..Beam::default() };
        assert_eq!(path(0.1, 0.0, 0.0).approach_to_echo_m(&near, 0.05, 0.01), Some(0.0));
        assert_eq!(path(0.0, 0.0, 0.0).approach_to_echo_m(&near, 0.05, 0.01), Some(0.0));
        assert_eq!(path(-0.1, 0.0, 0.0).approach_to_echo_m(&near, 0.05, 0.01), None);
        assert_eq!(path(-0.1, 0.0, 0.0).contact_with_echo_m(&near, 0.05, 0.01), Some(0.0));
    }

    #[test]
    fn no_input_panics_and_nonsense_is_in_the_way() {
        let crooked = Beam { azimuth_rad: f64::NAN, ..Beam::default() };
        assert_eq!(path(0.3, 0.0, 0.2).approach_to_echo_m(&crooked, 1.0, 0.01), Some(0.0));
        let wide = Beam { cone_rad: 1e300, ..Beam::default() };
        let _ = path(0.3, 0.0, 0.2).approach_to_echo_m(&wide, 1e300, 0.01);
    }
}
